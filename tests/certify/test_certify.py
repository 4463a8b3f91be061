"""Answer keys against the physics: the lesson's are certified, planted wrong ones refused with the evidence."""

import copy
import json
import time
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from grader.certify import Certificate, certify_question
from grader.domain.quiz import Question
from grader.errors import NotFound

ROOT = Path(__file__).parents[2]
QUESTION: TypeAdapter[Question] = TypeAdapter(Question)


def model_xml(name: str) -> str:
    return (ROOT / f"models/{name}.xml").read_text()


def lesson(number: int, **changes: Any) -> Question:
    raw = copy.deepcopy(json.loads((ROOT / "quizzes/1.3-check.json").read_text())["questions"][number - 1])
    return QUESTION.validate_python({"id": f"q{number}", **raw, **changes})


def certify(question: Question) -> Certificate:
    certificate = certify_question(question, model_xml)
    assert certificate is not None
    assert json.loads(json.dumps(certificate.to_json()))["ok"] is certificate.ok
    return certificate


def numeric(answer: float, tol: float, unit: str, **verify: Any) -> Question:
    raw = {"id": "n", "kind": "numeric", "q": "?", "answer": answer, "tol": tol, "unit": unit, "verify": verify}
    return QUESTION.validate_python(raw)


def predict(options: list[str], answer: int, sim: dict[str, Any], verify: dict[str, Any] | None = None) -> Question:
    raw = {"id": "p", "kind": "predict", "q": "?", "options": options, "answer": answer, "sim": sim, "verify": verify}
    return QUESTION.validate_python(raw)


SELECT_SPEED = {
    "type": "select",
    "label": "push",
    "param": "push",
    "options": [["gentle", 1], ["firm", 4], ["hard", 12]],
    "value": 1,
}
PUSHED = {"model": "pendulum", "controls": [SELECT_SPEED], "setup": "data.qvel[0] = ctx.push"}


def test_the_three_decidable_keys_of_the_lesson_are_certified() -> None:
    certificates = [certify_question(lesson(n), model_xml) for n in (1, 2, 3, 4)]
    assert [c.ok if c else None for c in certificates] == [True, True, True, None]
    assert all(c.cost_ms > 0 for c in certificates if c)


@pytest.mark.cost
def test_the_lessons_keys_are_certified_within_5_s_of_cpu() -> None:
    began = time.process_time()
    for n in (1, 2, 3, 4):
        certify_question(lesson(n), model_xml)
    assert time.process_time() - began < 5


def test_question_1_by_the_stage_that_fills_the_contacts() -> None:
    certificate = certify(lesson(1))
    assert certificate.measured["filled by"] == "mj_fwdPosition"
    assert certificate.measured["calls"]["mj_fwdPosition"] == "0 contacts, then 1 contacts"
    assert [certify(lesson(1, answer=wrong)).ok for wrong in (0, 2, 3)] == [False] * 3


def test_question_2_by_the_damping_limit() -> None:
    certificate = certify(lesson(2))
    assert certificate.answer == pytest.approx(5.0, abs=1e-6)
    assert certificate.measured["stable at"] < 5 < certificate.measured["unstable at"]
    assert certificate.uncertainty is not None
    assert certificate.uncertainty < 0.05 / 5
    refused = certify(lesson(2, answer=10))
    assert not refused.ok
    assert "derived 4.99999" in refused.why
    assert "key says 10" in refused.why


def test_question_3_by_its_lab() -> None:
    certificate = certify(lesson(3))
    assert certificate.answer == 2
    assert certificate.measured["discrete"]["stable"] is True
    assert certificate.measured["Euler"]["warning"] == "BADQACC"
    for wrong in (0, 1, 3):
        refused = certify(lesson(3, answer=wrong))
        assert not refused.ok
        assert "'discrete' came out right" in refused.why
        assert "BADQACC" in refused.why


