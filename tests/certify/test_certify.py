"""Answer keys against the physics: the lesson's are certified, planted wrong ones refused with the evidence."""

import copy
import json
import math
import re
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from grader.certify import Certificate, certify_key
from grader.certify.keys import find_refused_keys, name_slip
from grader.domain.verify import ByExpression
from grader.errors import NotFound
from grader.library import load
from grader.questions import ModelXml, NumberKey, Question, kind_of, question_adapter
from grader.questions.kinds.choice import ChoiceQuestion
from grader.questions.kinds.number import NumberQuestion
from grader.questions.kinds.predict import PredictQuestion

ROOT = Path(__file__).parents[2]
QUESTION = question_adapter()


def model_xml(name: str) -> str:
    return (ROOT / f"models/{name}.xml").read_text()


def lesson(number: int, **changes: Any) -> Question:
    raw = copy.deepcopy(json.loads((ROOT / "quizzes/1.3-check.json").read_text())["questions"][number - 1])
    return QUESTION.validate_python({"id": f"q{number}", **raw, **changes})


def certify_question(question: Question, xml: ModelXml) -> Certificate | None:
    keys = kind_of(question).answer_keys(question)
    assert len(keys) <= 1
    return certify_key(keys[0], xml) if keys else None


def certify(question: Question) -> Certificate:
    certificate = certify_question(question, model_xml)
    assert certificate is not None
    assert json.loads(json.dumps(certificate.to_json()))["ok"] is certificate.ok
    return certificate


def numeric(answer: float, tol: float, unit: str, **verify: Any) -> Question:
    raw = {"id": "n", "kind": "numeric", "q": "?", "answer": answer, "tol": tol, "unit": unit, "verify": verify}
    return QUESTION.validate_python(raw)


@pytest.mark.parametrize(
    ("answer", "unit", "slip"),
    [
        (2228.45, "s", "would be right in milliseconds (ms), but seconds (s) were asked for"),
        (-2.22845, "s", "has the wrong sign"),
        (1.114225, "s", "is off by a factor of two"),
        (1.7, "s", ""),
    ],
)
def test_a_refuted_number_is_told_its_slip(answer: float, unit: str, slip: str) -> None:
    question = numeric(answer, 0.0123, unit, by="expression", expr="2 * Math.PI * Math.sqrt(1.234 / 9.81)")
    (key,) = kind_of(question).answer_keys(question)
    certificate = name_slip(question, key, certify(question))
    assert certificate.verdict == "refuted"
    assert certificate.why.partition(". Your number ")[2] == (f"{slip}: correct `answer` or `unit`" if slip else "")


def predict(options: list[str], answer: int, sim: dict[str, Any], verify: dict[str, Any] | None = None) -> Question:
    raw = {
        "id": "p",
        "kind": "predict",
        "q": "What is stable?",
        "options": options,
        "answer": answer,
        "sim": sim,
        "verify": verify,
    }
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_an_expression_decides_between_the_settings_of_a_select() -> None:
    options = ["gentle", "<b>firm</b>", "hard"]
    over = {"by": "options", "criterion": "data.qpos[0] > Math.PI", "when": "ever", "seconds": 2}
    certificate = certify(predict(options, 2, PUSHED, over))
    assert certificate.ok
    assert not certify(predict(options, 1, PUSHED, over)).ok


@pytest.mark.parametrize(
    ("text", "is_told"),
    [("Which is stable?", True), ("Stability: which?", True), ("Which is unstable?", False), ("Which is fast?", False),
     ("Which is not stable?", False)],
)  # fmt: skip
def test_stability_that_was_inferred_refutes_no_question_about_something_else(text: str, is_told: bool) -> None:
    raw = json.loads(lesson(3).model_dump_json()) | {"answer": 0, "q": text}
    assert (certify_question(QUESTION.validate_python(raw), model_xml) is not None) is is_told


