"""`numbers`: type several numbers, each read, graded and diagnosed as that of a `numeric` question."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from grader.domain.lab import LabConfig
from grader.domain.pages.markup import quoted, spoken_text
from grader.domain.plugins import Remark
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.domain.verify import Verify
from grader.errors import InvalidAnswer
from grader.questions.answer_keys import NumberKey
from grader.questions.drawing import Drawable
from grader.questions.kind import NOTHING_TYPED, CountedNumber, Example, Fields, QuestionKind
from grader.questions.kinds.number import Target, list_typed_numbers, target_warnings
from grader.questions.kinds.number.quantities import Quantity, read_quantity
from grader.questions.kinds.number.slips import grade_number, is_right
from grader.questions.parts import PARTS_MAX, field_of, json_or_text, typed_for
from grader.questions.question import Question, Reveal

YOURS = "Your number"
"""How the sentence on a slip begins."""


class NumberField(Target):
    """One of the numbers. `verify` says how a simulation derives it again."""

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    label: str = Field(min_length=1)
    points: float = Field(default=1.0, gt=0, le=1000, strict=True, allow_inf_nan=False)
    verify: Verify | None = None

    @property
    def name(self) -> str:
        """The label as plain text."""
        return spoken_text(self.label)


def _distinct_ids(fields: tuple[NumberField, ...]) -> tuple[NumberField, ...]:
    ids = [field.id for field in fields]
    if twice := [field for field in ids if ids.count(field) > 1]:
        raise PydanticCustomError("repeated", "two fields have the id {id}: give each its own", {"id": repr(twice[0])})
    return fields


class NumbersQuestion(Drawable, Question):
    """Several numbers. The points of the question are the sum of those of its fields; `sim` is a simulation that the
    learner sees after the answer. With `either_sign` all numbers together may have the other sign, as a quaternion or
    an eigenvector may."""

    kind: Literal["numbers"]
    fields: Annotated[tuple[NumberField, ...], Field(min_length=1, max_length=PARTS_MAX), AfterValidator(_distinct_ids)]
    reveal: Reveal | None = None
    sim: LabConfig | None = None
    either_sign: bool = False

    @property
    def sum_of_points(self) -> float:
        """The points of all fields."""
        return math.fsum(field.points for field in self.fields)

    def model_post_init(self, context: Any) -> None:
        """Takes the sum of the points where the author gives none; `Numbers.faults` refuses another number."""
        if "points" not in self.model_fields_set:
            self.__dict__["points"] = self.sum_of_points


class Numbers(QuestionKind[NumbersQuestion, Mapping[str, Quantity]]):
    """Several typed numbers: an answer is read as a quantity for the id of every field."""

    question = NumbersQuestion

    def faults(self, question: NumbersQuestion) -> Iterator[Remark]:
        """Yields points that are not those of the fields."""
        if not math.isclose(question.points, question.sum_of_points):
            why = f"the points of the fields add up to {question.sum_of_points:g}: leave this out, or correct theirs"
            yield Remark("points", why)

    def warnings(self, question: NumbersQuestion) -> Iterator[Remark]:
        """Yields units and tolerances that accept fewer answers than their author may expect."""
        for place, field in enumerate(question.fields):
            for key, why in target_warnings(field):
                yield Remark(f"fields.{place}.{key}", why)

    def answer_keys(self, question: NumbersQuestion) -> Sequence[NumberKey]:
        """Returns the number of each field."""
        return [
            NumberKey(
                kind=question.kind, text=field.label, explain=question.explain or "", verify=field.verify,
                lab=question.sim, place=f"fields.{place}", answer=field.answer, tolerance=field.tolerance,
                unit=field.unit
            )
            for place, field in enumerate(question.fields)
        ]  # fmt: skip

    def other_keys(self, question: NumbersQuestion) -> Sequence[Sequence[NumberKey]]:
        """Returns the negative numbers, where either sign counts."""
        return [self.answer_keys(negate(question))] if question.either_sign else []

    def reveal(self, question: NumbersQuestion) -> Reveal | None:
        """Returns what the author allows."""
        return question.reveal

    def heading(self, question: NumbersQuestion) -> str:
        """Returns what to do."""
        return "Give the numbers"

    def view(self, question: NumbersQuestion) -> dict[str, Any]:
        """Returns the fields without their numbers; `has_lab` announces the lab, which is shown after the answer."""
        shown = {"id", "label", "unit", "points"}
        fields = [field.model_dump(include=shown) for field in question.fields]
        return {"fields": fields, "has_lab": question.sim is not None}

    def lab(self, question: NumbersQuestion) -> LabConfig | None:
        """Returns the simulation."""
        return question.sim

    def from_form(self, question: NumbersQuestion, fields: Fields) -> dict[str, str]:
        """Returns what was typed into each field. Raises InvalidAnswer where all are empty."""
        typed = {field.id: typed_for(fields, field.id) for field in question.fields}
        if not any(typed.values()):
            raise InvalidAnswer(NOTHING_TYPED)
        return typed

    def to_form(self, question: NumbersQuestion, answer: Any) -> Fields:
        """Returns what was typed into each field."""
        typed = answer if isinstance(answer, dict) else {}
        ids = [field.id for field in question.fields if isinstance(typed.get(field.id), str | int | float)]
        return {field_of(name): [str(typed[name])] for name in ids}

    def from_text(self, question: NumbersQuestion, text: str) -> Any:
        """Returns a JSON object."""
        return json_or_text(text)

    def show(self, question: NumbersQuestion, answer: Any) -> str:
        """Returns what was typed, each after its label."""
        if not isinstance(answer, dict):
            return super().show(question, answer)
        names = {field.id: field.name for field in question.fields if field.id in answer}
        return "; ".join(f"{names.get(name, name)}: {answer[name]}" for name in {**names, **answer})

    def sample_answers(self, question: NumbersQuestion) -> Sequence[dict[str, str]]:
        """Returns the right numbers, and others as people might type them, the same way in each field."""
        samples = [list_typed_numbers(field) for field in question.fields]
        ids = [field.id for field in question.fields]
        return [dict(zip(ids, row, strict=True)) for row in zip(*samples, strict=False)]

    def read(self, question: NumbersQuestion, answer: Any) -> Mapping[str, Quantity]:
        """Reads an object with a number or a text for every field. Names first what is wrong, then what is missing."""
        ids = [field.id for field in question.fields]
        if isinstance(answer, dict) and (unknown := list(answer.keys() - set(ids))):
            raise InvalidAnswer(f"The answer has {quoted(min(unknown))}, which is not asked: give {', '.join(ids)}.")
        if not isinstance(answer, dict):
            raise InvalidAnswer(f'The answer must be an object such as {{"{ids[0]}": "5"}}: give {", ".join(ids)}.')
        read = {field.id: _read_field(field, answer[field.id]) for field in question.fields if _is_given(field, answer)}
        for field in question.fields:
            if field.id not in read:
                raise InvalidAnswer(f"{field.name}: type a number here as well.")
        return read

    def describe(self, question: NumbersQuestion, answer: Mapping[str, Quantity]) -> str:
        """Returns each number in the unit of its field."""
        return "; ".join(f"{field.name}: {answer[field.id]}" for field in question.fields)

    def grade(self, question: NumbersQuestion, answer: Mapping[str, Quantity]) -> Verdict:
        """Gives the points of each field for a number within its tolerance; names the slips behind wrong ones. With
        `either_sign` the sign counts that gives more points."""
        verdict = self._grade(question, answer)
        if question.either_sign and verdict.points < verdict.max_points:
            either = (verdict, self._grade(negate(question), answer))
            return max(either, key=lambda verdict: (verdict.points, verdict.diagnosis is not None))
        return verdict

    def _grade(self, question: NumbersQuestion, answer: Mapping[str, Quantity]) -> Verdict:
        pairs = list(zip(question.fields, self.answer_keys(question), strict=True))
        graded = [grade_number(key, answer[field.id], field.points, field.id, field.name) for field, key in pairs]
        findings, slips = [finding for finding, _ in graded], [slip for _, slip in graded]
        wrong = [pair for pair, finding in zip(pairs, findings, strict=True) if not finding.passed]
        mistake = (
            _exchange(wrong, answer)
            or (_shift(pairs, answer) if wrong else None)
            or _mistake(
                [(finding.title, slip) for finding, slip in zip(findings, slips, strict=True) if not finding.passed]
            )
        )
        return verdict_of(
            tuple(findings if mistake else map(_with_slip, findings, slips)),
            diagnosis=mistake,
            evidence={"value": [None if finding.passed else finding.measured for finding in findings]},
        )

    def numbers(self, question: NumbersQuestion) -> Sequence[CountedNumber]:
        """Returns a number for each field."""
        return [CountedNumber(field.unit or "", field.tolerance, field.name) for field in question.fields]

    def example(self) -> Example:
        """Returns a question about a pendulum."""
        return Example(
            {
                "kind": "numbers",
                "q": "A pendulum of 1.234 m swings with a small amplitude. Give its period and its angular frequency.",
                "fields": [
                    {"id": "T", "label": "Period <em>T</em>", "answer": 2.22845, "tol": 0.0123, "unit": "s"},
                    {"id": "w", "label": "Angular frequency", "answer": 2.81953, "tol": 0.0145, "unit": "rad/s",
                     "points": 2},
                ],
                "explain": "<em>T</em> = 2 pi / w",
                "points": 3,
            },
            [({"T": 2.23, "w": "2.82"}, Status.CORRECT), ({"T": "2230 ms", "w": "2.82 rad/s"}, Status.CORRECT),
             ({"T": "2.2", "w": "2.82"}, Status.PARTIAL), ({"T": "2230", "w": "2820"}, Status.INCORRECT),
             ({"T": "2.23"}, Status.INVALID_ANSWER), ({"T": "2.23", "w": "3 kg"}, Status.INVALID_ANSWER),
             ({"T": "2.23", "w": "2.82", "f": "1"}, Status.INVALID_ANSWER), (2.23, Status.INVALID_ANSWER)],
        )  # fmt: skip


def negate(question: NumbersQuestion) -> NumbersQuestion:
    """Returns a question whose numbers have the other sign."""
    fields = tuple(field.model_copy(update={"answer": -field.answer}) for field in question.fields)
    return question.model_copy(update={"fields": fields})


def _is_given(field: NumberField, answer: Mapping[str, Any]) -> bool:
    """Whether the answer has anything for a field."""
    typed = answer.get(field.id)
    return typed is not None and not (isinstance(typed, str) and not typed.strip())


def _read_field(field: NumberField, typed: Any) -> Quantity:
    """Reads one number. Raises InvalidAnswer with a sentence that begins with the label."""
    try:
        return read_quantity(typed, field.unit, field.label)
    except InvalidAnswer as error:
        raise InvalidAnswer(f"{field.name}: {error}") from error


def _mistake(wrong: Sequence[tuple[str, str | None]]) -> str | None:
    """The slip that explains all wrong numbers, if it is the same; `wrong` has the label and the slip of each."""
    slip = wrong[0][1] if wrong else None
    if slip is None or any(other != slip for _, other in wrong):
        return None
    *others, last = [name for name, _ in wrong]
    names = f"{', '.join(others)} and {last}" if others else last
    return f"{names}: {'each' if others else 'your'} number{slip.removeprefix(YOURS)}"


def _exchange(wrong: Sequence[tuple[NumberField, NumberKey]], answer: Mapping[str, Quantity]) -> str | None:
    """The sentence for two wrong numbers of which each is right for the other field."""
    if len(wrong) != 2:
        return None
    (one, its), (other, others) = wrong
    if not (_is_right_for(answer[one.id], one, others) and _is_right_for(answer[other.id], other, its)):
        return None
    return f"{one.name} and {other.name} are exchanged: each number is right for the other."


def _shift(pairs: Sequence[tuple[NumberField, NumberKey]], answer: Mapping[str, Quantity]) -> str | None:
    """The sentence for three or more numbers that are all right for the next field, as a quaternion is with w last, or
    for the one before."""
    fields, keys = [field for field, _ in pairs], [key for _, key in pairs]
    first, last = fields[0], fields[-1]
    for shifted, where in (
        ([*keys[1:], keys[0]], f"next field, and the last one that of {first.name}, which is asked first"),
        ([keys[-1], *keys[:-1]], f"field before, and the first one that of {last.name}, which is asked last"),
    ):
        if len(pairs) > 2 and all(
            _is_right_for(answer[field.id], field, key) for field, key in zip(fields, shifted, strict=True)
        ):
            return f"Each number is that of the {where}."
    return None


def _is_right_for(given: Quantity, field: NumberField, key: NumberKey) -> bool:
    """Whether a number of one field is right for the key of another, in whose unit it is, or which it does not name."""
    is_its = given.typed_unit is None or (field.unit or "") == (key.unit or "")
    return is_its and is_right(given.number if given.typed_unit is None else given.value, key)


def _with_slip(finding: Finding, slip: str | None) -> Finding:
    """A finding whose message also tells the slip, which `direction` does not."""
    return finding if slip is None else finding.model_copy(update={"message": f"{finding.message} {slip}"})
