"""What an expression measures, read from its text: metres, radians, joules. It is known where every part is known: a
number that is written in the text may be a length or a mass as well, unless it is a usual factor such as 2 or 1000."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from math import isclose, log10, pi

import mujoco
import numpy as np
from tree_sitter import Node

from grader.errors import GraderError
from grader.expressions.compiling import syntax
from grader.questions.kinds.number.units import Rotation, convert, find_base_unit, known_unit

BASES = {"meter": (1, 0, 0, 1.0), "kilogram": (0, 1, 0, 1.0), "gram": (0, 1, 0, 1e-3), "second": (0, 0, 1, 1.0),
         "radian": (0, 0, 0, 1.0)}  # fmt: skip
"""Powers of metre, kilogram and second of the base units, and their size in these."""

FACTORS = frozenset((0.5, 1.0, 2.0, 3.0, 4.0))
"""Numbers that are taken for factors of a formula, which convert no unit."""

CONVERSIONS = frozenset((60.0, 180.0, 360.0))
"""Numbers that are taken for factors between units; powers of ten are, too."""


@dataclass(frozen=True)
class Dimension:
    """Powers of metre, kilogram and second, and the size of the unit in them; None where a factor leaves it open. An
    angle has no dimension; `name` is the unit as the author would write it. `is_number` says that it is a number that
    is written in the text, and `may_count` that a factor π or 1 over a time may have made it count turns."""

    powers: tuple[float, float, float]
    size: float | None = 1.0
    name: str = ""
    is_number: bool = False
    may_count: bool = False


FACTOR = Dimension((0, 0, 0), 1.0, is_number=True)
CONVERSION, PI = replace(FACTOR, size=None), replace(FACTOR, may_count=True)
RAD, DEG = Dimension((0, 0, 0), 1.0, "rad"), Dimension((0, 0, 0), pi / 180, "deg")
M, KG, S = Dimension((1, 0, 0), 1.0, "m"), Dimension((0, 1, 0), 1.0, "kg"), Dimension((0, 0, 1), 1.0, "s")
SPEED, TURNING = Dimension((1, 0, -1), 1.0, "m/s"), Dimension((0, 0, -1), 1.0, "rad/s")
ACCELERATION, SPIN = Dimension((1, 0, -2), 1.0, "m/s²"), Dimension((0, 0, -2), 1.0, "rad/s²")
N, J = Dimension((1, 1, -2), 1.0, "N"), Dimension((2, 1, -2), 1.0, "J")
N_M = replace(J, name="N m")

FIELDS = {
    "data.time": S, "model.opt.timestep": S, "model.opt.gravity": ACCELERATION, "model.body_mass": KG,
    "model.body_subtreemass": KG, "model.body_inertia": Dimension((2, 1, 0), 1.0, "kg m²"), "data.energy": J,
    **dict.fromkeys(("data.xpos", "data.xipos", "data.geom_xpos", "data.site_xpos", "data.subtree_com"), M),
    **dict.fromkeys(("model.body_pos", "model.body_ipos", "model.geom_size", "model.geom_pos", "model.site_pos"), M),
    "lib.energy().total": J, "lib.energy().kinetic": J, "lib.energy().potential": J,
}  # fmt: skip
"""What fields hold in every model."""

CALLS = {"lib.bodyPos": M, "lib.sitePos": M, "lib.geomPos": M, "lib.com": M, "lib.bodyVel": SPEED, "lib.normalForce": N,
         "lib.deg": DEG, "lib.rad": RAD, "Math.asin": RAD, "Math.acos": RAD, "Math.atan": RAD,
         "Math.atan2": RAD}  # fmt: skip
"""What functions give, whatever they take."""

SAME = ("Math.abs", "Math.max", "Math.min", "Math.hypot", "Math.round", "Math.floor", "Math.ceil", "lib.norm")
"""Functions that give what they take."""

JOINTS = {
    "data.qpos": (M, RAD), "model.qpos0": (M, RAD), "lib.qpos": (M, RAD),
    "data.qvel": (SPEED, TURNING), "lib.qvel": (SPEED, TURNING),
    "data.qacc": (ACCELERATION, SPIN), "data.qacc_smooth": (ACCELERATION, SPIN),
    **{f"data.qfrc_{which}": (N, N_M) for which in ("actuator", "applied", "bias", "constraint", "passive", "smooth")},
    "model.jnt_stiffness": (Dimension((0, 1, -2), 1.0, "N/m"), Dimension((2, 1, -2), 1.0, "N m/rad")),
    "model.dof_damping": (Dimension((0, 1, -1), 1.0, "N s/m"), Dimension((2, 1, -1), 1.0, "N m s/rad")),
}  # fmt: skip
"""What fields of joints hold: of a slide, and of a hinge."""

SENSORS = {
    "accelerometer": ACCELERATION, "velocimeter": SPEED, "gyro": TURNING, "force": N, "torque": N_M, "touch": N,
    "rangefinder": M, "geomdist": M, "ballangvel": TURNING, "framepos": M, "framelinvel": SPEED, "frameangvel": TURNING,
    "framelinacc": ACCELERATION, "frameangacc": SPIN, "subtreecom": M, "subtreelinvel": SPEED,
    "subtreeangmom": Dimension((2, 1, -1), 1.0, "kg m²/s"), "e_potential": J, "e_kinetic": J, "clock": S,
}  # fmt: skip
"""What sensors read in every model, by the names of MuJoCo's types."""