def test_a_servo_under_another_integrator_is_not_inferred_to_be_explicit() -> None:
    text = "A joint with inertia 0.25 kg m² has kp = 2000, kv = 5. What is the largest stable timestep"
    for rest, is_told in (("under Euler?", True), ("under implicitfast, unlike Euler?", False)):
        raw = {"id": "n", "kind": "numeric", "q": f"{text} {rest}", "answer": 25.0, "tol": 0.5, "unit": "ms"}
        assert (certify_question(QUESTION.validate_python(raw), model_xml) is not None) is is_told


@pytest.mark.parametrize(
    "asked",
    ["What is the largest stable timestep under explicit Euler if kv is doubled?",
     "By explicit Euler, the largest stable timestep is known. How long is a fifth of it?"],
)  # fmt: skip
def test_a_question_that_goes_on_from_the_limit_of_a_servo_is_not_inferred(asked: str) -> None:
    text = f"A servo joint of inertia 0.05 kg m² has kv = 10. {asked}"
    raw = {"id": "n", "kind": "numeric", "q": text, "answer": 5.0, "tol": 0.1, "unit": "ms"}
    assert certify_question(QUESTION.validate_python(raw), model_xml) is None


@pytest.mark.parametrize(
    "beside",
    ["through a gear", "with an armature", "with another damping of 20 N m s/rad", "and has a stiffness",
     "and hangs: a pendulum", "and weighs 2 kg", "in steps of Adams and Bashforth", "and must not overshoot",
     "and shall be free of oscillation", "under explicit Euler for both"],
)  # fmt: skip
def test_a_servo_with_more_than_inertia_and_damping_is_not_inferred(beside: str) -> None:
    """Each of these has another limit: gear² kv counts, the armature is inertia, 2.5 ms is where overshoot begins."""
    text = (
        "A servo joint of inertia 0.05 kg m² has kv = 20 N m s/rad {}. What is the largest stable timestep under Euler?"
    )
    for words, is_told in (("", True), (beside, False)):
        raw = {"id": "n", "kind": "numeric", "q": text.format(words), "answer": 5.0, "tol": 0.1, "unit": "ms"}
        assert (certify_question(QUESTION.validate_python(raw), model_xml) is not None) is is_told


@pytest.mark.parametrize(
    ("text", "is_told"),
    [("In which stage of <code>mj_step</code> is collision detection performed?", True),
     ("Which stage of mj_step finds the contacts?", True),
     ("Which stage of mj_step follows directly on the one in which collision detection runs?", False),
     ("In which stage of mj_step are the forces of the contacts that collision detection has found computed?", False),
     ("Which stage of mj_step does not run collision detection?", False)],
)  # fmt: skip
def test_a_stage_is_inferred_where_the_question_asks_for_the_contacts_alone(text: str, is_told: bool) -> None:
    options = ["Position stage", "Velocity stage", "Actuation stage"]
    raw = {"id": "s", "kind": "mcq", "q": text, "options": options, "answer": 1}
    certificate = certify_question(QUESTION.validate_python(raw), model_xml)
    assert (certificate is not None) is is_told
    if certificate is not None:
        assert certificate.verdict == "refuted"
        assert '{"by": "hand"' in certificate.why


def test_a_key_that_is_derived_by_hand_is_published_with_its_reason_and_nothing_is_inferred() -> None:
    by_hand = {"by": "hand", "accept": "It asks for another stage than it seems to."}
    raw = lesson(1, answer=2).model_dump(mode="json") | {"verify": by_hand}
    certificate = certify(QUESTION.validate_python(raw))
    assert (certificate.verdict, certificate.is_publishable) == ("cannot tell", True)
    with pytest.raises(ValidationError):
        QUESTION.validate_python(raw | {"verify": {"by": "hand"}})


def test_a_select_that_says_nothing_about_stability_is_not_guessed_at() -> None:
    assert certify_question(predict(["gentle", "firm", "hard"], 0, PUSHED), model_xml) is None


def test_settings_that_contradict_their_options_are_refused() -> None:
    """Exchanged by mistake, they would certify the wrong option."""
    for labels, is_told in ((("gentle", "firm"), False), (("firm", "gentle"), True)):
        settings = [{SELECT_SPEED["label"]: label} for label in labels]
        verify = {"by": "options", "settings": settings, "criterion": "data.qpos[0] > 0", "seconds": 0.1}
        certificate = certify(predict(["gentle", "firm"], 0, PUSHED, verify))
        assert ("is a setting itself" in certificate.why) is is_told


