"""What is told of controllers with several controls: the law of each is fitted, and a sentence is true of all."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from grader.exercises import JudgedTrial, load_kinds, plan_exercise
from grader.exercises.episodes.simulating import EpisodeRun, Record
from grader.questions import question_adapter
from grader.questions.kinds.script import ScriptQuestion

Floats = NDArray[np.float64]
Control = Callable[[mujoco.MjData], Any]

CONTROLLER: Any = load_kinds()["controller"]
GOAL = 0.5
HOLD = np.array([GOAL, 0.0])
"""Where the joints should be."""
KD = np.array([6.0, 3.0])

ARM = """<mujoco><option timestep="0.002" gravity="0 0 {gravity}"/><worldbody>
<body><joint name="a" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03" mass="1"/>
<body pos="0.4 0 0"><joint name="b" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.7"/></body></body></worldbody>
<actuator><motor name="ma" joint="a" ctrlrange="-40 40"/><motor name="mb" joint="b" ctrlrange="-20 20"/></actuator>
<sensor><jointpos name="xa" joint="a"/><jointpos name="xb" joint="b"/><jointvel name="va" joint="a"/>
<jointvel name="vb" joint="b"/></sensor></mujoco>"""

LAW = {"xa": [-200, -10], "xb": [-200, -10], "va": [-40, -1], "vb": [-40, -1], "target": [10, 200]}


def diagnose(control: Control, *, gravity: float = -9.81, has_law: bool = True) -> str | None:
    """Returns what is told of a controller of the arm, which starts beside its goal; None where it reaches it."""
    case = {"id": "a", "target": [{"value": GOAL}], "start": {"a": 0.1, "b": 0.4}}
    goals = [{"goal": "error", "from_s": 1, "max": 0.01},
             {"goal": "range", "sensor": "xb", "within": [-0.02, 0.02], "from_s": 1}]  # fmt: skip
    check = {"kind": "controller", "form": "control", "period_s": 0.004, "duration_s": 1.6, "model": "arm",
             "observe": ["xa", "xb", "va", "vb"], "track": "xa", "law": LAW if has_law else {}, "goals": goals,
             "cases": [case]}  # fmt: skip
    raw = {"kind": "code", "id": "arm", "q": "?", "entry": "control", "check": check}
    question = question_adapter().validate_python(raw)
    assert isinstance(question, ScriptQuestion)
    plan = plan_exercise(question, lambda _: ARM.format(gravity=gravity), 1)
    (trial,) = plan.trials
    judgement = CONTROLLER.judge(plan.parameters, trial, [play(plan.parameters, trial.problem, control)])
    if judgement.passed:
        return None
    return CONTROLLER.name_mistake(plan.parameters, [JudgedTrial(trial, judgement, counts=False)]) or ""


def play(parameters: Any, problem: Any, control: Control) -> Record:
    """Returns the record of a run under a control, which sees a forwarded copy of the data."""
    run, data = EpisodeRun(parameters, problem, 0), mujoco.MjData(problem.model)
    for _ in range(problem.periods):
        run.observe()
        data.qpos[:], data.qvel[:] = run.plant.data.qpos, run.plant.data.qvel
        mujoco.mj_forward(problem.model, data)
        if not run.apply(np.array(control(data), dtype=np.float64)):
            break
    return run.finish()


def follow(data: mujoco.MjData, kp: Any = 60.0, kd: Any = KD, bias: float = 1.0) -> Floats:
    """Returns a law that is right: gains on errors and rates, and what holds the arm."""
    return np.asarray(kp * (HOLD - data.qpos) - kd * data.qvel + bias * data.qfrc_bias)


@pytest.mark.parametrize(
    ("control", "told"),
    [
        (follow, None),
        (lambda data: follow(data, bias=-1), "carry gravity has the wrong sign"),
        (lambda data: follow(data, bias=2), "The controls carry gravity twice"),
        (lambda data: follow(data, bias=0), "It comes to rest beside the target"),
        (lambda data: follow(data)[::-1], "return the controls in the order of the model's actuators, ma, mb."),
        (lambda data: follow(data, kp=np.array([60.0, -60.0])), "The gain on xb has the wrong sign"),
        (lambda data: follow(data, kd=np.array([6.0, -3.0])), "The gain on vb has the wrong sign"),
        (lambda data: follow(data, kp=np.array([60.0, np.degrees(60.0)])), "The gain on xb is off by the factor"),
        (lambda data: follow(data) * [1.0, 0.0], "do not depend on xb"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_one_of_two_controls_is_told(control: Control, told: str | None) -> None:
    found = diagnose(control)
    assert found is told is None or (found and told and told in found), found


@pytest.mark.parametrize("bias", [-1, 0])
def test_gravity_is_told_without_a_law_of_the_author(bias: float) -> None:
    told = "gravity has the wrong sign" if bias else "It comes to rest beside the target"
    assert told in (diagnose(lambda data: follow(data, bias=bias), has_law=False) or "")


def test_a_number_that_two_controls_follow_differently_has_no_gain() -> None:
    """The second control pushes a joint that the first one holds: which gain is meant cannot be said."""
    crossed = np.array([[-60.0, 40.0, -6.0, 0.0], [0.0, 40.0, 0.0, -3.0]])

    def control(data: mujoco.MjData) -> Floats:
        return np.asarray(crossed @ [*(data.qpos - HOLD), *data.qvel] + data.qfrc_bias)

    assert "xb" in (diagnose(control) or "")
    crossed[1, 1] = -40.0
    assert "The gain on xb" not in (diagnose(control) or "")


def test_a_control_that_never_changes_is_named() -> None:
    told = diagnose(lambda data: follow(data) * [1.0, 0.0], gravity=0, has_law=False)
    assert told == "The control of mb never changes: where its joint must move, compute it from what is observed."
