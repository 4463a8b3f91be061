"""Runge-Kutta steps: the force that honest code does not notice, what counts, and what an author may write."""

import json
import re
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from exercises.conftest import ROOT, Grade, model_xml, question, with_check
from grader.domain.run import RunReport, RunStatus
from grader.domain.verdict import Status
from grader.exercises import check_exercise, judge_exercise, plan_exercise
from grader.exercises.kinds.rk4.judging.driver import add_force
from grader.exercises.kinds.rk4.judging.judge import OrderOutcome
from grader.exercises.kinds.rk4.judging.run import Problem
from grader.exercises.kinds.rk4.judging.trajectory import (
    compare,
    simulate_fourth_order,
    simulate_mujoco,
    simulate_unforced,
)
from grader.exercises.kinds.rk4.mistakes import METHODS
from grader.exercises.kinds.rk4.truth import build_truth
from grader.numerics.version import RK4_ORDER_ON_ROTATIONS
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail

STEP, FREE = question("rk4-step"), question("rk4-free-joint")
PROGRAMS = ROOT / "reference_solutions" / "1.3-exercises"
CLASSICAL = (PROGRAMS / "rk4-step" / "correct__classical.py").read_text()


def problems_of(exercise: ScriptQuestion, seed: int = 1) -> list[Problem]:
    return [trial.problem for trial in plan_exercise(exercise, model_xml, seed).trials]


def problem_of(exercise: ScriptQuestion, seed: int = 1) -> Problem:
    """The first case's."""
    return problems_of(exercise, seed)[0]


CURIOUS = """
import inspect, io, pickle, threading
import mujoco
import numpy as np
from mujoco import mj_forward

assert mj_forward is mujoco.mj_forward and mj_forward.__name__ == "mj_forward" and callable(mj_forward)
assert mj_forward.__module__ == mujoco.mj_step.__module__ and "MjModel" in mj_forward.__doc__
try:
    mj_forward(1, 2)
except TypeError:
    pass
else:
    raise AssertionError("wrong arguments pass")
free = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><freejoint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody>"
    "</mujoco>"
)
other = mujoco.MjData(free)
mj_forward(d=other, m=free)
assert abs(other.qacc[2] + 9.81) < 1e-12, "at import, or on another model, there is no other force"
looked = False


def look(model, data):
    global looked
    looked = True
    data.qfrc_applied[:] = np.arange(1, model.nv + 1) / 7
    before = [np.array(getattr(data, n)) for n in ("qfrc_applied", "qpos", "qvel", "ctrl", "act", "xfrc_applied")]
    assert mujoco.mj_forward(model, data) is None
    first = data.qacc.copy()
    mj_forward(m=model, d=data)
    assert np.array_equal(first, data.qacc), "twice is as once"
    after = [np.array(getattr(data, n)) for n in ("qfrc_applied", "qpos", "qvel", "ctrl", "act", "xfrc_applied")]
    assert all(np.array_equal(a, b) for a, b in zip(before, after))
    data.qfrc_applied[:] = 0
    mj_forward(free, other)
    assert abs(other.qacc[2] + 9.81) < 1e-12
""" + CLASSICAL.replace("def rk4_step(model, data):\n", "def rk4_step(model, data):\n    looked or look(model, data)\n")


def test_honest_code_does_not_notice_the_force(grade: Grade) -> None:
    verdict = grade(STEP, CURIOUS)
    assert verdict.status is Status.CORRECT, verdict.diagnosis
    assert verdict.findings[0].measured["qvel"] < 1e-12


@pytest.mark.parametrize("exercise", [STEP, FREE], ids=lambda q: q.id)
@pytest.mark.parametrize("seed", range(4))
def test_every_route_through_mj_step_is_far_away(exercise: ScriptQuestion, seed: int) -> None:
    """At least 10,000 times the tolerance, in every case: no draw of the force is too weak to be felt."""
    for problem in problems_of(exercise, seed):
        run = problem.run
        apart = compare(
            run, simulate_unforced(run, int(mujoco.mjtIntegrator.mjINT_RK4), run.steps), simulate_mujoco(run)
        )
        assert apart.worst > 1e4 * problem.tolerance


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_observed_order_of_right_methods_is_well_inside_its_tolerance(seed: int) -> None:
    step, free = problem_of(STEP, seed), problem_of(FREE, seed)
    mujocos = (free, simulate_mujoco, RK4_ORDER_ON_ROTATIONS)
    for problem, trajectory, order in ((step, simulate_mujoco, 4), (free, simulate_fourth_order, 4), mujocos):
        errors = [build_truth(problem).measure_error(run, trajectory(run)) for run in problem.order_runs]
        slopes = -np.diff(np.log2(errors))
        assert np.all(np.abs(slopes - order) < 0.1)