def test_stages_that_contradict_the_words_of_their_options_are_refused() -> None:
    raw = {"id": "s", "kind": "mcq", "q": "?", "options": ["Position stage", "Velocity stage"], "answer": 1}
    verify = {"by": "stage", "fills": "xpos", "stages": ["mj_fwdVelocity", "mj_fwdPosition"]}
    certificate = certify(QUESTION.validate_python({**raw, "verify": verify}))
    assert (certificate.verdict, "exchanged" in certificate.why) == ("cannot tell", True)


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


TOGGLE = """<mujoco><compiler angle="radian"/><option timestep="0.001" gravity="0 0 0"/><worldbody>
  <site name="wall" pos="0.6 0 0.3"/>
  <body><inertial pos="0 0 0.5" mass="1" diaginertia=".01 .01 .01"/>
    <joint axis="0 1 0" damping="0.05" stiffness="10"/><site name="arm" pos="0 0 0.5"/></body></worldbody>
  <tendon><spatial stiffness="1000" springlength="0.25"><site site="wall"/><site site="arm"/></spatial></tendon>
</mujoco>"""


@pytest.mark.parametrize(("start", "limit_ms"), [(1.33, 111.6), (0.5, 70.6)])
def test_the_limit_is_that_of_the_well_in_which_the_motion_begins(start: float, limit_ms: float) -> None:
    """A toggle comes to rest on either side, and is held there by different stiffnesses."""
    for answer, verdict in ((limit_ms, "certified"), (182.2 - limit_ms, "refuted")):
        question = numeric(answer, 2, "ms", by="threshold", xml=TOGGLE, qpos=[start])
        assert certify(question).verdict == verdict


def test_a_limit_under_another_integrator_than_the_models_own_is_remarked_on() -> None:
    spring = """<mujoco><option gravity="0 0 0" integrator="implicitfast"/><worldbody><body>
    <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><joint type="slide" stiffness="500" damping="2"/>
    </body></worldbody></mujoco>"""
    verify = {"by": "threshold", "xml": spring, "qpos": [0.3], "low": 0.01, "high": 0.3}
    question = {"id": "q", "kind": "numeric", "q": "?", "answer": 130.0, "tol": 50, "unit": "ms"}
    for more, remarks in ({}, 1), ({"integrator": "Euler"}, 0), ({"xml": spring.replace("implicitfast", "Euler")}, 0):
        certificate = certify(QUESTION.validate_python({**question, "verify": {**verify, **more}}))
        assert sum("own integrator is implicitfast" in remark for remark in certificate.remarks) == remarks


def test_a_key_of_another_model_than_the_one_shown_is_remarked_on() -> None:
    verify = {
        "by": "measurement",
        "model": "pendulum",
        "setup": "data.qpos[0] = 1",
        "seconds": 0.1,
        "expr": "data.time",
    }
    question = {"id": "q", "kind": "numeric", "q": "?", "answer": 0.1, "unit": "s", "verify": verify}
    for shown in ("pendulum", "double_pendulum"):
        sim = {"model": shown, "readouts": [{"label": "t", "expr": "data.time"}]}
        certificate = certify(QUESTION.validate_python({**question, "sim": sim}))
        assert any("shows double_pendulum" in remark for remark in certificate.remarks) is (shown != "pendulum")


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
    # Source: DOP853 gives -2.80059: the closed form is of small angles and without damping.
    assert certify(numeric(-2.80059, 0.001, "mrad", **period, timestep="any")).ok
    assert certify(numeric(-2.80059, 0.001, "mrad", **period)).verdict == "cannot tell"
    assert certify(numeric(-2.787, 0.001, "mrad", **period)).verdict == "refuted"
    refused = certify(numeric(-2.80059342, 1e-10, "mrad", **period))
    assert refused.verdict == "cannot tell"
    assert "more than a fifth of the tolerance" in refused.why


