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
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.expressions import values
from grader.expressions.machine import Machine
from grader.expressions.mathematics import largest, smallest
from grader.expressions.values import UNDEFINED, Record, Trouble, Value, Vector


def _identity(m: Machine, kind: str, name: Value) -> int:
    """The index of a named object. Raises Trouble where the model has none of that name."""
    text = values.from_units(values.to_string(name))
    found: int = mujoco.mj_name2id(m.model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), text)
    if found < 0:
        raise Trouble(f"the model has no {kind} named {text!r}")
    return found


def _named(m: Machine, kind: str, name: Value) -> Any:
    """MuJoCo's view of a named object's fields, such as `.xpos` of a body."""
    return getattr(m.data, kind)(_identity(m, kind, name))


def _one_or_all(row: NDArray[np.float64]) -> Value:
    numbers: list[Value] = row.tolist()
    return numbers[0] if len(numbers) == 1 else numbers


def _energy(m: Machine) -> Value:
    potential, kinetic = m.data.energy.tolist()
    return Record(total=potential + kinetic, kinetic=kinetic, potential=potential)


def _body_velocity(m: Machine, name: Value) -> Value:
    result = np.zeros(6)
    mujoco.mj_objectVelocity(m.model, m.data, mujoco.mjtObj.mjOBJ_BODY, _identity(m, "body", name), result, 0)
    return [*map(float, result[3:])]


def _touching(m: Machine, geom: Value) -> list[int]:
    """The contacts of a geom (by name or number), or all of them."""
    wanted: int | None = None
    if isinstance(geom, float):
        wanted = int(geom) if geom.is_integer() else -1
    elif geom is not UNDEFINED and geom is not None:
        wanted = _identity(m, "geom", geom)
    pairs: Any = m.data.contact.geom
    return [i for i in range(m.data.ncon) if wanted is None or wanted in pairs[i]]


def _normal_force(m: Machine, geom: Value) -> Value:
    force, total = np.zeros(6), 0.0
    for i in _touching(m, geom):
        mujoco.mj_contactForce(m.model, m.data, i, force)
        total += float(force[0])
    return total


def _array(value: Value) -> list[float]:
    if isinstance(value, list | Vector):
        return [values.to_number(x) for x in values.items_of(value)]
    raise Trouble("an array is needed here")


def _dot(m: Machine, a: Value, b: Value) -> Value:
    left, right = _array(a), _array(b)
    if len(left) != len(right):
        raise Trouble("two arrays of one length are needed here")
    return float(sum(x * y for x, y in zip(left, right, strict=True)))


def _cross(m: Machine, a: Value, b: Value) -> Value:
    left, right = _array(a), _array(b)
    if not len(left) == len(right) == 3:
        raise Trouble("two arrays of three numbers are needed here")
    return [*map(float, np.cross(left, right))]


def _clamp(m: Machine, x: Value, low: Value, high: Value) -> Value:
    return smallest(largest(values.to_number(x), values.to_number(low)), values.to_number(high))


FUNCTIONS: dict[str, Callable[..., Value]] = {
    "energy": _energy,
    "bodyPos": lambda m, name: _named(m, "body", name).xpos.tolist(),
    "sitePos": lambda m, name: _named(m, "site", name).xpos.tolist(),
    "geomPos": lambda m, name: _named(m, "geom", name).xpos.tolist(),
    "bodyVel": _body_velocity,
    "qpos": lambda m, name: _one_or_all(_named(m, "joint", name).qpos),
    "qvel": lambda m, name: _one_or_all(_named(m, "joint", name).qvel),
    "sensor": lambda m, name: _one_or_all(_named(m, "sensor", name).data),
    "normalForce": _normal_force,
    "contacts": lambda m, geom: float(len(_touching(m, geom))),
    "com": lambda m: m.data.subtree_com[0].tolist(),
    "norm": lambda m, array: math.hypot(*_array(array)),
    "dot": _dot,
    "cross": _cross,
    "deg": lambda m, x: values.to_number(x) * 180 / math.pi,
    "rad": lambda m, x: values.to_number(x) * math.pi / 180,
    "clamp": _clamp,
}
NUMBERS = frozenset(("normalForce", "contacts", "norm", "dot", "deg", "rad", "clamp"))
"""The functions whose result is always a number."""

RECORD_PARTS = frozenset(("total", "kinetic", "potential"))
