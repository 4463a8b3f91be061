"""Reads from a trace which runs a script made. They are claims."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from grader.exercises.trace import Trace

COLUMNS = 11
"""Numbers of a run in the note `search`."""


@dataclass(frozen=True)
class SearchRun:
    """One run: times [s]; the first coordinate, speed and control at its start; kinds of warning at start and end."""

    model: int
    timestep_s: float
    integrator: int
    start_s: float
    qpos: float
    qvel: float
    old_warnings: int
    end_s: float
    warnings: int
    last_timestep_s: float
    ctrl: float

    @property
    def new_warnings(self) -> int:
        """The kinds of warning that were raised in the run."""
        return self.warnings & ~self.old_warnings

    @property
    def duration_s(self) -> float:
        """The length of a run without a warning; after one MuJoCo sets the time back."""
        return self.end_s - self.start_s

    @property
    def steps(self) -> int:
        """The steps of a run without a warning."""
        return round(self.duration_s / self.timestep_s) if self.timestep_s > 0 else 0


@dataclass(frozen=True)
class SearchTrace:
    """The runs of one trial: `differing_fields` names for each model the fields in which it is not the given one.
    `created` counts how often a data was created or reset; `was_reset`: the last run was followed by a reset."""

    runs: tuple[SearchRun, ...]
    total: int
    created: int
    differing_fields: tuple[tuple[str, ...], ...]
    given: int | None
    set_s: float
    other_functions: tuple[str, ...]
    was_reset: bool = False


def read_search(trace: Trace) -> SearchTrace | None:
    """Returns the search that a trace tells of; None if it tells of none, or cannot be read."""
    note = next(iter(trace.list_notes("search")), None)
    if note is None or len(note.numbers) % COLUMNS:
        return None
    rows = [row for row in note.numbers.reshape(-1, COLUMNS).tolist() if all(map(isfinite, row[:4] + row[6:]))]
    total, created, given, set_s = (note.info.get(key) for key in ("total", "created", "given", "set_s"))
    return SearchTrace(
        runs=tuple(
            read_run(row) for row in rows if 0 < row[1] < 1e3 and all(0 <= row[i] < 2**31 for i in (0, 2, 6, 9))
        ),
        total=total if isinstance(total, int) else len(rows),
        created=created if isinstance(created, int) else 0,
        differing_fields=tuple(map(list_texts, models)) if isinstance(models := note.info.get("models"), list) else (),
        given=given if isinstance(given, int) else None,
        set_s=set_s if isinstance(set_s, float) else 0.0,
        other_functions=list_texts(note.info.get("others")),
        was_reset=note.info.get("cleared") is True,
    )


def read_run(row: Sequence[float]) -> SearchRun:
    """Returns the run that a row of the note describes."""
    model, timestep_s, integrator, start_s, qpos, qvel, stood, ctrl, end_s, raised, last_timestep_s = row
    return SearchRun(
        model=int(model), timestep_s=timestep_s, integrator=int(integrator), start_s=start_s, qpos=qpos, qvel=qvel,
        old_warnings=int(stood), end_s=end_s, warnings=int(raised), last_timestep_s=last_timestep_s, ctrl=ctrl
    )  # fmt: skip


def list_texts(value: object) -> tuple[str, ...]:
    """Returns the texts in a list."""
    return tuple(item for item in value if isinstance(item, str)) if isinstance(value, list) else ()
