"""The chance of a fixed answer: against closed forms, for the lesson's exercises, and refused by `grader check`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exercises.conftest import model_xml, question, with_check
from grader.domain.misread import drop_remarks
from grader.exercises import Case, Trial, compute_chance_of_luck, load_kinds, luck
from grader.exercises.episodes.goals import bound_success
from grader.exercises.kind import Content
from grader.exercises.kinds.threshold.parameters import ThresholdParameters
from grader.exercises.luck import DRAWS, compute_chance_of_part, select_boxes
from grader.exercises.running.planning import build_case_trials, refuse_text
from grader.grading.checking import ContentCheck
from grader.grading.pipeline import compute_digest, compute_seed, to_canonical_json
from grader.library import Library
from grader.questions import Quiz

pytestmark = pytest.mark.slow

SERVO = question("servo-threshold")
THRESHOLD = load_kinds()["threshold"]


def boxes(values: Any, width: float) -> Any:
    """One interval of this width about each number of each draw (draws, numbers)."""
    return select_boxes([[(value - width / 2, value + width / 2) for value in row] for row in values])


@pytest.mark.parametrize("width", [0.3, 0.03, 1e-3, 1e-6, 1e-9])
def test_of_a_uniform_number_the_chance_is_the_width_of_the_tolerance(width: float) -> None:
    for seed in range(5):
        chance = compute_chance_of_part(boxes(np.random.default_rng(seed).random((DRAWS, 1)), width))
        assert width < chance < 6 * width**0.6


@pytest.mark.parametrize("width", [0.1, 0.01, 1e-3])
def test_two_numbers_are_harder_to_guess_than_one(width: float) -> None:
    chance = compute_chance_of_part(boxes(np.random.default_rng(0).random((DRAWS, 2)), width))
    assert width**2 < chance < 12 * width**1.5


def test_two_numbers_on_a_line_are_no_harder_than_one() -> None:
    one = np.random.default_rng(0).random((DRAWS, 1))
    assert compute_chance_of_part(boxes(np.hstack([one, 3 * one]), 1e-3)) > 1e-3 / 3


def test_of_few_possible_answers_the_chance_is_not_carried_below_their_share() -> None:
    drawn = np.random.default_rng(0).integers(0, 50, (DRAWS, 1)).astype(float)
    assert 1 / 50 < compute_chance_of_part(boxes(drawn, 1e-9)) < 1 / 15


def test_none_is_an_answer_too() -> None:
    drawn = np.where(np.random.default_rng(0).random((DRAWS, 1)) < 0.5, np.inf, 1.0)
    assert 0.5 < compute_chance_of_part(select_boxes([[(row[0], row[0])] for row in drawn.tolist()])) < 0.65


def test_a_fixed_trajectory_has_no_chance_against_the_hidden_force() -> None:
    chance, allowed = compute_chance_of_luck(question("rk4-step"), model_xml)
    assert chance < allowed == 1e-6


def test_narrow_ranges_are_refused_unless_the_author_raises_the_limit() -> None:
    cases = [{"id": "a", "hidden": True, "set": {"kp": [1700, 1900], "kv": [3, 5]}}]
    for allowed, faults in ((1e-6, 1), (1.0, 0)):
        exercise = with_check(SERVO, cases=cases, integrators=["Euler"], luck=allowed)
        quiz = Quiz(id="q", title="Q", questions=(exercise,))
        models = {"pendulum_servo": model_xml("pendulum_servo")}
        library = Library(root=None, quizzes={"q": quiz}, files={"q": "quizzes/q.json"}, models=models)  # type: ignore[arg-type]
        check = ContentCheck(library, Path(), lambda: pytest.fail("luck needs no jail"), lambda text: None)
        check.check_luck("q", exercise)
        assert [fault.key for fault in check.report.faults] == ["servo-threshold.check.luck"] * faults


def test_an_exercise_that_draws_nothing_can_be_known_by_heart() -> None:
    cases = [{"id": "a", "hidden": True, "set": {"kp": 1700}}]
    assert compute_chance_of_luck(with_check(SERVO, cases=cases), model_xml)[0] == 1.0


@pytest.mark.parametrize(("allowed", "chance", "drawn"), [(0.02, 0.1**2, [0]), (1e-6, 0.1 * 0.05, [0, 1])])
def test_a_case_that_differs_in_labels_alone_is_drawn_only_where_it_matters(
    allowed: float, chance: float, drawn: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[int] = []

    def compute(kind: Any, parameters: Any, case: Case, content: Any, index: int) -> float:
        seen.append(index)
        return (0.1, 0.05)[index]

    monkeypatch.setattr(luck, "compute_chance_of_case", compute)
    cases = [{"id": name, "title": name, "hidden": True, "points": 2, "set": {"kp": [1700, 1900]}} for name in "ab"]
    assert compute_chance_of_luck(with_check(SERVO, cases=cases, luck=allowed), model_xml) == (chance, allowed)
    assert seen == drawn


PARAMETERS = ThresholdParameters.model_validate(drop_remarks(SERVO.check.parameters))
HIDDEN = [(index, case) for index, case in enumerate(PARAMETERS.cases) if case.hidden]
COMMENTS = 100


def trials(index: int, case: Case, seed: int) -> Sequence[Trial[Any]]:
    content = Content(SERVO.entry, model_xml, refuse_text)
    return build_case_trials(THRESHOLD, PARAMETERS, case, content, [seed, index])


def best_guess(index: int, case: Case) -> list[np.ndarray[Any, Any]]:
    """The claims, one for each integrator, that are right in the most of 100 draws of a case."""
    parts = (THRESHOLD.list_accepted(PARAMETERS, trials(index, case, seed)) for seed in range(100))
    accepted = np.array([part[0] for part in parts if part])
    lows, highs = accepted[..., 0], accepted[..., 1]
    with np.errstate(invalid="ignore"):
        middles = np.where(np.isinf(lows), lows, (lows + highs) / 2)
    right = ((lows <= middles[:, None]) & (middles[:, None] <= highs)).all(axis=-1)
    best = middles[np.argmax(right.sum(axis=1))]
    return [np.array([] if np.isinf(low) else [low, low + 0.99 * PARAMETERS.width_s]) for low in best]


def test_comments_do_not_make_constants_right() -> None:
    """A script that counts its calls, and returns the likeliest limits of each hidden case without a look at the model.

    Each case alone is guessed in a few of a hundred draws; all of them together never.
    """
    secret = bytes(range(32))
    guesses = {case.id: best_guess(index, case) for index, case in HIDDEN}

    def is_right(index: int, case: Case, seed: int) -> bool:
        asked = zip(trials(index, case, seed), guesses[case.id], strict=True)
        return all(THRESHOLD.judge(PARAMETERS, trial, {"claim": guess}).passed for trial, guess in asked)

    def seed_with(comment: int) -> int:
        source = f"def largest_stable_timestep(model, integrator): ...  # {comment}"
        return compute_seed(secret, compute_digest("1.3-exercises", SERVO.id, to_canonical_json({"source": source})))

    for index, case in HIDDEN:
        assert any(is_right(index, case, seed_with(comment)) for comment in range(600)), case.id
    for comment in range(COMMENTS):
        assert not all(is_right(index, case, seed_with(comment)) for index, case in HIDDEN)


SQUARE = """def root(x):
    return x**0.5


