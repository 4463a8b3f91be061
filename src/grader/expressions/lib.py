"""`lib`: what the course's widget offers beside MuJoCo itself. The tables at the end say what each function gives."""

import math
from collections.abc import Callable
from difflib import get_close_matches
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.expressions import values
from grader.expressions.machine import Machine
from grader.expressions.mathematics import Numeric, find_largest, find_smallest
from grader.expressions.values import UNDEFINED, Record, RunError, Value, Vector

COUNTS = {"body": "nbody", "joint": "njnt", "geom": "ngeom", "site": "nsite", "sensor": "nsensor"}
"""How many named objects of a kind a model has."""

NAMES_MAX = 12
"""Names that a sentence lists."""

SEARCHED_MAX = 500
"""Names, and characters of a wrong one, among which the one is sought that was meant."""


def _find_id(m: Machine, kind: str, name: Value) -> int:
    """Returns the index of a named object. Raises RunError where the model has none of that name."""
    text = values.from_units(values.to_string(name))
    index: int = mujoco.mj_name2id(m.model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), text)
    if index < 0:
        raise RunError(f"the model has no {kind} named {text!r}{_suggest(m, text, kind)}")
    return index


def _suggest(m: Machine, text: str, *kinds: str) -> str:
    """Returns the name that was meant, or the first that there are, for the end of a sentence on a wrong name."""
    there = [
        name
        for kind in kinds
        for index in range(min(SEARCHED_MAX, getattr(m.model, COUNTS[kind])))
        if (name := mujoco.mj_id2name(m.model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), index))
    ]
    if near := get_close_matches(text[:SEARCHED_MAX], there, n=1):
        return f": did you mean {near[0]!r}?"
    if not there:
        return ", and none with a name"
    return f"; there are: {', '.join(there[:NAMES_MAX])}{', ...' if len(there) > NAMES_MAX else ''}"


def _view(m: Machine, kind: str, name: Value) -> Any:
    """MuJoCo's view of a named object's fields, such as `.xpos` of a body."""
    return getattr(m.data, kind)(_find_id(m, kind, name))


def _one_or_all(row: NDArray[np.float64]) -> Value:
    numbers: list[Value] = row.tolist()
    return numbers[0] if len(numbers) == 1 else numbers


def _energy(m: Machine) -> Value:
    potential, kinetic = m.data.energy.tolist()
    return Record(total=potential + kinetic, kinetic=kinetic, potential=potential)


def _body_velocity(m: Machine, name: Value) -> Value:
    result = np.zeros(6)
    mujoco.mj_objectVelocity(m.model, m.data, mujoco.mjtObj.mjOBJ_BODY, _find_id(m, "body", name), result, 0)
    return [*map(float, result[3:])]


def _find_contacts(m: Machine, geom: Value) -> list[int]:
    """Returns the contacts of a geom (by name or number), or all of them."""
    wanted: int | None = None
    if isinstance(geom, float):
        wanted = int(geom) if geom.is_integer() else -1
    elif geom is not UNDEFINED and geom is not None:
        wanted = _find_id(m, "geom", geom)
    pairs: Any = m.data.contact.geom
    return [i for i in range(m.data.ncon) if wanted is None or wanted in pairs[i]]


def _normal_force(m: Machine, geom: Value) -> Value:
    force, total = np.zeros(6), 0.0
    for i in _find_contacts(m, geom):
        mujoco.mj_contactForce(m.model, m.data, i, force)
        total += float(force[0])
    return total


def _contact_pairs(m: Machine) -> Value:
    """Returns the geoms of every contact; one without a name is called by its body."""

    def name(geom: int) -> str:
        body = int(m.model.geom_bodyid[geom])
        named = mujoco.mj_id2name(m.model, mujoco.mjtObj.mjOBJ_GEOM, geom)
        return values.to_units(named or mujoco.mj_id2name(m.model, mujoco.mjtObj.mjOBJ_BODY, body) or "")

    return [" / ".join(map(name, pair)) for pair in m.data.contact.geom.tolist()]


def _mass_matrix(m: Machine) -> Value:
    """Derives what depends on qpos again, but no acceleration: the run goes on unchanged."""
    for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon, mujoco.mj_makeM):
        stage(m.model, m.data)
    _pay_for(m, m.model.nv)
    matrix = np.zeros((m.model.nv, m.model.nv))
    mujoco.mj_fullM(m.model, m.data, matrix)
    rows: list[Value] = matrix.tolist()
    return rows


