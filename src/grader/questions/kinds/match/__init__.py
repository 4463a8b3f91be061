"""`match`: give each text of one list its partner in another."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from grader.domain.pages.markup import quoted, spoken_text
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.errors import InvalidAnswer
from grader.questions.kind import Example, Fields, Option, QuestionKind
from grader.questions.kinds.choice.options import option_text
from grader.questions.parts import (
    PARTS_MAX,
    DistinctTexts,
    PartText,
    by_id,
    field_of,
    find_place,
    follow_texts,
    json_or_text,
    typed_for,
)
from grader.questions.question import Question, check_distinct

UNTOUCHED = "Choose a partner for each text first."
SHIFTED = "Your partners are shifted by one line: each belongs to the line {where} the one where you put it."
SHIFTED_MIN = 3
"""The fewest pairs of which a shift can be told from an exchange."""

Pair = tuple[PartText, PartText]


def _distinct_lefts(pairs: tuple[Pair, ...]) -> tuple[Pair, ...]:
    check_distinct([left for left, _ in pairs])
    return pairs


class MatchQuestion(Question):
    """Pairs of texts; several may have the same right side. `extra` has further right sides that belong to no left one.
    Points are the share of the pairs that are right."""

    kind: Literal["match"]
    pairs: Annotated[tuple[Pair, ...], Field(min_length=2, max_length=PARTS_MAX), AfterValidator(_distinct_lefts)]
    extra: DistinctTexts = ()

    @model_validator(mode="after")
    def _has_a_choice(self) -> "MatchQuestion":
        rights = {" ".join(right.split()) for _, right in self.pairs}
        if both := [text for text in self.extra if " ".join(text.split()) in rights]:
            raise PydanticCustomError("extra", "{text} of extra is in pairs: remove it", {"text": repr(both[0])})
        if len(rights) + len(self.extra) < 2:
            raise PydanticCustomError("extra", "all lefts have the same right text: add others to extra")
        return self

    @property
    def lefts(self) -> dict[str, str]:
        """The left texts by their ids, in the author's order: `1`, `2`, ..."""
        return {str(number): left for number, (left, _) in enumerate(self.pairs, 1)}

    @property
    def right_texts(self) -> list[str]:
        """The right texts in the author's order."""
        return list(dict.fromkeys([*(right for _, right in self.pairs), *self.extra]))

    @property
    def rights(self) -> dict[str, str]:
        """The right texts by their ids, in an order that tells nothing."""
        return by_id(self.right_texts)

    @property
    def key(self) -> dict[str, str]:
        """The id of the right text by that of the left one."""
        ids = {text: right for right, text in self.rights.items()}
        return {left: ids[right] for left, (_, right) in zip(self.lefts, self.pairs, strict=True)}


