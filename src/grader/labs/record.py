"""LabRun: what a run of a lab showed, frame by frame, as the page plays it."""

from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grader.domain.lab import LabConfig
from grader.labs.number_text import to_fixed
from grader.labs.values import Trouble, Value, from_units, to_string

Floats = NDArray[np.float64]
DIGITS_DEFAULT = 3
POSITION_DIGITS = 5
NUMBER_DIGITS = 9


@dataclass(frozen=True)
class Warned:
    """A warning of MuJoCo: its kind, such as BADQACC, and the lab's time [s] at which the step began."""

    kind: str
    time_s: float


@dataclass(frozen=True)
class LabRun:
    """A run of a lab. `time_s` (frames,) is the lab's own time, which goes on when MuJoCo resets the state.

    `positions` (frames, geoms, 3) [m] and `orientations` (frames, geoms, 4) of the drawn geoms; `readouts`, `traces`
    and `trail` hold one value a frame. `controls` are the values that were used.
    """

    config: LabConfig
    controls: dict[str, Any]
    geoms: tuple[dict[str, Any], ...]
    time_s: Floats
    positions: Floats
    orientations: Floats
    readouts: tuple[tuple[Value, ...], ...]
    traces: tuple[tuple[tuple[Value, ...], ...], ...]
    reference_lines: tuple[tuple[Any, ...], ...]
    trail: tuple[Value, ...] | None
    warnings: tuple[Warned, ...]
    duration_s: float
    steps: int
    timing_ms: dict[str, float]

    @property
    def stable(self) -> bool:
        """Whether MuJoCo never warned."""
        return not self.warnings

    def to_json(self) -> dict[str, Any]:
        """Plain JSON: numbers that JSON does not have are null."""
        return {
            "duration": _number(self.duration_s),
            "steps": self.steps,
            "controls": self.controls,
            "times": _rounded(self.time_s, NUMBER_DIGITS),
            "geoms": list(self.geoms),
            "frames": _rounded(np.concatenate([self.positions, self.orientations], axis=2), POSITION_DIGITS),
            "readouts": [self._readout(i) for i in range(len(self.readouts))],
            "plots": [self._plot(i) for i in range(len(self.traces))],
            "trail": None if self.trail is None else [_point(value) for value in self.trail],
            "warnings": [{"kind": w.kind, "time": _number(w.time_s)} for w in self.warnings],
            "stable": self.stable,
            "timing_ms": {name: round(ms, 3) for name, ms in self.timing_ms.items()},
        }

    def _readout(self, index: int) -> dict[str, Any]:
        readout, values = self.config.readouts[index], self.readouts[index]
        texts = [readout_text(value, readout.digits) for value in values]
        numbers = [_number(value) for value in values]
        return {
            "label": readout.label,
            "unit": readout.unit,
            "texts": texts,
            "values": numbers,
            "final": {"text": texts[-1], "value": numbers[-1]},
        }

    def _plot(self, index: int) -> dict[str, Any]:
        plot = self.config.plots[index]
        shown = plot.model_dump(mode="json", include={"ylabel", "window", "ymin", "ymax"})
        traces = [
            {"label": trace.label, "dash": trace.dash, "color": trace.color, "values": [_number(v) for v in values]}
            for trace, values in zip(plot.traces, self.traces[index], strict=True)
        ]
        return {**shown, "refLines": list(self.reference_lines[index]), "traces": traces}


def readout_text(value: Value, digits: int | None) -> str:
    """As the page shows it: a number with its digits, anything else as JavaScript would write it."""
    if type(value) is float:
        return to_fixed(value, DIGITS_DEFAULT if digits is None else digits)
    try:
        return from_units(to_string(value))
    except Trouble:
        return "?"


def _number(value: Value) -> float | None:
    if isinstance(value, bool) or not isinstance(value, float) or not isfinite(value):
        return float(value) if isinstance(value, bool) else None
    return float(f"{value:.{NUMBER_DIGITS}g}")


def _point(value: Value) -> list[float | None]:
    return [_number(x) for x in value[:3]] if isinstance(value, list) else [None, None, None]


def _rounded(array: Floats, digits: int) -> Any:
    """Nested lists; NaN and infinities become null."""
    rounded = np.round(array, digits) + 0.0
    if np.all(np.isfinite(rounded)):
        return rounded.tolist()
    plain = rounded.astype(object)
    plain[~np.isfinite(rounded)] = None
    return plain.tolist()