@pytest.mark.parametrize(
    ("errors", "fourth"),
    [
        ((1e-5, 6e-7, 4e-8, 2.5e-9), True),
        ((3e-6, 1e-7, 5e-9, 2e-10), True),  # steeper, and small
        ((7e-8, 2e-9, 6e-11, 2e-12), True),  # fifth order, at round-off in the end
        ((3e-11, 2e-11, 2e-11, 2e-12), True),  # round-off throughout
        ((20.0, 6e-2, 3e-4, 2e-6), False),  # steep, because wild at the largest timesteps
        ((1.0, 1e-12, 1e-12, 1e-12), False),
        ((1e-3, 2.5e-4, 6e-5, 1.6e-5), False),
        ((np.inf, 6e-7, 4e-8, 2.5e-9), False),
    ],
)
def test_fourth_order_is_a_slope_of_four_or_errors_as_small(errors: tuple[float, ...], fourth: bool) -> None:
    problem = problem_of(FREE)
    assert problem.order
    outcome = OrderOutcome(problem.order, errors, False, False, problem.order_runs[0], build_truth(problem))
    assert outcome.is_fourth is fourth


def test_the_length_of_a_quaternion_does_not_count() -> None:
    run = problem_of(FREE).run
    ours = simulate_mujoco(run)
    longer = replace(ours, qpos=ours.qpos * [1, 1, 1, 9, 9, 9, 9])
    assert compare(run, longer, ours).worst < 1e-13


def test_the_force_of_each_seed_is_another_so_a_replay_is_worthless() -> None:
    one, other = problem_of(STEP, 1).run, problem_of(STEP, 2).run
    assert compare(one, simulate_mujoco(one), simulate_mujoco(other)).worst > 1e-3


def test_the_wrapped_forward_leaves_everything_but_the_accelerations() -> None:
    run = problem_of(STEP).run
    model = mujoco.MjModel.from_xml_string(run.xml)
    plain, forced = mujoco.MjData(model), mujoco.MjData(model)
    for data in (plain, forced):
        data.qpos[:], data.qfrc_applied[:] = run.qpos, 0.25
    mujoco.mj_forward(model, plain)
    add_force(mujoco.mj_forward, vars(run.force))(model, forced)
    assert not np.allclose(plain.qacc, forced.qacc, atol=1e-3)
    for name in ("qpos", "qvel", "qfrc_applied", "qfrc_bias", "qfrc_passive", "xpos", "xquat"):
        assert np.array_equal(getattr(plain, name), getattr(forced, name))


def test_the_library_of_mistakes_is_large_enough_and_tells_each_apart() -> None:
    sentences = list(METHODS)
    assert len(sentences) >= 22


def test_the_verdict_says_which_method_it_was_with_both_errors(grade: Grade) -> None:
    order, near, name = {
        2: ("second order of MuJoCo", "nearer to the truth", "correct__one_mj_integratepos"),
        4: ("fourth order", "as near to the truth", "correct__rotation_vector"),
    }[RK4_ORDER_ON_ROTATIONS]
    mujocos_way = grade(FREE, (PROGRAMS / "rk4-free-joint" / f"{name}.py").read_text())
    better = grade(FREE, (PROGRAMS / "rk4-free-joint" / "correct__quaternion_derivative.py").read_text())
    assert "Agrees with MuJoCo's RK4" in mujocos_way.findings[0].message
    assert "from the truth" in mujocos_way.findings[0].message
    assert order in mujocos_way.findings[-1].message
    assert f"observed order is {RK4_ORDER_ON_ROTATIONS}.0" in mujocos_way.findings[-1].message
    assert "Not MuJoCo's method" in better.findings[0].message
    assert near in better.findings[0].message
    assert "fourth order" in better.findings[-1].message


