"""A kind of another package that uses the whole door: it plays, has several findings a trial with shares, tables, and
a bound of luck."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.exercises import TrialProgress, bound_share

pytestmark = [pytest.mark.jail, pytest.mark.slow]

PACKAGE = Path(__file__).with_name("estimator")
PROGRAMS = Path("reference_solutions/1.1-identify/oscillator")
OFFLINE = ("--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--disable-pip-version-check")


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """The environment in which the package is installed, and its content is the course."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("target")
    shutil.copytree(PACKAGE, source, dirs_exist_ok=True)
    subprocess.run([sys.executable, "-m", "pip", "install", *OFFLINE, "--target", target, source], check=True)
    path = os.pathsep.join(filter(None, [str(target), os.environ.get("PYTHONPATH")]))
    yield {**os.environ, "PYTHONPATH": path, "GRADER_CONTENT": str(source / "content")}


def grader(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).with_name("grader")), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def test_every_program_of_the_plug_in_gets_its_status_and_diagnosis(environment: dict[str, str]) -> None:
    content = environment["GRADER_CONTENT"]
    checked = grader(environment, "check", content, "--again", "--json")
    report = json.loads(checked.stdout)
    assert report["faults"] == report["undecided"] == []
    assert [reference["got"] for reference in report["references"]] == [
        "correct",
        "crashed",
        "incorrect",
        "incorrect",
        "partial",
    ]


def test_a_verdict_has_a_finding_for_each_number_with_its_share_and_tables(environment: dict[str, str]) -> None:
    wrong = Path(environment["GRADER_CONTENT"]) / PROGRAMS / "partial__half_the_damping.py"
    verdict = json.loads(grader(environment, "grade", "1.1-identify", "oscillator", str(wrong), "--json").stdout)
    findings = {finding["id"]: finding for finding in verdict["findings"]}
    assert (findings["seen.stiffness"]["passed"], findings["seen.damping"]["passed"]) == (True, False)
    low, high = (round(100 * end) for end in bound_share(0, 10))
    assert f"Found in 0 of 10 recordings (95 % interval: {low} to {high} %)" in findings["seen.damping"]["message"]
    assert findings["hidden-1.damping"]["measured"] is None
    assert verdict["points"] == 2
    (table,) = verdict["evidence"]["tables"]
    assert table["head"] == ["recording", "stiffness", "damping"]
    assert table["rows"][-1] == ["true", "25", "0.4"]


@pytest.mark.parametrize(("at", "of", "unit"), [(1, 10, "recording"), (3, 2, "s"), (-1, 2, "s"), (1, 10_000, "s")])
def test_progress_that_no_page_can_show_is_refused(at: int, of: int, unit: str) -> None:
    with pytest.raises(ValueError, match="progress"):
        TrialProgress(at, of, unit)  # type: ignore[arg-type]