def _rows_of_jacobian(m: Machine, name: Value, columns: Value) -> NDArray[np.float64]:
    """d(velocity, angular velocity) / d(qvel) of a site, else of a body: (6, columns), all `nv` where not given."""
    text = values.from_units(values.to_string(name))
    site = mujoco.mj_name2id(m.model, mujoco.mjtObj.mjOBJ_SITE, text)
    body = mujoco.mj_name2id(m.model, mujoco.mjtObj.mjOBJ_BODY, text)
    if site < 0 and body < 0:
        raise RunError(f"the model has no site or body named {text!r}{_suggest(m, text, 'site', 'body')}")
    _pay_for(m, 6)
    rows = np.zeros((6, m.model.nv))
    if site >= 0:
        mujoco.mj_jacSite(m.model, m.data, rows[:3], rows[3:], site)
    else:
        mujoco.mj_jacBody(m.model, m.data, rows[:3], rows[3:], body)
    return rows if columns is UNDEFINED or columns is None else rows[:, : max(0, values.to_index(columns))]


def _pay_for(m: Machine, rows: int) -> None:
    """A matrix with so many rows of nv numbers costs as much as an array of its size."""
    m.tick(rows * m.model.nv // 16)


def _jacobian(m: Machine, name: Value, columns: Value) -> Value:
    rows: list[Value] = _rows_of_jacobian(m, name, columns).tolist()
    return rows


def _singular_values(m: Machine, name: Value, options: Value) -> Value:
    """Largest first, one for each row: of all six, or with `{rows: 'pos'}` of the translation alone."""
    given = options if isinstance(options, Record) else Record()
    rows = _rows_of_jacobian(m, name, given.get("cols"))[: 3 if given.get("rows") == "pos" else 6]
    values = np.linalg.svd(rows, compute_uv=False) if rows.size and np.isfinite(rows).all() else np.zeros(0)
    return [*map(float, values), *[0.0] * (len(rows) - len(values))]


def _array(value: Value) -> list[float]:
    if isinstance(value, list | Vector):
        return [values.to_number(x) for x in values.list_items(value)]
    raise RunError("an array is needed here")


def _dot(m: Machine, a: Value, b: Value) -> Value:
    left, right = _array(a), _array(b)
    if len(left) != len(right):
        raise RunError("two arrays of one length are needed here")
    return float(sum(x * y for x, y in zip(left, right, strict=True)))


def _cross(m: Machine, a: Value, b: Value) -> Value:
    left, right = _array(a), _array(b)
    if not len(left) == len(right) == 3:
        raise RunError("two arrays of three numbers are needed here")
    return [*map(float, np.cross(left, right))]


FUNCTIONS: dict[str, Callable[..., Value]] = {
    # {total, kinetic, potential} [J], of the start of the last step, of the state itself under RK4
    "energy": _energy,
    # world position [x, y, z] [m]
    "bodyPos": lambda m, name: _view(m, "body", name).xpos.tolist(),
    "sitePos": lambda m, name: _view(m, "site", name).xpos.tolist(),
    "geomPos": lambda m, name: _view(m, "geom", name).xpos.tolist(),
    # linear velocity of the body's centre of mass [x, y, z] [m/s]
    "bodyVel": _body_velocity,
    # a joint's position and velocity, a sensor's reading: a number where there is one, else an array
    "qpos": lambda m, name: _one_or_all(_view(m, "joint", name).qpos),
    "qvel": lambda m, name: _one_or_all(_view(m, "joint", name).qvel),
    "sensor": lambda m, name: _one_or_all(_view(m, "sensor", name).data),
    # sum of the normal contact forces [N], and number of contacts; of one geom where it is given
    "normalForce": _normal_force,
    "contacts": lambda m, geom: float(len(_find_contacts(m, geom))),
    # the geoms of every contact, as "floor / ball"
    "contactPairs": _contact_pairs,
    # the number of a body, of a joint
    "bodyId": lambda m, name: float(_find_id(m, "body", name)),
    "jointId": lambda m, name: float(_find_id(m, "joint", name)),
    # the inertia at the present qpos, (nv, nv), as rows
    "massMatrix": _mass_matrix,
    # of a site or body: 3 rows of translation, 3 of rotation, (6, nv) or as many columns as are asked for; and its
    # singular values, largest first, with {rows: 'pos', cols: 2} of the translation and the first two columns
    "jacobian": _jacobian,
    "jacobianSV": _singular_values,
    # centre of mass of the whole model [x, y, z] [m]
    "com": lambda m: m.data.subtree_com[0].tolist(),
    # Euclidean length, scalar product, vector product
    "norm": lambda m, array: math.hypot(*_array(array)),
    "dot": _dot,
    "cross": _cross,
}
"""Functions of the machine and of the author's arguments. To add one, add a line."""

NUMERIC: dict[str, Numeric] = {
    "deg": lambda x: x * 180 / math.pi,
    "rad": lambda x: x * math.pi / 180,
    "clamp": lambda x, low, high: find_smallest(find_largest(x, low), high),
}
"""Functions of numbers alone: radians to degrees, degrees to radians, x within low..high."""

RECORD_PARTS = frozenset(("total", "kinetic", "potential"))
