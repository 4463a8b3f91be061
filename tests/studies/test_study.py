"""A benchmark that was stopped resumes, and only a change of what it measures with discards its records."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest
from rich.console import Console

from grader.studies.bench.study import (
    Journal,
    Measurement,
    Record,
    Records,
    carry_out,
    compute_code_digest,
    extract_measuring_part,
)


@dataclass(frozen=True)
class Letter(Measurement):
    """Measures its own length, and notes in `measured` that it did."""

    name: str
    measured: ClassVar[list[str]] = []
    stop: ClassVar[str | None] = None

    def measure(self, quick: bool, done: Records) -> Record:
        if self.name == self.stop:
            raise KeyboardInterrupt
        self.measured.append(self.name)
        return {"value": len(self.name) / 3, "before": len(done)}


@dataclass(frozen=True)
class Other(Measurement):
    """Another kind with the same fields."""

    name: str

    def measure(self, quick: bool, done: Records) -> Record:
        raise LookupError(self.name)


@dataclass(frozen=True)
class Apart(Measurement):
    """Is not timed; tells the process that measured it."""

    name: str
    timed = False

    def measure(self, quick: bool, done: Records) -> Record:
        return {"process": os.getpid()}


@pytest.fixture(autouse=True)
def nothing_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Letter, "measured", [])


QUIET = Console(quiet=True)
LETTERS = [Letter(name) for name in ("a", "bb", "ccc", "dddd")]


def test_after_ctrl_c_only_the_rest_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "journal.jsonl"
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Letter, "stop", "ccc")
        carry_out("t", LETTERS, Journal(path, "c"), QUIET)
    assert Letter.measured == ["a", "bb"]
    records = carry_out("t", LETTERS, Journal(path, "c"), QUIET)
    assert Letter.measured == ["a", "bb", "ccc", "dddd"]
    assert records == {key: {"value": len(key.name) / 3, "before": len(key.name) - 1} for key in LETTERS}


def test_a_line_that_was_cut_short_is_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    carry_out("t", LETTERS[:2], Journal(path, "c"), QUIET)
    path.write_text(path.read_text()[:-9])
    carry_out("t", LETTERS, Journal(path, "c"), QUIET)
    assert Letter.measured == ["a", "bb", "bb", "ccc", "dddd"]
    assert len(Journal(path, "c").read()) == len(LETTERS)


def test_records_of_other_versions_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    for context in ("old", "new"):
        carry_out("t", LETTERS[:1], Journal(path, context), QUIET)
    assert Letter.measured == ["a", "a"]


def test_kinds_with_the_same_fields_are_told_apart(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "j", "c")
    journal.add(Letter("a"), {"value": 1})
    assert carry_out("t", [Letter("a")], journal, QUIET) == {Letter("a"): {"value": 1}}
    with pytest.raises(LookupError):
        carry_out("t", [Other("a")], journal, QUIET)


@pytest.mark.slow
def test_what_is_not_timed_is_measured_before_in_other_processes(tmp_path: Path) -> None:
    plan = [Letter("a"), Apart("b"), Apart("c")]
    records = carry_out("t", plan, Journal(tmp_path / "j", "c"), QUIET)
    assert list(records) == plan
    assert records[plan[0]]["before"] == 2
    assert os.getpid() not in {records[key]["process"] for key in plan[1:]}


def test_two_equal_measurements_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="the same"):
        carry_out("t", [Letter("a"), Letter("a")], Journal(tmp_path / "j", "c"), QUIET)


MEASURING = "STEPS = 5\n\n\ndef measure():\n    return 1\n"
DRAWING = (
    '"""A study."""\n\nSTEPS = 5\n\n\ndef measure():\n    """Measure."""\n    return 1\n\n\ndef draw_it():\n    pass\n'
)


def test_what_only_draws_does_not_discard_what_was_measured() -> None:
    assert extract_measuring_part(DRAWING) == extract_measuring_part(MEASURING)
    assert extract_measuring_part(MEASURING.replace("1", "2")) != extract_measuring_part(MEASURING)
    assert compute_code_digest("skip") != compute_code_digest("precision")
