"""Read the option that a learner chose, by its index or its text."""

import re
from functools import lru_cache
from typing import Any

from grader.answers.spelling import quoted
from grader.domain.markup import plain_text
from grader.domain.quiz import ChoiceQuestion, PredictQuestion
from grader.errors import InvalidAnswer

INDEX = re.compile(r"[+-]?[0-9]{1,9}")

CHARACTERS_MAX = 4000
"""The longest text that is compared with the options; stripping tags takes time quadratic in their nesting."""


def read_choice(question: ChoiceQuestion | PredictQuestion, answer: Any) -> int:
    """Read the 0-based index of an option from an index, its digits, or the whole text of the option.

    Raises InvalidAnswer; JSON `true` is not an index.
    """
    last = len(question.options) - 1
    advice = f"choose one of the {last + 1} options by its number, from 0 to {last}"
    index = _as_index(answer)
    if index is None and isinstance(answer, str):
        index = _index_of_text(question.options, answer)
    if index is None:
        what = quoted(answer) if isinstance(answer, str) else "The answer"
        raise InvalidAnswer(f"{what} is not an option: {advice}.")
    if not 0 <= index <= last:
        raise InvalidAnswer(f"There is no such option: {advice}.")
    return index


def _as_index(answer: Any) -> int | None:
    if isinstance(answer, bool):
        return None
    if isinstance(answer, int):
        return answer
    if isinstance(answer, float) and answer.is_integer():
        return int(answer)
    if isinstance(answer, str) and INDEX.fullmatch(answer.strip()):
        return int(answer)
    return None


def _index_of_text(options: tuple[str, ...], answer: str) -> int | None:
    """Find the only option with this text, ignoring tags, spacing and case; None where there are none or several."""
    if len(answer) > CHARACTERS_MAX:
        return None
    wanted = plain_text(answer).casefold()
    found = [index for index, option in enumerate(options) if option_text(option).casefold() == wanted]
    return found[0] if len(found) == 1 else None


@lru_cache(maxsize=2048)
def option_text(option: str) -> str:
    """An author's option as plain text. Kept, since parsing its HTML takes longer than all else in grading a choice."""
    return plain_text(option)