JOINT_SENSORS = {"jointpos": "data.qpos", "jointvel": "data.qvel", "jointactfrc": "data.qfrc_actuator"}
"""Sensors of joints, and the fields that they read."""

TENDONS = {"data.ten_length": (M, RAD), "data.ten_velocity": (SPEED, TURNING)}
ACTUATORS = {
    "data.actuator_length": (M, RAD), "data.actuator_velocity": (SPEED, TURNING), "data.actuator_force": (N, N_M),
}  # fmt: skip
"""What fields of tendons and actuators hold: of what is as long as a slide, and of what turns as a hinge."""

DRIVEN_SENSORS = {
    "tendonpos": "data.ten_length", "tendonvel": "data.ten_velocity", "actuatorpos": "data.actuator_length",
    "actuatorvel": "data.actuator_velocity", "actuatorfrc": "data.actuator_force",
}  # fmt: skip
"""Sensors of tendons and actuators, and the fields that they read."""

SLIDE, HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
MASSES = {(SLIDE, SLIDE): KG, (HINGE, HINGE): Dimension((2, 1, 0), 1.0, "kg m²")}
"""What an element of the mass matrix is, by the joints of its row and column."""

MASS = re.compile(r"lib\.massMatrix\(\)\[(\d+)\]\[(\d+)\]")


def explain_unit(text: str, model: mujoco.MjModel, unit: str) -> str | None:
    """Returns why the value of an expression is not in the unit of its question; None where it is, or is not known."""
    wanted, measured = find_unit_dimension(unit), read_dimension(text, model)
    if wanted is None or measured is None:
        return None
    if any(not isclose(a, b, abs_tol=1e-9) for a, b in zip(measured.powers, wanted.powers, strict=True)):
        what = measured.name or _spell(measured.powers)
        cure = "name masses and lengths in it by their fields, such as model.body_mass[1], or write another unit"
        return f"the expression gives a value in {what}, which the unit {unit} does not measure: {cure}"
    if measured.size is not None and wanted.size is not None and not isclose(measured.size, wanted.size):
        base = _spell(measured.powers) if isclose(measured.size, 1) else "base units"
        what = f"a value in {measured.name or base}" if measured.name or any(measured.powers) else "a plain ratio"
        return f"the expression gives {what}, and the unit is {unit}: convert one"
    if measured.size is not None and not measured.may_count and counts_turns(unit):
        what = measured.name or "rad and s"
        return f"the expression gives a value in {what}, and {unit} counts turns: divide by 2π, or write another unit"
    return None


def explain_missing_unit(text: str, model: mujoco.MjModel) -> str | None:
    """Returns why a question without a unit should have one; None where what is measured has none, or is not known."""
    measured = read_dimension(text, model)
    if measured is None or not measured.name:
        return None
    return (
        f"The expression gives a value in {measured.name}, and the question has no unit: a number that is typed with "
        "one is not read. Write the unit."
    )


