"""The examples in the docstrings of all public names run, and there is one for each."""

from __future__ import annotations

import doctest
import inspect

import pytest

import meshlab_lowrank
from meshlab_lowrank import filters
from meshlab_lowrank.mesh import fixed_values

PUBLIC = {
    name: getattr(meshlab_lowrank, name)
    for name in meshlab_lowrank.__all__
    if callable(getattr(meshlab_lowrank, name))
} | {f"filters.{function.__name__}": function for function in filters.FILTERS}
WITH_EXAMPLES = {
    name: value
    for name, value in PUBLIC.items()
    if not (inspect.isclass(value) and issubclass(value, Exception))
} | {"minimise_with_fixed": fixed_values.minimise_with_fixed}


@pytest.mark.parametrize("name", sorted(WITH_EXAMPLES))
def test_examples_do_what_they_say(name):
    tests = doctest.DocTestFinder(recurse=True).find(WITH_EXAMPLES[name], name)
    assert tests[0].examples, f"{name} has no example"
    for test in tests:
        runner = doctest.DocTestRunner(optionflags=doctest.IGNORE_EXCEPTION_DETAIL)
        found: list[str] = []
        runner.run(test, out=found.append)
        assert runner.summarize(verbose=False).failed == 0, "".join(found)


@pytest.mark.parametrize("name", sorted(WITH_EXAMPLES))
def test_every_public_name_says_what_else_to_look_at(name):
    assert "See Also\n" in inspect.getdoc(WITH_EXAMPLES[name])


def test_a_wrong_example_would_fail():
    test = doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "wrong", None, 0)
    assert doctest.DocTestRunner().run(test, out=lambda _: None).failed == 1
