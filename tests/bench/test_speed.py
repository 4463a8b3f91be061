"""Coarse floors on speed, generous enough for a loaded machine, and the same bits from all loops."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from grader.bench import speed


@pytest.fixture(scope="module")
def measured() -> dict[str, Any]:
    """In a process of its own: there the wheel's profiling timer is still as a student finds it."""
    done = subprocess.run(
        [sys.executable, "-m", "grader.bench.speed", "0.08"], capture_output=True, text=True, check=True
    )
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def test_all_loops_give_the_same_bits(measured: dict[str, Any]) -> None:
    assert len(measured["rows"]) == 6
    assert all(row["bitwise_same"] for row in measured["rows"])


def test_a_step_costs_about_what_it_costs_in_c(measured: dict[str, Any]) -> None:
    """The claim is 1.15 on a quiet machine."""
    if measured["loop_in_c"] == speed.NO_COMPILER:
        pytest.skip(speed.NO_COMPILER)
    assert measured["loop_in_c"] == "measured", measured["loop_in_c"]
    assert all(row["ours_per_c"]["median"] < 1.5 for row in measured["rows"])


def test_the_lessons_loop_is_far_behind(measured: dict[str, Any]) -> None:
    """The claim is 3 times on a quiet machine, with the timer on."""
    assert measured["timer_on"]
    assert all(row["lesson_per_ours"]["median"] > 1.8 for row in measured["rows"])


def test_certifying_a_claim_is_far_cheaper_than_finding_it(measured: dict[str, Any]) -> None:
    """The claim is 100 times on a quiet machine."""
    certified = measured["certify"]
    assert certified["holds"] is True
    low, high = certified["bracket_ms"]
    assert 19.5 < low < 20.117 < high < 20.7
    assert certified["bisection_per_certify"]["median"] > 20


def test_without_a_compiler_the_reason_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    with pytest.raises(speed.NoLoop, match="no C compiler"):
        speed.compiled_loop(tmp_path)


def test_without_headers_the_reason_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(speed, "PACKAGE", tmp_path)
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    with pytest.raises(speed.NoLoop, match="headers or library"):
        speed.compiled_loop(tmp_path)