def counts_turns(text: str) -> bool:
    """Whether a unit counts whole turns, such as Hz or rpm."""
    unit = known_unit(text)
    return unit is not None and unit.rotation in (Rotation.CYCLES, Rotation.TURNS)


def read_dimension(text: str, model: mujoco.MjModel) -> Dimension | None:
    """Returns what an expression measures; None where it is not known, as that of a bare number."""
    try:
        measured = _read(syntax.Source(text, "expression").tree(), model)
    except (syntax.SyntaxRefused, AttributeError):
        return None
    return None if measured is None or measured.is_number else measured


def find_unit_dimension(text: str) -> Dimension | None:
    """Returns the powers and the size of a unit; None for one that holds more than metre, kilogram and second."""
    unit = known_unit(text)
    if unit is None:
        return None
    try:
        base = find_base_unit(unit)
        size = 1.0 if counts_turns(text) else convert(1.0, unit, base)
    except GraderError:
        return None
    powers = [0.0, 0.0, 0.0]
    for name, power in base.powers:
        if name not in BASES:
            return None
        *own, factor = BASES[name]
        powers = [sum_ + power * exponent for sum_, exponent in zip(powers, own, strict=True)]
        size *= factor**power
    return Dimension((powers[0], powers[1], powers[2]), None if counts_turns(text) else size, text)


def _spell(powers: tuple[float, ...]) -> str:
    """Returns powers of metre, kilogram and second as text."""
    named = [f"{name}^{power:g}" if power != 1 else name for name, power in zip(("m", "kg", "s"), powers) if power]  # noqa: B905
    return " ".join(named) or "no unit of length, mass or time"


def _read(node: Node, model: mujoco.MjModel) -> Dimension | None:
    """Returns what a node of an expression measures, or None."""
    parts = syntax.list_parts(node)
    match node.type:
        case "parenthesized_expression" | "unary_expression" if syntax.read_text(node)[:1] in "(+-":
            return _read(parts[0], model)
        case "number":
            return _read_number(syntax.read_number(node))
        case "ternary_expression" | "array":
            return _read_alike(parts[node.type == "ternary_expression" :], model)
        case "binary_expression":
            return _combine(syntax.read_text(syntax.get_field(node, "operator")), parts[0], parts[1], model)
        case "call_expression" | "member_expression" | "subscript_expression":
            return (_read_call if node.type == "call_expression" else _read_field)(node, model)
    return None


def _read_number(value: float) -> Dimension | None:
    if value in FACTORS:
        return FACTOR
    return CONVERSION if value in CONVERSIONS or (value > 0 and log10(value).is_integer()) else None


def _combine(operator: str, left: Node, right: Node, model: mujoco.MjModel) -> Dimension | None:
    """Returns what a sum, a product or a power measures."""
    if operator == "**" and right.type == "number":
        return _raise(_read(left, model), syntax.read_number(right))
    if operator in ("+", "-") and (_is_constant(left) or _is_constant(right)):
        return _read_alike([left, right], model)
    a, b = _read(left, model), _read(right, model)
    if a is None or b is None:
        return None
    if operator in ("+", "-"):
        return _add(a, b)
    return _multiply(a, b, 1 if operator == "*" else -1) if operator in ("*", "/") else None


def _add(a: Dimension, b: Dimension) -> Dimension | None:
    if a.powers != b.powers:
        return None
    size = a.size if a.size == b.size else None
    return Dimension(a.powers, size, a.name, a.is_number and b.is_number, a.may_count or b.may_count)


def _multiply(a: Dimension, b: Dimension, sign: int) -> Dimension:
    """Returns what a product measures, or with a `sign` of -1 a quotient."""
    size = None if a.size is None or b.size is None else a.size * b.size**sign
    x, y, z = (p + sign * q for p, q in zip(a.powers, b.powers, strict=True))
    name = a.name if b in (FACTOR, CONVERSION) else b.name if a == FACTOR and sign == 1 else ""
    may_count = a.may_count or b.may_count or (a.is_number and sign == -1)
    return Dimension((x, y, z), size, name, a.is_number and b.is_number, may_count)


