"""The largest stable timestep: what counts as right, what an author may write, what is told and what is not."""

import json
import re
from collections.abc import Callable
from math import isinf
from typing import Any

import numpy as np
import pytest

from exercises.conftest import Grade, model_xml, question, with_check
from grader.domain.misread import drop_remarks
from grader.domain.run import RunReport, RunStatus
from grader.domain.verdict import Status, Verdict
from grader.errors import NotFound
from grader.exercises import check_exercise, judge_exercise, plan_exercise
from grader.exercises.kinds.threshold.judging.judge import Bracket, judge_claim
from grader.exercises.kinds.threshold.limits import find_accepted_ends
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.exercises.kinds.threshold.wrong_methods import METHODS, ClaimContext
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail

SERVO = question("servo-threshold")
PARAMETERS = ThresholdParameters.model_validate(drop_remarks(SERVO.check.parameters))
HIDDEN = [case.id for case in PARAMETERS.cases if case.hidden]
LESSON = {"id": "lesson", "set": {"kp": 2000, "kv": 5}}


def claimed(*values: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array(values, dtype=np.float64)


def judged(exercise: ScriptQuestion, **results: np.ndarray[Any, Any]) -> Verdict:
    plan = plan_exercise(exercise, model_xml, 1)
    return judge_exercise(exercise, plan, RunReport(RunStatus.RETURNED, results=results, hidden_results=results))


def is_right(integrator: str, *claim: float) -> bool:
    exercise = with_check(SERVO, integrators=[integrator], cases=[LESSON])
    return judged(exercise, t0_claim=claimed(*claim)).status is Status.CORRECT


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


def test_none_everywhere_earns_nothing() -> None:
    verdict = judged(SERVO, **{f"t{i}_claim": claimed() for i in range(21)})
    assert (verdict.status, verdict.points) == (Status.INCORRECT, 0)
    said = {finding.id: finding.message for finding in verdict.findings}
    assert "counts only if you find a limit" in said["hidden-6.implicitfast"]
    assert "None was returned" in said["lesson.implicitfast"]


def test_a_right_none_counts_beside_a_limit_of_the_same_model() -> None:
    verdict = judged(SERVO, t0_claim=claimed(0.0200, 0.0205), t2_claim=claimed(), t5_claim=claimed())
    assert {finding.id for finding in verdict.findings if finding.passed} == {"lesson.Euler", "lesson.discrete"}


def test_none_needs_nothing_where_no_integrator_has_a_limit() -> None:
    exercise = with_check(SERVO, integrators=["discrete"], cases=[LESSON])
    assert judged(exercise, t0_claim=claimed()).status is Status.CORRECT


@pytest.mark.parametrize(
    "results",
    [
        {},
        {"t0_claim": np.array(["x"])},
        {"t0_claim": np.zeros((2, 2))},
        {"t0_claim": np.array([0.02, 0.0204, 0.03])},
        {"t0_other": np.array([255, 254], dtype=np.uint8)},
        {"t0_claim": np.array([1, 2], dtype=np.int64)},
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
    assert (one.inputs, one.hidden_inputs) == (same.inputs, same.hidden_inputs)
    assert one.inputs == other.inputs
    models = [[trial["inputs"]["model"] for trial in plan.hidden_inputs["trials"]] for plan in (one, other)]
    assert [a == b for a, b in zip(*models, strict=True)] == [False] * 18
    verdict = judged(SERVO, **{f"t{i}_claim": claimed(0.0123, 0.0125) for i in range(21)})
    hidden = [finding for finding in verdict.findings if finding.title.startswith("hidden case")]
    assert len(hidden) == 18
    told = json.dumps([f.model_dump(include={"title", "message", "measured", "expected"}) for f in hidden])
    for trial in one.trials:
        if trial.hidden:
            model = trial.problem.scene.model
            for number in (model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 2], model.body_mass[1]):
                assert f"{abs(number):.4g}" not in told
    assert {picture["case"].partition(".")[0] for picture in verdict.evidence["stability"]} == {"lesson"}


BY_NATURE = {
    *((case, "Euler", "Euler everywhere") for case in HIDDEN),
    *((case, "implicitfast", method) for case in HIDDEN[:-1] for method in ("damped joint", "implicitfast everywhere")),
    ("heavily-damped", "Euler", "overshoot"),
}
"""Case, integrator and wrong method, where the method is right: Euler's limit is right under Euler. MuJoCo's
implicitfast treats a joint's damping as it does the servo's. Strong damping lets nothing swing out that is stable."""


LIMITLESS = {("heavily-damped", "implicitfast"), *((case, "discrete") for case in HIDDEN)}


def right_claims(cell: Cell) -> list[Bracket]:
    """The lowest, a middle and the highest right bracket of nearly the allowed width; none where None is right."""
    lowest, highest = find_accepted_ends(PARAMETERS, cell)
    if isinf(lowest):
        return []
    assert 0.009 < lowest < highest < 0.047  # well inside the search
    lows = (lowest + 1e-4, (lowest + highest) / 2, highest - 1e-4)
    claims = [Bracket(low, low + 0.99 * PARAMETERS.width_s) for low in lows]
    assert all(judge_claim(PARAMETERS, cell, claim).passed for claim in claims)
    return claims


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_no_draw_makes_a_wrong_method_right(seed: int) -> None:
    """Nothing that is right is what a known wrong method gives, but where the two are right by nature.

    So the points of a wrong method depend on the method, not on the draw or on where its search happens to end.
    """
    cells = [trial.problem for trial in plan_exercise(SERVO, model_xml, seed).trials]
    first = {cell.integrator.name: cell for cell in reversed(cells)}
    right = {(cell.case, cell.integrator.name): right_claims(cell) for cell in cells if cell.case in HIDDEN}
    assert {key for key, claims in right.items() if not claims} == LIMITLESS
    results = {
        (cell.case, cell.integrator.name, method.id)
        for cell in cells
        for claim in right.get((cell.case, cell.integrator.name), [])
        for method in METHODS
        if method.matches(ClaimContext(PARAMETERS, cell, first[cell.integrator.name]), claim)
    }
    assert results == BY_NATURE


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
    exercise = ScriptQuestion.model_validate(raw)
    gate: Callable[[str], str] = {"gate": OTHER_MODEL}.__getitem__
    assert check_exercise(exercise, gate, "other.json") == []
    plan = plan_exercise(exercise, gate, 5)
    report = jail.run(plan.build_job(RIGHT, exercise.limits))
    verdict = judge_exercise(exercise, plan, report)
    assert (verdict.status, verdict.points) == (Status.CORRECT, 2)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"integrators": ["Verlet"]}, "check.integrators.0"),
        ({"widht_s": 0.001}, "check.widht_s"),
        ({"search_s": [0.05, 0.001]}, "check.search_s"),
        ({"model": "no_such_model"}, "check.model"),
        ({"start": {"knee": 1.0}}, "check.start.knee"),
        ({"cases": [{"id": "a", "set": {"kpp": 1}}]}, "check.cases.0.set.kpp"),
        ({"cases": [{"id": "a"}, {"id": "a"}]}, "check.cases.1.id"),
        ({"numbers": {"kp": {"element": "motor[@name='servo']", "attribute": "kp"}}}, "check.numbers.kp.element"),
        ({"numbers": {"kp": {"element": "position[@@", "attribute": "kp"}}}, "check.numbers.kp.element"),
        ({"numbers": {"kp": {"element": "./actuator/position", "attribute": "kp"}}}, "check.numbers.kp.element"),
        ({"cases": [{"id": "a", "hidden": True, "set": {"mass": [-1, 1]}}]}, "check.cases.0.set.mass"),
        ({"cases": [{"id": "a", "hidden": True, "set": {"mass": [1, -1]}}]}, "check.cases.0.set.mass"),
    ],
)
def test_an_authors_mistake_is_a_fault_with_its_key(changes: dict[str, Any], key: str) -> None:
    def models(name: str) -> str:
        if name != "pendulum_servo":
            raise NotFound(f"there is no model {name!r}")
        return model_xml(name)

    cases = [{"id": "a", "set": {"kp": 1}}, {"id": "b", "set": {"kp": 2}}]
    faults = check_exercise(with_check(SERVO, **{"cases": cases, **changes}), models, "1.3-exercises.json")
    assert [(fault.file, fault.key) for fault in faults] == [("1.3-exercises.json", f"servo-threshold.{key}")]
    assert faults[0].why


