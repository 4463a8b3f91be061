"""A benchmark that was stopped goes on where it was."""

from pathlib import Path

import pytest
from rich.console import Console

from grader.bench.journal import Journal, Record, Task, carry_out


class Counted:
    """Measures, and counts how often; the one named in `stop` is interrupted."""

    def __init__(self, stop: str | None = None) -> None:
        self.done: list[str] = []
        self.stop = stop

    def task(self, key: str) -> Task:
        def measure() -> Record:
            if key == self.stop:
                raise KeyboardInterrupt
            self.done.append(key)
            return {"value": len(key) / 3}

        return Task(key, measure)


QUIET = Console(quiet=True)
KEYS = ["a", "bb", "ccc", "dddd"]


def test_after_ctrl_c_only_the_rest_is_measured(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    first = Counted(stop="ccc")
    with pytest.raises(KeyboardInterrupt):
        carry_out("t", [first.task(key) for key in KEYS], Journal(path, "c"), QUIET)
    assert first.done == ["a", "bb"]
    second = Counted()
    records = carry_out("t", [second.task(key) for key in KEYS], Journal(path, "c"), QUIET)
    assert second.done == ["ccc", "dddd"]
    assert records == {key: {"value": len(key) / 3} for key in KEYS}


def test_a_line_that_was_cut_short_is_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    carry_out("t", [Counted().task(key) for key in KEYS[:2]], Journal(path, "c"), QUIET)
    path.write_text(path.read_text()[:-9])
    again = Counted()
    carry_out("t", [again.task(key) for key in KEYS], Journal(path, "c"), QUIET)
    assert again.done == ["bb", "ccc", "dddd"]
    assert Journal(path, "c").records.keys() == set(KEYS)


def test_records_of_other_versions_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    carry_out("t", [Counted().task("a")], Journal(path, "old"), QUIET)
    again = Counted()
    carry_out("t", [again.task("a")], Journal(path, "new"), QUIET)
    assert again.done == ["a"]


def test_two_tasks_of_one_key_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="share a key"):
        carry_out("t", [Counted().task("a"), Counted().task("a")], Journal(tmp_path / "j", "c"), QUIET)
