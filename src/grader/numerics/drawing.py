"""What a viewer draws of a model: its geoms, and how they are turned."""

from collections.abc import Callable, Iterable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

GROUP_MAX = 2
"""Geoms of higher groups are hidden. Source: the default of mjvOption.geomgroup."""

DEFAULT_RGBA = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)
MESH_MAX = 4000
"""Triangles of the meshes of one scene: some 60 kB, compressed. Further meshes are drawn as their bounding boxes."""

BOX_FACES = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]
"""Two triangles a side; the bits of a corner's number say on which side of x, y and z it lies."""

MESHED = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF)


def list_drawn_geoms(model: mujoco.MjModel) -> dict[int, dict[str, Any]]:
    """Returns the geoms that are shown, by index: those in a visible group that are not fully transparent. Each has its
    name, type, size and colour, and the name of its body, which is None where no joint moves it. Meshes and height
    fields have the half sizes of their bounding box, and their triangles as far as MESH_MAX of them fit, else those of
    the box."""
    left = MESH_MAX
    colours = {geom: _choose_colour(model, geom) for geom in range(model.ngeom) if model.geom_group[geom] <= GROUP_MAX}
    drawn = {geom: _describe_geom(model, geom, rgba) for geom, rgba in colours.items() if rgba[3] > 0}
    for geom, described in drawn.items():
        if mujoco.mjtGeom(int(model.geom_type[geom])) in MESHED:
            vertices, faces = _list_triangles(model, geom, left)
            described["mesh"] = {"vertices": np.round(vertices, 5).ravel().tolist(), "faces": faces}
            left -= len(faces) // 3
    return drawn


def _describe_geom(model: mujoco.MjModel, geom: int, rgba: NDArray[np.float32]) -> dict[str, Any]:
    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    size = model.geom_aabb[geom, 3:] if kind in MESHED else model.geom_size[geom]
    return {
        "name": mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom),
        "type": kind.name.removeprefix("mjGEOM_").lower(),
        "size": [round(float(x), 6) for x in size],
        "rgba": [round(float(x), 3) for x in rgba],
        "body": _name_body(model, int(model.geom_bodyid[geom])),
    }


def _name_body(model: mujoco.MjModel, body: int) -> str | None:
    """Returns the name of a body that moves, or its number; None for one that is fixed to the world."""
    if int(model.body_weldid[body]) == 0:
        return None
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body {body}"


def _list_triangles(model: mujoco.MjModel, geom: int, most: int) -> tuple[Floats, list[int]]:
    """Returns the corners (n, 3) [m] of a mesh or height field in the geom's frame, and the corners of its triangles,
    one after the other; those of its bounding box where there are more than `most`."""
    kind, part = model.geom_type[geom], int(model.geom_dataid[geom])
    if kind == mujoco.mjtGeom.mjGEOM_MESH and model.mesh_facenum[part] <= most:
        vertex, face = int(model.mesh_vertadr[part]), int(model.mesh_faceadr[part])
        faces = model.mesh_face[face : face + int(model.mesh_facenum[part])]
        return model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[part])], faces.ravel().tolist()
    if kind == mujoco.mjtGeom.mjGEOM_HFIELD:
        rows, columns = int(model.hfield_nrow[part]), int(model.hfield_ncol[part])
        if 2 * (rows - 1) * (columns - 1) <= most:
            return _list_ground(model, part, rows, columns)
    sides = np.array([[corner >> axis & 1 for axis in (2, 1, 0)] for corner in range(8)]) * 2 - 1
    return model.geom_aabb[geom, :3] + sides * model.geom_aabb[geom, 3:], BOX_FACES


def _list_ground(model: mujoco.MjModel, field: int, rows: int, columns: int) -> tuple[Floats, list[int]]:
    """Returns the corners and triangles of the upper side of a height field, whose rows go along y."""
    start, (x, y, high, _) = int(model.hfield_adr[field]), model.hfield_size[field]
    along, across = np.meshgrid(np.linspace(-x, x, columns), np.linspace(-y, y, rows))
    heights = high * model.hfield_data[start : start + rows * columns]
    corners = np.arange(rows * columns).reshape(rows, columns)
    low, right, up, far = corners[:-1, :-1], corners[:-1, 1:], corners[1:, :-1], corners[1:, 1:]
    faces = np.stack([low, right, far, low, far, up], axis=-1).ravel().tolist()
    return np.column_stack([along.ravel(), across.ravel(), heights]), faces


