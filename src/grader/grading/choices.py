"""The option that a learner chose: its index, or its text."""

import html
import re
from typing import Any

from grader.domain.quiz import ChoiceQuestion, PredictQuestion
from grader.errors import InvalidAnswer
from grader.grading.numbers import quoted

INDEX = re.compile(r"[+-]?[0-9]{1,9}")
TAG = re.compile(r"</?[A-Za-z][^<>$]*>")
"""No dollar sign stands in a tag: `$a<b$ and $c>d$` is TeX."""


def read_choice(question: ChoiceQuestion | PredictQuestion, answer: Any) -> int:
    """The 0-based index of an option, from an index, its digits, or the option's whole text.

    Raises InvalidAnswer: JSON `true` is no index.
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
    """The one option with this text, tags and spacing aside."""
    wanted = plain_text(answer).casefold()
    found = [index for index, option in enumerate(options) if plain_text(option).casefold() == wanted]
    return found[0] if len(found) == 1 else None


def plain_text(markup: str) -> str:
    """HTML as the words that are read: no tags, entities as characters, one space between words."""
    return " ".join(html.unescape(TAG.sub("", markup)).split())