@pytest.mark.slow
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
    "verify",
    [
        {"by": "magic"},
        {"by": "expression"},
        {"by": "expression", "expr": "1", "extra": 1},
        {"by": "threshold", "servo": {"inertia": 1, "kv": 1}, "low": 0.1, "high": 0.05},
        {"by": "threshold", "servo": {"inertia": 1, "kv": 1}, "model": "pendulum"},
        {"by": "expression", "expr": "1", "model": "pendulum", "xml": "<mujoco/>"},
    ],
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


MUSCLE = """<mujoco>
<worldbody><body><joint name="j" type="slide" damping="1"/><geom size="0.1" mass="1"/></body></worldbody>
<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
<actuator><muscle joint="j" lengthrange="0.5 1.5"/></actuator></mujoco>"""
STAGES = ["Position stage", "Velocity stage", "Actuation stage", "Constraint stage", "Integration"]


@pytest.mark.parametrize(
    ("field", "right"),
    [("ten_length", 0), ("ten_velocity", 1), ("qfrc_passive", 1), ("act_dot", 2), ("qfrc_actuator", 2), ("act", 4)],
)
def test_a_field_that_is_0_at_rest_is_filled_in_motion(field: str, right: int) -> None:
    raw = {"id": "s", "kind": "mcq", "q": "Which stage?", "options": STAGES}
    verify = {"by": "stage", "fills": field, "xml": MUSCLE}
    for answer in range(len(STAGES)):
        certificate = certify(QUESTION.validate_python({**raw, "answer": answer, "verify": verify}))
        assert certificate.verdict == ("certified" if answer == right else "refuted"), certificate.why


def test_a_field_that_no_stage_fills_refutes_no_key() -> None:
    verify = {"by": "stage", "fills": "qfrc_inverse", "xml": MUSCLE}
    raw = {"id": "s", "kind": "mcq", "q": "Which stage?", "options": [*STAGES, "None of them"], "answer": 5}
    certificate = certify(QUESTION.validate_python({**raw, "verify": verify}))
    assert (certificate.verdict, certificate.key) == ("cannot tell", "verify.fills")


SENSED = """<mujoco><option><flag energy="enable"/></option>
<worldbody><body><joint name="j"/><geom size="0.1" pos="0.3 0 0.2"/><site name="at"/></body></worldbody>
<sensor>{}</sensor></mujoco>"""


@pytest.mark.parametrize(
    ("field", "sensor", "right"),
    [("sensordata", '<jointpos joint="j"/>', 0), ("sensordata", '<jointvel joint="j"/>', 1),
     ("sensordata", '<accelerometer site="at"/>', 3), ("energy", "", 0), ("cacc", '<accelerometer site="at"/>', 3)],
)  # fmt: skip
def test_what_sensors_and_energies_hold_is_filled_behind_its_stage(field: str, sensor: str, right: int) -> None:
    verify = {"by": "stage", "fills": field, "xml": SENSED.format(sensor)}
    raw = {"id": "s", "kind": "mcq", "q": "Which stage?", "options": STAGES, "answer": right}
    certificate = certify(QUESTION.validate_python({**raw, "verify": verify}))
    assert certificate.ok, certificate.why


def test_an_input_of_a_step_is_told_as_one() -> None:
    raw = {"id": "s", "kind": "mcq", "q": "Which stage?", "options": STAGES, "answer": 0}
    certificate = certify(QUESTION.validate_python({**raw, "verify": {"by": "stage", "fills": "ctrl"}}))
    assert "data.ctrl is an input of mj_step" in certificate.why


def test_a_number_alone_is_no_derivation_and_an_array_no_number() -> None:
    remarked = certify(numeric(42, 0.1, "m", by="expression", expr="42"))
    assert [remark for remark in remarked.remarks if "a number alone" in remark]
    measured = certify(numeric(6, 0.1, "m", by="measurement", xml=SENSED.format(""), expr="2*3", seconds=0.1))
    assert [remark for remark in measured.remarks if "a number alone" in remark]
    told = {"by": "measurement", "xml": SENSED.format(""), "expr": "data.site_xpos", "when": "max", "seconds": 0.1}
    refused = certify(numeric(42, 0.1, "m", **told))
    assert (refused.verdict, refused.key) == ("cannot tell", "verify.expr")
    assert "expr gives 3 numbers" in refused.why


