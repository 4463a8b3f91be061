"""The cost of an author's line beside the same line written by hand in Python over MuJoCo's own arrays.

At a ratio of 1 both cost the same; above it the compiled line is faster. `grader.bench.floors` measures them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco

from grader.bench.timing import Paired, paired
from grader.expressions import Machine, ProgramKind, Value, compile_program

JOINTS = 10
SCENE = f"""
<mujoco>
  <worldbody>{'<body pos="0 0 -.1"><joint/><geom size=".1"/>' * JOINTS}{"</body>" * JOINTS}</worldbody>
  <actuator><motor joint="swing"/></actuator>
</mujoco>
""".replace("<joint/>", '<joint name="swing"/>', 1)
BUDGET_S = 0.2

Values = dict[str, Value]


@dataclass(frozen=True)
class Line:
    """A text and the same by hand, with the least ratio that is allowed."""

    name: str
    kind: ProgramKind
    text: str
    by_hand: Callable[[mujoco.MjModel, mujoco.MjData, Values], Callable[[], object]]
    least: float


def _read(model: mujoco.MjModel, data: mujoco.MjData, ctx: Values) -> Callable[[], object]:
    return lambda: data.qpos[0]


def _control(model: mujoco.MjModel, data: mujoco.MjData, ctx: Values) -> Callable[[], object]:
    def run() -> None:
        data.ctrl[0] = -ctx["kp"] * data.qpos[0] - ctx["kv"] * data.qvel[0]  # type: ignore[operator]

    return run


def _total(model: mujoco.MjModel, data: mujoco.MjData, ctx: Values) -> Callable[[], object]:
    def run() -> float:
        total = 0.0
        for i in range(model.nv):
            total += data.qvel[i] * data.qvel[i]
        return total

    return run


def _damp(model: mujoco.MjModel, data: mujoco.MjData, ctx: Values) -> Callable[[], object]:
    def run() -> None:
        for i in range(model.nv):
            model.dof_damping[i] = 0.75 / (i + 1)

    return run


LINES = (
    Line("line, read", "expression", "data.qpos[0]", _read, 1.0),
    Line(
        "line, controller",
        "statement",
        "data.ctrl[0] = -ctx.kp * data.qpos[0] - ctx.kv * data.qvel[0]",
        _control,
        1.0,
    ),
    Line(
        "line, loop that reads",
        "statement",
        "let total = 0; for (let i = 0; i < model.nv; i++) total += data.qvel[i] * data.qvel[i]; return total",
        _total,
        0.5,
    ),
    Line(
        "line, loop that writes",
        "statement",
        "for (let i = 0; i < model.nv; i++) model.dof_damping[i] = 0.75 / (i + 1)",
        _damp,
        0.5,
    ),
)


def speed(line: Line) -> Paired:
    """CPU time of the line by hand over that of the compiled line, on one state, in turns."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = 0.3, 0.7
    machine = Machine(model, data)
    machine.ctx.update(kp=100.0, kv=5.0)
    compiled = compile_program(line.text, line.kind, "bench").bind(machine)
    by_hand = line.by_hand(model, data, machine.ctx)

    def evaluate() -> Value:
        machine.budget[0] = 0  # many runs' worth of evaluations are measured
        return compiled()

    return paired(by_hand, evaluate, BUDGET_S)
