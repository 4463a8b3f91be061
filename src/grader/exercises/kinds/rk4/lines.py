"""Finds the line of a script that reaches a stage, or the end, of its step: the note `lines` of a trace says in which
lines one step changes the state and calls mj_forward."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from grader.exercises.trace import LINES_MAX, Trace

COLUMNS = 4
"""Numbers of a row: what changes, as bits; the line; the lines of its callers, 0 where there is none."""

PARTS = ("qpos", "qvel", "act", "time")
CALL = 1 << len(PARTS)
"""The bit of a call of mj_forward."""

END = -1
"""The place behind the last call."""


@dataclass(frozen=True)
class StateChange:
    """A line that changes the state or calls mj_forward; `lines` begins with the innermost."""

    bits: int
    lines: tuple[int, ...]

    def changes(self, part: str) -> bool:
        """Whether it changes a part of the state; any part for "forward"."""
        return bool(self.bits & (1 << PARTS.index(part) if part in PARTS else CALL - 1))


def read_changes(trace: Trace) -> list[list[StateChange]]:
    """Returns the changes of the step in a trace, in groups: a group ends with a call of mj_forward, the last one with
    the step. Empty where there is no note, or it cannot be read."""
    note = next(iter(trace.list_notes("lines")), None)
    if note is None or len(note.numbers) % COLUMNS or not np.all((note.numbers >= 0) & (note.numbers <= LINES_MAX)):
        return []
    groups: list[list[StateChange]] = [[]]
    for bits, *lines in note.numbers.astype(int).reshape(-1, COLUMNS).tolist():
        groups[-1].append(StateChange(bits, tuple(line for line in lines if line)))
        if bits & CALL:
            groups.append([])
    return groups


@dataclass(frozen=True)
class StepPlace:
    """Where a step goes wrong: behind how many calls of mj_forward, END for the end of the step, and in which part of
    the state, or "forward" where a call lacks. `calls` is how many the step has."""

    after: int
    part: str
    calls: int


def find_line(trace: Trace, place: StepPlace) -> int | None:
    """Returns the line that writes that part of the state there, else that of the next call; None where the trace tells
    of no such line. Where a line is shared by the stages, the line that calls it is returned, if that is not."""
    groups = read_changes(trace)
    if not place.calls < len(groups) <= place.calls + 2:  # one call more: after the step
        return None
    here = place.calls if place.after == END else place.after
    changes = [change for change in groups[here] if change.lines]
    writes = [change for change in changes if change.changes(place.part)]
    if not writes:
        writes = [change for change in changes if change.bits & CALL][-1:]
    if not writes:
        return None
    return choose_line(writes[0] if place.part == "forward" else writes[-1], groups, here)


def choose_line(change: StateChange, groups: Sequence[Sequence[StateChange]], here: int) -> int:
    """Returns the innermost of a change's lines that no other group has; the innermost of all where each is shared."""
    others = [group for index, group in enumerate(groups) if index != here]
    shared = {line for group in others for place in group for line in place.lines}
    return next((line for line in change.lines if line not in shared), change.lines[0])