@pytest.mark.parametrize(
    ("text", "expr", "is_alone"),
    [
        ("How high?", "2*3", True),
        ("How high?", "Math.sqrt(2 * 0.9 / 9.81)", True),
        ("How long does it fall 0.9 m?", "Math.sqrt(2 * 0.9 / 9.81)", False),
        ("How long does it fall 90 cm?", "Math.sqrt(2 * 0.9 / 9.81)", False),
        ("How much is 27 of 30?", "27 / 30", False),
        ("How much is 27?", "27", True),
        ("How heavy is it?", "2 * model.body_mass[1]", False),
    ],
)
def test_a_closed_form_over_numbers_of_the_question_is_no_number_alone(text: str, expr: str, is_alone: bool) -> None:
    verify = ByExpression.model_validate({"by": "expression", "expr": expr, "xml": SENSED.format("")})
    key = NumberKey(kind="numeric", text=text, verify=verify, answer=1.0, tolerance=1e3)
    certificate = certify_key(key, model_xml)
    assert certificate is not None and certificate.ok
    assert any("a number alone" in remark for remark in certificate.remarks) is is_alone


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


SPRING = """<mujoco><option gravity="0 0 0"/>
  <worldbody><body><inertial pos="0 0 0" mass="{mass!r}" diaginertia="1 1 1"/>
    <joint name="rail" type="slide" axis="1 0 0" stiffness="{stiffness!r}"/></body></worldbody>
  <actuator><general joint="rail" biastype="affine" gainprm="0" biasprm="0 0 {damper!r}"/></actuator>
</mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize("damped", [False, True])
def test_no_right_limit_of_a_spring_is_refused_by_luck(damped: bool) -> None:
    """From rest: an undamped motion neither decays nor grows below its limit."""
    rng = np.random.default_rng(7 + damped)
    for _ in range(12):
        mass, stiffness = np.exp(rng.uniform(-3, 3)), np.exp(rng.uniform(2, 10))
        damper = np.exp(rng.uniform(-3, 1)) if damped else 0.0
        # Source: Euler's limit for m a = -k x - c v: h = (sqrt(c^2 + 4 m k) - c) / k.
        limit_s = (np.sqrt(damper**2 + 4 * mass * stiffness) - damper) / stiffness
        xml = SPRING.format(mass=float(mass), stiffness=float(stiffness), damper=float(-damper))
        verify = {"by": "threshold", "xml": xml, "qpos": [0.1], "low": limit_s / 4, "high": 3 * limit_s}
        certificate = certify(numeric(1e3 * limit_s, 10 * limit_s, "ms", **verify))
        assert certificate.ok, certificate.why
        off = certify(numeric(1.015e3 * limit_s, 10 * limit_s, "ms", **verify))
        assert not off.ok


def test_where_the_horizon_is_too_short_the_linear_limit_is_compared_with() -> None:
    """A soft servo under gravity: beyond its limit gravity bounds the motion, and MuJoCo never warns."""
    soft = {"model.actuator_gainprm[0]": 20, "model.actuator_biasprm[1]": -20, "model.actuator_biasprm[2]": -0.1}
    verify = {"by": "threshold", "model": "pendulum_servo", "qpos": [0.3], "set": soft, "low": 0.05, "high": 0.4}
    # Source: h = (sqrt(c^2 + 4 I K) - c) / K with K = kp + m g L = 24.905, I = 0.2501, c = 0.1.
    limit_ms = 1e3 * (math.sqrt(0.01 + 4 * 0.2501 * 24.905) - 0.1) / 24.905
    certificate = certify(numeric(round(limit_ms, 3), 2.0, "ms", **verify, criterion="no_warning", seconds=3))
    assert certificate.ok, certificate.why
    assert certificate.measured["compared with"] == "the linear stability limit"
    assert any("too short to decide" in remark for remark in certificate.remarks)
    assert certificate.uncertainty is not None and certificate.uncertainty < 0.4
    plain = certify(numeric(round(limit_ms, 3), 2.0, "ms", **verify))
    assert plain.ok and not plain.remarks


TUMBLING = """<mujoco><option gravity="0 0 0" timestep="0.004" integrator="RK4"/>
  <worldbody><body><joint name="spin" type="ball"/><geom type="box" size=".3 .1 .02" density="1000"/></body></worldbody>
