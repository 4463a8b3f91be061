"""The `exact-text` kind: the function gets a word and must return it backwards."""

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from grader.exercises import Case, DrawnCase, ExerciseParameters, Intervals, Judgement, Kind, Results, Trial

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
    """Words alone."""

    cases: tuple[WordCase, ...] = Field(min_length=1)


class ExactText(Kind[WordParameters, str, str]):
    """Judges words that are returned backwards."""

    parameters = WordParameters
    driver = DRIVER
    needs_model = False

    def trials(self, parameters: WordParameters, drawn: DrawnCase) -> Sequence[Trial[str]]:
        """Returns one call."""
        case = drawn.case
        assert isinstance(case, WordCase)
        word = case.word or "".join(drawn.rng.choice(list(LETTERS), 10))
        return [Trial(case.id, {"word": word}, word, case, hidden=case.hidden, points=case.points)]

    def judge(self, parameters: WordParameters, trial: Trial[str], results: Results) -> Judgement[str]:
        """Compares the text."""
        text = results.get("text", np.empty(0, np.uint8)).tobytes().decode(errors="replace")
        right = text == trial.problem[::-1]
        message = "The word is returned backwards." if right else "The word is not returned backwards."
        return Judgement(right, message, text, measured=text, expected=trial.problem[::-1])

    def accepted(self, parameters: WordParameters, trials: Sequence[Trial[str]]) -> Sequence[Intervals]:
        """Returns the place of the word's first letters in the dictionary; places are whole numbers."""
        (trial,) = trials
        place = 0.0
        for letter in trial.problem[:LETTERS_COMPARED]:
            place = len(LETTERS) * place + LETTERS.find(letter)
        return [[(place - 0.5, place + 0.5)]]
