"""LabRun: the recorded frames of a run, with the geoms that a viewer draws, as the page plays them."""

from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.domain.lab import LabConfig, Plot, Readout
from grader.expressions import Trouble, Value, texts, values

Floats = NDArray[np.float64]
DIGITS_DEFAULT = 3
POSITION_DIGITS = 5
NUMBER_DIGITS = 9


@dataclass(frozen=True)
class Warned:
    """A warning of MuJoCo: its kind, such as BADQACC, and the lab's time [s] at which the step began."""

    kind: str
    time_s: float

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {"kind": self.kind, "time": number_or_none(self.time_s)}


def noted(counts: NDArray[np.int32], time_s: float) -> list[Warned]:
    """What MuJoCo has counted since the last call; clears the counters, which it leaves at 1 after a reset."""
    if not counts.any():
        return []
    kinds = [mujoco.mjtWarning(int(kind)) for kind in np.flatnonzero(counts)]
    counts[:] = 0
    return [Warned(kind.name.removeprefix("mjWARN_"), time_s) for kind in kinds]


Column = tuple[Value, ...]
"""What one expression gave, a value a frame."""


@dataclass
class LabRun:
    """A run of a lab, frame by frame; `controls` are the values that were used.

    `times` [s] are the lab's own, which go on when MuJoCo resets the state. `poses` are positions (geoms, 3) [m] and
    rotation matrices (geoms, 9) of the drawn `geoms`; a row holds the readouts, the traces of the plots and the trail.
    """

    config: LabConfig
    controls: dict[str, Any]
    geoms: list[dict[str, Any]] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    poses: list[tuple[Floats, Floats]] = field(default_factory=list)
    rows: list[list[Value]] = field(default_factory=list)
    reference_lines: list[list[Any]] = field(default_factory=list)
    warnings: list[Warned] = field(default_factory=list)
    duration_s: float = 0.0
    steps: int = 0
    timing_ms: dict[str, float] = field(default_factory=dict)

    @property
    def stable(self) -> bool:
        """Whether MuJoCo never warned."""
        return not self.warnings

    @property
    def readouts(self) -> list[Column]:
        """The values of the readouts."""
        return list(zip(*self.rows, strict=True))[: len(self.config.readouts)]

    def to_json(self) -> dict[str, Any]:
        """Plain JSON: numbers that JSON does not have are null."""
        columns = zip(*self.rows, strict=True)
        positions, matrices = (np.array(each) for each in zip(*self.poses, strict=True))
        return {
            "duration": number_or_none(self.duration_s),
            "steps": self.steps,
            "controls": self.controls,
            "times": _rounded(np.array(self.times), NUMBER_DIGITS),
            "geoms": self.geoms,
            "frames": _rounded(np.dstack([positions, _quaternions(matrices)]), POSITION_DIGITS),
            "readouts": [_readout(readout, next(columns)) for readout in self.config.readouts],
            "plots": [
                _plot(plot, [next(columns) for _ in plot.traces], lines)
                for plot, lines in zip(self.config.plots, self.reference_lines, strict=True)
            ],
            "trail": next(([_point(value) for value in column] for column in columns), None),
            "warnings": [warning.to_json() for warning in self.warnings],
            "stable": self.stable,
            "timing_ms": {name: round(ms, 3) for name, ms in self.timing_ms.items()},
        }


def _readout(readout: Readout, column: Column) -> dict[str, Any]:
    shown = [readout_text(value, readout.digits) for value in column]
    numbers = [number_or_none(value) for value in column]
    final = {"text": shown[-1], "value": numbers[-1]}
    return {"label": readout.label, "unit": readout.unit, "texts": shown, "values": numbers, "final": final}


def _plot(plot: Plot, traces: list[Column], lines: list[Any]) -> dict[str, Any]:
    shown = plot.model_dump(mode="json", include={"ylabel", "window", "ymin", "ymax"})
    drawn = [
        {"label": trace.label, "dash": trace.dash, "color": trace.color, "values": list(map(number_or_none, column))}
        for trace, column in zip(plot.traces, traces, strict=True)
    ]
    return {**shown, "refLines": lines, "traces": drawn}


def readout_text(value: Value, digits: int | None) -> str:
    """As the page shows it: a number with its digits, anything else as JavaScript would write it."""
    if type(value) is float:
        return texts.to_fixed(value, DIGITS_DEFAULT if digits is None else digits)
    try:
        return values.from_units(values.to_string(value))
    except Trouble:
        return "?"


def number_or_none(value: Value) -> float | None:
    """A number as JSON has it, to NUMBER_DIGITS digits; None for everything else."""
    if isinstance(value, bool) or not isinstance(value, float) or not isfinite(value):
        return float(value) if isinstance(value, bool) else None
    return float(f"{value:.{NUMBER_DIGITS}g}")


def _point(value: Value) -> list[float | None]:
    return [number_or_none(x) for x in value[:3]] if isinstance(value, list) else [None, None, None]


def _rounded(array: Floats, digits: int) -> Any:
    """Nested lists; NaN and infinities become null."""
    rounded = np.round(array, digits) + 0.0
    if np.all(np.isfinite(rounded)):
        return rounded.tolist()
    plain = rounded.astype(object)
    plain[~np.isfinite(rounded)] = None
    return plain.tolist()


GROUP_MAX = 2
"""Geoms of higher groups are hidden. Source: the default of mjvOption.geomgroup."""

DEFAULT_RGBA = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)


def drawn_geoms(model: mujoco.MjModel) -> list[int]:
    """The geoms that are shown: in a visible group and not fully transparent."""
    return [g for g in range(model.ngeom) if model.geom_group[g] <= GROUP_MAX and _rgba(model, g)[3] > 0]


def describe_geom(model: mujoco.MjModel, geom: int) -> dict[str, Any]:
    """Name, type, size and colour; a mesh or height field has the half sizes of its bounding box."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    boxed = kind in (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF)
    size = model.geom_aabb[geom, 3:] if boxed else model.geom_size[geom]
    return {
        "name": mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom),
        "type": kind.name.removeprefix("mjGEOM_").lower(),
        "size": [round(float(x), 6) for x in size],
        "rgba": [round(float(x), 3) for x in _rgba(model, geom)],
    }


def _rgba(model: mujoco.MjModel, geom: int) -> NDArray[np.float32]:
    """A material colours a geom that has no colour of its own. Source: mjv_updateScene."""
    material = int(model.geom_matid[geom])
    own: NDArray[np.float32] = model.geom_rgba[geom]
    if material >= 0 and bool(np.all(own == DEFAULT_RGBA)):
        colour: NDArray[np.float32] = model.mat_rgba[material]
        return colour
    return own


def _quaternions(matrices: Floats) -> Floats:
    """Unit quaternions (frames, geoms, 4), w first and not negative, of rotation matrices (frames, geoms, 9)."""
    found = np.empty((*matrices.shape[:2], 4))
    for quaternion, matrix in zip(found.reshape(-1, 4), matrices.reshape(-1, 9), strict=True):
        mujoco.mju_mat2Quat(quaternion, matrix)
    result: Floats = np.where(found[..., :1] < 0, -found, found)
    return result
