"""`order`: put texts into the right order."""

from collections.abc import Iterator, Sequence
from itertools import pairwise, permutations
from typing import Annotated, Any, Literal

from pydantic import Field

from grader.domain.pages.markup import quoted, spoken_text
from grader.domain.plugins import Remark
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.errors import InvalidAnswer
from grader.questions.kind import Example, Fields, Option, QuestionKind
from grader.questions.kinds.choice.options import option_text
from grader.questions.parts import (
    DistinctTexts,
    by_id,
    field_of,
    find_place,
    follow_texts,
    json_or_text,
    typed_for,
)
from grader.questions.question import Question

UNTOUCHED = "Give each item its position first."
REVERSED = "Your order is the reverse of the right one: check at which end it begins."
ROTATED = "Your items follow each other rightly, but the order begins at the wrong one: check which comes first."
CHARACTERS_QUOTED = 120
"""Characters of an item that a finding quotes: enough to tell two apart that begin alike."""


class OrderQuestion(Question):
    """Texts in the right order. Points are the share of neighbours that follow each other directly in the answer."""

    kind: Literal["order"]
    items: Annotated[DistinctTexts, Field(min_length=2)]


class Order(QuestionKind[OrderQuestion, tuple[str, ...]]):
    """An order of texts: an answer is read as their ids."""

    question = OrderQuestion

    def heading(self, question: OrderQuestion) -> str:
        """Returns what to do."""
        return "Put in order"

    def warnings(self, question: OrderQuestion) -> Iterator[Remark]:
        """Yields a remark where the order that is shown is the right one, as by chance it may be."""
        if list(by_id(question.items).values()) == list(question.items):
            yield Remark("items", "are shown in the right order, so that nothing is to be moved: change a word")

    def view(self, question: OrderQuestion) -> dict[str, Any]:
        """Returns the items in an order that tells nothing, with their ids."""
        return {"items": [{"id": item, "text": text} for item, text in by_id(question.items).items()]}

    def from_form(self, question: OrderQuestion, fields: Fields) -> list[str]:
        """Returns the ids by the positions that were chosen. Raises InvalidAnswer unless they are 1 to n, each once."""
        items = by_id(question.items)
        positions = {item: typed_for(fields, item) for item in items}
        if not any(positions.values()):
            raise InvalidAnswer(UNTOUCHED)
        at: dict[str, str] = {}
        for item, position in positions.items():
            if position not in map(str, range(1, len(items) + 1)):
                raise InvalidAnswer(f"{quoted(spoken_text(items[item]))} has no position: choose one for each item.")
            if position in at:
                raise InvalidAnswer(f"Position {position} is taken twice: give each item a position of its own.")
            at[position] = item
        return [at[str(position)] for position in range(1, len(items) + 1)]

    def to_form(self, question: OrderQuestion, answer: Any) -> Fields:
        """Returns the position of each item."""
        try:
            return {field_of(item): [str(at)] for at, item in enumerate(self.read(question, answer), 1)}
        except InvalidAnswer:
            return {}

    def from_text(self, question: OrderQuestion, text: str) -> Any:
        """Returns a JSON list."""
        return json_or_text(text)

    def show(self, question: OrderQuestion, answer: Any) -> str:
        """Returns the texts, numbered."""
        try:
            return self.describe(question, self.read(question, answer))
        except InvalidAnswer:
            return super().show(question, answer)

    def sample_answers(self, question: OrderQuestion) -> Sequence[list[str]]:
        """Returns the right order, its reverse, and one that begins at the wrong item."""
        key = list(_key_of(question))
        return [key, key[::-1], [*key[1:], key[0]]]

    def read(self, question: OrderQuestion, answer: Any) -> tuple[str, ...]:
        """Reads a list with the id of every item, each once."""
        ids = list(by_id(question.items))
        if not isinstance(answer, list) or sorted(map(str, answer)) != sorted(ids) or set(map(type, answer)) != {str}:
            raise InvalidAnswer(f"The answer must be a list of all items, each once: order {', '.join(ids)}.")
        return tuple(answer)

    def carry_over(self, earlier: OrderQuestion, question: OrderQuestion, answer: Any) -> list[str]:
        """Returns the ids of the same texts."""
        moved, words = follow_texts(earlier.items, question.items), by_id(earlier.items)
        ids = {text: item for item, text in by_id(question.items).items()}
        given = (earlier.items.index(words[item]) for item in self.read(earlier, answer))
        return [ids[question.items[find_place(moved, at)]] for at in given]

    def describe(self, question: OrderQuestion, answer: tuple[str, ...]) -> str:
        """Returns the texts, numbered."""
        items = by_id(question.items)
        return "; ".join(f"{at}. {option_text(items[item])}" for at, item in enumerate(answer, 1))

    def grade(self, question: OrderQuestion, answer: tuple[str, ...]) -> Verdict:
        """Gives a share for each pair of neighbours that follow each other directly in the right order."""
        numbers = {pair: number for number, pair in enumerate(permutations(by_id(question.items), 2))}
        evidence = {"option": [numbers[pair] for pair in pairwise(answer)]}
        return verdict_of(
            tuple(_findings(question, answer)), diagnosis=_mistake(_key_of(question), answer), evidence=evidence
        )

    def options(self, question: OrderQuestion) -> Sequence[Option]:
        """Returns all pairs of items that may follow each other; their order depends on what is shown alone."""
        items, right = by_id(question.items), set(pairwise(_key_of(question)))
        words = {item: option_text(text) for item, text in items.items()}
        return [Option(f"{words[one]}, then {words[two]}", (one, two) in right) for one, two in permutations(items, 2)]

    def example(self) -> Example:
        """Returns a question about the stages of a step."""
        key = ["Forward kinematics", "Contact detection", "Constraint solver", "Integration"]
        ids = {text: item for item, text in by_id(key).items()}
        right = [ids[text] for text in key]
        return Example(
            {
                "kind": "order",
                "q": "In which order does <code>mj_step</code> do this?",
                "items": key,
                "explain": "Contacts need positions, and the solver needs contacts.",
                "points": 3,
            },
            [(right, Status.CORRECT), ([right[0], right[1], right[3], right[2]], Status.PARTIAL),
             ([*right[1:], right[0]], Status.PARTIAL), (right[::-1], Status.INCORRECT),
             (right[:3], Status.INVALID_ANSWER), ([*right[:3], right[0]], Status.INVALID_ANSWER),
             (key, Status.INVALID_ANSWER), ("a", Status.INVALID_ANSWER)],
        )  # fmt: skip


