"""A benchmark that was stopped resumes, and only a change of what it measures with discards its records."""

from dataclasses import dataclass
from pathlib import Path

import pytest
from rich.console import Console

from grader.bench.study import Journal, Key, Record, Task, carry_out, code_digest, measuring_part


@dataclass(frozen=True)
class Letter(Key):
    """A kind of measurement."""

    name: str


@dataclass(frozen=True)
class Other(Key):
    """Another kind with the same fields."""

    name: str


class Counted:
    """Measures, and counts how often; the one named in `stop` is interrupted."""

    def __init__(self, stop: str | None = None) -> None:
        self.done: list[str] = []
        self.stop = stop

    def task(self, name: str) -> Task:
        def measure() -> Record:
            if name == self.stop:
                raise KeyboardInterrupt
            self.done.append(name)
            return {"value": len(name) / 3}

        return Task(Letter(name), measure)


QUIET = Console(quiet=True)
NAMES = ["a", "bb", "ccc", "dddd"]


def test_after_ctrl_c_only_the_rest_is_measured(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    first = Counted(stop="ccc")
    with pytest.raises(KeyboardInterrupt):
        carry_out("t", [first.task(name) for name in NAMES], Journal(path, "c"), QUIET)
    assert first.done == ["a", "bb"]
    second = Counted()
    records = carry_out("t", [second.task(name) for name in NAMES], Journal(path, "c"), QUIET)
    assert second.done == ["ccc", "dddd"]
    assert records == {Letter(name): {"value": len(name) / 3} for name in NAMES}


def test_a_line_that_was_cut_short_is_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    carry_out("t", [Counted().task(name) for name in NAMES[:2]], Journal(path, "c"), QUIET)
    path.write_text(path.read_text()[:-9])
    again = Counted()
    carry_out("t", [again.task(name) for name in NAMES], Journal(path, "c"), QUIET)
    assert again.done == ["bb", "ccc", "dddd"]
    assert all(Journal(path, "c").find(Letter(name)) for name in NAMES)


def test_records_of_other_versions_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    carry_out("t", [Counted().task("a")], Journal(path, "old"), QUIET)
    again = Counted()
    carry_out("t", [again.task("a")], Journal(path, "new"), QUIET)
    assert again.done == ["a"]


def test_kinds_with_the_same_fields_are_told_apart(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "j", "c")
    journal.add(Letter("a"), {"value": 1})
    assert journal.find(Other("a")) is None


def test_two_tasks_of_one_key_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="share a key"):
        carry_out("t", [Counted().task("a"), Counted().task("a")], Journal(tmp_path / "j", "c"), QUIET)


MEASURING = "STEPS = 5\n\n\ndef measure():\n    return 1\n"
DRAWING = (
    '"""A study."""\n\nSTEPS = 5\n\n\ndef measure():\n    """Measure."""\n    return 1\n\n\ndef draw_it():\n    pass\n'
)


def test_what_only_draws_does_not_discard_what_was_measured() -> None:
    assert measuring_part(DRAWING) == measuring_part(MEASURING)
    assert measuring_part(MEASURING.replace("1", "2")) != measuring_part(MEASURING)
    assert code_digest("skip") != code_digest("precision")
