"""Questions with one right option: what a choice and a prediction share, and how an option is read."""

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, TypeVar

from grader.domain.lab import LabConfig
from grader.domain.pages.markup import plain_text, quoted
from grader.domain.plugins import Remark
from grader.domain.verdict import Finding, Verdict, verdict_of
from grader.errors import InvalidAnswer
from grader.questions.answer_keys import OptionKey
from grader.questions.kind import FIELD, Fields, Option, QuestionKind
from grader.questions.parts import find_place, follow_texts
from grader.questions.question import OptionIndex, Options, Question, Whys

INDEX = re.compile(r"[+-]?[0-9]{1,9}")

CHARACTERS_MAX = 4000
"""The longest text that is compared with the options; stripping tags takes time quadratic in their nesting."""

DIGITS_MAX = 5
"""The longest index that a form sends."""

NO_WHYS = Remark("whys", "every wrong option gets the same sentence: add a sentence on each option, why it is wrong")

NOTHING_CHOSEN = "Choose one of the options first."


class OptionsQuestion(Question):
    """One right option; `answer` is its 0-based index. Each option may have a sentence of its own in `whys`."""

    options: Options
    answer: OptionIndex
    whys: Whys = ()


Q = TypeVar("Q", bound=OptionsQuestion)


class OneOption(QuestionKind[Q, int]):
    """Reads, grades and counts one of the options, by its index."""

    def warnings(self, question: Q) -> Iterator[Remark]:
        """Yields remarks on the options."""
        return remark_options(question.options, question.whys)

    def sample_answers(self, question: Q) -> Sequence[int]:
        """Returns every option, the right one first."""
        others = (index for index in range(len(question.options)) if index != question.answer)
        return [question.answer, *others]

    def view(self, question: Q) -> dict[str, Any]:
        """Returns the options."""
        return {"options": list(question.options)}

    def from_form(self, question: Q, fields: Fields) -> int:
        """Returns the index of the radio button. Raises InvalidAnswer where none is chosen."""
        chosen = next(iter(fields.get(FIELD, ())), "")
        if not (chosen.isascii() and chosen.isdigit() and len(chosen) <= DIGITS_MAX):
            raise InvalidAnswer(NOTHING_CHOSEN)
        return int(chosen)

    def to_form(self, question: Q, answer: Any) -> Fields:
        """Returns the value of the radio button; none where the question has no such option."""
        try:
            return {FIELD: [str(self.read(question, answer))]}
        except InvalidAnswer:
            return {}

    def show(self, question: Q, answer: Any) -> str:
        """Returns the words of the option."""
        if isinstance(answer, int) and 0 <= answer < len(question.options):
            return plain_text(question.options[answer])
        return super().show(question, answer)

    def read(self, question: Q, answer: Any) -> int:
        """Reads an index, its digits, or the whole text of an option."""
        return read_choice(question.options, answer)

    def carry_over(self, earlier: Q, question: Q, answer: Any) -> int:
        """Returns the index of the option with the same words."""
        return find_place(follow_texts(earlier.options, question.options), self.read(earlier, answer))

    def describe(self, question: Q, answer: int) -> str:
        """Returns the words of the option."""
        return option_text(question.options[answer])

    def grade(self, question: Q, answer: int) -> Verdict:
        """Gives all points for the right option."""
        passed, words = answer == question.answer, self.describe(question, answer)
        why = option_text(question.whys[answer]) if question.whys else ""
        message = why or ("This option is right." if passed else "This option is not right.")
        finding = Finding(
            id="choice", title="Your choice", passed=passed, points=question.points if passed else 0.0,
            max_points=question.points, message=message, direction=message, measured=words,
            expected=words if passed else None
        )  # fmt: skip
        return verdict_of((finding,), evidence={"option": answer})

    def options(self, question: Q) -> Sequence[Option]:
        """Returns the options."""
        return [Option(plain_text(text), index == question.answer) for index, text in enumerate(question.options)]


def remark_options(options: Sequence[str], whys: Sequence[str]) -> Iterator[Remark]:
    """Yields a remark where every wrong option gets the same sentence, and where the text of an option is read as the
    index of another one, or of none."""
    if not whys:
        yield NO_WHYS
    texts = enumerate(map(option_text, options))
    if (text := next((text for index, text in texts if _as_index(text) not in (None, index)), None)) is not None:
        yield Remark(
            "options", f"{text}, where it is typed, is read as an index from 0, not as this option: add a word to it"
        )


def option_key(question: OptionsQuestion, lab: LabConfig | None = None) -> OptionKey:
    """Returns the key of a question for a simulation to derive again."""
    return OptionKey(
        kind=question.kind,
        text=question.q,
        explain=question.explain or "",
        verify=question.verify,
        answer=question.answer,
        options=question.options,
        lab=lab,
    )


def read_choice(options: Sequence[str], answer: Any) -> int:
    """Read the 0-based index of an option from an index, its digits, or the whole text of the option. Raises
    InvalidAnswer; JSON `true` is not an index."""
    last = len(options) - 1
    advice = f"choose one of the {last + 1} options by its number, from 0 to {last}"
    index = _as_index(answer)
    if index is None and isinstance(answer, str):
        index = _index_of_text(options, answer)
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
    return int(answer) if isinstance(answer, str) and INDEX.fullmatch(answer.strip()) else None


def _index_of_text(options: Sequence[str], answer: str) -> int | None:
    """Find the only option with this text, ignoring tags, spacing and case; None where there are none or several."""
    if len(answer) > CHARACTERS_MAX:
        return None
    wanted = plain_text(answer).casefold()
    matches = [index for index, option in enumerate(options) if option_text(option).casefold() == wanted]
    return matches[0] if len(matches) == 1 else None


@lru_cache(maxsize=2048)
def option_text(option: str) -> str:
    """An author's option as plain text. Kept, since parsing its HTML takes longer than all else in grading a choice."""
    return plain_text(option)