</mujoco>"""

TUMBLES = {"xml": TUMBLING, "setup": "data.qvel.set([0.02, 6, 0.02])"}
"""A box that spins about its intermediate axis, which reverses every few seconds (Dzhanibekov's effect)."""


def history(*claims: Any, answer: int = 0, seconds: float = 8.0) -> Certificate:
    options = [f"option {index}" for index in range(len(claims))]
    verify = {"by": "outcome", "claims": list(claims), "seconds": seconds}
    return certify(predict(options, answer, TUMBLES, verify))


@pytest.mark.slow
def test_how_often_a_body_reverses_is_counted() -> None:
    upright = "data.qvel[1] < 0"

    def flips(at_least: int, at_most: int) -> dict[str, Any]:
        return {"expr": upright, "when": "times", "at_least": at_least, "at_most": at_most}

    counted = history(flips(1, 9), flips(0, 0))
    assert counted.ok, counted.why
    number = counted.measured["option 0"]["times"]
    assert number >= 1
    assert not history(flips(int(number) + 1, 99), flips(0, 0)).ok


@pytest.mark.slow
def test_when_it_reverses_first_and_how_fast_it_is_within_a_window() -> None:
    first = {"expr": "data.qvel[1] < 0", "when": "first"}
    early = history(first | {"at_most": 8.0}, first | {"at_least": 8.0})
    assert early.ok, early.why
    time_s = early.measured["option 0"]["first"]
    assert 0 < time_s < 8
    window = {"expr": "data.qvel[1]", "when": "min", "until": 0.9 * time_s}
    assert history(window | {"at_least": 0}, window | {"at_most": -1}).ok
    later = {"expr": "data.qvel[1]", "when": "min", "since": 0.9 * time_s}
    assert history(later | {"at_most": -1}, later | {"at_least": 0}).ok


@pytest.mark.slow
def test_each_claim_has_its_own_when() -> None:
    ever = {"expr": "data.qvel[1] < 0", "when": "ever"}
    always = {"expr": "data.qvel[1] > 0", "when": "always"}
    assert history(ever, always).ok
    assert not history(ever, always, answer=1).ok


def test_what_never_happens_has_no_first_time() -> None:
    never = {"expr": "data.qvel[1] > 100", "when": "first", "at_least": 0}
    assert history("data.qvel[1] < 100", never, seconds=0.5).ok


def test_a_count_that_hangs_on_the_timestep_is_refused() -> None:
    steps = {"expr": "Math.round(1e3 * data.time) % 3 == 0", "when": "times"}
    refused = history({**steps, "at_most": 2}, {**steps, "at_least": 3}, seconds=0.02)
    assert not refused.ok
    assert "round-off or on the timestep" in refused.why


@pytest.mark.parametrize(
    "claim",
    [
        {"expr": "1", "when": "times"},
        {"expr": "1", "when": "ever", "at_least": 1},
        {"expr": "1", "when": "ever", "since": 2, "until": 1},
        {"expr": "1", "when": "often"},
    ],
)
def test_a_claim_of_another_form_is_no_question(claim: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        history(claim, "true")


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"when": "max", "level": 0.5}, "remove `level`: with when max it has no effect, only with crossing"),
        ({"when": "period", "direction": "down"}, "only with crossing, crossings"),
        ({"when": "end", "count": 2}, "remove `count`: with when end it has no effect, only with crossing"),
        ({"when": "end", "since": 1}, "remove `since`: with when end it has no effect, only with max"),
        ({"when": "mean", "band": 0.1}, "only with settling"),
        ({"when": "settling"}, "give `band`"),
        ({"when": "crossing", "level": 0.5, "direction": "down", "count": 2, "since": 0.01}, None),
        ({"when": "max", "level": None}, None),
    ],
)
def test_a_part_of_a_window_that_has_no_effect_is_refused(given: dict[str, Any], why: str | None) -> None:
    verify = {"by": "measurement", "xml": TUMBLES["xml"], "expr": "data.qvel[1]", "seconds": 0.1, **given}
    question = {"id": "q", "kind": "numeric", "q": "?", "answer": 1.0, "verify": verify}
    with nullcontext() if why is None else pytest.raises(ValidationError, match=re.escape(why)):
        QUESTION.validate_python(question)