def test_the_certificate_of_question_3_lists_all_five_and_remarks_on_rk4() -> None:
    certificate = certify(lesson(3))
    table = certificate.measured["all integrators"]
    assert list(table) == ["Euler", "RK4", "implicit", "implicitfast", "discrete"]
    assert [name for name, row in table.items() if row["stable"]] == ["RK4", "discrete"]
    limits = {name: row["limit_ms"] for name, row in table.items()}
    # Source: h = (sqrt(c^2 + 4 I K) -+ c) / K with K = kp + m g L = 20004.905, I = 0.2501, c = 5.
    assert limits["Euler"] == pytest.approx(6.826, abs=2e-3)
    assert limits["implicitfast"] == pytest.approx(7.326, abs=2e-3)
    assert limits["RK4"] == pytest.approx(10.22, abs=5e-3)
    assert limits["discrete"] is None
    assert len(certificate.remarks) == 1
    assert "RK4 (up to 10.22 ms)" in certificate.remarks[0]


def test_none_of_them_is_right_where_none_is() -> None:
    sim = copy.deepcopy(json.loads((ROOT / "quizzes/1.3-check.json").read_text())["questions"][2]["sim"])
    sim["controls"][2]["options"] = [["Euler", 0], ["implicit", 2], ["implicitfast", 3]]
    options = ["Euler", "implicitfast", "None of them"]
    assert certify(predict(options, 2, sim)).ok
    assert not certify(predict(options, 1, sim)).ok


def test_an_expression_decides_between_the_settings_of_a_select() -> None:
    options = ["gentle", "<b>firm</b>", "hard"]
    over = {"by": "options", "criterion": "data.qpos[0] > Math.PI", "when": "ever"}
    certificate = certify(predict(options, 2, PUSHED, over))
    assert certificate.ok
    assert not certify(predict(options, 1, PUSHED, over)).ok


def test_a_select_that_says_nothing_about_stability_is_not_guessed_at() -> None:
    assert certify_question(predict(["gentle", "firm", "hard"], 0, PUSHED), model_xml) is None


def test_a_key_that_hangs_on_round_off_is_refused() -> None:
    balanced = {"model": "pendulum", "controls": [SELECT_SPEED], "setup": "data.qpos[0] = Math.PI"}
    falls = {"by": "options", "criterion": "data.qpos[0] > Math.PI", "seconds": 8}
    refused = certify(predict(["gentle", "firm", "hard"], 0, balanced, falls))
    assert not refused.ok
    assert "round-off" in refused.why


def test_one_run_decides_between_claims() -> None:
    claims = ["Math.abs(data.qpos[0]) < 0.01", "Math.abs(data.qpos[0]) >= 0.01"]
    sim = {"model": "pendulum_servo", "setup": "data.qpos[0] = 1"}
    verify = {"by": "outcome", "claims": claims, "seconds": 3}
    assert certify(predict(["at rest", "still moving"], 0, sim, verify)).ok
    assert not certify(predict(["at rest", "still moving"], 1, sim, verify)).ok


def test_a_threshold_of_a_model_in_the_folder() -> None:
    verify = {
        "by": "threshold",
        "model": "pendulum_servo",
        "qpos": [1.0],
        "set": {"model.actuator_gainprm[0]": 2000, "model.actuator_biasprm[1]": -2000, "model.actuator_biasprm[2]": -5},
        "criterion": "no_warning",
        "low": 0.001,
        "high": 0.05,
    }
    # Source: the simulated limits within 3 s, kp = 2000, kv = 5, from 1 rad.
    assert certify(numeric(20.116, 0.1, "ms", **verify)).ok
    assert certify(numeric(25.194, 0.1, "ms", **verify, integrator="implicitfast")).ok
    refused = certify(numeric(22.365, 0.5, "ms", **verify))
    assert not refused.ok
    assert "derived 20.1" in refused.why