def test_an_unknown_checker_is_a_fault() -> None:
    faults = check_exercise(with_check(SERVO, kind="guess"), model_xml, "f.json")
    assert [fault.key for fault in faults] == ["servo-threshold.check.kind"]
    assert "rk4" in faults[0].why
    assert "threshold" in faults[0].why


def test_returning_anything_else_says_what_to_return(grade: Grade) -> None:
    for value in ("'20 ms'", "(None, None)", "True", "float('nan')", "{}", "(1, 2, 3)", "object()"):
        verdict = grade(
            with_check(SERVO, cases=[LESSON]), f"def largest_stable_timestep(model, integrator):\n    return {value}\n"
        )
        assert verdict.status is Status.INCORRECT
        assert re.search(r"return \(h_stable|return None alone, else two numbers, \(h_stable", verdict.diagnosis or "")


@pytest.mark.parametrize("value", ["10**400", "10**5000", "(0.01, 10**400)"])
def test_a_whole_number_too_large_for_a_float_is_told_so(value: str, grade: Grade) -> None:
    source = f"def largest_stable_timestep(model, integrator):\n    return {value}\n"
    verdict = grade(with_check(SERVO, cases=[LESSON]), source)
    assert verdict.status is Status.INCORRECT
    assert "a whole number too large for a float" in (verdict.diagnosis or "")


@pytest.mark.parametrize(
    "pair",
    [
        "[np.array([a]), np.array([b])]",
        "np.array([[a], [b]])",
        "(np.array(a), np.float64(b))",
        "np.array([a, b])",
        "np.array([(a + b) / 2])",
        "np.longdouble((a + b) / 2)",
    ],
)
def test_arrays_of_one_element_are_numbers(pair: str, grade: Grade) -> None:
    exercise = with_check(SERVO, integrators=["Euler"], cases=[LESSON])
    head = "import numpy as np\n\ndef largest_stable_timestep(model, integrator):\n    a, b = 0.0199, 0.0203\n"
    source = f"{head}    return {pair}\n"
    assert grade(exercise, source).status is Status.CORRECT


COUNTING = """
import mujoco

plain = mujoco.MjModel.from_xml_string

def counted(*arguments):
    print("compiled")
    return plain(*arguments)

mujoco.MjModel.from_xml_string = counted

def largest_stable_timestep(model, integrator):
    print(model.opt.timestep)
    model.opt.timestep = 1
"""


def test_every_call_gets_a_fresh_model_which_is_not_compiled_again(run: Callable[..., RunReport]) -> None:
    report = run(SERVO, COUNTING)
    assert report.stdout.split() == ["0.002"] * len(PARAMETERS.integrators)
