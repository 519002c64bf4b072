"""Commands that are killed at random moments; ``KILLS`` in the environment asks for more cases."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from benchmarks.kills import COMMANDS, campaign


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_random_kills_leave_whole_files_only_and_the_next_run_ends(tmp_path: Path) -> None:
    count = int(os.environ.get("KILLS", "3"))
    outcomes = list(campaign(tmp_path, count, seed=1, jobs=2))
    assert {outcome.case.command for outcome in outcomes} == set(COMMANDS)
    assert any(outcome.hit for outcome in outcomes)
    assert [outcome for outcome in outcomes if outcome.wrong] == []
