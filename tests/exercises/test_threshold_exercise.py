"""The largest stable timestep: what counts as right, what an author may write, what is told and what is not."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from exercises.conftest import Grade, model_xml, question, with_check
from grader.domain.quiz import CodeQuestion
from grader.domain.run import Job, RunReport, RunStatus
from grader.domain.verdict import Status, Verdict
from grader.errors import NotFound
from grader.grading.exercise import check_exercise, judge_exercise, plan_exercise
from grader.sandbox.jail import Jail

SERVO = question("servo-threshold")
LESSON = {"id": "lesson", "set": {"kp": 2000, "kv": 5}}


def claimed(*values: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array(values, dtype=np.float64)


def judged(exercise: CodeQuestion, **results: np.ndarray[Any, Any]) -> Verdict:
    plan = plan_exercise(exercise, model_xml, 1)
    return judge_exercise(exercise, plan, RunReport(RunStatus.RETURNED, results=results))


def is_right(integrator: str, *claim: float) -> bool:
    exercise = with_check(SERVO, integrators=[integrator], cases=[LESSON])
    return judged(exercise, claim0=claimed(*claim)).status is Status.CORRECT


@pytest.mark.parametrize(
    ("integrator", "claim"),
    [
        ("Euler", (0.0200, 0.0205)),
        ("Euler", (0.0196, 0.0200)),  # decay and spectral radius: 19.93..19.98 ms
        ("Euler", (0.0201, 0.0206)),  # any warning within 3 s: 20.12 ms
        ("Euler", (0.01992, 0.01993)),  # the energy criterion, bisected finely
        ("Euler", (0.02012, 0.02013)),  # other start angles
        ("Euler", (0.0205,)),  # one number: within 0.5 ms
        ("Euler", (0.0195,)),
        ("implicitfast", (0.0248, 0.0253)),
        ("implicitfast", (0.02522, 0.02523)),
        ("implicit", (0.0250, 0.0252)),
        ("RK4", (0.0333, 0.0337)),
        ("discrete", ()),
    ],
)
def test_reasonable_readings_are_right(integrator: str, claim: tuple[float, ...]) -> None:
    assert is_right(integrator, *claim)


@pytest.mark.parametrize(
    ("integrator", "claim"),
    [
        ("Euler", ()),
        ("Euler", (0.0190, 0.0195)),
        ("Euler", (0.0203, 0.0208)),
        ("Euler", (0.0193,)),
        ("Euler", (0.0208,)),
        ("Euler", (0.0198, 0.0204)),  # 0.6 ms wide
        ("Euler", (0.0202, 0.0200)),
        ("Euler", (0.02237,)),  # the bound
        ("Euler", (20.0, 20.0004)),
        ("Euler", (-0.02, -0.0196)),
        ("Euler", (1e-12, 1e-11)),
        ("implicitfast", (0.0222, 0.0226)),
        ("RK4", (0.0575, 0.0578)),  # the window in which RK4 seems stable again
        ("discrete", (0.0201, 0.0203)),
        ("discrete", (0.05, 0.0505)),
    ],
)
def test_wrong_claims_are_wrong(integrator: str, claim: tuple[float, ...]) -> None:
    assert not is_right(integrator, *claim)


def test_none_is_right_exactly_where_nothing_is_unstable_and_alone_is_partial() -> None:
    verdict = judged(SERVO, **{f"claim{i}": claimed() for i in range(12)})
    assert verdict.status is Status.PARTIAL
    right = {finding.id for finding in verdict.findings if finding.passed}
    assert right == {
        "lesson.discrete",
        "heavier-and-longer.discrete",
        "stiffer.discrete",
        "heavily-damped.discrete",
        "heavily-damped.implicitfast",
    }


@pytest.mark.parametrize(
    "results",
    [
        {},
        {"claim0": np.array(["x"])},
        {"claim0": np.zeros((2, 2))},
        {"claim0": np.array([0.02, 0.0204, 0.03])},
        {"other0": np.array([255, 254], dtype=np.uint8)},
        {"claim0": np.array([1, 2], dtype=np.int64)},
    ],
)
def test_forged_results_are_a_wrong_answer_and_never_a_fault(results: dict[str, Any]) -> None:
    exercise = with_check(SERVO, integrators=["Euler"], cases=[LESSON])
    assert judged(exercise, **results).status is Status.INCORRECT


@pytest.mark.parametrize("status", [status for status in RunStatus if status is not RunStatus.RETURNED])
def test_a_script_that_did_not_return_gets_the_status_of_that_name(status: RunStatus) -> None:
    verdict = judge_exercise(SERVO, plan_exercise(SERVO, model_xml, 1), RunReport(status, "so it was"))
    assert (verdict.status.value, verdict.diagnosis, verdict.points) == (status.value, "so it was", 0.0)


def test_hidden_cases_are_drawn_by_the_seed_and_stay_hidden() -> None:
    one, same, other = (plan_exercise(SERVO, model_xml, seed) for seed in (1, 1, 2))
    assert one.inputs == same.inputs
    assert one.inputs["models"][0] == other.inputs["models"][0]
    assert all(a != b for a, b in zip(one.inputs["models"][1:], other.inputs["models"][1:], strict=True))
    verdict = judged(SERVO, **{f"claim{i}": claimed(0.0123, 0.0125) for i in range(12)})
    hidden = [finding for finding in verdict.findings if finding.title.startswith("hidden case")]
    assert len(hidden) == 9
    told = json.dumps([f.model_dump(include={"title", "message", "measured", "expected"}) for f in hidden])
    for cell in one.problem.cells:
        if cell.hidden:
            model = cell.scene.model
            for number in (model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 2], model.body_mass[1]):
                assert f"{abs(number):.4g}" not in told
    assert {picture["case"].partition(".")[0] for picture in verdict.evidence["stability"]} == {"lesson"}


@pytest.mark.parametrize("seed", range(40))
def test_every_draw_has_a_limit_well_inside_the_search(seed: int) -> None:
    cells = {cell.id: cell for cell in plan_exercise(SERVO, model_xml, seed).problem.cells}
    for case, integrator in (
        ("heavier-and-longer", "implicitfast"),
        ("stiffer", "implicitfast"),
        ("heavily-damped", "Euler"),
    ):
        scene = cells[f"{case}.{integrator}"].scene
        inertia, kv = float(scene.model.dof_M0[0]), float(-scene.model.actuator_biasprm[0, 2])
        kp = float(scene.model.actuator_gainprm[0, 0])
        limit = 2 * inertia / kv if case == "heavily-damped" else 2 * (inertia / kp) ** 0.5 + kv / kp
        assert 0.002 < limit < 0.045


OTHER_MODEL = """
<mujoco model="gate">
  <option timestep="0.005"/>
  <worldbody>
    <body name="gate" pos="0 0 1">
      <joint name="rail" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="3" diaginertia="0.1 0.1 0.1"/>
    </body>
  </worldbody>
  <actuator><position name="ram" joint="rail" kp="4000" kv="20"/></actuator>
