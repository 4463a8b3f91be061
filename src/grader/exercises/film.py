"""Films: runs of one model that play side by side on one clock. A kind records them of what a verdict shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.numerics.drawing import place_geoms
from grader.numerics.scene import Scene

FRAMES_MAX = 120
"""Frames of a run in a film: every step of a run with a large timestep."""

DIGITS = 4
"""Decimals of positions [m] and quaternions: a tenth of a millimetre is less than a pixel."""

FIGURES = 5

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Panel:
    """One run of a film: times [s] (n,) and positions (n, nq) of some of its steps. `detail` says at which timestep or
    of what it is, `integrator` has its colour, `ended` says why it ended before the film does, and is empty where it
    did not. `behind` is the place of the panel whose outlines are drawn over this one; None for none."""

    title: str
    times_s: Floats
    qpos: Floats
    detail: str = ""
    integrator: str = ""
    ended: str = ""
    behind: int | None = None


@dataclass(frozen=True)
class Distance:
    """A distance against time [s], for a logarithmic axis; None where it is not finite. `tolerance` is what passes."""

    label: str
    tolerance: float
    times_s: Sequence[float]
    values: Sequence[float | None]


@dataclass(frozen=True)
class Film:
    """Runs of the model of `scene`, shown up to `end_s` [s]; `steps` were simulated for it. `name` is unique among the
    films of a verdict, `title` is what a learner chooses it by, and `caption` says what is seen."""

    name: str
    title: str
    caption: str
    scene: Scene
    end_s: float
    panels: tuple[Panel, ...]
    distance: Distance | None = None
    steps: int = 0

    def to_json(self) -> dict[str, Any]:
        """Plain JSON: numbers that JSON does not have are null."""
        model = self.scene.model
        placed = [place_geoms(model, panel.qpos) for panel in self.panels]
        distance = self.distance
        return {
            "name": self.name,
            "title": self.title,
            "caption": self.caption,
            "end": round(self.end_s, 9),
            "geoms": placed[0][0] if placed else [],
            "unit": find_unit(model),
            "panels": [
                describe_panel(panel, poses, with_values=find_unit(model) is not None)
                for panel, (_, poses) in zip(self.panels, placed, strict=True)
            ],
            "distance": None
            if distance is None
            else {
                "label": distance.label,
                "tolerance": distance.tolerance,
                "times": list(distance.times_s),
                "values": list(distance.values),
            },
        }


def describe_panel(panel: Panel, poses: Floats, *, with_values: bool) -> dict[str, Any]:
    """Returns a panel as plain JSON. `values` are those of the first coordinate, for models whose first joint has only
    one."""
    values = panel.qpos[:, 0] if with_values else np.empty(0)
    return {
        "title": panel.title,
        "detail": panel.detail,
        "integrator": panel.integrator,
        "ended": panel.ended,
        "behind": panel.behind,
        "times": [round(time_s, 9) for time_s in panel.times_s.tolist()],
        "values": [float(f"{value:.{FIGURES}g}") if np.isfinite(value) else None for value in values.tolist()],
        "frames": round_poses(poses),
    }


def round_poses(poses: Floats) -> list[Any]:
    """Returns poses (n, geoms, 7) as nested lists; null for what is not finite, or too large to round."""
    with np.errstate(all="ignore"):
        rounded = np.round(poses, DIGITS) + 0.0
    plain = rounded.astype(object)
    plain[~np.isfinite(rounded)] = None
    result: list[Any] = plain.tolist()
    return result


def find_unit(model: mujoco.MjModel) -> str | None:
    """Returns the unit of the first coordinate; None where it is one of several of a joint."""
    units = {mujoco.mjtJoint.mjJNT_HINGE: "rad", mujoco.mjtJoint.mjJNT_SLIDE: "m"}
    return units.get(mujoco.mjtJoint(int(model.jnt_type[0]))) if model.njnt else None


def choose_rows(rows: int) -> NDArray[np.int64]:
    """Returns the indices of at most FRAMES_MAX rows, the first and the last among them."""
    chosen: NDArray[np.int64] = np.unique(np.linspace(0, rows - 1, min(rows, FRAMES_MAX)).round().astype(np.int64))
    return chosen
