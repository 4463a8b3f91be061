"""Names what an expression reads, as the axis of a picture has it."""

import re
from collections.abc import Sequence

import mujoco

READING = re.compile(r"data\.(qpos|qvel|sensordata)\[(\d+)\]|lib\.(qpos|qvel|sensor)\((['\"])([^'\"]+)\4\)")
ENERGY = re.compile(r"lib\.energy\(\)\.(total|kinetic|potential)")
SIZE = re.compile(r"Math\.abs\((.+)\)")

UNITS = {
    "qpos": {mujoco.mjtJoint.mjJNT_SLIDE: "m", mujoco.mjtJoint.mjJNT_HINGE: "rad"},
    "qvel": {mujoco.mjtJoint.mjJNT_SLIDE: "m/s", mujoco.mjtJoint.mjJNT_HINGE: "rad/s"},
}
WORDS = {"qpos": "position", "qvel": "velocity"}


def name_reading(expr: str, model: mujoco.MjModel) -> str | None:
    """Returns what an expression reads, in words and with its unit, such as "velocity of hinge [rad/s]"; None where it
    is more than one number of a joint or a sensor, or an energy."""
    text = expr.strip()
    if size := SIZE.fullmatch(text):
        inner = name_reading(size[1], model)
        return inner and re.sub(r"^(.+?)( \[.+\])?$", r"|\1|\2", inner)
    if energy := ENERGY.fullmatch(text):
        return f"{energy[1]} energy [J]"
    match = READING.fullmatch(text)
    if match is None:
        return None
    field, index = match[1] or match[3], match[2]
    if field in ("sensor", "sensordata"):
        return match[5] if index is None else _name_sensor(model, int(index))
    joint = _find_joint(model, field, match[5] if index is None else int(index))
    if joint is None or not model.joint(joint).name:
        return None
    unit = UNITS[field].get(mujoco.mjtJoint(model.jnt_type[joint]))
    return unit and f"{WORDS[field]} of {model.joint(joint).name} [{unit}]"


def _name_sensor(model: mujoco.MjModel, index: int) -> str | None:
    """Returns the name of a sensor of one number at a place of `sensordata`."""
    at = {int(address): sensor for sensor, address in enumerate(model.sensor_adr) if model.sensor_dim[sensor] == 1}
    return model.sensor(at[index]).name or None if index in at else None


def _find_joint(model: mujoco.MjModel, field: str, which: int | str) -> int | None:
    """Returns the joint of a name, or whose first number stands at an address of `qpos` or `qvel`."""
    addresses = model.jnt_qposadr if field == "qpos" else model.jnt_dofadr
    at: Sequence[int] = [
        joint for joint in range(model.njnt) if which in (model.joint(joint).name, int(addresses[joint]))
    ]
    return at[0] if at else None
