"""What compiled code calls: the functions that authors name, and the parts of the language that Python lacks."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from grader.expressions import lib, mathematics, values
from grader.expressions.fields import names
from grader.expressions.machine import Machine, exhausted, lenient
from grader.expressions.methods import call_method
from grader.expressions.values import UNDEFINED, Record, Trouble, Value, Vector

Gives = type[float] | type[bool] | None


@dataclass(frozen=True)
class Function:
    """A callable of the host, called with the machine and the arguments.

    `takes` names its first arguments that must be written literally `model` or `data`; `gives` is the type of its
    result where that is always the same. A function of numbers alone has `numeric`, which takes `arity` floats (None:
    any number of them).
    """

    call: Callable[..., Value]
    takes: tuple[str, ...] = ()
    cost: int = 1
    gives: Gives = None
    numeric: Callable[..., float] | None = None
    arity: int | None = None


def _mathematics(arity: int | None, numeric: Callable[..., float]) -> Function:
    def call(_: Machine, *args: Value) -> Value:
        numbers = [values.to_number(arg) for arg in args[:arity]]
        return numeric(*numbers, *[math.nan] * ((arity or 0) - len(numbers)))

    return Function(call, gives=float, numeric=numeric, arity=arity)


def _of_value(function: Callable[[Value], Value], gives: Gives = None, default: Value = UNDEFINED) -> Function:
    return Function(lenient(lambda m, value=default: function(value)), gives=gives)


def _parse_float(value: Value) -> float:
    """The longest prefix that is a number."""
    found = values.DECIMAL.match(values.to_string(value).lstrip(values.WHITESPACE))
    return float(found.group().replace("Infinity", "inf")) if found else math.nan


def _array_from(m: Machine, source: Value) -> Value:
    if not isinstance(source, list | Vector | str):
        raise Trouble("Array.from needs an array")
    m.tick(1 + values.weight(source))
    return list(source if isinstance(source, str) else values.items_of(source))


def typed_array(m: Machine, args: list[Value]) -> Value:
    """`new Float64Array(size)` or `new Float64Array(array)`."""
    source = args[0] if args else 0.0
    if isinstance(source, list | Vector):
        return Vector(np.zeros(0)).like(values.bounded(values.items_of(source)))
    size = values.to_index(source)
    if not 0 <= size <= 10_000:
        raise Trouble("a typed array has from 0 to 10000 elements")
    m.tick(1 + size // 16)
    return Vector(np.zeros(size))


PHYSICS = names("""
    mj_resetData mj_forward mj_step mj_step1 mj_step2 mj_inverse mj_setConst mj_kinematics mj_comPos mj_comVel
    mj_fwdPosition mj_fwdVelocity mj_fwdActuation mj_fwdAcceleration mj_fwdConstraint mj_energyPos mj_energyVel
    mj_subtreeVel mj_rnePostConstraint mj_camlight mj_collision mj_sensorPos mj_sensorVel mj_sensorAcc
