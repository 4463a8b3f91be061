"""`lib`: what the course's widget offers beside MuJoCo itself.

| call | gives |
|---|---|
| `lib.energy()` | `{total, kinetic, potential}` [J], of the start of the last step, as MuJoCo computes it |
| `lib.bodyPos(name)`, `lib.sitePos(name)`, `lib.geomPos(name)` | world position `[x, y, z]` [m] |
| `lib.bodyVel(name)` | linear velocity of the body's centre of mass `[x, y, z]` [m/s] |
| `lib.qpos(name)`, `lib.qvel(name)` | a joint's position and velocity: a number for hinge and slide, else an array |
| `lib.sensor(name)` | a sensor's reading: a number, or an array where it has several |
| `lib.normalForce(geom?)` | sum of the normal contact forces [N], of one geom's contacts where it is named |
| `lib.contacts(geom?)` | number of contacts, of one geom where it is named |
| `lib.com()` | centre of mass of the whole model `[x, y, z]` [m] |
| `lib.norm(array)`, `lib.dot(a, b)`, `lib.cross(a, b)` | Euclidean length, scalar product, vector product |
| `lib.deg(x)`, `lib.rad(x)` | radians to degrees, degrees to radians |
| `lib.clamp(x, low, high)` | x within low..high |
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.labs.machine import Machine
from grader.labs.mathematics import FUNCTIONS as FUNCTIONS_OF_MATH
from grader.labs.values import UNDEFINED, Record, Trouble, Value, Vector, from_units, to_number, to_string


def _identity(m: Machine, kind: mujoco.mjtObj, name: Value) -> int:
    """The index of a named object. Raises Trouble where the model has none of that name."""
    text = from_units(to_string(name))
    found: int = mujoco.mj_name2id(m.model, kind, text)
    if found < 0:
        raise Trouble(f"the model has no {kind.name.removeprefix('mjOBJ_').lower()} named {text!r}")
    return found


def _numbers(row: NDArray[np.float64]) -> list[Value]:
    return [float(x) for x in row]


def _one_or_all(row: NDArray[np.float64]) -> Value:
    return float(row[0]) if row.size == 1 else _numbers(row)


def _energy(m: Machine, *_: Value) -> Value:
    potential, kinetic = (float(x) for x in m.data.energy)
    return Record(total=potential + kinetic, kinetic=kinetic, potential=potential)


def _position(kind: mujoco.mjtObj, array: str) -> Callable[..., Value]:
    assert array in ("xpos", "site_xpos", "geom_xpos")

    def position(m: Machine, name: Value = UNDEFINED, *_: Value) -> Value:
        return _numbers(getattr(m.data, array)[_identity(m, kind, name)])

    return position


def _body_velocity(m: Machine, name: Value = UNDEFINED, *_: Value) -> Value:
    body, result = _identity(m, mujoco.mjtObj.mjOBJ_BODY, name), np.zeros(6)
    mujoco.mj_objectVelocity(m.model, m.data, mujoco.mjtObj.mjOBJ_BODY, body, result, 0)
    return _numbers(result[3:])


WIDTHS = {int(mujoco.mjtJoint.mjJNT_FREE): (7, 6), int(mujoco.mjtJoint.mjJNT_BALL): (4, 3)}


def _joint_position(m: Machine, name: Value = UNDEFINED, *_: Value) -> Value:
    joint = _identity(m, mujoco.mjtObj.mjOBJ_JOINT, name)
    first, width = int(m.model.jnt_qposadr[joint]), WIDTHS.get(int(m.model.jnt_type[joint]), (1, 1))[0]
    return _one_or_all(m.data.qpos[first : first + width])


def _joint_velocity(m: Machine, name: Value = UNDEFINED, *_: Value) -> Value:
    joint = _identity(m, mujoco.mjtObj.mjOBJ_JOINT, name)
    first, width = int(m.model.jnt_dofadr[joint]), WIDTHS.get(int(m.model.jnt_type[joint]), (1, 1))[1]
    return _one_or_all(m.data.qvel[first : first + width])


def _sensor(m: Machine, name: Value = UNDEFINED, *_: Value) -> Value:
    sensor = _identity(m, mujoco.mjtObj.mjOBJ_SENSOR, name)
    first, width = int(m.model.sensor_adr[sensor]), int(m.model.sensor_dim[sensor])
    return _one_or_all(m.data.sensordata[first : first + width])


def _touching(m: Machine, geom: Value) -> Iterator[int]:
    """The contacts of a geom (by name or number), or all of them."""
    wanted: int | None = None
    if isinstance(geom, float):
        wanted = int(geom) if geom.is_integer() else -1
    elif geom is not UNDEFINED and geom is not None:
        wanted = _identity(m, mujoco.mjtObj.mjOBJ_GEOM, geom)
    pairs: Any = m.data.contact.geom
    return (i for i in range(m.data.ncon) if wanted is None or wanted in pairs[i])


def _normal_force(m: Machine, geom: Value = UNDEFINED, *_: Value) -> Value:
    force, total = np.zeros(6), 0.0
    for i in _touching(m, geom):
        mujoco.mj_contactForce(m.model, m.data, i, force)
        total += float(force[0])
    return total


def _contacts(m: Machine, geom: Value = UNDEFINED, *_: Value) -> Value:
    return float(sum(1 for _contact in _touching(m, geom)))


def _com(m: Machine, *_: Value) -> Value:
    return _numbers(m.data.subtree_com[0])


def _array(value: Value) -> list[float]:
    if isinstance(value, list | Vector):
        return [to_number(x) for x in (value.values() if isinstance(value, Vector) else value)]
    raise Trouble("an array is needed here")


def _norm(m: Machine, array: Value = UNDEFINED, *_: Value) -> Value:
    return math.hypot(*_array(array))


def _dot(m: Machine, a: Value = UNDEFINED, b: Value = UNDEFINED, *_: Value) -> Value:
    left, right = _array(a), _array(b)
    if len(left) != len(right):
        raise Trouble("two arrays of one length are needed here")
    return float(sum(x * y for x, y in zip(left, right, strict=True)))


def _cross(m: Machine, a: Value = UNDEFINED, b: Value = UNDEFINED, *_: Value) -> Value:
    left, right = _array(a), _array(b)
    if not len(left) == len(right) == 3:
        raise Trouble("two arrays of three numbers are needed here")
    return _numbers(np.cross(left, right))


def _degrees(m: Machine, x: Value = UNDEFINED, *_: Value) -> Value:
    return to_number(x) * 180 / math.pi


def _radians(m: Machine, x: Value = UNDEFINED, *_: Value) -> Value:
    return to_number(x) * math.pi / 180


def _clamp(m: Machine, x: Value = UNDEFINED, low: Value = UNDEFINED, high: Value = UNDEFINED, *_: Value) -> Value:
    return FUNCTIONS_OF_MATH["min"](FUNCTIONS_OF_MATH["max"](x, low), high)


FUNCTIONS: dict[str, Callable[..., Value]] = {
    "energy": _energy,
    "bodyPos": _position(mujoco.mjtObj.mjOBJ_BODY, "xpos"),
    "sitePos": _position(mujoco.mjtObj.mjOBJ_SITE, "site_xpos"),
    "geomPos": _position(mujoco.mjtObj.mjOBJ_GEOM, "geom_xpos"),
    "bodyVel": _body_velocity,
    "qpos": _joint_position,
    "qvel": _joint_velocity,
    "sensor": _sensor,
    "normalForce": _normal_force,
    "contacts": _contacts,
    "com": _com,
    "norm": _norm,
    "dot": _dot,
    "cross": _cross,
    "deg": _degrees,
    "rad": _radians,
    "clamp": _clamp,
}
RECORD_PARTS = frozenset(("total", "kinetic", "potential"))
