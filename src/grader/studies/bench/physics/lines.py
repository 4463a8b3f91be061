"""The cost of an author's line beside the same line written by hand in Python over MuJoCo's own arrays. At a ratio of 1
both cost the same; above it the compiled line is faster. `grader.studies.bench.floors` measures them."""

from collections.abc import Callable

import mujoco

from grader.expressions import Machine, ProgramKind, Value, compile_program
from grader.studies.bench.timing import TimeRatio, measure_pairs

JOINTS = 10
SCENE = f"""
<mujoco>
  <worldbody>{'<body pos="0 0 -.1"><joint/><geom size=".1"/>' * JOINTS}{"</body>" * JOINTS}</worldbody>
  <actuator><motor joint="swing"/></actuator>
</mujoco>
""".replace("<joint/>", '<joint name="swing"/>', 1)

LINES: dict[str, tuple[ProgramKind, str, float]] = {
    "read": ("expression", "data.qpos[0]", 1.0),
    "controller": ("statement", "data.ctrl[0] = -ctx.kp * data.qpos[0] - ctx.kv * data.qvel[0]", 1.0),
    "loop that reads": (
        "statement",
        "let total = 0; for (let i = 0; i < model.nv; i++) total += data.qvel[i] * data.qvel[i]; return total",
        0.5,
    ),
    "loop that writes": ("statement", "for (let i = 0; i < model.nv; i++) model.dof_damping[i] = 0.75 / (i + 1)", 0.5),
}
"""What each is, its text, and the least ratio that is allowed."""


def write_by_hand(name: str, model: mujoco.MjModel, data: mujoco.MjData, ctx: dict[str, Value]) -> Callable[[], object]:
    """Returns one of LINES as Python."""

    def control() -> None:
        data.ctrl[0] = -ctx["kp"] * data.qpos[0] - ctx["kv"] * data.qvel[0]  # type: ignore[operator]

    def total() -> float:
        total = 0.0
        for i in range(model.nv):
            total += data.qvel[i] * data.qvel[i]
        return total

    def damp() -> None:
        for i in range(model.nv):
            model.dof_damping[i] = 0.75 / (i + 1)

    return dict(zip(LINES, (lambda: data.qpos[0], control, total, damp), strict=True))[name]


def measure_speed(name: str) -> TimeRatio:
    """CPU time of the line by hand over that of the compiled line, on one state, in turns."""
    kind, text, _ = LINES[name]
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = 0.3, 0.7
    machine = Machine(model, data)
    machine.ctx.update(kp=100.0, kv=5.0)
    compiled = compile_program(text, kind, "bench").bind(machine)

    def evaluate() -> Value:
        machine.budget[0] = 0  # many runs' worth of evaluations are measured
        return compiled()

    return measure_pairs(write_by_hand(name, model, data, machine.ctx), evaluate)
