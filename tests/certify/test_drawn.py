"""Drawn numbers: what derives the key must use them, and a key that cannot be known is given to nobody."""

import json
from pathlib import Path
from typing import Any

import pytest

from grader.certify.drawn import NoKey, certify_corners, settle
from grader.certify.keys import certify_quizzes
from grader.library import PassedChecks, load
from grader.questions import parse_question

CART = """<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody><body><inertial pos="0 0 0" mass="2"
diaginertia="1 1 1"/><joint type="slide" axis="1 0 0" stiffness="500"/></body></worldbody></mujoco>"""
PENDULUM = """<mujoco><option timestep="0.002"/><worldbody><body><inertial pos="0 0 -0.5" mass="1"
diaginertia="1e-4 1e-4 1e-4"/><joint axis="0 1 0"/></body></worldbody></mujoco>"""

NUMERIC = {"kind": "numeric", "q": "With {m} kg?", "draw": {"m": [1, 3]}, "unit": "rad/s", "answer": 15.8}
PREDICT = {
    "kind": "predict", "q": "Where is it with {m} kg?", "draw": {"m": [1, 3]}, "options": ["left", "right"],
    "answer": 0,
}  # fmt: skip
EXPRESSION = {"by": "expression", "expr": "Math.sqrt(500 / 2)"}
OUTCOME = {"by": "outcome", "claims": ["data.qpos[0] < 0", "data.qpos[0] >= 0"], "seconds": 0.2}
LAB = {"xml": CART, "setup": "data.qpos[0] = 0.3"}


def explain(question: dict[str, Any]) -> list[str]:
    failed = certify_corners(parse_question({"id": "q", **question}), lambda _: "")
    return [f"{certificate.key}: {certificate.verdict}: {certificate.why}" for _, certificate in failed]


@pytest.mark.parametrize(
    "question",
    [
        {**NUMERIC, "verify": EXPRESSION},
        {**NUMERIC, "q": "{m} and {k}", "draw": {"m": [1, 3], "k": [1, 2]},
         "verify": {"by": "expression", "expr": "Math.sqrt(250) + 0 * {k}"}},
        {**NUMERIC, "verify": EXPRESSION, "sim": {**LAB, "note": "{m} kg", "setup": "model.body_mass[1] = {m}"}},
        {"kind": "numbers", "q": "With {m} kg", "draw": {"m": [1, 3]},
         "fields": [{"id": "a", "label": "a", "answer": 15.8, "unit": "rad/s", "verify": EXPRESSION}]},
        {**PREDICT, "verify": OUTCOME, "sim": {**LAB, "note": "{m} kg"}},
    ],
)  # fmt: skip
def test_a_number_that_the_key_does_not_come_from_is_told(question: dict[str, Any]) -> None:
    (why,) = explain(question)
    assert why.startswith("draw: cannot tell: {m} is in q, but nothing that derives the key uses it")


@pytest.mark.parametrize(
    "question",
    [
        {**NUMERIC, "verify": {"by": "expression", "expr": "Math.sqrt(500 / {m})"}},
        {**NUMERIC, "verify": {"by": "expression", "expr": "Math.sqrt(250) + 0 * {m}"}},
        {"kind": "numbers", "q": "With {m} kg", "draw": {"m": [1, 3]},
         "fields": [{"id": "a", "label": "a", "answer": 15.8, "unit": "rad/s", "verify": EXPRESSION},
                    {"id": "b", "label": "b", "answer": 2, "verify": {"by": "expression", "expr": "{m}"}}]},
        {**PREDICT, "verify": OUTCOME, "sim": {**LAB, "setup": "data.qpos[0] = 0.3; model.body_mass[1] = {m}"}},
        {**PREDICT, "verify": {**OUTCOME, "claims": ["data.qpos[0] < 0 * {m}", "data.qpos[0] >= 0"]}, "sim": LAB},
    ],
)  # fmt: skip
def test_a_number_that_is_used_somewhere_passes(question: dict[str, Any]) -> None:
    assert explain(question) == []


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({}, "With a = 0.1 the key is 0.0001, and tol is 0.2: it is as large as the answer"),
        ({"draw": {"a": [0.8, 1.3]}}, "With a = 0.8 the key is 0.4096, and tol is 0.2: it is wide"),
        ({"draw": {"a": [0.9, 1.2]}}, ""),
        ({"tol": None}, ""),
        ({"draw": {"a": [-1.8, 2]}, "answer": 0.1, "verify": {"by": "expression", "expr": "{a}"}, "tol": 0.03}, ""),
        ({"tol": 0.6}, ""),  # of which the middle is told
    ],
)
def test_a_tolerance_that_is_too_wide_at_an_end_is_remarked(changes: dict[str, Any], told: str) -> None:
    raw = {
        "id": "q", "kind": "numeric", "q": "Energy {a}^4?", "draw": {"a": [0.1, 2]}, "answer": 1.2155, "tol": 0.2,
        "verify": {"by": "expression", "expr": "{a}**4"}, **changes,
    }  # fmt: skip
    certified = list(certify_corners(parse_question(raw), lambda _: ""))
    assert all(certificate.ok for _, certificate in certified)
    remarks = [one for _, certificate in certified for one in certificate.remarks if "tol is" in one]
    assert len(remarks) == bool(told)
    assert all(told in one for one in remarks)