def test_the_same_submission_gives_the_same_json(grade: Grade) -> None:
    for exercise, program in (
        (STEP, PROGRAMS / "rk4-step" / "partial__three_eighths_rule.py"),
        (question("servo-threshold"), PROGRAMS / "servo-threshold" / "incorrect__half_a_second.py"),
    ):
        first, second = (grade(exercise, program.read_text()).model_dump_json() for _ in range(2))
        assert first == second
        assert json.loads(first)["evidence"]


def test_hidden_cases_tell_whether_they_are_right_and_nothing_else(grade: Grade) -> None:
    verdict = grade(STEP, (PROGRAMS / "rk4-step" / "incorrect__heun.py").read_text())
    titles = [finding.title for finding in verdict.findings]
    assert titles == [
        "double pendulum, 500 steps of 2 ms",
        *(f"hidden case {i}" for i in range(1, 7)),
        "observed order",
    ]
    assert re.search(r"departs at step 1, and by 0\.00\d+ in all", verdict.findings[0].message)
    assert {(f.message, f.measured, f.expected) for f in verdict.findings[1:7]} == {
        ("Departs from MuJoCo's RK4.", None, None)
    }
    assert [picture["case"] for picture in verdict.evidence["differences"]] == ["double-pendulum"]
    assert len(verdict.evidence["differences"][0]["qpos"]) <= 300
    assert verdict.evidence["order"]["slope"] == pytest.approx(2, abs=0.2)


@pytest.mark.parametrize(
    "results",
    [
        {},
        {"q0": np.zeros(3), "v0": np.zeros((500, 2)), "t0": np.zeros((500, 1)), "a0": np.zeros((500, 0))},
        {"q0": np.zeros((9999, 2)), "v0": np.zeros((3, 2)), "t0": np.zeros((500, 1)), "a0": np.zeros((500, 0))},
        {"q0": np.zeros((500, 2), np.int64)},
        {"refused": np.array([255, 0], np.uint8)},
        {"refused": np.zeros((2, 2))},
    ],
)
def test_forged_results_are_incorrect_and_never_a_fault(results: dict[str, Any]) -> None:
    plan = plan_exercise(STEP, model_xml, 1)
    verdict = judge_exercise(
        STEP, plan, RunReport(RunStatus.RETURNED, results={f"t0_{k}": v for k, v in results.items()})
    )
    assert verdict.status is Status.INCORRECT
    assert verdict.points == 0


@pytest.mark.parametrize(
    "line",
    [
        "data.qpos[:] = float('nan')",
        "data.qvel[0] = float('inf')",
        "data.time = float('nan')",
        "data.qpos[:] = 1e300",
    ],
)
def test_a_state_that_is_not_finite_is_incorrect(line: str, grade: Grade) -> None:
    assert grade(STEP, f"def rk4_step(model, data):\n    {line}\n").status is Status.INCORRECT


def test_a_run_that_breaks_off_is_not_told_that_its_time_is_wrong(grade: Grade) -> None:
    case = {"id": "a", "model": "double_pendulum", "time_matters": True, "steps": 20}
    exercise = with_check(STEP, cases=[case], order=None)
    broken = CLASSICAL.rstrip() + "\n    if data.time > 0.0199:\n        data.qpos[0] = float('nan')\n"
    verdict = grade(exercise, broken)
    assert verdict.findings[0].message == "The state does not stay finite. It is no longer finite after step 9."
    slow = CLASSICAL.replace("v, act, t0 + h\n", "v, act, t0 + h / 2\n")
    verdict = grade(exercise, slow)
    assert "data.time has the wrong value" in verdict.findings[0].message
    assert "data.time advances by 1/2 h in a step" in (verdict.diagnosis or "")


OTHER_STEP = {
    "kind": "code",
    "id": "crane",
    "q": "Step a crane.",
    "entry": "advance",
    "points": 2,
    "check": {
        "kind": "rk4",
        "numbers": {"load": {"element": "body[@name='load']/inertial", "attribute": "mass"}},
        "order": {"timesteps_s": [0.02, 0.01, 0.005], "seconds": 0.4},
        "cases": [
            {"id": "crane", "model": "crane", "start": {"qvel": [1, 0.5]}, "timestep_s": 0.01, "steps": 60},
            {
                "id": "loaded",
                "hidden": True,
                "model": "crane",
                "set": {"load": [3, 5]},
                "start": {"qvel": [0.2, 1]},
                "timestep_s": 0.004,
                "steps": 60,
                "time_matters": True,
            },
        ],
    },
}