def test_a_measurement_of_more_than_its_run_is_refused() -> None:
    verify = {"by": "measurement", "xml": TUMBLES["xml"], "expr": "data.qvel[1]", "when": "max", "seconds": 0.1}
    question = {"id": "q", "kind": "numeric", "q": "?", "answer": 1.0, "verify": {**verify, "until": 2}}
    refused = certify(QUESTION.validate_python(question))
    assert (refused.verdict, refused.key) == ("cannot tell", "verify.until")


@pytest.mark.parametrize(
    ("claim", "why"),
    [
        ("data.qvel[1]", "neither true nor false"),
        ("data.qvel[1] > 100 ? 'fast' : 'slow'", "'slow', which is neither true nor false"),
        ("data.qvel[1] = 3", "assigns: compare with =="),
        ({"expr": "data.qvel[1]", "when": "times", "at_most": 9}, "neither true nor false"),
        ({"expr": "data.qvel[1] > 100", "when": "ever", "since": 5}, "up to 5 s, and it lasts 0.1 s"),
        ({"expr": "data.qvel[1] < 100", "when": "always", "until": 2}, "up to 2 s, and it lasts 0.1 s"),
    ],
)
def test_a_claim_that_says_nothing_true_or_false_is_refused(claim: Any, why: str) -> None:
    """A number that was to be compared counts as true, and what is never looked at as false."""
    refused = history(claim, "data.qvel[1] > 100", seconds=0.1)
    assert (refused.verdict, why in refused.why) == ("cannot tell", True), refused.why


@pytest.mark.parametrize("claim", ["data.ncon + 1", {"expr": "data.qvel[1] < 100", "when": "always", "until": 0.1}])
def test_a_count_is_true_where_it_is_not_0_and_a_window_may_end_with_the_run(claim: Any) -> None:
    assert history(claim, "data.qvel[1] > 100", seconds=0.1).ok


@pytest.mark.slow
def test_a_criterion_may_need_history_too() -> None:
    times = {"expr": "data.qpos[0] > 0.2", "when": "times", "at_least": 2}
    labelled = {"by": "options", "criterion": times, "seconds": 4}
    fast = certify(predict(["gentle", "firm", "hard"], 0, PUSHED, labelled))
    counted = {name: row["times"] for name, row in fast.measured.items()}
    assert counted["gentle"] >= 2


def ten_questions() -> list[Question]:
    """Questions with a right key, of every way to derive one."""
    cart = {"inertia": 2.0, "kp": 500.0, "kv": 2.0}
    euler_ms = 1e3 * (math.sqrt(4 + 4 * 2 * 500) - 2) / 500
    swing = {"by": "measurement", "model": "pendulum", "setup": "data.qpos[0] = 0.01", "seconds": 1.0}
    flips = {"expr": "data.qvel[1] < 0", "when": "ever"}
    return [
        lesson(1),
        lesson(2),
        lesson(3),
        numeric(euler_ms, 1.0, "ms", by="threshold", servo=cart),
        numeric(
            1e3 * (math.sqrt(4 + 4 * 2 * 500) + 2) / 500,
            1.0,
            "ms",
            by="threshold",
            servo=cart,
            integrator="implicitfast",
        ),
        numeric(-2.787, 0.5, "mrad", **swing, expr="data.qpos[0] * 1000"),
        numeric(5, 0.05, "ms", by="expression", expr="1000 * 2 * 0.05 / 20"),
        predict(
            ["gentle", "firm", "hard"],
            2,
            PUSHED,
            {"by": "options", "criterion": "data.qpos[0] > Math.PI", "when": "ever", "seconds": 2},
        ),
        predict(
            ["it reverses", "it does not"],
            0,
            TUMBLES,
            {"by": "outcome", "claims": [flips, {"expr": "data.qvel[1] > 0", "when": "always"}], "seconds": 6},
        ),
        predict(
            ["at rest", "moving"],
            0,
            {"model": "pendulum_servo", "setup": "data.qpos[0] = 1"},
            {"by": "outcome", "claims": ["Math.abs(data.qpos[0]) < 0.01", "Math.abs(data.qpos[0]) >= 0.01"]},
        ),
    ]


