"""The `exact-text` kind: the function gets a word and must return it backwards.

The smallest whole kind. It shows each method that nearly every kind needs; a larger kind puts parameters, driver,
judge, mistakes and pictures into files of their own.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import Field

from grader.exercises import (
    Case,
    DrawnCase,
    ExerciseExample,
    ExerciseParameters,
    Intervals,
    JudgedTrial,
    Judgement,
    Kind,
    Results,
    Trial,
)

DRIVER = """
import numpy as np

def trial(functions, inputs, submit):
    (entry,) = functions
    submit("text", np.frombuffer(str(entry(inputs["word"])).encode()[:100], dtype=np.uint8))
"""

LETTERS = "abcdefghijklmnopqrstuvwxyz"
LETTERS_COMPARED = 6


class WordCase(Case):
    """A word; without one, a word of ten letters is drawn."""

    word: str | None = Field(default=None, min_length=1, max_length=100)


class WordParameters(ExerciseParameters):
    """Cases with words."""

    cases: tuple[WordCase, ...]


class ExactText(Kind[WordParameters, str, str]):
    """Judges words that are returned backwards: the problem is the word, the outcome is the student's text."""

    parameters = WordParameters
    driver = DRIVER
    needs_model = False

    def example(self) -> ExerciseExample:
        """Returns an exercise with one word that is shown and two that are drawn."""
        cases = [{"id": "abba", "word": "abbac"}, {"id": "a", "hidden": True}, {"id": "b", "hidden": True}]
        question = {"q": "Write <code>turn(word)</code>: the word backwards.", "entry": "turn"}
        check = {"kind": "exact-text", "cases": cases}
        return ExerciseExample({**question, "check": check}, "def turn(word):\n    return word[::-1]\n")

    def build_trials(self, parameters: WordParameters, drawn: DrawnCase[WordCase]) -> Sequence[Trial[str]]:
        """Returns one call."""
        word = drawn.case.word or "".join(drawn.rng.choice(list(LETTERS), 10))
        return [Trial(drawn.case.id, {"word": word}, word)]

    def judge(self, parameters: WordParameters, trial: Trial[str], results: Results) -> Judgement[str]:
        """Compares the text; results that the driver never sends count as an empty text."""
        text = results.get("text", np.empty(0, np.uint8)).tobytes().decode(errors="replace")
        right = text == trial.problem[::-1]
        message = "The word is returned backwards." if right else "The word is not returned backwards."
        return Judgement(right, message, text, measured=text, expected=trial.problem[::-1])

    def name_mistake(self, parameters: WordParameters, judged: Sequence[JudgedTrial[str, str]]) -> str | None:
        """Recognises words that are returned as they are."""
        wrong = [trial for trial in judged if not trial.judgement.passed]
        unchanged = all(trial.judgement.outcome == trial.problem for trial in wrong)
        return "You return the word as it is: reverse the order of its letters." if wrong and unchanged else None

    def build_pictures(self, parameters: WordParameters, visible: Sequence[JudgedTrial[str, str]]) -> dict[str, Any]:
        """Returns a chart of each word: which letters are right."""
        return {"charts": [right_letters(trial) for trial in visible]}

    def list_accepted(self, parameters: WordParameters, trials: Sequence[Trial[str]]) -> Sequence[Intervals]:
        """Returns the place of the word's first letters in the dictionary; places are whole numbers."""
        (trial,) = trials
        place = 0.0
        for letter in trial.problem[:LETTERS_COMPARED]:
            place = len(LETTERS) * place + LETTERS.find(letter)
        return [[(place - 0.5, place + 0.5)]]


def right_letters(trial: JudgedTrial[str, str]) -> dict[str, Any]:
    """Returns 1 for each letter of the text that is right, else 0, against the position of the letter."""
    right = [int(a == b) for a, b in zip(trial.judgement.outcome, trial.problem[::-1], strict=False)]
    series = [{"label": "right (1) or wrong (0)", "x": list(range(1, len(right) + 1)), "y": right, "points": True}]
    return {
        "case": trial.id,
        "title": "letters",
        "x": {"label": "position"},
        "y": {"label": "right"},
        "series": series,
    }