def _key_of(question: OrderQuestion) -> tuple[str, ...]:
    """The ids in the right order."""
    ids = {text: item for item, text in by_id(question.items).items()}
    return tuple(ids[text] for text in question.items)


def _findings(question: OrderQuestion, answer: tuple[str, ...]) -> Iterator[Finding]:
    """Yields a finding for each pair of neighbours in the answer."""
    words = {item: spoken_text(text) for item, text in by_id(question.items).items()}
    names = {item: quoted(text, CHARACTERS_QUOTED) for item, text in words.items()}
    following = dict(pairwise(_key_of(question)))
    share = question.points / len(following)
    for at, (first, second) in enumerate(pairwise(answer), 1):
        passed = following.get(first) == second
        message = f"{names[second]} {'comes' if passed else 'does not come'} directly after {names[first]}."
        yield Finding(
            id=f"after-{at}", title=f"Positions {at} and {at + 1}", passed=passed, points=share if passed else 0.0,
            max_points=share, message=message, direction=message, measured=words[second],
            expected=words[following[first]] if first in following else f"{names[first]} comes last"
        )  # fmt: skip


def _mistake(key: tuple[str, ...], answer: tuple[str, ...]) -> str | None:
    """The one mistake that explains a wrong order, if there is one."""
    if answer == key:
        return None
    if answer == key[::-1]:
        return REVERSED
    begin = answer.index(key[0])
    return ROTATED if answer[begin:] + answer[:begin] == key else None
