"""The same programs on the same state: here, and in Node."""

import copy
import functools
import json
import math
import struct
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np

from grader.errors import ContentError, LabError
from grader.expressions import UNDEFINED, Machine, Value, Vector, compile_program, fields, runtime
from grader.expressions.compiling import paths
from grader.expressions.values import Record, to_number, to_units

SCENE = """
<mujoco>
  <option timestep="0.002"><flag energy="enable"/></option>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="box" pos="0 0 .0999"><freejoint name="free"/><geom name="box" type="box" size=".1 .1 .1"/></body>
    <body name="arm" pos="0 1 1">
      <joint name="hinge" axis="0 1 0" damping=".3"/><geom name="rod" type="capsule" fromto="0 0 0 0 0 -.5" size=".02"/>
      <site name="tip" pos="0 0 -.5"/>
    </body>
    <body name="plate" mocap="true" pos="1 0 1"><geom type="box" size=".1 .1 .01" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator><position name="servo" joint="hinge" kp="20" kv="2"/></actuator>
  <sensor><jointpos name="angle" joint="hinge"/></sensor>
</mujoco>
"""
WRITABLE = (fields.MODEL_PARAMETERS, fields.DATA_STATE)


class Case(NamedTuple):
    kind: Literal["expression", "statement"]
    text: str
    value: float = 0.75


@functools.cache
def _moving() -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    data.qpos[7], data.ctrl[0] = 0.4, 0.2
    mujoco.mj_step(model, data, 50)
    return model, data


def machine() -> Machine:
    """A scene in motion, with contacts; a fresh copy each time."""
    model, data = _moving()
    return Machine(copy.copy(model), copy.copy(data))


def _array(array: Any) -> dict[str, Any]:
    return {"type": array.dtype.str[1:], "values": [float(x) for x in array.reshape(-1)]}


def _plain(m: Machine) -> dict[str, Any]:
    """Everything of the allow-list, as JSON."""
    model_arrays = fields.MODEL_PARAMETERS | fields.MODEL_FIXED
    option: dict[str, Any] = {name: float(getattr(m.model.opt, name)) for name in fields.OPTION_SCALARS}
    option |= {name: _array(getattr(m.model.opt, name)) for name in fields.OPTION_VECTORS}
    data = {name: _array(getattr(m.data, name)) for name in fields.DATA_STATE | fields.DATA_RESULTS}
    return {
        "model": {name: _array(getattr(m.model, name)) for name in model_arrays}
        | {name: float(getattr(m.model, name)) for name in fields.MODEL_SIZES}
        | {"opt": option},
        "data": data | {name: float(getattr(m.data, name)) for name in fields.DATA_COUNTS} | {"time": m.data.time},
    }


def _table(m: Machine) -> dict[str, Any]:
    """What `lib` and `mj` say of this state, for the stand-ins."""

    def call(name: str, *args: Value) -> Any:
        return runtime.FUNCTIONS[f"lib.{name}"].call(m, *args)

    named = {
        "bodyPos": ("box", "arm"),
        "bodyVel": ("box", "arm"),
        "sitePos": ("tip",),
        "geomPos": ("rod",),
        "qpos": ("free", "hinge"),
        "qvel": ("free", "hinge"),
        "sensor": ("angle",),
        "bodyId": ("box", "arm"),
        "jointId": ("hinge",),
    }
    kinds = {"box": mujoco.mjtObj.mjOBJ_BODY, "tip": mujoco.mjtObj.mjOBJ_SITE, "hinge": mujoco.mjtObj.mjOBJ_JOINT}
    return {
        "energy": call("energy"),
        "com": call("com"),
        "contactPairs": call("contactPairs"),
        "jacobian": {"tip": call("jacobian", "tip")},
        "jacobianSV": {"tip": call("jacobianSV", "tip", Record(rows="pos"))},
        **{name: {arg: call(name, arg) for arg in args} for name, args in named.items()},
        **{
            name: {g: call(name, *([g] if g else [])) for g in ("", "box", "rod")}
            for name in ("normalForce", "contacts")
        },
        "enums": {e: {k: {"value": int(v)} for k, v in members.items()} for e, members in paths.ENUMS.items()},
        "ids": {f"{int(kind)} {name}": mujoco.mj_name2id(m.model, kind, name) for name, kind in kinds.items()},
        "massMatrix": call("massMatrix"),  # last: it moves what depends on qpos to the present
    }


def run_node(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """What Node makes of the cases, each on a fresh state."""
    m = machine()
    text = json.dumps({**_plain(m), "table": _table(m), "cases": [case._asdict() for case in cases]})
    script = Path(__file__).with_name("stand_in.js")
    done = subprocess.run(["node", str(script)], input=text, capture_output=True, text=True, check=True, timeout=60)
    answer: list[dict[str, Any]] = json.loads(done.stdout)
    return answer


Outcome = tuple[Machine, Value] | str
"""The machine afterwards and the value, or the error."""


def run_here(case: Case) -> Outcome:
    """What we make of a case: the machine afterwards and the value, or the error."""
    try:
        program = compile_program(case.text, case.kind, "case")
        m = machine()
        return m, program.run(m, case.value)
    except (ContentError, LabError) as error:
        return str(error)


def _same_number(here: float, there: float) -> bool:
    """Bit for bit (but NaN is NaN), or 4 units in the last place off: V8's sin and pow are its own."""
    if math.isnan(here) or math.isnan(there):
        return math.isnan(here) and math.isnan(there)
    if here == there:
        return math.copysign(1, here) == math.copysign(1, there)
    return math.isclose(here, there, rel_tol=9e-16, abs_tol=0)


def _decoded(bits: str) -> float:
    number: float = struct.unpack(">d", bytes.fromhex(bits))[0]
    return number


def same(here: Value, there: dict[str, Any]) -> bool:
    """Whether our value is the one that Node gave."""
    (kind, content), *_ = there.items()
    match kind:
        case "n":
            return isinstance(here, float) and _same_number(here, _decoded(content))
        case "s":
            return here == to_units(content)
        case "b":
            return here is content
        case "z":
            return here is None
        case "u":
            return here is UNDEFINED
        case "a":
            return isinstance(here, list) and len(here) == len(content) and all(map(same, here, content))
        case "t":
            if not isinstance(here, Vector) or len(here) != len(content):
                return False
            return all(_same_number(to_number(a), _decoded(b)) for a, b in zip(here, content, strict=True))
    return isinstance(here, Record) and all(same(here[k], v) for k, v in content.items())


def same_state(m: Machine, answer: dict[str, Any]) -> list[str]:
    """The names of the writable fields that came out different."""
    different = [k for k, v in answer["ctx"]["r"].items() if not same(m.ctx.get(k, UNDEFINED), v)]
    for part, owner, names in (("model", m.model, WRITABLE[0]), ("data", m.data, WRITABLE[1])):
        there = answer[part]["r"]
        different += [n for n in names if not same(Vector(np.asarray(getattr(owner, n))), there[n])]
    options = answer["model"]["r"]["opt"]["r"]
    different += [n for n in fields.OPTION_SCALARS if not same(float(getattr(m.model.opt, n)), options[n])]
    return different
