"""From parsed JSON to a Quiz; what does not fit is told in an author's words, key by key."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from grader.domain.lab import Lab
from grader.domain.quiz import Question, Quiz
from grader.errors import Fault
from grader.library.complaints import complaint, place
from grader.library.json_text import JsonObject, join, without_remarks

QUIZ = TypeAdapter[Quiz](Quiz)
QUESTION = TypeAdapter[Question](Question)
LAB = TypeAdapter[Lab](Lab)

Part = TypeVar("Part")


@dataclass(frozen=True)
class Reading:
    """The questions and labs that are right, and the faults of the rest; a quiz only where nothing is wrong."""

    quiz: Quiz | None
    questions: list[Question]
    labs: list[Lab]
    faults: list[Fault]


def read_quiz(raw: dict[str, Any], file: str) -> Reading:
    """A quiz with ids given by position, and every fault of its keys and values."""
    quizzes, faults = validate(QUIZ, [("", shell(raw))], file)
    questions, question_faults = validate(QUESTION, named_questions(raw), file)
    labs, lab_faults = validate(LAB, named_labs(raw), file)
    faults += [*question_faults, *lab_faults, *list_faults(raw, file), *repeated_ids(raw, file)]
    parts = {"questions": tuple(questions), "labs": tuple(labs)}
    return Reading(None if faults else quizzes[0].model_copy(update=parts), questions, labs, faults)


def named_parts(raw: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """The quiz without its lists, every question and every lab, each with the key under which its faults are told."""
    yield "", shell(raw)
    yield from named_questions(raw)
    yield from named_labs(raw)


def shell(raw: dict[str, Any]) -> JsonObject:
    """The quiz without its lists."""
    own = JsonObject([(name, value) for name, value in raw.items() if name not in ("questions", "labs")])
    own.repeated = getattr(raw, "repeated", [])
    return own


def list_faults(raw: Mapping[str, Any], file: str) -> Iterator[Fault]:
    """`questions` or `labs` that are no list."""
    for name in ("questions", "labs"):
        if not isinstance(raw.get(name, []), list):
            yield Fault(file, name, "must be a list")


def named_questions(raw: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Every question with its id: the author's, or `q1`, `q2`, ... by position."""
    for position, item in enumerate(_list(raw, "questions"), 1):
        name = item.setdefault("id", f"q{position}") if isinstance(item, dict) else None
        yield (name if isinstance(name, str) else f"q{position}"), item


def named_labs(raw: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Every lab with the name by which its faults are told."""
    for index, item in enumerate(_list(raw, "labs")):
        named = isinstance(item, dict) and isinstance(item.get("id"), str)
        yield (item["id"] if named else f"labs.{index}"), item


def _list(raw: Mapping[str, Any], name: str) -> list[Any]:
    value = raw.get(name)
    return value if isinstance(value, list) else []


def repeated_ids(raw: Mapping[str, Any], file: str) -> Iterator[Fault]:
    """Two questions, or two labs, of one id."""
    for ids in ([key for key, _ in named_questions(raw)], [key for key, _ in named_labs(raw)]):
        for key in sorted({key for key in ids if ids.count(key) > 1}):
            yield Fault(file, join(key, "id"), "two have this id: give each its own")


def validate(adapter: TypeAdapter[Part], items: Iterable[tuple[str, Any]], file: str) -> tuple[list[Part], list[Fault]]:
    """The parts that are right, and the faults of the others, one for each key."""
    parts: list[Part] = []
    faults: dict[str, Fault] = {}
    for key, raw in items:
        item = without_remarks(raw)
        try:
            parts.append(adapter.validate_json(json.dumps(item), strict=True))
        except ValidationError as error:
            for detail in error.errors(include_url=False):
                where = join(key, *place(detail, item))
                faults.setdefault(where, Fault(file, where, complaint(detail)))
    return parts, list(faults.values())
