"""Dotted names that begin at a root such as `model`, `data`, `mj`, `lib` or `ctx`, and what each one means."""

from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any

import mujoco
from tree_sitter import Node

from grader.expressions import fields, mathematics
from grader.expressions.compiling.scope import ROOTS
from grader.expressions.compiling.syntax import SyntaxRefused, get_field, read_text
from grader.expressions.machine import Machine
from grader.expressions.runtime import FUNCTIONS
from grader.expressions.values import UNDEFINED, RunError, Value, Vector, measure_weight, to_number, write_index

ENUMS = {
    name: getattr(mujoco, name).__members__
    for name in fields.split_names("""
        mjtObj mjtJoint mjtGeom mjtIntegrator mjtSolver mjtCone mjtJacobian mjtDisableBit mjtEnableBit mjtTrn mjtEq
        mjtSensor mjtWarning
    """)
}


def find_path(node: Node) -> str | None:
    """Returns a name such as `model.opt.timestep` that begins at a root; None for anything else."""
    names: list[str] = []
    while node.type == "member_expression" and node.child_by_field_name("optional_chain") is None:
        names.append(read_text(get_field(node, "property")))
        node = get_field(node, "object")
    if node.type != "identifier" or read_text(node) not in ROOTS:
        return None
    return ".".join((read_text(node), *reversed(names)))


WRITABLE: dict[str | None, bool] = {
    **{f"model.{name}": True for name in fields.MODEL_PARAMETERS},
    **{f"model.{name}": False for name in fields.MODEL_FIXED},
    **{f"model.opt.{name}": True for name in fields.OPTION_VECTORS},
    **{f"data.{name}": True for name in fields.DATA_STATE},
    **{f"data.{name}": False for name in fields.DATA_RESULTS},
}
"""The arrays that programs reach, by path, and whether they may be changed."""

NUMBERS: dict[str, str] = {
    **{f"model.{name}": "count" for name in fields.MODEL_SIZES},
    **{f"data.{name}": "scalar" for name in ("time", *fields.DATA_COUNTS)},
    **{f"model.opt.{name}": "scalar" for name in fields.OPTION_SCALARS},
}
"""The numbers of the model, its options and the data, with their kind in BINDERS: what a run may change is a scalar."""

CONSTANTS: dict[str, float] = {
    **mathematics.CONSTANTS,
    **{f"mj.{enum}.{name}.value": float(int(value)) for enum, of in ENUMS.items() for name, value in of.items()},
}
"""The numbers that a path always means."""


READABLE = sorted(filter(None, (*WRITABLE, *NUMBERS, *CONSTANTS)))
"""Every path that a program may read."""


def ctx_name(node: Node, path: str) -> str:
    """Returns the name of a ctx value, if the path is one. Raises SyntaxRefused for JavaScript's own."""
    owner, _, name = path.rpartition(".")
    if owner != "ctx":
        return ""
    if name.startswith("__") or name in fields.CTX_FORBIDDEN:
        raise SyntaxRefused(node, f"{path} is not available")
    return name


_EMPTY = mujoco.MjModel.from_xml_string("<mujoco/>")
_BLANK = Machine(_EMPTY, mujoco.MjData(_EMPTY))


def holds_floats(path: str) -> bool:
    """Whether the elements of the array at an allowed path are floats."""
    return not bind_vector(_BLANK, path).whole


def _bind_scalar(m: Machine, path: str) -> Callable[[], float]:
    owner, _, name = path.rpartition(".")
    source = attrgetter(owner)(m)
    return lambda: float(getattr(source, name))


def _bind_scalar_writer(m: Machine, path: str) -> Callable[[Value], Value]:
    """Writes the time, or an option within the range that MuJoCo survives; whole numbers where the option is one."""
    owner, _, name = path.rpartition(".")
    target, limits = attrgetter(owner)(m), fields.OPTION_SCALARS.get(name)
    convert = type(getattr(target, name))

    def write(value: Value) -> Value:
        number = to_number(value)
        if limits is not None and not limits[0] <= number <= limits[1]:
            raise RunError(f"{path} must be from {limits[0]:g} to {limits[1]:g}")
        setattr(target, name, convert(number))
        return value

    return write


def bind_vector(m: Machine, path: str) -> Vector:
    """Returns the field at an allowed path, such as `data.qpos`. MuJoCo keeps it in place while the data lives."""
    vector = m.vectors.get(path)
    if vector is None:
        array: Any = attrgetter(path)(m)
        vector = m.vectors[path] = Vector(array, path, WRITABLE[path])
    return vector


def _bind_positions(m: Machine, path: str) -> dict[float, int]:
    """Returns the index in Python of each index in JavaScript."""
    return {float(i): i for i in range(len(bind_vector(m, path)))}


def _bind_writer(m: Machine, path: str) -> Callable[[Value, Value], Value]:
    """Writes an element of a field; a value that is no float, or out of range, takes the general way."""
    vector, positions = bind_vector(m, path), _bind_positions(m, path) if holds_floats(path) else {}
    view = vector.view

    def write(index: Value, value: Value) -> Value:
        if type(index) is type(value) is float and index in positions:
            view[positions[index]] = value
            return value
        m.tick(measure_weight(value))
        return write_index(vector, index, value)

    return write


BINDERS: dict[str, Callable[[Machine, str], object]] = {
    "vector": bind_vector,
    "view": lambda m, path: bind_vector(m, path).view,
    "size": lambda m, path: float(len(bind_vector(m, path))),
    "positions": _bind_positions,
    "write": _bind_writer,
    "count": lambda m, path: _bind_scalar(m, path)(),
    "scalar": _bind_scalar,
    "write scalar": _bind_scalar_writer,
    "function": lambda m, path: FUNCTIONS[path],
    "numeric": lambda m, path: FUNCTIONS[path].numeric,
    "callback": lambda m, path: partial(FUNCTIONS[path].call, m),
    "ctx": lambda m, key: m.ctx.setdefault(key, UNDEFINED),
}
"""What a compiled program asks of a machine before it runs, by kind; each makes the value for one path."""
