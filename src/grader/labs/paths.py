"""Dotted names that begin at `model`, `data`, `mj`, `lib`, `Math` or `ctx`: what each one reads or writes."""

from collections.abc import Callable
from operator import attrgetter

import mujoco
from tree_sitter import Node

from grader.labs import fields, mathematics
from grader.labs.machine import Machine
from grader.labs.scope import Code, Scope
from grader.labs.syntax import field, text_of
from grader.labs.values import UNDEFINED, Trouble, Value, to_number

Path = tuple[str, ...]
Store = Callable[[Machine, Value], None]

ROOTS = frozenset(["model", "data", "mj", "lib", "Math", "ctx", "Number"])
NUMBER_CONSTANTS = {
    "EPSILON": 2.0**-52,
    "MAX_SAFE_INTEGER": 2.0**53 - 1,
    "MIN_SAFE_INTEGER": 1 - 2.0**53,
    "MAX_VALUE": 1.7976931348623157e308,
    "MIN_VALUE": 5e-324,
    "POSITIVE_INFINITY": float("inf"),
    "NEGATIVE_INFINITY": float("-inf"),
    "NaN": float("nan"),
}
ENUMS = {
    name: getattr(mujoco, name).__members__
    for name in [
        "mjtObj",
        "mjtJoint",
        "mjtGeom",
        "mjtIntegrator",
        "mjtSolver",
        "mjtCone",
        "mjtJacobian",
        "mjtDisableBit",
        "mjtEnableBit",
        "mjtTrn",
        "mjtEq",
        "mjtSensor",
        "mjtWarning",
    ]
}
CTX_FORBIDDEN = frozenset(
    [
        "constructor",
        "prototype",
        "toString",
        "valueOf",
        "hasOwnProperty",
        "isPrototypeOf",
        "propertyIsEnumerable",
        "toLocaleString",
        "caller",
        "callee",
        "arguments",
    ]
)


def path_of(node: Node) -> Path | None:
    """("model", "opt", "timestep") for `model.opt.timestep`; None for anything that is no such name."""
    names: list[str] = []
    while node.type == "member_expression" and node.child_by_field_name("optional_chain") is None:
        names.append(text_of(field(node, "property")))
        node = field(node, "object")
    if node.type != "identifier" or text_of(node) not in ROOTS:
        return None
    return (text_of(node), *reversed(names))


def vector_is_writable(path: Path) -> bool | None:
    """Whether the array at the path may be changed; None where the path names no allowed array."""
    match path:
        case ("model", name):
            return True if name in fields.MODEL_PARAMETERS else False if name in fields.MODEL_FIXED else None
        case ("model", "opt", name):
            return True if name in fields.OPTION_VECTORS else None
        case ("data", name):
            return True if name in fields.DATA_STATE else False if name in fields.DATA_RESULTS else None
    return None


def load(scope: Scope, node: Node, path: Path) -> Code:
    """Code that reads a path. Raises Refused where it names nothing that may be read."""
    constant = _constant(path)
    if constant is not None:
        number = constant
        return lambda m: number
    writable = vector_is_writable(path)
    if writable is not None:
        allowed: bool = writable
        return lambda m: m.vectors.get(path) or m.vector(path, allowed)
    if path[0] == "ctx" and len(path) == 2:
        name = _ctx_name(scope, node, path[1])
        return lambda m: m.ctx.get(name, UNDEFINED)
    if _is_scalar(path):
        read = attrgetter(".".join(path))
        return lambda m: float(read(m))
    raise scope.refuse(node, f"{'.'.join(path)} cannot be read here")


def store(scope: Scope, node: Node, path: Path) -> Store:
    """Code that writes a number or a ctx value to a path. Raises Refused where that is not allowed."""
    if path[0] == "ctx" and len(path) == 2:
        name = _ctx_name(scope, node, path[1])

        def to_ctx(m: Machine, value: Value) -> None:
            m.ctx[name] = value

        return to_ctx
    match path:
        case ("model", "opt", name) if name in fields.OPTION_SCALARS:
            return _option(name)
        case ("data", "time"):
            return _time
    if vector_is_writable(path) is not None:
        raise scope.refuse(node, f"{'.'.join(path)} is an array: assign its elements, or use .set() or .fill()")
    raise scope.refuse(node, f"{'.'.join(path)} cannot be assigned")


def _constant(path: Path) -> float | None:
    match path:
        case ("Math", name):
            return mathematics.CONSTANTS.get(name)
        case ("Number", name):
            return NUMBER_CONSTANTS.get(name)
        case ("mj", enum, member, "value") if enum in ENUMS and member in ENUMS[enum]:
            return float(int(ENUMS[enum][member]))
    return None


def _is_scalar(path: Path) -> bool:
    match path:
        case ("model", name):
            return name in fields.MODEL_SIZES
        case ("model", "opt", name):
            return name in fields.OPTION_SCALARS
        case ("data", name):
            return name == "time" or name in fields.DATA_COUNTS
    return False


def _ctx_name(scope: Scope, node: Node, name: str) -> str:
    if name.startswith("__") or name in CTX_FORBIDDEN:
        raise scope.refuse(node, f"ctx.{name} is not available")
    return name


def _option(name: str) -> Store:
    """Writes within the range that MuJoCo can live with; whole numbers where the option is one."""
    low, high = fields.OPTION_SCALARS[name]
    whole = name in fields.OPTION_INTEGERS

    def write(m: Machine, value: Value) -> None:
        number = to_number(value)
        if not low <= number <= high:
            raise Trouble(f"model.opt.{name} must be from {low:g} to {high:g}")
        setattr(m.model.opt, name, int(number) if whole else number)

    return write


def _time(m: Machine, value: Value) -> None:
    m.data.time = to_number(value)