def _is_constant(node: Node) -> bool:
    """Whether a node is a number that the author wrote: it is in the unit of what it is added to or compared with."""
    return node.type == "number" or (
        node.type in ("unary_expression", "parenthesized_expression") and _is_constant(syntax.list_parts(node)[0])
    )


def _read_alike(nodes: list[Node], model: mujoco.MjModel) -> Dimension | None:
    """Returns what all of these nodes measure, but for numbers that are written; None where they differ."""
    first, *others = [_read(node, model) for node in nodes if not _is_constant(node)] or [None]
    return first if all(other == first for other in others) else None


def _raise(base: Dimension | None, exponent: float) -> Dimension | None:
    if base is None:
        return None
    x, y, z = (exponent * power for power in base.powers)
    return replace(base, powers=(x, y, z), size=None if base.size is None else base.size**exponent, name="")


def _read_call(node: Node, model: mujoco.MjModel) -> Dimension | None:
    name = syntax.read_text(syntax.get_field(node, "function"))
    arguments = syntax.list_parts(syntax.get_field(node, "arguments"))
    if name in CALLS:
        return CALLS[name]
    if name in JOINTS and arguments and arguments[0].type == "string":
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, syntax.read_string(arguments[0]))
        return None if joint < 0 else _of_joint(name, int(model.jnt_type[joint]))
    if name == "lib.sensor" and arguments and arguments[0].type == "string":
        return _read_sensor(
            model, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, syntax.read_string(arguments[0]))
        )
    if name == "Math.sqrt" and arguments:
        return _raise(_read(arguments[0], model), 0.5)
    return _read_alike(arguments, model) if name in SAME else None


def _read_field(node: Node, model: mujoco.MjModel) -> Dimension | None:
    """Returns what a field or an element of one holds."""
    text = syntax.read_text(node).replace(" ", "")
    if node.type == "member_expression":
        return PI if text == "Math.PI" else FIELDS.get(text) or _read_all_joints(text, model)
    owner, index = syntax.get_field(node, "object"), syntax.get_field(node, "index")
    path = syntax.read_text(owner).replace(" ", "")
    if path in FIELDS:
        return FIELDS[path]
    if owner.type == "call_expression":
        return _read(owner, model)
    if found := MASS.fullmatch(text):
        return _read_mass(model, *map(int, found.groups()))
    return _read_element(path, syntax.read_number(index), model) if index.type == "number" else None


def _read_all_joints(path: str, model: mujoco.MjModel) -> Dimension | None:
    """Returns what a whole field of joints holds, if they are all slides or all hinges."""
    types = {int(type_) for type_ in model.jnt_type}
    return _of_joint(path, types.pop()) if path in JOINTS and len(types) == 1 else None


def _read_element(path: str, at: float, model: mujoco.MjModel) -> Dimension | None:
    """Returns what an element of a field of joints holds."""
    joints = range(model.njnt)
    if path == "data.sensordata":
        return _read_sensor(model, int(np.searchsorted(model.sensor_adr, at, side="right")) - 1)
    if path == "model.actuator_gainprm":
        return _read_stiffness(model, int(at))
    if path in TENDONS or path in ACTUATORS:
        return _read_driven(path, model, int(at))
    if path not in JOINTS:
        return None
    addresses = {"data.qpos": model.jnt_qposadr, "model.qpos0": model.jnt_qposadr, "model.jnt_stiffness": joints}
    at_joint = [joint for joint in joints if addresses.get(path, model.jnt_dofadr)[joint] == at]
    single = _of_joint(path, int(model.jnt_type[at_joint[0]])) if at_joint else None
    return _read_loose_element(path, int(at), model) if single is None and path != "model.jnt_stiffness" else single


