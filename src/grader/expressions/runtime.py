"""What compiled code calls: the functions that authors name, and the parts of the language that Python lacks."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from grader.expressions import lib, mathematics, values
from grader.expressions.fields import CTX_FORBIDDEN, split_names
from grader.expressions.machine import Machine, count_arguments, make_lenient, raise_exhausted
from grader.expressions.mathematics import Numeric
from grader.expressions.methods import call_method
from grader.expressions.values import UNDEFINED, Record, RunError, Value, Vector
from grader.numerics.scene import FULL_STATE


@dataclass(frozen=True)
class Function:
    """A function that authors name. `call` gets the machine and the arguments, missing ones as undefined. `takes` names
    the first arguments, which must be written literally `model` or `data`. A function of numbers alone has `numeric`,
    which takes floats."""

    call: Callable[..., Value]
    takes: tuple[str, ...] = ()
    cost: int = 1
    numeric: Numeric | None = None


def _of_numbers(numeric: Numeric) -> Function:
    count = count_arguments(numeric)

    def call(_: Machine, *args: Value) -> Value:
        numbers = [values.to_number(arg) for arg in args[:count]]
        return numeric(*numbers, *[math.nan] * ((count or 0) - len(numbers)))

    return Function(call, numeric=numeric)


def _of_machine(function: Callable[..., Value], *takes: str, cost: int = 1) -> Function:
    return Function(make_lenient(function), takes, cost)


def _of_value(function: Callable[[Value], Value], default: Value = UNDEFINED) -> Function:
    return _of_machine(lambda m, value=default: function(value))


def _parse_float(value: Value) -> float:
    """Returns the longest prefix that is a number."""
    match = values.DECIMAL.match(values.to_string(value).lstrip(values.WHITESPACE))
    return float(match.group().replace("Infinity", "inf")) if match else math.nan


def _array_from(m: Machine, source: Value, f: Callable[..., Value] | None = None) -> Value:
    if not isinstance(source, list | Vector | str):
        raise RunError("Array.from needs an array")
    m.tick(1 + values.measure_weight(source))
    items = list(source if isinstance(source, str) else values.list_items(source))
    if f is not None and not callable(f):
        raise RunError("Array.from needs a function here, such as x => 2 * x")
    return items if f is None else [f(x, float(i)) for i, x in enumerate(items)]


def _join(m: Machine, *pieces: Value) -> Value:
    return values.check_length("".join(map(values.to_string, pieces)))


def _new_array(m: Machine, size: Value) -> Value:
    return [UNDEFINED] * _pay_for_size(m, size if isinstance(size, float) and size.is_integer() else -1)


def _new_typed_array(m: Machine, source: Value = 0.0) -> Value:
    if isinstance(source, list | Vector):
        return Vector(np.zeros(0)).like(values.check_length(values.list_items(source)))
    return Vector(np.zeros(_pay_for_size(m, values.to_index(source))))


def _pay_for_size(m: Machine, size: float) -> int:
    """Returns the size of a new array, which is paid for."""
    if not 0 <= size <= values.LENGTH_MAX:
        raise RunError(f"a new array has from 0 to {values.LENGTH_MAX} elements")
    m.tick(1 + int(size) // 16)
    return int(size)


PHYSICS = split_names("""
    mj_resetData mj_forward mj_step mj_step1 mj_step2 mj_inverse mj_kinematics mj_comPos mj_comVel
    mj_fwdPosition mj_fwdVelocity mj_fwdActuation mj_fwdAcceleration mj_fwdConstraint mj_energyPos mj_energyVel
    mj_subtreeVel mj_rnePostConstraint mj_camlight mj_collision mj_sensorPos mj_sensorVel mj_sensorAcc
