"""Finished measurements on disk, one JSON line each, so that a run that was stopped goes on where it was."""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

Record = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """One measurement: a key that is unique within a benchmark, such as `error/servo/RK4/0.002`."""

    key: str
    measure: Callable[[], Record]


class Journal:
    """The records under one context (versions, code and scenes); lines of another context are left alone, unread."""

    def __init__(self, path: Path, context: str) -> None:
        self.path = path
        self.context = context
        self.records: dict[str, Record] = {}
        if path.exists():
            self._read(path.read_text(encoding="utf-8"))

    def _read(self, text: str) -> None:
        if text and not text.endswith("\n"):
            with self.path.open("a", encoding="utf-8") as lines:
                lines.write("\n")  # the last line was cut short: keep it from spoiling the next one
        for line in text.splitlines():
            try:
                entry = json.loads(line)
            except ValueError:
                continue
            if entry["context"] == self.context:
                self.records[entry["key"]] = entry["record"]

    def add(self, key: str, record: Record) -> None:
        """Write one finished measurement and flush it."""
        line = json.dumps({"context": self.context, "key": key, "record": record})
        with self.path.open("a", encoding="utf-8") as lines:
            lines.write(line + "\n")
        # What is kept is what would be read back, so that a resumed run and a whole one are the same.
        self.records[key] = json.loads(line)["record"]


def context_of(*parts: object) -> str:
    """A short digest of everything that, when changed, makes old records worthless."""
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def progress_bar(console: Console) -> Progress:
    """A bar on stderr: what is measured now, how many of how many, and how long still."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
    )


def carry_out(title: str, tasks: Sequence[Task], journal: Journal, console: Console) -> dict[str, Record]:
    """Do what is not in the journal yet, in order; return the records of all tasks by key."""
    keys = [task.key for task in tasks]
    if len(set(keys)) != len(keys):
        raise ValueError(f"{title}: two tasks share a key")
    due = [task for task in tasks if task.key not in journal.records]
    if len(due) < len(tasks):
        console.print(f"{title}: {len(tasks) - len(due)} of {len(tasks)} measurements are already in {journal.path}")
    with progress_bar(console) as progress:
        bar = progress.add_task(title, total=len(tasks), completed=len(tasks) - len(due))
        for task in due:
            progress.update(bar, description=f"{title}: {task.key}")
            journal.add(task.key, task.measure())
            progress.advance(bar)
    return {key: journal.records[key] for key in keys}