@pytest.mark.parametrize("start", [{"qpos": [1.0]}, {"key": 0}, {"qvel": [1.0]}, {"qpos": [0.5], "qvel": [-1.0]}])
@pytest.mark.parametrize(("integrator", "limit_ms"), [("Euler", 20.004), ("implicitfast", 25.004), ("RK4", 33.05)])
def test_the_linear_stability_limit_does_not_depend_on_the_start(
    start: dict[str, Any], integrator: str, limit_ms: float
) -> None:
    fields = {"model.actuator_gainprm[0]": 2000, "model.actuator_biasprm[1]": -2000, "model.actuator_biasprm[2]": -5}
    weightless = {**fields, "model.opt.gravity[2]": 0}
    verify = {"by": "threshold", "model": "pendulum_servo", "set": weightless, "integrator": integrator, **start}
    # Source: closed forms with K = kp, I = 0.2501 kg m2: h = (sqrt(c^2 + 4 I K) -+ c) / K.
    assert certify(numeric(limit_ms, 0.1, "ms", **verify)).ok


@pytest.mark.parametrize(
    ("answer", "tol", "more", "why"),
    [
        (5.0, 0.0, {}, "the tolerance is 0"),
        (5.0, 0.0, {"criterion": "no_warning"}, "the tolerance is 0"),
        (5.0, 0.1, {"qvel": [0.0]}, "nothing moves from this start"),
        (50.0, 400.0, {}, "derived 4.99"),
    ],
)
def test_why_a_threshold_cannot_be_certified(answer: float, tol: float, more: dict[str, Any], why: str) -> None:
    verify = {"by": "threshold", "servo": {"inertia": 0.05, "kv": 20}, **more}
    assert why in certify(numeric(answer, tol, "ms", **verify)).why


def test_a_mass_that_is_set_counts() -> None:
    cart = """<mujoco>
      <worldbody><body><joint name="rail" type="slide" axis="1 0 0"/><geom size=".1" mass="2"/></body></worldbody>
      <actuator><position joint="rail" kp="500" kv="2"/></actuator>
    </mujoco>"""
    verify = {
        "by": "threshold",
        "xml": cart,
        "qpos": [0.3],
        "set": {"model.opt.gravity[2]": 0, "model.body_mass[1]": 1},
    }
    # Source: h = (sqrt(c^2 + 4 m k) - c) / k with m = 1, c = 2, k = 500.
    assert certify(numeric(85.53, 0.1, "ms", **verify)).ok


def test_a_measurement_must_be_known_to_a_fifth_of_the_tolerance() -> None:
    period = {
        "by": "measurement",
        "model": "pendulum",
        "setup": "data.qpos[0] = 0.01",
        "expr": "data.qpos[0] * 1000",
        "seconds": 1.0,
    }
    # Source: q = q0 cos(w t), w^2 = m g L / I = 4.905 / 0.2501.
    assert certify(numeric(-2.787, 0.5, "mrad", **period)).ok
    refused = certify(numeric(-2.787, 0.001, "mrad", **period))
    assert not refused.ok
    assert "more than a fifth of the tolerance" in refused.why


def test_a_chaotic_measurement_is_refused() -> None:
    tip = {
        "by": "measurement",
        "model": "double_pendulum",
        "key": 0,
        "expr": "lib.sitePos('tip')[2]",
        "seconds": 40,
    }
    refused = certify(numeric(1.0, 0.05, "m", **tip))
    assert not refused.ok
    assert "cannot be decided" in refused.why


def test_a_closed_form_and_the_fields_of_a_model() -> None:
    assert certify(numeric(5, 0.05, "ms", by="expression", expr="1000 * 2 * 0.05 / 20")).ok
    mass = {"by": "expression", "model": "pendulum", "expr": "model.body_mass[1] * 2"}
    assert certify(numeric(2, 0.01, "kg", **mass)).ok
    assert not certify(numeric(3, 0.01, "kg", **mass)).ok


