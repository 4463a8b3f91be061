"""What is drawn: the geoms that a viewer shows, and where they are."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

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


def quaternions(matrices: Floats) -> Floats:
    """Unit quaternions (n, 4), w first and not negative, of rotation matrices (n, 9).

    Source: the quaternion's outer product with itself is linear in the matrix; its largest row is best conditioned.
    """
    a, b, c, d, e, f, g, h, i = matrices.T
    outer = np.array(
        [
            [1 + a + e + i, h - f, c - g, d - b],
            [h - f, 1 + a - e - i, b + d, c + g],
            [c - g, b + d, 1 - a + e - i, f + h],
            [d - b, c + g, f + h, 1 - a - e + i],
        ]
    )
    squares = outer[range(4), range(4)]
    best = np.argmax(np.nan_to_num(squares), axis=0)
    rows = outer[best, :, np.arange(len(matrices))]
    with np.errstate(invalid="ignore", divide="ignore"):
        rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    result: Floats = np.where(rows[:, :1] < 0, -rows, rows)
    return result
