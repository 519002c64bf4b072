"""How Sphinx builds the site: ``python -m sphinx -W docs site`` with the extra ``docs``."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import TYPE_CHECKING

from pygments.lexers.python import PythonLexer

from meshlab_lowrank import __version__

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).parent.parent
ELSEWHERE = {  # pages whose text stands elsewhere in the repository
    "index": "README.md",
    "benchmarks": "benchmarks/README.md",
    "changelog": "CHANGELOG.md",
    "contributing": "CONTRIBUTING.md",
    "sample_meshes": "sample_meshes/README.md",
}
LINK = re.compile(r"(\]\()([^)#:\s]+)((?:#[^)\s]*)?\))")

project = "meshlab-lowrank"
version = release = __version__
extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc"]
html_theme = "furo"
html_extra_path = ["../LICENSE"]

autodoc_typehints = "none"  # the docstrings tell types and shapes
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
myst_heading_anchors = 3

nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300


def bring_text(_: Sphinx, name: str, source: list[str]) -> None:
    """Put the text of a page in the place of its stub, and let links lead to the pages."""
    path = ELSEWHERE.get(name)
    if path is None:
        source[0] = _linked(source[0], "docs")
        return
    text = (ROOT / path).read_text(encoding="utf-8")
    _, *rest = source[0].split("\n---\n")  # what a stub says of itself ends there
    source[0] = "\n".join([_linked(text, posixpath.dirname(path)), *rest])


def _linked(text: str, folder: str) -> str:
    """Turn links that are right in a folder of the repository into those of the site."""
    pages = {path: f"{name}.md" for name, path in ELSEWHERE.items()}

    def moved(link: re.Match[str]) -> str:
        path = posixpath.normpath(posixpath.join(folder, link[2]))
        return f"{link[1]}{pages.get(path, posixpath.relpath(path, 'docs'))}{link[3]}"

    return LINK.sub(moved, text)


def setup(app: Sphinx) -> None:
    """Register what this file adds to Sphinx."""
    app.connect("source-read", bring_text)
    app.add_lexer("snakemake", PythonLexer)  # nearly; there is none of its own