</mujoco>"""

RIGHT = """
import mujoco

def stable(model, integrator, h):
    model.opt.integrator, model.opt.timestep = integrator, h
    data = mujoco.MjData(model)
    data.qpos[0] = 0.1
    for _ in range(round(5 / h)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True

def limit(model, integrator):
    low, high = 0.002, 0.08
    if stable(model, integrator, high):
        return None
    while high - low > 0.001:
        middle = (low + high) / 2
        low, high = (middle, high) if stable(model, integrator, middle) else (low, middle)
    return low, high
"""


def test_a_second_exercise_is_json_alone(jail: Jail) -> None:
    raw = {
        "kind": "code",
        "id": "gate",
        "q": "How large may the timestep of the gate be?",
        "entry": "limit",
        "points": 2,
        "limits": {"cpu_s": 10},
        "check": {
            "kind": "threshold",
            "model": "gate",
            "start": {"rail": 0.1},
            "horizon_s": 5,
            "search_s": [0.002, 0.08],
            "width_s": 0.001,
            "integrators": ["Euler", "RK4"],
            "numbers": {"load": {"element": "body[@name='gate']/inertial", "attribute": "mass"}},
            "cases": [{"id": "as-built"}, {"id": "loaded", "hidden": True, "set": {"load": [4, 6]}, "x-note": "y"}],
        },
    }
    exercise = CodeQuestion.model_validate(raw)
    gate: Callable[[str], str] = {"gate": OTHER_MODEL}.__getitem__
    assert check_exercise(exercise, gate, "other.json") == []
    plan = plan_exercise(exercise, gate, 5)
    report = jail.run(Job(RIGHT, plan.driver, plan.inputs, exercise.limits))
    verdict = judge_exercise(exercise, plan, report)
    assert (verdict.status, verdict.points) == (Status.CORRECT, 2)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"integrators": ["Verlet"]}, "check.integrators.0"),
        ({"widht_s": 0.001}, "check.widht_s"),
        ({"search_s": [0.05, 0.001]}, "check"),
        ({"model": "no_such_model"}, "check.cases.0"),
        ({"start": {"knee": 1.0}}, "check.cases.0"),
        ({"cases": [{"id": "a", "set": {"kpp": 1}}]}, "check.cases.0"),
        ({"cases": [{"id": "a"}, {"id": "a"}]}, "check.cases.1.id"),
        ({"numbers": {"kp": {"element": "motor[@name='servo']", "attribute": "kp"}}}, "check.cases.0"),
        ({"numbers": {"kp": {"element": "position[@@", "attribute": "kp"}}}, "check.cases.0"),
        ({"numbers": {"kp": {"element": "./actuator/position", "attribute": "kp"}}}, "check.cases.0"),
        ({"cases": [{"id": "a", "hidden": True, "set": {"mass": [-1, 1]}}]}, "check.cases.0"),
        ({"cases": [{"id": "a", "hidden": True, "set": {"mass": [1, -1]}}]}, "check.cases.0"),
    ],
)
def test_an_authors_mistake_is_a_fault_with_its_key(changes: dict[str, Any], key: str) -> None:
    def models(name: str) -> str:
        if name != "pendulum_servo":
            raise NotFound(f"there is no model {name!r}")
        return model_xml(name)

    faults = check_exercise(with_check(SERVO, **changes), models, "1.3-exercises.json")
    assert faults
    assert faults[0].file == "1.3-exercises.json"
    assert faults[0].key == f"servo-threshold.{key}"
    assert faults[0].why


def test_an_unknown_checker_is_a_fault() -> None:
    faults = check_exercise(with_check(SERVO, kind="guess"), model_xml, "f.json")
    assert [fault.key for fault in faults] == ["servo-threshold.check.kind"]


def test_returning_anything_else_says_what_to_return(grade: Grade) -> None:
    for value in ("'20 ms'", "(None, None)", "True", "float('nan')", "{}", "(1, 2, 3)", "object()"):
        verdict = grade(
            with_check(SERVO, cases=[LESSON]), f"def largest_stable_timestep(model, integrator):\n    return {value}\n"
        )
        assert verdict.status is Status.INCORRECT
        assert "must return (h_stable, h_unstable)" in (verdict.diagnosis or "")


def test_a_crash_says_in_which_call(grade: Grade) -> None:
    source = "def largest_stable_timestep(model, integrator):\n    return (1 / (integrator - 3), 1)\n"
    verdict = grade(question("servo-threshold"), source)
    assert verdict.status is Status.CRASHED
    assert verdict.diagnosis == "ZeroDivisionError: division by zero (model 1 of 4, integrator 3)"
