"""Films that kinds record of evidence: only of visible trials, and nothing where the evidence cannot be read."""

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from grader.exercises import load_kinds, plan_exercise
from grader.exercises.film import FRAMES_MAX, Film, choose_rows
from grader.grading.films import record_films
from grader.library import Library
from grader.numerics.drawing import place_geoms
from grader.questions.kinds.script import ScriptQuestion
from support.content import load_content

ROOT = Path(__file__).parents[2]
QUIZ = "1.3-exercises"
SEED = 7


@pytest.fixture(scope="module")
def library() -> Library:
    return load_content()


def film(library: Library, question: str, evidence: Any, failed: tuple[str, ...] = ()) -> list[Film]:
    findings = [{"id": one, "passed": False} for one in failed]
    return record_films(library, (QUIZ, question), SEED, {"evidence": evidence, "findings": findings})


def a_claim(case: str, low: float, high: float) -> dict[str, Any]:
    return {"case": case, "claim_ms": [low, high], "said_none": False}


def test_claims_within_the_search_are_shown_at_their_own_timesteps(library: Library) -> None:
    claims = [a_claim("lesson.Euler", 10, 21), a_claim("lesson.implicitfast", 12, 900)]
    lower, upper = film(library, "servo-threshold", {"claims": claims})
    assert [panel.detail for panel in lower.panels] == ["10 ms", "12 ms"]
    assert [panel.detail for panel in upper.panels] == ["21 ms"]
    assert lower.end_s == 3
    assert all(len(panel.times_s) == FRAMES_MAX for panel in lower.panels)


@pytest.mark.parametrize(
    ("low", "high", "first"), [(10, 25, "lower-end"), (10, 15, "upper-end"), (22, 25, "lower-end")]
)
def test_the_end_that_refutes_the_claim_comes_first(library: Library, low: float, high: float, first: str) -> None:
    none = {"case": "lesson.discrete", "claim_ms": None, "said_none": True}
    films = film(library, "servo-threshold", {"claims": [a_claim("lesson.Euler", low, high), none]})
    assert films[0].name == first
    assert len(films) == 2


def test_none_is_shown_at_the_longest_timestep(library: Library) -> None:
    [only] = film(
        library, "servo-threshold", {"claims": [{"case": "lesson.Euler", "claim_ms": None, "said_none": True}]}
    )
    assert only.name == "longest-timestep"
    assert [panel.detail for panel in only.panels] == ["50 ms, you said None"]
    assert only.panels[0].ended


def test_no_film_is_made_of_a_hidden_case(library: Library) -> None:
    question = library.question(QUIZ, "servo-threshold")
    assert isinstance(question, ScriptQuestion)
    plan = plan_exercise(question, library.model_xml, SEED, library.text)
    hidden = [trial.id for trial in plan.trials if trial.hidden]
    assert hidden
    assert film(library, "servo-threshold", {"claims": [a_claim(one, 10, 20) for one in hidden]}) == []


@pytest.mark.parametrize("question", ["servo-threshold", "rk4-step", "rk4-free-joint"])
@pytest.mark.parametrize(
    "evidence",
    [
        {},
        {"claims": 3, "motion": 3, "differences": 3},
        {"claims": [{"case": "lesson.Euler"}], "motion": {"case": "double-pendulum", "steps": [], "qpos": []}},
        {
            "claims": [a_claim("elsewhere.Euler", 1, 2)],
            "motion": {"case": "elsewhere", "steps": [1], "qpos": [[1]]},
            "differences": [{"case": "elsewhere", "tolerance": 1, "time_s": [], "qpos": []}],
        },
        {
            "motion": {"case": "double-pendulum", "steps": [9999], "qpos": [[1, 2]]},
            "differences": [{"case": "double-pendulum", "tolerance": 1, "time_s": [], "qpos": []}],
        },
        {
            "motion": {"case": "double-pendulum", "steps": [1], "qpos": [[1, 2, 3]]},
            "differences": [{"case": "double-pendulum", "tolerance": 1, "time_s": [], "qpos": []}],
        },
    ],
)
def test_what_cannot_be_read_makes_no_film(library: Library, question: str, evidence: Any) -> None:
    assert film(library, question, evidence) == []


def test_a_run_that_stopped_early_says_when(library: Library) -> None:
    motion = {"case": "double-pendulum", "steps": [1, 2], "qpos": [[2, 0.5], [2, 0.4]], "ended": True}
    measured = {"case": "double-pendulum", "tolerance": 1e-10, "time_s": [0.002], "qpos": [0.1]}
    [one] = film(library, "rk4-step", {"motion": motion, "differences": [measured]})
    assert one.panels[0].ended == "not finite after 0.004 s"
    assert len(one.panels[0].times_s) == 3
    assert len(one.panels[1].times_s) == FRAMES_MAX + 1


def test_positions_as_large_as_a_double_can_hold_are_left_out(library: Library) -> None:
    motion = {"case": "free-body", "steps": [1], "qpos": [[1e308, 0, 1, 0, 0, 0, 0]], "ended": False}
    measured = {"case": "free-body", "tolerance": 1e-10, "time_s": [0.002], "qpos": [None]}
    [one] = film(library, "rk4-free-joint", {"motion": motion, "differences": [measured]})
    told = json.loads(json.dumps(one.to_json(), allow_nan=False))
    assert None in told["panels"][0]["frames"][1][0]
    assert None not in told["panels"][1]["frames"][1][0]


def test_a_question_without_a_script_has_no_film(library: Library) -> None:
    assert record_films(library, ("1.3-check", "q2"), SEED, {"evidence": {"value": 1}, "findings": []}) == []


def test_a_kind_has_no_film_unless_it_says_so() -> None:
    values = load_kinds()["values"]
    assert values.record_films(None, [], {"claims": [a_claim("lesson.Euler", 1, 2)]}, ()) == ()


def test_a_body_without_geoms_is_drawn_as_its_inertia() -> None:
    box = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom type='box' size='.1 .2 .3'/></body></worldbody></mujoco>"
    )
    [drawn], poses = place_geoms(box, np.array([[1, 2, 3, 1, 0, 0, 0]], dtype=float))
    assert (drawn["type"], drawn["size"]) == ("box", [0.1, 0.2, 0.3])
    inertia = box.body_inertia[1]
    bare = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='a'><freejoint/><inertial pos='0 0 0' "
        f"mass='{box.body_mass[1]}' diaginertia='{' '.join(map(str, inertia))}'/></body></worldbody></mujoco>"
    )
    [same], there = place_geoms(bare, np.array([[1, 2, 3, 1, 0, 0, 0]], dtype=float))
    assert sorted(same["size"]) == pytest.approx([0.1, 0.2, 0.3], abs=1e-6)
    np.testing.assert_allclose(there[0, 0, :3], [1, 2, 3])
    np.testing.assert_allclose(poses[0, 0, :3], [1, 2, 3])


@pytest.mark.parametrize("rows", [1, 2, 119, 120, 121, 5000])
def test_frames_are_spread_over_the_run(rows: int) -> None:
    chosen = choose_rows(rows)
    assert len(chosen) == min(rows, FRAMES_MAX)
    assert (chosen[0], chosen[-1]) == (0, rows - 1)
    assert np.all(np.diff(chosen) > 0)
