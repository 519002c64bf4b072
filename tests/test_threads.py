"""The number of threads: from the environment, checked like a parameter."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pymeshlab
import pytest
from threadpoolctl import threadpool_info

from meshlab_lowrank.errors import InvalidParameterError
from meshlab_lowrank.inpainting import inpaint
from meshlab_lowrank.parameters import InpaintParameters
from meshlab_lowrank.presets import AUTO
from meshlab_lowrank.threads import THREADS_VARIABLE, available_cores, thread_count

HOLED = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]])  # a tetrahedron without its floor


@pytest.mark.parametrize("text", ["0", "-1", "two", "1.5", "²", "1e3", "1 2"])
def test_a_wrong_number_is_named(monkeypatch, text):
    monkeypatch.setenv(THREADS_VARIABLE, text)
    with pytest.raises(InvalidParameterError, match=f"{THREADS_VARIABLE} is {text!r}"):
        thread_count()


@pytest.mark.parametrize("text", [None, "", "  "])
def test_without_a_number_there_is_one_thread_a_core(monkeypatch, text):
    if text is None:
        monkeypatch.delenv(THREADS_VARIABLE, raising=False)
    else:
        monkeypatch.setenv(THREADS_VARIABLE, text)
    assert thread_count() == available_cores() >= 1


def test_the_number_is_taken(monkeypatch):
    monkeypatch.setenv(THREADS_VARIABLE, " 3 ")
    assert thread_count() == 3


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no affinity here")
def test_only_the_cores_of_this_process_count(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {4, 7, 9})
    assert available_cores() == 3


def test_a_filter_says_what_is_wrong_and_changes_nothing(monkeypatch):
    monkeypatch.setenv(THREADS_VARIABLE, "many")
    ms = pymeshlab.MeshSet()
    ms.add_mesh(pymeshlab.Mesh(np.eye(4, 3), HOLED))
    with pytest.raises(pymeshlab.PyMeshLabException, match=THREADS_VARIABLE):
        ms.meshing_inpaint_lowrank(closerim=True)
    assert ms.current_mesh().face_number() == 3


def test_linear_algebra_has_one_thread_from_the_first_stage_on():
    seen = []

    def close(regions, *, edge_lengths):
        seen.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        return AUTO.close(regions, edge_lengths=edge_lengths)

    inpaint(
        np.eye(4, 3),
        HOLED,
        parameters=InpaintParameters(detail="none", closerim=True),
        pipeline=replace(AUTO, close=close),
    )
    assert seen
    assert set(seen) == {1}