def off(x, y):
    return y * y - x
"""


@pytest.mark.parametrize(("solved", "low", "high"), [(True, 0.0, 1e-3), (False, 1.0, 1.0)])
def test_of_a_residual_answers_are_tried_where_the_author_solves_it(solved: bool, low: float, high: float) -> None:
    check: dict[str, Any] = {
        "kind": "values",
        "program": "p.py",
        "functions": [{"name": "root", "results": [{"name": "root"}], "residual": {"function": "off", "atol": 0.01}}],
        "cases": [{"id": "a", "hidden": True, "function": "root", "calls": 3, "arguments": [[1, 9]]}],
    }
    exercise = SERVO.model_copy(update={"check": type(SERVO.check)(**check)})
    text = SQUARE if solved else SQUARE.partition("\n\n\n")[2]
    chance, _ = compute_chance_of_luck(exercise, model_xml, lambda _: text)
    assert low <= chance <= high


def test_of_a_share_of_episodes_the_chance_falls_with_their_number() -> None:
    assert bound_success(5, 5, 10, 0.9) == 1.0
    chances = [bound_success(1, 5, episodes, 0.9) for episodes in (5, 10, 20)]
    assert chances == sorted(chances, reverse=True)
    assert 1e-5 < chances[-1] < 0.05