""")
"""Functions of MuJoCo that take the model and the data and nothing else."""


def _wrap_physics(call: Callable[..., Value]) -> Callable[..., Value]:
    return lambda m: call(m.model, m.data) or UNDEFINED  # it gives nothing


def _set_const(m: Machine) -> Value:
    """Derives the model's constants again, and keeps the state, which MuJoCo's function sets to qpos0."""
    state = np.empty(mujoco.mj_stateSize(m.model, FULL_STATE))
    mujoco.mj_getState(m.model, m.data, state, FULL_STATE)
    mujoco.mj_setConst(m.model, m.data)
    mujoco.mj_setState(m.model, m.data, state, FULL_STATE)
    return UNDEFINED


def _reset_keyframe(m: Machine, number: Value = 0.0) -> Value:
    key = values.to_index(number)
    if not 0 <= key < m.model.nkey:
        raise RunError(f"the model has no keyframe {key}")
    mujoco.mj_resetDataKeyframe(m.model, m.data, key)
    return UNDEFINED


def _set_total_mass(m: Machine, value: Value) -> Value:
    mass = values.to_number(value)
    if not 0 < mass < 1e9:
        raise RunError("the total mass must be positive")
    mujoco.mj_setTotalmass(m.model, mass)
    return UNDEFINED


def _name_to_id(m: Machine, kind: Value, name: Value) -> Value:
    return float(mujoco.mj_name2id(m.model, values.to_int32(kind), values.from_units(values.to_string(name))))


def _id_to_name(m: Machine, kind: Value, number: Value) -> Value:
    return values.to_units(mujoco.mj_id2name(m.model, values.to_int32(kind), values.to_int32(number)) or "")


def _do_nothing(m: Machine) -> Value:
    """Does nothing: the page plays and pauses what was recorded."""
    return UNDEFINED


STATE = ("model", "data")
FUNCTIONS: dict[str, Function] = {
    **{f"Math.{name}": _of_numbers(function) for name, function in mathematics.FUNCTIONS.items()},
    **{f"lib.{name}": _of_numbers(function) for name, function in lib.NUMERIC.items()},
    **{f"lib.{name}": _of_machine(function) for name, function in lib.FUNCTIONS.items()},
    **{f"mj.{name}": _of_machine(_wrap_physics(getattr(mujoco, name)), *STATE, cost=10) for name in PHYSICS},
    "mj.mj_setConst": _of_machine(_set_const, *STATE, cost=10),
    "mj.mj_resetDataKeyframe": _of_machine(_reset_keyframe, *STATE, cost=10),
    "mj.mj_setTotalmass": _of_machine(_set_total_mass, "model", cost=10),
    "mj.mj_getTotalmass": _of_machine(lambda m: float(mujoco.mj_getTotalmass(m.model)), "model"),
    "mj.mj_name2id": _of_machine(_name_to_id, "model"),
    "mj.mj_id2name": _of_machine(_id_to_name, "model"),
    **dict.fromkeys(("sim.play", "sim.pause"), _of_machine(_do_nothing)),
    "sim.forward": _of_machine(_wrap_physics(mujoco.mj_forward), cost=10),
    "Number": _of_value(values.to_number, default=0.0),
    "String": _of_value(values.to_string, default=""),
    "Boolean": _of_value(values.to_boolean),
    "isNaN": _of_value(lambda v: math.isnan(values.to_number(v))),
    "isFinite": _of_value(lambda v: math.isfinite(values.to_number(v))),
    "Number.isNaN": _of_value(values.is_nan),
    "Number.isFinite": _of_value(lambda v: isinstance(v, float) and math.isfinite(v)),
    "Number.isInteger": _of_value(lambda v: isinstance(v, float) and v.is_integer()),
    **dict.fromkeys(("parseFloat", "Number.parseFloat"), _of_value(_parse_float)),
    "Array.isArray": _of_value(lambda v: isinstance(v, list)),
    "Array.from": _of_machine(_array_from),
    "Array.of": _of_machine(lambda m, *args: list(args)),
    "`": _of_machine(_join, cost=0),
    "new Array": _of_machine(_new_array, cost=0),
    "new Float64Array": _of_machine(_new_typed_array, cost=0),
}
"""By the name that authors write, or the sign of a template literal; to add one, add a line."""


def number(m: Machine, value: Value) -> float:
    """`Number(value)`, paid for by the length of the value."""
    m.tick(values.measure_weight(value))
    return values.to_number(value)


def slow(m: Machine, operator: Any, left: Value, right: Value) -> Value:
    """Applies an operator to values that are not both numbers."""
    m.tick(values.measure_weight(left) + values.measure_weight(right))
    result: Value = operator(left, right)
    return result


def spread(m: Machine, value: Value) -> list[Value]:
    """Returns the elements of `...value`."""
    m.tick(1 + values.measure_weight(value))
    if isinstance(value, list | Vector):
        return values.list_items(value)
    raise RunError("only an array can be spread out")


def through(value: Value) -> Iterable[Value]:
    """What `for (const x of value)` goes through; elements that are added meanwhile are seen."""
    if isinstance(value, list | Vector):
        return value
    raise RunError("for ... of goes through an array")


def unpack(value: Value, count: int) -> list[Value]:
    """Returns the first elements of an array, undefined past its end."""
    if not isinstance(value, list | Vector):
        raise RunError("only an array can be taken apart")
    return [values.read_index(value, float(i)) for i in range(count)]


def put(container: Any, key: Any, value: Value) -> Value:
    """Assign an item, as an expression."""
    container[key] = value
    return value


def host(m: Machine, function: Function, args: list[Value]) -> Value:
    """Call a function of the host."""
    m.tick(function.cost + sum(map(values.measure_weight, args)))
    return function.call(m, *args)


def member(value: Value, name: str) -> Value:
    """`value.name` for the few names that values have: `length`, and the parts of a record."""
    if value is None or value is UNDEFINED:
        raise RunError(f"{values.to_string(value)} has no {name}")
    if name == "length":
        return float(len(value)) if isinstance(value, str | list | Vector) else UNDEFINED
    return value.get(name, UNDEFINED) if isinstance(value, Record) else UNDEFINED


CTX_NAMES_MAX, CTX_NAME_MAX = 1000, 64
"""How many names `ctx[...]` may hold, and how long each may be [characters]."""


def ctx_name(key: Value) -> str:
    """Returns the name that `ctx[key]` means. Raises RunError for one that means something else in JavaScript."""
    name = values.to_string(key)
    if len(name) > CTX_NAME_MAX or name.startswith("__") or name in CTX_FORBIDDEN:
        raise RunError(f"ctx has no place named {name[:CTX_NAME_MAX]!r}")
    return name


def read_named(ctx: dict[str, Value], key: Value) -> Value:
    """`ctx[key]`."""
    return ctx.get(ctx_name(key), UNDEFINED)


def write_named(ctx: dict[str, Value], key: Value, value: Value) -> Value:
    """`ctx[key] = value`."""
    name = ctx_name(key)
    if name not in ctx and len(ctx) >= CTX_NAMES_MAX:
        raise RunError(f"ctx holds more than {CTX_NAMES_MAX} names")
    ctx[name] = value
    return value


def record(names: list[str], parts: list[Value]) -> Record:
    """`{name: part}`."""
    return Record(zip(names, parts, strict=True))


OPERATORS = {operator: f"operator{i}" for i, operator in enumerate(values.BINARY)}
"""The name, in compiled code, of the function of each binary operator."""

NAMES: dict[str, object] = {
    **{
        function.__name__: function
        for function in (
            *(number, slow, spread, through, unpack, put, host, member),
            *(values.read_index, values.write_index, values.type_name, read_named, write_named, record),
            raise_exhausted,
        )
    },
    **{name: values.BINARY[operator] for operator, name in OPERATORS.items()},
    "array": values.check_length,
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
