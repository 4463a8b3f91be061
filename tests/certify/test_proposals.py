"""Proposals for keys without a `verify`: true keys hold under what is proposed, and pasting it makes the check certify
them; no false key is said to hold. True keys are closed forms, of numbers that hypothesis draws."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.certify import certify_key
from grader.certify.keys import certify_quizzes, propose_for_key
from grader.certify.proposals import LabScene, Proposal, propose_verify
from grader.certify.proposals.expressions import multiply
from grader.certify.proposals.scenes import write_control
from grader.certify.wording import Way, read_question, read_ways
from grader.domain.lab import LabConfig, Select, Slider
from grader.grading.checking import check_content
from grader.library import PassedChecks, load
from grader.questions import Question, kind_of, question_adapter

pytestmark = pytest.mark.slow

QUESTION = question_adapter()
M_IN = {"m": 1.0, "mm": 1000.0, "cm": 100.0}
S_IN = {"s": 1.0, "ms": 1000.0}


def oscillator(mass: float, rate: float, damping: float = 0.0) -> str:
    """MJCF of a mass on a spring that swings at `rate` [rad/s]."""
    spring = mass * rate**2
    return f"""<mujoco><option timestep="0.01" gravity="0 0 0" integrator="RK4"/><worldbody><body>
      <joint name="rail" type="slide" axis="1 0 0" stiffness="{spring!r}" damping="{damping!r}"/>
      <geom size=".1" mass="{mass!r}"/></body></worldbody></mujoco>"""


def lab(xml: str, start: float, seconds: float = 5.0, **more: Any) -> dict[str, Any]:
    return {
        "xml": xml, "seconds": seconds,
        "controls": [{"label": "start", "apply": "data.qpos[0] = value", "min": -9, "max": 9, "value": start,
                      "init": True}],
        "plots": [{"ylabel": "place (m)", "traces": [{"label": "place", "expr": "data.qpos[0]"}]}],
        "readouts": [{"label": "speed", "expr": "data.qvel[0]", "unit": "m/s"}], **more,
    }  # fmt: skip


def ask(raw: dict[str, Any]) -> Question:
    return QUESTION.validate_python({"id": "x", **json.loads(json.dumps(raw))})


def propose(raw: dict[str, Any]) -> Proposal | None:
    """Returns the proposal for the first key of a question with a simulation of its own."""
    question = ask(raw)
    (key, *_), config = kind_of(question).answer_keys(question), kind_of(question).lab(question)
    assert config is not None and config.xml is not None
    text = question.q if not key.place else f"{question.q} {key.text}"
    return propose_verify(key, [LabScene(config, config.xml, is_own=True)], dict[str, str]().__getitem__, text)


def certify_pasted(raw: dict[str, Any], proposal: Proposal) -> str:
    """Returns the verdict on the key once what is proposed has been pasted into the question."""
    pasted = json.loads(f"{json.dumps(raw)[:-1]}, {proposal.paste}}}")
    (key,) = kind_of(ask(pasted)).answer_keys(ask(pasted))
    certificate = certify_key(key, dict[str, str]().__getitem__)
    assert certificate is not None
    return certificate.verdict


@dataclass(frozen=True)
class Asked:
    """A question about an oscillator that swings at `rate` from `start`: what it asks, and the closed form."""

    words: str
    units: dict[str, float]
    true: Any


ASKED = [
    Asked("What is the largest speed?", {f"{unit}/s": size for unit, size in M_IN.items()}, lambda w, a: a * w),
    Asked("What is the period?", S_IN, lambda w, a: 2 * math.pi / w),
    Asked("What is the angular frequency?", {"rad/s": 1.0}, lambda w, a: w),
    Asked("What is the frequency?", {"Hz": 1.0}, lambda w, a: w / (2 * math.pi)),
    Asked("Where is it after 0.7 s?", M_IN, lambda w, a: a * math.cos(0.7 * w)),
    Asked("What is the lowest place that it reaches?", M_IN, lambda w, a: -a),
    Asked("How large is the amplitude of the place?", M_IN, lambda w, a: a),
    Asked("How far is it from peak to peak?", M_IN, lambda w, a: 2 * a),
]


@st.composite
def draw_numeric(draw: st.DrawFn) -> dict[str, Any]:
    asked = draw(st.sampled_from(ASKED))
    rate, start = (
        draw(st.floats(2.5, 9).map(lambda x: round(x, 2))),
        draw(st.floats(0.1, 0.9).map(lambda x: round(x, 2))),
    )
    unit = draw(st.sampled_from(sorted(asked.units)))
    mass = draw(st.floats(0.5, 4).map(lambda x: round(x, 1)))
    true = asked.units[unit] * asked.true(rate, start)
    size = 0.02 * abs(asked.units[unit] * asked.true(rate, start) or 1.0)
    raw = {"kind": "numeric", "q": asked.words, "answer": float(f"{true:.5g}"), "unit": unit, "tol": size}
    return raw | {"sim": lab(oscillator(mass, rate), start)}


def is_near_zero(raw: dict[str, Any]) -> bool:
    answer: float = raw["answer"]
    return abs(answer) < 0.02 * max(M_IN.get(raw["unit"], 0.0), 1e-3)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(draw_numeric().filter(lambda raw: not is_near_zero(raw)))
def test_a_true_number_holds_and_what_is_pasted_certifies_it(raw: dict[str, Any]) -> None:
    proposal = propose(raw)
    assert proposal is not None and proposal.holds, proposal
    assert certify_pasted(raw, proposal) == "certified"


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    draw_numeric().filter(lambda raw: not is_near_zero(raw)),
    st.sampled_from((2.0, 0.5, 1.1, 1 / 1.1, 10.0, 1000.0, math.pi, 180 / math.pi, math.pi / 180, -1.3)),
)
def test_no_false_number_is_said_to_hold(raw: dict[str, Any], factor: float) -> None:
    wrong = raw["answer"] * factor
    false = raw | {"answer": float(f"{wrong:.5g}"), "tol": min(0.02 * abs(wrong), raw["tol"])}
    proposal = propose(false)
    assert proposal is not None and not proposal.holds, proposal
    assert "where the key says" in str(proposal)
    (key,) = kind_of(ask(false)).answer_keys(ask(false))
    assert certify_key(key, dict[str, str]().__getitem__) is None, "a proposal refutes nothing"


@st.composite
def draw_prediction(draw: st.DrawFn) -> tuple[dict[str, Any], int]:
    """A predict question, and the right one of its options."""
    rate, start = (
        draw(st.floats(2.5, 9).map(lambda x: round(x, 2))),
        draw(st.floats(0.1, 0.9).map(lambda x: round(x, 2))),
    )
    mass = draw(st.floats(0.5, 4).map(lambda x: round(x, 1)))
    right = draw(st.integers(0, 2))
    if draw(st.booleans()):
        peak = start * rate
        options = [f"{peak * factor:.3g} m/s" for factor in (0.6, 1.5)]
        options.insert(right, f"{peak:.3g} m/s")
        raw: dict[str, Any] = {
            "q": "What is the largest speed?",
            "options": options,
            "sim": lab(oscillator(mass, rate), start),
        }
        return raw | {"kind": "predict"}, right
    words = ["It rises", "It stays", "It falls"]
    push = {0: 1.0, 1: 0.0, 2: -1.0}[right]
    xml = oscillator(mass, rate, damping=2 * mass * rate)
    sim = lab(xml, 0.0, controller=f"data.qfrc_applied[0] = {push * mass * rate**2 * start!r}") | {"readouts": []}
    return {"kind": "predict", "q": "What does its place do?", "options": words, "sim": sim}, right


@settings(max_examples=8, deadline=None, derandomize=True)
@given(draw_prediction(), st.integers(1, 2))
def test_the_right_option_holds_and_no_other(drawn: tuple[dict[str, Any], int], shift: int) -> None:
    raw, right = drawn
    proposal = propose(raw | {"answer": right})
    assert proposal is not None and proposal.holds, proposal
    assert certify_pasted(raw | {"answer": right}, proposal) == "certified"
    other = propose(raw | {"answer": (right + shift) % 3})
    assert other is not None and not other.holds, other
    assert other.gives == proposal.says


def test_the_largest_stable_timestep_of_a_servo_is_proposed() -> None:
    inertia, kp, kv = 0.25, 2000.0, 5.0
    xml = f"""<mujoco><option gravity="0 0 0" integrator="Euler" timestep="0.002"/><worldbody><body>
      <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/><joint name="hinge" axis="0 1 0"/>
      </body></worldbody><actuator><position joint="hinge" kp="{kp}" kv="{kv}"/></actuator></mujoco>"""
    limit_s = (math.sqrt(kv**2 + 4 * inertia * kp) - kv) / kp  # semi-implicit Euler, damper explicit
    raw = {"kind": "numeric", "q": "What is the largest timestep at which it is stable?", "unit": "ms", "tol": 0.1,
           "answer": round(1000 * limit_s, 3), "sim": {"xml": xml, "setup": "data.qpos[0] = 1"}}  # fmt: skip
    proposal = propose(raw)
    assert proposal is not None and proposal.holds, proposal
    assert proposal.verify["by"] == "threshold"
    assert certify_pasted(raw, proposal) == "certified"
    other = propose(raw | {"answer": round(1000 * 2 * math.sqrt(inertia / kp), 3)})
    assert other is not None and not other.holds


def test_a_setting_that_comes_out_on_top_is_proposed() -> None:
    select = {"type": "select", "label": "push", "param": "push", "options": [["gentle", 1], ["firm", 4], ["hard", 9]]}
    sim = lab(oscillator(1, 3, 1), 0.0, controller="data.qfrc_applied[0] = ctx.push", controls=[select])
    raw = {"kind": "predict", "q": "Under which push does it reach the largest place?", "sim": sim,
           "options": ["gentle", "firm", "hard"]}  # fmt: skip
    right, wrong = propose(raw | {"answer": 2}), propose(raw | {"answer": 0})
    assert right is not None and right.holds and certify_pasted(raw | {"answer": 2}, right) == "certified"
    assert wrong is not None and not wrong.holds and wrong.gives == "“hard”"


def test_quantities_that_disagree_say_of_no_option_that_it_holds() -> None:
    both = [{"label": "one", "expr": "data.qpos[0]"}, {"label": "other", "expr": "-data.qpos[0]"}]
    sim = lab(oscillator(1, 3, 6), 0.0, controller="data.qfrc_applied[0] = 5") | {"plots": [], "readouts": both}
    for answer in (0, 1):
        proposal = propose({"kind": "predict", "q": "Then?", "options": ["Up", "Down"], "answer": answer, "sim": sim})
        assert proposal is not None and not proposal.holds
        assert "another option" in str(proposal)


@pytest.mark.parametrize(
    "sim",
    [
        {"xml": "<mujoco/>"},
        lab(oscillator(1, 3), 0.3, controller="data.qpos[0] = 0 / 0"),
        lab(oscillator(1, 3), 0.3, seconds=60.0, setup="model.opt.timestep = 1e-5"),
        lab(oscillator(1, 3), 0.3) | {"readouts": [{"label": "word", "expr": "'up'"}], "plots": []},
    ],
    ids=["nothing moves", "broken", "long", "no number"],
)
@pytest.mark.parametrize("kind", ["numeric", "predict"])
def test_a_simulation_that_gives_nothing_proposes_nothing_and_raises_nothing(kind: str, sim: dict[str, Any]) -> None:
    raw: dict[str, Any] = {"kind": kind, "q": "What is the largest torque?", "answer": 1, "sim": sim}
    raw |= {"unit": "N m"} if kind == "numeric" else {"options": ["It rises", "It falls"]}
    assert propose(raw) is None or not propose(raw).holds  # type: ignore[union-attr]


def test_controls_are_written_as_they_act() -> None:
    slider = Slider(
        label="a", min=0, max=1, value=0.5, set="model.dof_damping[0]", param="a", apply="ctx.b = 2 * value"
    )
    assert write_control(slider) == ["{ ctx.b = 2 * (0.5) }", "model.dof_damping[0] = 0.5", "ctx.a = 0.5"]
    select = Select(type="select", label="s", param="s", options=(("one", (1.0, 2.0)), ("two", "x")))
    assert write_control(select) == ["ctx.s = [1.0, 2.0]"]
    scene = LabScene(
        LabConfig(xml="", setup="ctx.c = 1", controls=(slider.model_copy(update={"init": True}),)), "", True
    )
    assert scene.setup is not None
    assert (
        scene.setup.index("ctx.c")
        < scene.setup.rindex("ctx.b")
        != scene.setup.index("ctx.b")
        < scene.setup.index("ctx.c")
    )


@pytest.mark.parametrize(
    ("text", "quantities", "moments"),
    [
        ("How fast is it at most?", ("max",), ()),
        ("What is the largest speed within 2 s?", ("max",), (2.0,)),
        ("Where is it after 300 ms?", ("end",), (0.3,)),
        ("How long is its period?", ("period",), ()),
        ("What is it?", (), ()),
    ],
)
def test_words_name_quantities_and_moments(text: str, quantities: tuple[str, ...], moments: tuple[float, ...]) -> None:
    asked = read_question(text)
    assert asked.quantities == quantities
    assert asked.moments_s == pytest.approx(moments)


@pytest.mark.parametrize(
    ("question", "options", "ways"),
    [
        ("Then?", ("It rises", "It falls"), [Way.UP, Way.DOWN]),
        ("Does it fall?", ("No", "Yes"), [Way.SAME, Way.DOWN]),
        ("Does it stay?", ("Yes, at once", "No"), [Way.SAME, Way.MOVES]),
        ("Then?", ("It does not move", "It swings"), [Way.SAME, Way.MOVES]),
        ("Then?", ("It rises", "It grows"), None),
        ("Then?", ("Red", "Green"), None),
    ],
)
def test_options_say_how_something_changes(question: str, options: tuple[str, ...], ways: list[Way] | None) -> None:
    assert read_ways(question, options) == ways


@pytest.mark.parametrize(("unit", "rate"), [("Hz", 3 / (2 * math.pi)), ("rpm", 90 / math.pi), ("rad/s", 3)])
def test_a_rate_in_radians_is_converted_where_turns_are_counted(unit: str, rate: float) -> None:
    wheel = "<mujoco><worldbody><body><joint axis='1 0 0'/><geom size='.1'/></body></worldbody></mujoco>"
    sim: dict[str, Any] = {"xml": wheel, "setup": "data.qvel[0] = 3", "seconds": 1}
    sim["readouts"] = [{"label": "rate", "expr": "data.qvel[0]"}]
    for answer, holds in ((rate, True), (3 if unit != "rad/s" else 4, False)):
        raw = {"id": "n", "kind": "numeric", "q": "How fast at the end?", "answer": answer, "unit": unit, "sim": sim}
        question = QUESTION.validate_python(raw)
        (key,) = kind_of(question).answer_keys(question)
        proposal = propose_verify(
            key, [LabScene(LabConfig.model_validate(sim), wheel, is_own=True)], lambda _: "", question.q
        )
        assert proposal is not None
        assert proposal.holds is holds


def test_factors_are_written_so_that_the_unit_can_be_read() -> None:
    assert multiply("data.qpos[0]", 1000) == "1000 * data.qpos[0]"
    assert multiply("data.qpos[0]", 0.001) == "data.qpos[0] / 1000"
    assert multiply("a - b", 180 / math.pi) == "(a - b) * 180 / Math.PI"


def write_course(root: Path, answer: float) -> Path:
    sim = lab(oscillator(2, 5), 0.4)
    swing = {
        "id": "fast",
        "kind": "numeric",
        "q": "What is the largest speed?",
        "answer": answer,
        "unit": "m/s",
        "sim": sim,
    }
    bare = {"id": "bare", "kind": "numeric", "q": "What is the largest torque?", "answer": 3, "unit": "N m"}
    (root / "quizzes").mkdir(parents=True)
    quiz = {"id": "8-q", "title": "Q", "questions": [swing, bare]}
    (root / "quizzes/8-q.json").write_text(json.dumps(quiz), encoding="utf-8")
    return root


@pytest.mark.parametrize(("answer", "holds"), [(2.0, True), (3.0, False)])
def test_a_check_remarks_on_a_proposal_and_passes(tmp_path: Path, answer: float, holds: bool) -> None:
    root, said = write_course(tmp_path / "course", answer), list[str]()
    report = check_content(root, lambda _: pytest.fail("no program runs"), said.append, doing=said.append)
    assert not report.faults and not report.undecided and report.to_json()["ok"]
    (proposal,) = report.to_json()["proposals"]
    assert (proposal["quiz"], proposal["question"], proposal["holds"]) == ("8-q", "fast", holds)
    remarks = {warning.key: warning.why for warning in report.warnings}
    assert proposal["paste"] in remarks["fast.verify"]
    assert ("The key holds" in remarks["fast.verify"]) is holds
    assert ("the simulation gives 2 m/s where the key says 3 m/s" in remarks["fast.verify"]) is not holds
    assert remarks["bare.verify"].startswith("no simulation confirms this key")
    assert "looking for a verify of 8-q fast" in said


def test_a_proposal_is_kept_until_the_question_or_its_simulation_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: list[Any] = []
    actual = LabScene.run

    def run(*given: Any) -> Any:
        runs.append(given)
        return actual(*given)

    monkeypatch.setattr(LabScene, "run", run)
    root, passed = write_course(tmp_path / "course", 2.0), PassedChecks(tmp_path / "passed")

    def propose_all() -> list[Proposal | None]:
        library = load(root)
        every = certify_quizzes(library, library.quizzes, passed)
        return [
            propose_for_key(library, certified.quiz, certified.question, certified.key, passed) for certified in every
        ]

    first = propose_all()
    counted = len(runs)
    assert counted
    assert propose_all() == first and len(runs) == counted
    path = root / "quizzes/8-q.json"
    path.write_text(path.read_text().replace("largest speed", "largest speed of all"), encoding="utf-8")
    propose_all()
    assert len(runs) > counted