def test_a_key_that_is_not_known_for_a_learners_numbers_is_given_to_nobody() -> None:
    """From the top, rounding decides to which side a pendulum falls: the ends of the range do not show it."""
    setup = "data.qpos[0] = {a} == 2 ? Math.PI : 0"
    verify = {"by": "measurement", "xml": PENDULUM, "setup": setup, "expr": "Math.sin(data.qpos[0])", "seconds": 6}
    raw = {"kind": "numeric", "q": "From {a}?", "draw": {"a": [1, 4]}, "answer": 0, "tol": 0.05, "verify": verify}
    question = parse_question({"id": "q", **raw})
    assert explain(raw) == []
    assert settle(question, {"a": 3}, lambda _: "").answer == 0  # type: ignore[attr-defined]
    with pytest.raises(NoKey, match=r"for a = 2 cannot be derived: .* nudged"):
        settle(question, {"a": 2}, lambda _: "")


def test_a_key_far_below_the_middle_is_derived_to_its_own_tolerance() -> None:
    """The limits are 2 sqrt(m / k): 2 % of that in the middle are a third of the shortest."""
    verify = {"by": "threshold", "xml": CART.replace('"2"', '"{m}"'), "qpos": [0.3], "low": 1e-3, "high": 0.5}
    raw = {"kind": "numeric", "q": "With {m} kg?", "draw": {"m": [0.02, 3.98]}, "answer": 126.5, "unit": "ms"}
    question = parse_question({"id": "q", **raw, "verify": verify})
    assert settle(question, {"m": 0.02}, lambda _: "").answer == pytest.approx(12.649, rel=0.002)  # type: ignore[attr-defined]


def test_a_key_that_changes_its_sign_between_the_ends_needs_a_tolerance() -> None:
    wave = {"answer": 0.18, "verify": {"by": "expression", "expr": "0.2 * Math.cos(2 * Math.sqrt({k} / 2))"}}
    told = explain({"kind": "numeric", **wave, "q": "{k}?", "draw": {"k": [20, 320]}})
    assert [why.partition(":")[0] for why in told] == ["tol"]


@pytest.mark.parametrize(
    ("draw", "tol", "is_told"), [([-1, 2], None, True), ([-1, 2], 0.1, False), ([1, 2], None, False)]
)
def test_a_key_of_either_sign_needs_a_tolerance(draw: list[float], tol: float | None, is_told: bool) -> None:
    """2 % of 0.001 is next to nothing, and some learner would have that key."""
    key = {"answer": 1, "tol": tol, "verify": {"by": "expression", "expr": "2 * {a}"}}
    for question, at in (
        ({"kind": "numeric", **key}, "tol"),
        ({"kind": "numbers", "fields": [{"id": "x", "label": "x", **key}]}, "fields.0.tol"),
    ):
        told = explain({**question, "q": "{a}?", "draw": {"a": draw}})
        assert [why.partition(":")[0] for why in told] == [at] * is_told


def test_a_remark_at_an_end_is_kept_with_the_checks_that_passed(tmp_path: Path) -> None:
    raw = {
        "id": "q", "kind": "numeric", "q": "Energy {a}^4?", "draw": {"a": [0.1, 2]}, "answer": 1.2155, "tol": 0.2,
        "verify": {"by": "expression", "expr": "{a}**4"},
    }  # fmt: skip
    (tmp_path / "quizzes").mkdir()
    (tmp_path / "quizzes/a.json").write_text(json.dumps({"id": "a", "title": "A", "questions": [raw]}))
    library, passed = load(tmp_path), PassedChecks(tmp_path / "passed")
    first, again = (list(certify_quizzes(library, ["a"], passed)) for _ in range(2))
    assert first == again
    assert [one.certificate.remarks for one in again if one.certificate and one.certificate.remarks]
