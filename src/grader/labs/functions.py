"""The functions that a program may call by name: Math, Number, Array, mj and lib."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from grader.labs import library, mathematics
from grader.labs.machine import Machine
from grader.labs.values import (
    DECIMAL,
    UNDEFINED,
    WHITESPACE,
    Trouble,
    Value,
    Vector,
    bounded_list,
    from_units,
    in_units,
    to_boolean,
    to_index,
    to_number,
    to_string,
    weight,
)

Path = tuple[str, ...]


@dataclass(frozen=True)
class Function:
    """A callable of the host. `takes` names its first arguments that must be written literally `model` or `data`."""

    call: Callable[..., Value]
    takes: tuple[str, ...] = ()
    cost: int = 1


def _pure(function: Callable[..., Value]) -> Function:
    return Function(lambda m, *args: function(*args))


def _first(function: Callable[[Value], Value], default: Value = UNDEFINED) -> Function:
    return Function(lambda m, *args: function(args[0] if args else default))


def _is_integer(value: Value) -> bool:
    return isinstance(value, float) and value.is_integer()


def _parse_float(value: Value) -> float:
    """The longest prefix that is a number."""
    found = DECIMAL.match(to_string(value).lstrip(WHITESPACE))
    return float(found.group().replace("Infinity", "inf")) if found else math.nan


def _array_from(m: Machine, *args: Value) -> Value:
    source = args[0] if args else UNDEFINED
    if not isinstance(source, list | Vector | str):
        raise Trouble("Array.from needs an array")
    m.tick(1 + weight(source))
    return list(source.values() if isinstance(source, Vector) else source)


def _typed_array(m: Machine, *args: Value) -> Value:
    source = args[0] if args else 0.0
    if isinstance(source, list | Vector):
        return Vector(np.zeros(0)).like(bounded_list(source.values() if isinstance(source, Vector) else source))
    size = to_index(source)
    if not 0 <= size <= 10_000:
        raise Trouble("a typed array has from 0 to 10000 elements")
    return Vector(np.zeros(size))


GLOBAL: dict[Path, Function] = {
    **{("Math", name): _pure(function) for name, function in mathematics.FUNCTIONS.items()},
    ("Number",): _first(to_number, 0.0),
    ("String",): _first(to_string, ""),
    ("Boolean",): _first(to_boolean),
    ("isNaN",): _first(lambda v: math.isnan(to_number(v))),
    ("isFinite",): _first(lambda v: math.isfinite(to_number(v))),
    ("parseFloat",): _first(_parse_float),
    ("Number", "isNaN"): _first(lambda v: isinstance(v, float) and math.isnan(v)),
    ("Number", "isFinite"): _first(lambda v: isinstance(v, float) and math.isfinite(v)),
    ("Number", "isInteger"): _first(_is_integer),
    ("Number", "parseFloat"): _first(_parse_float),
    ("Array", "isArray"): _first(lambda v: isinstance(v, list)),
    ("Array", "from"): Function(_array_from),
    ("Array", "of"): Function(lambda m, *args: list(args)),
}
TYPED_ARRAYS: dict[str, Function] = {"Float64Array": Function(_typed_array)}


def _physics(name: str, cost: int = 10) -> Function:
    """A function of MuJoCo that takes the model and the data and nothing else."""
    call = getattr(mujoco, name)

    def called(m: Machine, *_: Value) -> Value:
        call(m.model, m.data)
        return UNDEFINED

    return Function(called, ("model", "data"), cost)


def _reset_keyframe(m: Machine, *args: Value) -> Value:
    key = to_index(args[0]) if args else 0
    if not 0 <= key < m.model.nkey:
        raise Trouble(f"the model has no keyframe {key}")
    mujoco.mj_resetDataKeyframe(m.model, m.data, key)
    return UNDEFINED


def _set_total_mass(m: Machine, *args: Value) -> Value:
    mass = to_number(args[0]) if args else math.nan
    if not 0 < mass < 1e9:
        raise Trouble("the total mass must be positive")
    mujoco.mj_setTotalmass(m.model, mass)
    return UNDEFINED


def _name_to_id(m: Machine, *args: Value) -> Value:
    kind, name = (*args, UNDEFINED, UNDEFINED)[:2]
    return float(mujoco.mj_name2id(m.model, to_index(kind), from_units(to_string(name))))


def _id_to_name(m: Machine, *args: Value) -> Value:
    kind, number = (*args, UNDEFINED, UNDEFINED)[:2]
    name = mujoco.mj_id2name(m.model, to_index(kind), to_index(number))
    return "" if name is None else in_units(name)


MUJOCO: dict[Path, Function] = {
    **{
        ("mj", name): _physics(name)
        for name in [
            "mj_resetData",
            "mj_forward",
            "mj_step",
            "mj_step1",
            "mj_step2",
            "mj_inverse",
            "mj_setConst",
            "mj_kinematics",
            "mj_comPos",
            "mj_comVel",
            "mj_fwdPosition",
            "mj_fwdVelocity",
            "mj_fwdActuation",
            "mj_fwdAcceleration",
            "mj_fwdConstraint",
            "mj_energyPos",
            "mj_energyVel",
            "mj_subtreeVel",
            "mj_rnePostConstraint",
            "mj_camlight",
            "mj_collision",
            "mj_sensorPos",
            "mj_sensorVel",
            "mj_sensorAcc",
        ]
    },
    ("mj", "mj_resetDataKeyframe"): Function(_reset_keyframe, ("model", "data"), 10),
    ("mj", "mj_setTotalmass"): Function(_set_total_mass, ("model",), 10),
    ("mj", "mj_getTotalmass"): Function(lambda m, *_: float(mujoco.mj_getTotalmass(m.model)), ("model",)),
    ("mj", "mj_name2id"): Function(_name_to_id, ("model",)),
    ("mj", "mj_id2name"): Function(_id_to_name, ("model",)),
}

FUNCTIONS: dict[Path, Function] = {
    **GLOBAL,
    **MUJOCO,
    **{("lib", name): Function(function) for name, function in library.FUNCTIONS.items()},
}