CRANE = """
<mujoco>
  <worldbody>
    <body name="trolley">
      <joint name="rail" type="slide" axis="1 0 0" stiffness="20"/>
      <inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.1"/>
      <body name="load">
        <joint name="rope" type="hinge" axis="0 1 0"/>
        <inertial pos="0 0 -1.5" mass="2" diaginertia="0.1 0.1 0.1"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""


MUSCLE = """
<mujoco>
  <worldbody><body><joint name="elbow" range="0 2" limited="true"/><geom size=".1" pos="0 0 -.3"/></body></worldbody>
  <actuator><muscle name="biceps" joint="elbow"/></actuator>
</mujoco>
"""


def test_a_second_exercise_is_json_alone(jail: Jail) -> None:
    exercise = ScriptQuestion.model_validate(OTHER_STEP)
    crane = {"crane": CRANE}.__getitem__
    assert check_exercise(exercise, crane, "other.json") == []
    plan = plan_exercise(exercise, crane, 3)
    for source, status in (
        (CLASSICAL.replace("rk4_step", "advance"), Status.CORRECT),
        ("import mujoco\ndef advance(model, data):\n    mujoco.mj_step(model, data)\n", Status.FORBIDDEN),
    ):
        report = jail.run(plan.build_job(source, exercise.limits))
        assert judge_exercise(exercise, plan, report).status is status


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"accept": "anything"}, "check.accept"),
        ({"cases": [{"id": "a", "xml": MUSCLE}]}, "check.cases.0"),
        ({"cases": [{"id": "a", "model": "double_pendulum", "xml": "<mujoco/>"}]}, "check.cases.0"),
        ({"cases": [{"id": "a"}]}, "check.cases.0"),
        ({"cases": [{"id": "a", "model": "double_pendulum", "start": {"qpos": [1]}}]}, "check.cases.0"),
        ({"cases": [{"id": "a", "model": "double_pendulum", "start": {"key": "none"}}]}, "check.cases.0"),
        ({"cases": [{"id": "a", "xml": "<mujoco>"}]}, "check.cases.0"),
        (
            {"cases": [{"id": "a", "model": "double_pendulum", "set": {"upper mass": [-1, 1]}}]},
            "check.cases.0.set.upper mass",
        ),
        (
            {"cases": [{"id": "a", "model": "double_pendulum", "set": {"upper mass": [1, -1]}}]},
            "check.cases.0.set.upper mass",
        ),
        ({"cases": [{"id": "a", "model": "double_pendulum", "start": {"qvel": [1e9, 0]}}]}, "check.cases.0"),
        ({"cases": [{"id": "a", "xml": "<mujoco><worldbody><geom/></worldbody></mujoco>"}]}, "check.cases.0"),
        ({"cases": [{"id": "a", "model": "double_pendulum", "set": {"mass": 1}}]}, "check.cases.0.set.mass"),
        ({"order": {"timesteps_s": [0.1, 0.05]}}, "check.order.timesteps_s"),
        ({"order": {"timesteps_s": [0.01, 0.02, -0.04]}}, "check.order.timesteps_s.2"),
        ({"order": {"timesteps_s": [0.01, 0.02, 0.02]}}, "check.order.timesteps_s"),
        ({"order": {"seconds": 5}}, "check.order.seconds"),
        ({"order": {"second": 1}}, "check.order.second"),
    ],
)
def test_an_authors_mistake_is_a_fault_with_its_key(changes: dict[str, Any], key: str) -> None:
    faults = check_exercise(with_check(STEP, **changes), model_xml, "1.3-exercises.json")
    assert [fault.key for fault in faults] == [f"rk4-step.{key}"]


@pytest.mark.parametrize("id_", ["servo-threshold", "rk4-step", "rk4-free-joint"])
def test_the_lessons_own_exercises_have_no_faults(id_: str) -> None:
    assert check_exercise(question(id_), model_xml, "1.3-exercises.json") == []