def _choose_colour(model: mujoco.MjModel, geom: int) -> NDArray[np.float32]:
    """Returns the colour of a geom: its material's where it has none of its own. Source: mjv_updateScene."""
    material, own = int(model.geom_matid[geom]), model.geom_rgba[geom]
    colour: NDArray[np.float32] = (
        model.mat_rgba[material] if material >= 0 and bool(np.all(own == DEFAULT_RGBA)) else own
    )
    return colour


def place_geoms(model: mujoco.MjModel, positions: Floats) -> tuple[list[dict[str, Any]], Floats]:
    """Returns what is drawn of a model at positions (n, nq), and its poses (n, drawn, 7): position [m] and quaternion.
    Of a model without geoms that are shown, the boxes of inertia of its bodies."""
    data, geoms = mujoco.MjData(model), list_drawn_geoms(model)
    bodies = [] if geoms else [body for body in range(1, model.nbody) if model.body_mass[body] > 0]
    places, matrices = [], []
    for data.qpos[:] in positions:
        mujoco.mj_kinematics(model, data)
        if bodies:
            mujoco.mj_comPos(model, data)
        places.append(data.xipos[bodies] if bodies else data.geom_xpos[list(geoms)])
        matrices.append(data.ximat[bodies] if bodies else data.geom_xmat[list(geoms)])
    drawn = [_describe_inertia(model, body) for body in bodies] if bodies else list(geoms.values())
    return drawn, np.dstack([np.array(places), to_quaternions(np.array(matrices))])


def _describe_inertia(model: mujoco.MjModel, body: int) -> dict[str, Any]:
    """Returns the solid box with the mass and the inertia of a body. Source: half sides a, b, c of a box of mass m
    have m (b^2 + c^2) / 3 = I_a."""
    inertia = model.body_inertia[body]
    squared = 1.5 * (inertia.sum() - 2 * inertia) / model.body_mass[body]
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
    size = [round(float(x), 6) for x in np.sqrt(np.maximum(squared, 0))]
    moves = _name_body(model, body)
    return {"name": name, "type": "box", "size": size, "rgba": [0.62, 0.65, 0.7, 1.0], "body": moves}


Draw = Callable[[mujoco.MjModel, mujoco.MjData], list[list[float]]]


def list_overlays(names: Iterable[str]) -> list[tuple[str, Draw]]:
    """What draws each overlay of these names, without those that are never drawn; contacts and forces are one."""
    known = dict.fromkeys("contacts" if name == "forces" else name for name in names)
    return [(name, OVERLAYS[name]) for name in known if name in OVERLAYS]


def _draw_contacts(model: mujoco.MjModel, data: mujoco.MjData) -> list[list[float]]:
    """Returns, for every contact that acts, the point [m], and the force on the second geom [N], in the world."""
    force, rows = np.zeros(6), []
    for i in range(min(data.ncon, CONTACTS_MAX)):
        contact = data.contact[i]
        mujoco.mj_contactForce(model, data, i, force)
        rows.append([*contact.pos.tolist(), *(force[:3] @ contact.frame.reshape(3, 3)).tolist()])
    return rows


def _draw_cameras(model: mujoco.MjModel, data: mujoco.MjData) -> list[list[float]]:
    """Returns, for every camera, the point [m] and the quaternion, by which it looks along -z with +y up."""
    turned = to_quaternions(data.cam_xmat[np.newaxis])[0] if model.ncam else np.empty((0, 4))
    rows: list[list[float]] = np.hstack([data.cam_xpos, turned]).tolist()
    return rows


CONTACTS_MAX = 50
"""How many contacts of a frame are drawn."""

OVERLAYS: dict[str, Draw] = {
    "frames": lambda _, data: np.hstack([data.xpos[1:], data.xquat[1:]]).tolist(),
    "joints": lambda _, data: np.hstack([data.xanchor, data.xaxis]).tolist(),
    "contacts": _draw_contacts,
    "com": lambda _, data: data.xipos[1:].tolist(),
    "sites": lambda _, data: data.site_xpos.tolist(),
    "cameras": _draw_cameras,
}
"""Rows: positions [m]; of frames and cameras with a quaternion, of joints with an axis, of contacts with a force."""


def to_quaternions(matrices: Floats) -> Floats:
    """Unit quaternions (frames, geoms, 4), w first and not negative, of rotation matrices (frames, geoms, 9)."""
    quats = np.empty((*matrices.shape[:2], 4))
    for quaternion, matrix in zip(quats.reshape(-1, 4), matrices.reshape(-1, 9), strict=True):
        mujoco.mju_mat2Quat(quaternion, matrix)
    result: Floats = np.where(quats[..., :1] < 0, -quats, quats)
    return result