def _read_loose_element(path: str, at: int, model: mujoco.MjModel) -> Dimension | None:
    """Returns what an element of a free joint, or of the velocity of a ball joint, holds: places and speeds come first.
    Elements of a quaternion are known as none."""
    in_space, turning = JOINTS[path]
    is_place = path in ("data.qpos", "model.qpos0")
    for joint in range(model.njnt):
        offset = at - int((model.jnt_qposadr if is_place else model.jnt_dofadr)[joint])
        match int(model.jnt_type[joint]):
            case mujoco.mjtJoint.mjJNT_FREE if 0 <= offset < 3:
                return in_space
            case mujoco.mjtJoint.mjJNT_FREE if 3 <= offset < 6 and not is_place:
                return turning
            case mujoco.mjtJoint.mjJNT_BALL if 0 <= offset < 3 and not is_place:
                return turning
    return None


def _read_sensor(model: mujoco.MjModel, index: int) -> Dimension | None:
    """Returns what a sensor reads."""
    if not 0 <= index < model.nsensor:
        return None
    name = mujoco.mjtSensor(model.sensor_type[index]).name.removeprefix("mjSENS_").lower()
    at = int(model.sensor_objid[index])
    if name in DRIVEN_SENSORS:
        return _read_driven(DRIVEN_SENSORS[name], model, at)
    return _of_joint(JOINT_SENSORS[name], int(model.jnt_type[at])) if name in JOINT_SENSORS else SENSORS.get(name)


def _read_driven(path: str, model: mujoco.MjModel, at: int) -> Dimension | None:
    """Returns what an element of a field of tendons or actuators holds."""
    fields = TENDONS if path in TENDONS else ACTUATORS
    if not 0 <= at < (model.ntendon if path in TENDONS else model.nu):
        return None
    type_ = _find_tendon_type(model, at) if path in TENDONS else _find_driven_type(model, at)
    return None if type_ is None else fields[path][type_ == HINGE]


def _find_tendon_type(model: mujoco.MjModel, tendon: int) -> int | None:
    """Returns the type of the joints that a fixed tendon couples, if they are slides or hinges alone; a spatial tendon
    is as long as a slide."""
    parts = range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
    if model.wrap_type[parts.start] != mujoco.mjtWrap.mjWRAP_JOINT:
        return SLIDE
    types = {int(model.jnt_type[model.wrap_objid[part]]) for part in parts}
    return types.pop() if len(types) == 1 and types <= {SLIDE, HINGE} else None


def _find_driven_type(model: mujoco.MjModel, actuator: int) -> int | None:
    """Returns the type of the joint that an actuator drives, as that of its tendon; None of bodies and sites."""
    target = int(model.actuator_trnid[actuator, 0])
    match int(model.actuator_trntype[actuator]):
        case mujoco.mjtTrn.mjTRN_JOINT | mujoco.mjtTrn.mjTRN_JOINTINPARENT:
            return type_ if (type_ := int(model.jnt_type[target])) in (SLIDE, HINGE) else None
        case mujoco.mjtTrn.mjTRN_TENDON:
            return _find_tendon_type(model, target)
        case mujoco.mjtTrn.mjTRN_SLIDERCRANK:
            return SLIDE
    return None


def _read_mass(model: mujoco.MjModel, row: int, column: int) -> Dimension | None:
    """Returns what an element of the mass matrix is."""
    if not max(row, column) < model.nv:
        return None
    types = (int(model.jnt_type[model.dof_jntid[dof]]) for dof in (row, column))
    return MASSES.get((next(types), next(types)))


def _read_stiffness(model: mujoco.MjModel, index: int) -> Dimension | None:
    """Returns what the first gain of a position servo is: the stiffness that its joint feels."""
    actuator, number = divmod(index, mujoco.mjNGAIN)
    if number or actuator >= model.nu or model.actuator_biasprm[actuator, 1] != -model.actuator_gainprm[actuator, 0]:
        return None
    joint = int(model.actuator_trnid[actuator, 0])
    at_joint = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
    return _of_joint("model.jnt_stiffness", int(model.jnt_type[joint])) if at_joint else None


def _of_joint(path: str, type_: int) -> Dimension | None:
    slide, hinge = JOINTS[path]
    return {SLIDE: slide, HINGE: hinge}.get(type_)