""")
"""Functions of MuJoCo that take the model and the data and nothing else."""


def _physics(call: Callable[..., Value]) -> Callable[..., Value]:
    return lambda m: call(m.model, m.data) or UNDEFINED  # it gives nothing


def _reset_keyframe(m: Machine, number: Value = 0.0) -> Value:
    key = values.to_index(number)
    if not 0 <= key < m.model.nkey:
        raise Trouble(f"the model has no keyframe {key}")
    mujoco.mj_resetDataKeyframe(m.model, m.data, key)
    return UNDEFINED


def _set_total_mass(m: Machine, value: Value) -> Value:
    mass = values.to_number(value)
    if not 0 < mass < 1e9:
        raise Trouble("the total mass must be positive")
    mujoco.mj_setTotalmass(m.model, mass)
    return UNDEFINED


def _name_to_id(m: Machine, kind: Value, name: Value) -> Value:
    return float(mujoco.mj_name2id(m.model, values.to_int32(kind), values.from_units(values.to_string(name))))


def _id_to_name(m: Machine, kind: Value, number: Value) -> Value:
    return values.in_units(mujoco.mj_id2name(m.model, values.to_int32(kind), values.to_int32(number)) or "")


MODEL, STATE = ("model",), ("model", "data")
FUNCTIONS: dict[str, Function] = {
    **{f"Math.{name}": _mathematics(*function) for name, function in mathematics.FUNCTIONS.items()},
    "Number": _of_value(values.to_number, float, default=0.0),
    "String": _of_value(values.to_string, default=""),
    "Boolean": _of_value(values.to_boolean, bool),
    "isNaN": _of_value(lambda v: math.isnan(values.to_number(v)), bool),
    "isFinite": _of_value(lambda v: math.isfinite(values.to_number(v)), bool),
    "parseFloat": _of_value(_parse_float, float),
    "Number.isNaN": _of_value(values.is_nan, bool),
    "Number.isFinite": _of_value(lambda v: isinstance(v, float) and math.isfinite(v), bool),
    "Number.isInteger": _of_value(lambda v: isinstance(v, float) and v.is_integer(), bool),
    "Number.parseFloat": _of_value(_parse_float, float),
    "Array.isArray": _of_value(lambda v: isinstance(v, list), bool),
    "Array.from": Function(lenient(_array_from)),
    "Array.of": Function(lambda m, *args: list(args)),
    **{f"mj.{name}": Function(lenient(_physics(getattr(mujoco, name))), STATE, cost=10) for name in PHYSICS},
    "mj.mj_resetDataKeyframe": Function(lenient(_reset_keyframe), STATE, cost=10),
    "mj.mj_setTotalmass": Function(lenient(_set_total_mass), MODEL, cost=10),
    "mj.mj_getTotalmass": Function(lenient(lambda m: float(mujoco.mj_getTotalmass(m.model))), MODEL),
    "mj.mj_name2id": Function(lenient(_name_to_id), MODEL),
    "mj.mj_id2name": Function(lenient(_id_to_name), MODEL),
    **{
        f"lib.{name}": Function(lenient(function), gives=float if name in lib.NUMBERS else None)
        for name, function in lib.FUNCTIONS.items()
    },
}


def number(m: Machine, value: Value) -> float:
    """`Number(value)`, paid for by the length of the value."""
    m.tick(values.weight(value))
    return values.to_number(value)


def slow(m: Machine, operator: Any, left: Value, right: Value) -> Value:
    """An operator on values that are not both numbers."""
    m.tick(values.weight(left) + values.weight(right))
    result: Value = operator(left, right)
    return result


def template(m: Machine, pieces: list[Value]) -> Value:
    """The text of a template literal."""
    m.tick(sum(map(values.weight, pieces)))
    return values.bounded("".join(map(values.to_string, pieces)))


def spread(m: Machine, value: Value) -> list[Value]:
    """The elements of `...value`."""
    m.tick(1 + values.weight(value))
    if isinstance(value, list | Vector):
        return values.items_of(value)
    raise Trouble("only an array can be spread out")


def through(value: Value) -> Iterable[Value]:
    """What `for (const x of value)` goes through; elements that are added meanwhile are seen."""
    if isinstance(value, Vector):
        return map(float, value.view)
    if isinstance(value, list):
        return value
    raise Trouble("for ... of goes through an array")


def unpack(value: Value, count: int) -> list[Value]:
    """The first elements of an array, undefined past its end."""
    if not isinstance(value, list | Vector):
        raise Trouble("only an array can be taken apart")
    return [values.read_index(value, float(i)) for i in range(count)]


def put(container: Any, key: Any, value: Value) -> Value:
    """Assign an item, as an expression."""
    container[key] = value
    return value


def host(m: Machine, function: Function, args: list[Value]) -> Value:
    """Call a function of the host."""
    m.tick(function.cost + sum(map(values.weight, args)))
    return function.call(m, *args)


def map_from(m: Machine, function: Function, args: list[Value], callback: Any) -> Value:
    """`Array.from(array, callback)`."""
    copied = function.call(m, *args)
    assert isinstance(copied, list)
    return [callback(x, float(i)) for i, x in enumerate(copied)]


def empty_array(m: Machine, size: Value) -> Value:
    """`new Array(size)`."""
    if not isinstance(size, float) or not size.is_integer() or not 0 <= size <= 10_000:
        raise Trouble("an array here has from 0 to 10000 elements")
    m.tick(1 + int(size) // 16)
    return [UNDEFINED] * int(size)


def member(value: Value, name: str) -> Value:
    """`value.name` for the few names that values have: `length`, and the parts of a record."""
    if value is None or value is UNDEFINED:
        raise Trouble(f"{values.to_string(value)} has no {name}")
    if name == "length":
        return float(len(value)) if isinstance(value, str | list | Vector) else UNDEFINED
    return value.get(name, UNDEFINED) if isinstance(value, Record) else UNDEFINED


OPERATORS = {operator: f"operator{i}" for i, operator in enumerate(values.BINARY)}
"""The name, in compiled code, of the function of each binary operator."""

NAMES: dict[str, object] = {
    **{
        function.__name__: function
        for function in (
            *(number, slow, template, spread, through, unpack, put, host, map_from, typed_array, empty_array, member),
            *(values.read_index, values.write_index, exhausted, values.type_name),
        )
    },
    **{name: values.BINARY[operator] for operator, name in OPERATORS.items()},
    "array": values.bounded,
    "method": call_method,
    "truth": values.to_boolean,
    "complement": lambda value: float(~values.to_int32(value)),
    "tick": Machine.tick,
    "kind_of": type,
    "float_type": float,
    "undefined": UNDEFINED,
    "nan": math.nan,
}
"""Everything that compiled code can name besides its own variables and what is bound to it; it has no builtins."""