class Match(QuestionKind[MatchQuestion, Mapping[str, str]]):
    """Pairs of texts: an answer is read as the ids of right texts by those of the left ones."""

    question = MatchQuestion

    def heading(self, question: MatchQuestion) -> str:
        """Returns what to do."""
        return "Match"

    def view(self, question: MatchQuestion) -> dict[str, Any]:
        """Returns both lists with the ids of their texts; the right one in an order that tells nothing."""
        lists = {"left": question.lefts, "right": question.rights}
        return {name: [{"id": part, "text": text} for part, text in texts.items()] for name, texts in lists.items()}

    def from_form(self, question: MatchQuestion, fields: Fields) -> dict[str, str]:
        """Returns the partners that were chosen. Raises InvalidAnswer where none is; `read` names what is missing."""
        chosen = {left: typed_for(fields, left) for left in question.lefts}
        if not any(chosen.values()):
            raise InvalidAnswer(UNTOUCHED)
        return {left: right for left, right in chosen.items() if right}

    def to_form(self, question: MatchQuestion, answer: Any) -> Fields:
        """Returns the partner of each left text."""
        try:
            return {field_of(left): [right] for left, right in self.read(question, answer).items()}
        except InvalidAnswer:
            return {}

    def from_text(self, question: MatchQuestion, text: str) -> Any:
        """Returns a JSON object."""
        return json_or_text(text)

    def show(self, question: MatchQuestion, answer: Any) -> str:
        """Returns the pairs."""
        try:
            return self.describe(question, self.read(question, answer))
        except InvalidAnswer:
            return super().show(question, answer)

    def sample_answers(self, question: MatchQuestion) -> Sequence[dict[str, str]]:
        """Returns the right pairs, and pairs that are shifted by one line."""
        rights = list(question.key.values())
        return [question.key, dict(zip(question.key, [*rights[1:], rights[0]], strict=True))]

    def read(self, question: MatchQuestion, answer: Any) -> Mapping[str, str]:
        """Reads an object with a partner for every left text."""
        lefts, rights = question.lefts, question.rights
        if not isinstance(answer, dict) or not answer.keys() <= lefts.keys():
            raise InvalidAnswer(
                f"The answer must give each left text its partner, such as "
                f'{{"1": "a"}}: choose for {", ".join(lefts)} among {", ".join(rights)}.'
            )
        for left, text in lefts.items():
            right = answer.get(left)
            if not isinstance(right, str) or right not in rights:
                name = quoted(spoken_text(text))
                what = "has no partner" if right is None else "has a partner that is none of the letters"
                raise InvalidAnswer(f"{name} {what}: choose one of {', '.join(rights)} for it.")
        return {left: answer[left] for left in lefts}

    def carry_over(self, earlier: MatchQuestion, question: MatchQuestion, answer: Any) -> dict[str, str]:
        """Returns the ids of the same texts."""
        lefts = follow_texts([*earlier.lefts.values()], [*question.lefts.values()])
        rights = follow_texts(earlier.right_texts, question.right_texts)
        words, ids = earlier.rights, {text: right for right, text in question.rights.items()}
        given = [earlier.right_texts.index(words[right]) for right in self.read(earlier, answer).values()]
        return {
            str(find_place(lefts, at) + 1): ids[question.right_texts[find_place(rights, right)]]
            for at, right in enumerate(given)
        }

    def describe(self, question: MatchQuestion, answer: Mapping[str, str]) -> str:
        """Returns the pairs."""
        lefts, rights = question.lefts, question.rights
        return "; ".join(f"{option_text(text)}: {option_text(rights[answer[left]])}" for left, text in lefts.items())

    def grade(self, question: MatchQuestion, answer: Mapping[str, str]) -> Verdict:
        """Gives a share for each right pair."""
        rights = list(question.rights)
        chosen = [rights.index(right) for right in answer.values()]
        evidence = {"option": [row * len(rights) + at for row, at in enumerate(chosen)]}
        return verdict_of(tuple(_findings(question, answer)), diagnosis=_mistake(question, answer), evidence=evidence)

    def options(self, question: MatchQuestion) -> Sequence[Option]:
        """Returns all pairs, by left texts and then right ones, in the orders that are shown."""
        rights, key = question.rights.items(), question.key
        return [
            Option(f"{option_text(text)}: {option_text(words)}", key[left] == right)
            for left, text in question.lefts.items()
            for right, words in rights
        ]

    def example(self) -> Example:
        """Returns a question about units."""
        pairs = [
            ["damping of a hinge", "N m s/rad"],
            ["armature of a hinge", "kg m²"],
            ["gain of a position servo", "N m/rad"],
        ]
        ids = {text: right for right, text in by_id([*(right for _, right in pairs), "N m"]).items()}
        right = [ids[text] for _, text in pairs]

        def answer(*partners: str) -> dict[str, str]:
            return {str(left): partner for left, partner in enumerate(partners, 1)}

        return Example(
            {
                "kind": "match",
                "q": "Which unit has what?",
                "pairs": pairs,
                "extra": ["N m"],
                "explain": "A damping times a velocity is a torque.",
                "points": 3,
            },
            [(answer(*right), Status.CORRECT), (answer(right[0], right[0], right[2]), Status.PARTIAL),
             (answer(*right[1:], right[0]), Status.INCORRECT), (answer(*right[:2]), Status.INVALID_ANSWER),
             (answer(*right[:2], "z"), Status.INVALID_ANSWER), ({"4": right[0]}, Status.INVALID_ANSWER),
             (right, Status.INVALID_ANSWER)],
        )  # fmt: skip


def _findings(question: MatchQuestion, answer: Mapping[str, str]) -> Iterator[Finding]:
    """Yields a finding for each left text."""
    rights, key = question.rights, question.key
    share = question.points / len(key)
    for left, text in question.lefts.items():
        passed = answer[left] == key[left]
        words = spoken_text(rights[answer[left]])
        message = f"{quoted(spoken_text(text))} {'goes' if passed else 'does not go'} with {quoted(words)}."
        yield Finding(
            id=f"pair-{left}", title=f"Line {left}", passed=passed, points=share if passed else 0.0, max_points=share,
            message=message, direction=message, measured=words, expected=spoken_text(rights[key[left]])
        )  # fmt: skip


def _mistake(question: MatchQuestion, answer: Mapping[str, str]) -> str | None:
    """The one mistake that explains wrong pairs, if there is one: all but the last line, or the first, are shifted."""
    key, chosen = list(question.key.values()), list(answer.values())
    if len(key) < SHIFTED_MIN or len(set(key)) < len(key):
        return None
    if chosen[:-1] == key[1:] and chosen[-1] != key[-1]:
        return SHIFTED.format(where="below")
    return SHIFTED.format(where="above") if chosen[1:] == key[:-1] and chosen[0] != key[0] else None
