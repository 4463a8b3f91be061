"""Every reference program, through the real jail, gets the status in its name and the diagnosis of its first lines."""

from collections import Counter
from pathlib import Path

import pytest

from exercises.conftest import ROOT, Grade, question
from grader.domain.verdict import Status
from grader.grading.references import read_demand

PROGRAMS = sorted((ROOT / "reference_solutions" / "1.3-exercises").glob("*/*.py"))


ONCE_MISTOLD = {"incorrect__missing_parentheses": 3297233161, "partial__wraps_angles": 1422266014}
"""Draws under which a program was once told something else."""


def seeds(path: Path) -> list[int]:
    """One of eight draws for each program, whose simulations the others share, and a second one for every twelfth.

    `make verdicts` grades every program under sixty.
    """
    index = PROGRAMS.index(path)
    return (
        [100 + index % 8] + [1] * (index % 12 == 8) + [seed for name, seed in ONCE_MISTOLD.items() if path.stem == name]
    )


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_it_gets_the_status_in_its_name_and_one_diagnosis_whatever_the_seed(path: Path, grade: Grade) -> None:
    status, diagnosis = read_demand(path.read_text(), path.stem.partition("__")[0])
    verdicts = [grade(question(path.parent.name), path.read_text(), seed) for seed in seeds(path)]
    for verdict in verdicts:
        assert verdict.status == status, verdict.diagnosis
        assert (diagnosis or "") in (verdict.diagnosis or "")
    assert len({verdict.diagnosis for verdict in verdicts}) == 1


def test_there_are_enough_of_them() -> None:
    statuses = Counter(path.stem.partition("__")[0] for path in PROGRAMS)
    assert set(statuses) <= set(Status)
    assert statuses["correct"] >= 8
    assert statuses.total() - statuses["correct"] >= 20


@pytest.mark.parametrize("id_", ["servo-threshold", "rk4-step", "rk4-free-joint"])
def test_the_starter_runs_and_earns_nothing(id_: str, grade: Grade) -> None:
    exercise = question(id_)
    assert exercise.starter
    verdict = grade(exercise, (ROOT / exercise.starter).read_text())
    assert (verdict.status, verdict.points) == (Status.INCORRECT, 0)
    assert verdict.diagnosis
