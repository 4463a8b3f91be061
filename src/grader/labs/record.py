"""LabRun: the recorded frames of a run, with the geoms that a viewer draws, as the page plays them."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from math import isfinite
from typing import Any

import numpy as np

from grader.domain.lab import LabConfig, Plot, Readout
from grader.errors import LabError
from grader.expressions import UNDEFINED, RunError, Value, texts, values
from grader.labs.probes import Probe
from grader.numerics.drawing import Floats, to_quaternions
from grader.numerics.stepping import MujocoWarning

DIGITS_DEFAULT = 3
POSITION_DIGITS = 5
NUMBER_DIGITS = 9


DASH = "–"
"""How a value that could not be computed is written."""

Column = tuple[Value, ...]
"""What one expression gave, a value a frame; undefined where it failed."""


@dataclass(frozen=True)
class Limit:
    """The linear stability limit [s] at the slider `control` of the timestep; None if it has none in its range."""

    control: str
    timestep_s: float | None


@dataclass
class LabRun:
    """A run of a lab, frame by frame; `controls` are the values that were used.

    `seconds` is the length that was asked for; a run that `stopAt` ends is shorter. `failed` holds, by the index of
    what is shown, the first error of an expression and in how many frames it failed. `overlays` are, by name, what is
    drawn over the scene, frame by frame (`grader.numerics.drawing`).
    `times` [s] are the lab's own, which go on when MuJoCo resets the state. `poses` are positions (geoms, 3) [m] and
    rotation matrices (geoms, 9) of the drawn `geoms`; a row holds the readouts, the traces of the plots and the trail.
    `rederived` says that derived quantities are shown and were computed again for the states, as RK4 leaves others.
    `states` are positions and velocities at evenly spaced moments, of runs from a nudged start alone.
    `limit` is None where the lab has no slider of the timestep, or nothing that can be linearised.
    """

    config: LabConfig
    controls: dict[str, Any]
    geoms: list[dict[str, Any]] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    poses: list[tuple[Floats, Floats]] = field(default_factory=list)
    rows: list[list[Value]] = field(default_factory=list)
    reference_lines: list[list[Any]] = field(default_factory=list)
    warnings: list[MujocoWarning] = field(default_factory=list)
    failed: dict[int, tuple[LabError, int]] = field(default_factory=dict)
    overlays: dict[str, list[list[list[float]]]] = field(default_factory=dict)
    rederived: bool = False
    limit: Limit | None = None
    seconds: float = 0.0
    duration_s: float = 0.0
    steps: int = 0
    probes: list[Probe] = field(default_factory=list)
    states: list[Floats] = field(default_factory=list)
    timing_ms: dict[str, float] = field(default_factory=dict)

    @property
    def stable(self) -> bool:
        """Whether MuJoCo never warned."""
        return not self.warnings

    @property
    def readouts(self) -> list[Column]:
        """The values of the readouts."""
        return list(zip(*self.rows, strict=True))[: len(self.config.readouts)]

    def always_failed(self, index: int) -> bool:
        """Says whether what is shown failed in every frame; a reference line is computed once, at the end."""
        _, times = self.failed.get(index, (None, 0))
        return times == (len(self.times) if index < len(self.rows[0]) else 1)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON: numbers that JSON does not have are null."""
        columns = zip(*self.rows, strict=True)
        positions, matrices = (np.array(each) for each in zip(*self.poses, strict=True))
        return {
            "seconds": self.seconds,
            "duration": to_number_or_none(self.duration_s),
            "steps": self.steps,
            "controls": self.controls,
            "times": _round(np.array(self.times), NUMBER_DIGITS),
            "geoms": self.geoms,
            "frames": _round(np.dstack([positions, to_quaternions(matrices)]), POSITION_DIGITS),
            "overlays": {
                name: [_round(np.array(frame), POSITION_DIGITS) for frame in frames]
                for name, frames in self.overlays.items()
            },
            "readouts": [
                _readout_to_json(readout, next(columns), i in self.failed)
                for i, readout in enumerate(self.config.readouts)
            ],
            "plots": [
                _plot_to_json(plot, [next(columns) for _ in plot.traces], lines)
                for plot, lines in zip(self.config.plots, self.reference_lines, strict=True)
            ],
            "trail": next((list(map(_to_point, column)) for column in columns), None),
            "warnings": warnings_to_json(self.warnings),
            "stable": self.stable,
            "limit": None if self.limit is None else asdict(self.limit),
            "timing_ms": {name: round(ms, 3) for name, ms in self.timing_ms.items()},
        }


def _readout_to_json(readout: Readout, column: Column, failed: bool) -> dict[str, Any]:
    shown = [DASH if failed and value is UNDEFINED else format_readout(value, readout.digits) for value in column]
    numbers = [to_number_or_none(value) for value in column]
    final = {"text": shown[-1], "value": numbers[-1]}
    return {"label": readout.label, "unit": readout.unit, "texts": shown, "values": numbers, "final": final}


def _plot_to_json(plot: Plot, traces: list[Column], lines: list[Any]) -> dict[str, Any]:
    shown = plot.model_dump(mode="json", include={"xlabel", "ylabel", "height", "window", "ymin", "ymax"})
    drawn = [
        {"label": trace.label, "dash": trace.dash, "color": trace.color, "values": list(map(to_number_or_none, column))}
        for trace, column in zip(plot.traces, traces, strict=True)
    ]
    return {**shown, "refLines": lines, "traces": drawn}


def format_readout(value: Value, digits: int | None) -> str:
    """As the page shows it: a number with its digits, anything else as JavaScript would write it."""
    if type(value) is float:
        return texts.to_fixed(value, DIGITS_DEFAULT if digits is None else digits)
    try:
        return values.from_units(values.to_string(value))
    except RunError:
        return "?"


def to_number_or_none(value: Value) -> float | None:
    """Returns a number as JSON has it, to NUMBER_DIGITS digits; None for everything else."""
    if isinstance(value, bool):
        return float(value)
    return float(f"{value:.{NUMBER_DIGITS}g}") if isinstance(value, float) and isfinite(value) else None


def warnings_to_json(warnings: Iterable[MujocoWarning]) -> list[dict[str, Any]]:
    """Plain JSON."""
    return [{"kind": warning.kind, "time": to_number_or_none(warning.time_s)} for warning in warnings]


def _to_point(value: Value) -> list[float | None]:
    return [to_number_or_none(x) for x in value[:3]] if isinstance(value, list) else [None] * 3


def _round(array: Floats, digits: int) -> Any:
    """Nested lists; NaN and infinities become null."""
    rounded = np.round(array, digits) + 0.0
    if np.all(np.isfinite(rounded)):
        return rounded.tolist()
    plain = rounded.astype(object)
    plain[~np.isfinite(rounded)] = None
    return plain.tolist()