@pytest.mark.slow
@pytest.mark.parametrize("number", range(10))
def test_every_other_key_of_a_certified_question_is_refused(number: int) -> None:
    question = ten_questions()[number]
    assert certify(question).ok
    if isinstance(question, NumberQuestion):
        others = [question.answer + sign * 1.5 * question.tolerance for sign in (-1, 1)]
    else:
        assert isinstance(question, ChoiceQuestion | PredictQuestion)
        others = [index for index in range(len(question.options)) if index != question.answer]
    tolerance = {"tol": question.tolerance} if isinstance(question, NumberQuestion) else {}
    for other in others:
        assert not certify(question.model_copy(update={"answer": other, **tolerance})).ok, other


OSCILLATOR = (
    '<mujoco><option gravity="0 0 0" integrator="RK4"/><worldbody><body><joint type="slide" axis="1 0 0" '
    'stiffness="39.4784176"/><geom size="0.1" mass="1"/></body></worldbody></mujoco>'
)


@pytest.mark.parametrize(
    ("expr", "level", "period", "is_remarked"),
    [
        ("Math.abs(data.qpos[0])", 0.05, 0.5, True),
        ("data.qpos[0] ** 2", 0.005, 0.5, True),
        ("data.qpos[0] * data.qpos[0]", 0.005, 0.5, True),
        ("Math.cos(data.qpos[0])", 0.9975, 0.5, True),
        ("lib.norm(data.qpos)", 0.05, 0.5, True),
        ("lib.energy().kinetic", 0.05, 0.5, True),
        ("data.qvel[0]", 0, 1, False),
        ("data.qpos[0]", 0, 1, False),
    ],
)
def test_the_period_of_a_size_is_remarked_on(expr: str, level: float, period: float, is_remarked: bool) -> None:
    told = {"by": "measurement", "xml": OSCILLATOR, "setup": "data.qpos[0] = 0.1", "when": "period", "seconds": 4}
    certificate = certify(numeric(period, 0.01, "s", **told, expr=expr, level=level))
    assert certificate.ok, certificate.why
    assert any("comes by twice" in remark for remark in certificate.remarks) is is_remarked


TURNED = "<mujoco><worldbody><body quat='0.6 0.8 0 0'/></worldbody></mujoco>"


@pytest.mark.parametrize(
    ("numbers", "either_sign", "holds"),
    [((0.6, 0.8), True, True), ((-0.6, -0.8), True, True), ((-0.6, -0.8), False, False), ((-0.6, 0.8), True, False)],
)
def test_numbers_of_either_sign_hold_all_together(
    tmp_path: Path, numbers: tuple[float, ...], either_sign: bool, holds: bool
) -> None:
    fields = [
        {"id": f"n{at}", "label": f"n{at}", "answer": number, "tol": 0.01,
         "verify": {"by": "expression", "xml": TURNED, "expr": f"data.xquat[{4 + at}]"}}
        for at, number in enumerate(numbers)
    ]  # fmt: skip
    question = {"id": "q", "kind": "numbers", "q": "The quaternion?", "fields": fields, "either_sign": either_sign}
    (tmp_path / "quizzes").mkdir()
    (tmp_path / "quizzes/a.json").write_text(json.dumps({"id": "a", "title": "A", "questions": [question]}))
    refused = list(find_refused_keys(load(tmp_path), ["a"]))
    assert (refused == []) == holds, refused