@pytest.mark.parametrize(
    ("key", "verify"),
    [
        ("verify.expr", {"by": "expression", "expr": "1 +"}),
        ("verify.expr", {"by": "expression", "expr": "process.exit()"}),
        ("verify.expr", {"by": "expression", "expr": "0 / 0"}),
        ("verify", {"by": "stage"}),
        ("verify", {"by": "threshold"}),
        ("verify", {"by": "threshold", "model": "nothing"}),
        ("verify.set", {"by": "threshold", "model": "pendulum", "set": {"model.nope": 1}}),
        ("verify", {"by": "threshold", "servo": {"inertia": 1, "kv": 1}, "low": 0.1, "high": 0.05}),
        ("verify.expr", {"by": "measurement", "model": "pendulum", "expr": "data.qpos[9].x", "seconds": 1}),
        ("verify.expr", {"by": "measurement", "model": "pendulum", "expr": "data.timee", "seconds": 1}),
        ("verify.setup", {"by": "measurement", "model": "pendulum", "setup": "data.", "expr": "1", "seconds": 1}),
        ("verify.key", {"by": "measurement", "model": "pendulum", "key": 9, "expr": "1", "seconds": 1}),
        ("verify", {"by": "measurement", "xml": "<mujoco><bad/></mujoco>", "expr": "1", "seconds": 1}),
        ("answer", {"by": "expression", "expr": "2"}),
    ],
)
def test_a_verify_that_cannot_work_is_refused_and_says_where_and_why(key: str, verify: dict[str, Any]) -> None:
    def only_known(name: str) -> str:
        if name == "nothing":
            raise NotFound("There is no model 'nothing'.")
        return model_xml(name)

    certificate = certify_question(numeric(1, 0.1, "s", **verify), only_known)
    assert certificate is not None
    assert (certificate.ok, certificate.key) == (False, key)
    assert len(certificate.why) > 10 and "\n" not in certificate.why


@pytest.mark.parametrize(
    "verify", [{"by": "magic"}, {"by": "expression"}, {"by": "expression", "expr": "1", "extra": 1}]
)
def test_a_verify_of_another_form_is_no_question(verify: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        numeric(1, 0.1, "s", **verify)


def test_a_question_about_another_field_of_the_data() -> None:
    raw = {
        "id": "s",
        "kind": "mcq",
        "q": "Which stage fills qfrc_bias?",
        "options": ["Position stage", "Velocity stage", "Constraint stage"],
        "answer": 1,
        "verify": {"by": "stage", "fills": "qfrc_bias"},
    }
    assert certify(QUESTION.validate_python(raw)).ok
    assert not certify(QUESTION.validate_python({**raw, "answer": 0})).ok


PUSH = {"by": "options", "settings": [{"push": 1}, {"push": 4}, {"push": 12}]}
CLAIMS = ["data.qpos[0] > 3", "data.qpos[0] < 3", "data.timee"]


@pytest.mark.parametrize(
    ("key", "sim", "verify"),
    [
        ("verify.criterion", {}, PUSH | {"criterion": "data.qpos[0"}),
        ("verify.criterion", {}, PUSH | {"criterion": "data.qpos[9].x > 1"}),
        ("verify.claims", {}, {"by": "outcome", "claims": CLAIMS}),
        ("verify", {"setup": "data.qpos[9].x = 1"}, PUSH),
        ("verify", {"setup": "data."}, PUSH),
        ("verify", {}, PUSH | {"settings": [{"push": 1}, {"push": 4}, {"pull": 12}]}),
        ("verify", {"model": "nothing"}, PUSH),
    ],
)
def test_a_lab_that_fails_names_the_key_from_which_the_failing_part_was_taken(
    key: str, sim: dict[str, Any], verify: dict[str, Any]
) -> None:
    def only_known(name: str) -> str:
        if name == "nothing":
            raise NotFound("There is no model 'nothing'.")
        return model_xml(name)

    certificate = certify_question(predict(["gentle", "firm", "hard"], 0, PUSHED | sim, verify), only_known)
    assert certificate is not None
    assert (certificate.ok, certificate.key) == (False, key)
