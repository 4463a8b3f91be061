"""The chance of a fixed answer: against closed forms, for the lesson's exercises, and refused by `grader check`."""

import secrets
from typing import Any

import numpy as np
import pytest

from exercises.conftest import model_xml, question, with_check
from grader.check import luck_faults
from grader.domain.quiz import Quiz
from grader.exercises import chance_of_luck, installed_kinds
from grader.exercises.kind import Content
from grader.exercises.luck import DRAWS, boxes_of, chance_of_part
from grader.exercises.runner import case_trials, no_text, read_parameters
from grader.library import Library
from grader.pipeline import canonical, keyed_seed, submission_digest

SERVO = question("servo-threshold")


def boxes(values: Any, width: float) -> Any:
    """One interval of this width about each number of each draw (draws, numbers)."""
    return boxes_of([[(value - width / 2, value + width / 2) for value in row] for row in values])


@pytest.mark.parametrize("width", [0.3, 0.03, 1e-3, 1e-6, 1e-9])
def test_of_a_uniform_number_the_chance_is_the_width_of_the_tolerance(width: float) -> None:
    for seed in range(5):
        chance = chance_of_part(boxes(np.random.default_rng(seed).random((DRAWS, 1)), width))
        assert width < chance < 6 * width**0.6


@pytest.mark.parametrize("width", [0.1, 0.01, 1e-3])
def test_two_numbers_are_harder_to_guess_than_one(width: float) -> None:
    chance = chance_of_part(boxes(np.random.default_rng(0).random((DRAWS, 2)), width))
    assert width**2 < chance < 12 * width**1.5


def test_two_numbers_on_a_line_are_no_harder_than_one() -> None:
    one = np.random.default_rng(0).random((DRAWS, 1))
    assert chance_of_part(boxes(np.hstack([one, 3 * one]), 1e-3)) > 1e-3 / 3


def test_of_few_possible_answers_the_chance_is_not_carried_below_their_share() -> None:
    drawn = np.random.default_rng(0).integers(0, 50, (DRAWS, 1)).astype(float)
    assert 1 / 50 < chance_of_part(boxes(drawn, 1e-9)) < 1 / 15


def test_none_is_an_answer_too() -> None:
    drawn = np.where(np.random.default_rng(0).random((DRAWS, 1)) < 0.5, np.inf, 1.0)
    assert 0.5 < chance_of_part(boxes_of([[(row[0], row[0])] for row in drawn.tolist()])) < 0.65


def test_a_fixed_trajectory_has_no_chance_against_the_hidden_force() -> None:
    chance, allowed = chance_of_luck(question("rk4-step"), model_xml)
    assert chance < allowed == 1e-6


def test_narrow_ranges_are_refused_unless_the_author_raises_the_limit() -> None:
    cases = [{"id": "a", "hidden": True, "set": {"kp": [1700, 1900], "kv": [3, 5]}}]
    for luck, faults in ((1e-6, 1), (1.0, 0)):
        exercise = with_check(SERVO, cases=cases, integrators=["Euler"], luck=luck)
        quiz = Quiz(id="q", title="Q", questions=(exercise,))
        models = {"pendulum_servo": model_xml("pendulum_servo")}
        library = Library(root=None, quizzes={"q": quiz}, files={"q": "quizzes/q.json"}, models=models)  # type: ignore[arg-type]
        found = list(luck_faults(library, "q", exercise, lambda text: None))
        assert [fault.key for fault in found] == ["servo-threshold.check.luck"] * faults


def test_an_exercise_that_draws_nothing_can_be_known_by_heart() -> None:
    cases = [{"id": "a", "hidden": True, "set": {"kp": 1700}}]
    assert chance_of_luck(with_check(SERVO, cases=cases), model_xml)[0] == 1.0


GUESSES = {"Euler": [0.0198, 0.0203], "implicitfast": [0.0248, 0.0253], "discrete": []}
"""The lesson's own limits [s], and None under `discrete`: the best that a script can say without a look."""


@pytest.mark.cost
def test_ten_thousand_comments_do_not_make_constants_right() -> None:
    exercise = question("servo-threshold")
    kind = installed_kinds()["threshold"]
    parameters = read_parameters(kind, exercise)
    content = Content(exercise.entry, model_xml, no_text)
    secret = secrets.token_bytes(32)
    claims = {name: np.array(guess, np.float64) for name, guess in GUESSES.items()}

    def is_right(seed: int) -> bool:
        return all(
            kind.judge(parameters, trial, {"claim": claims[trial.problem.integrator.name]}).passed
            for index, case in enumerate(parameters.cases)
            if case.hidden
            for trial in case_trials(kind, parameters, case, content, [seed, index])
        )

    for number in range(10_000):
        text = canonical({"source": f"def largest_stable_timestep(model, integrator): ...  # {number}"})
        assert not is_right(keyed_seed(secret, submission_digest("1.3-exercises", exercise.id, text)))
