"""Validates parsed JSON as a Quiz, and explains each fault to its author."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, reduce
from operator import getitem
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, TypeAdapter, ValidationError

from grader.domain import verify
from grader.domain.lab import (
    Button,
    Lab,
    LabConfig,
    Plot,
    PlotTrace,
    Readout,
    Select,
    Slider,
    UnknownLab,
)
from grader.domain.misread import drop_remarks, explain_misread
from grader.domain.policy import Late, Policy
from grader.domain.rubric import SecondMarking
from grader.errors import Fault
from grader.labs import lab_adapter, lab_kinds
from grader.library.json_text import JsonObject, join_key
from grader.questions import Question, Quiz, installed_kinds, question_adapter
from grader.questions.drawing import fill_in_middle

QUIZ = TypeAdapter[Quiz](Quiz)

Part = TypeVar("Part")

PARTS: Mapping[str, type[BaseModel]] = {
    "options": verify.ByOptions,
    "policy": Policy,
    "late": Late,
    "second_marking": SecondMarking,
    "unknown": UnknownLab,
    "sim": LabConfig,
    "slider": Slider,
    "select": Select,
    "button": Button,
    "readouts": Readout,
    "plots": Plot,
    "traces": PlotTrace,
    "outcome": verify.ByOutcome,
    "stage": verify.ByStage,
    "threshold": verify.ByThreshold,
    "servo": verify.ServoJoint,
    "measurement": verify.ByMeasurement,
    "expression": verify.ByExpression,
    "hand": verify.ByHand,
}
"""The class of a part beside the questions, by the last step of pydantic's location of it."""


@dataclass(frozen=True)
class ParsedQuiz:
    """The questions and labs that can be checked further, and the faults; `quiz` is None if there is any fault."""

    quiz: Quiz | None
    questions: list[Question]
    labs: list[Lab | UnknownLab]
    faults: list[Fault]


def read_quiz(raw: dict[str, Any], file: str) -> ParsedQuiz:
    """Validate a quiz, naming questions by position, and collect every fault of its keys and values."""
    quizzes, faults = validate(QUIZ, [("", _without_lists(raw))], file)
    questions, question_faults = validate(question_adapter(), _named_questions(raw), file)
    labs, lab_faults = validate(lab_adapter(), _named_labs(raw), file)
    faults += [*question_faults, *lab_faults, *_list_faults(raw, file), *_repeated_ids(raw, file)]
    parts = {"questions": tuple(questions), "labs": tuple(labs)}
    return ParsedQuiz(None if faults else quizzes[0].model_copy(update=parts), questions, labs, faults)


def list_policy_faults(values: Mapping[str, Any]) -> list[str]:
    """Says what is wrong with the values of a `policy`, as of one in a quiz file: `key: why`."""
    _, faults = validate(QUIZ, [("", {"id": "any", "title": "", "policy": dict(values)})], "")
    return [f"{fault.key.removeprefix('policy.')}: {fault.why}" for fault in faults]


def name_parts(raw: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the quiz without its lists, every question and every lab, each with the key that begins its faults."""
    yield "", _without_lists(raw)
    yield from _named_questions(raw)
    yield from _named_labs(raw)


def _without_lists(raw: dict[str, Any]) -> JsonObject:
    """Returns the quiz without `questions` and `labs`, and without the `$schema` of editors."""
    own = JsonObject([(name, value) for name, value in raw.items() if name not in ("questions", "labs", "$schema")])
    own.repeated = getattr(raw, "repeated", [])
    return own


def _list_faults(raw: Mapping[str, Any], file: str) -> Iterator[Fault]:
    """Yields a fault for `questions` or `labs` that is not a list."""
    for name in ("questions", "labs"):
        if not isinstance(raw.get(name, []), list):
            yield Fault(file, name, "must be a list")


def _named_questions(raw: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yields every question with its id: the author's, or `q1`, `q2`, ... by position."""
    for position, item in enumerate(_list(raw, "questions"), 1):
        name = item.setdefault("id", f"q{position}") if isinstance(item, dict) else None
        yield (name if isinstance(name, str) else f"q{position}"), item


def _named_labs(raw: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield every lab with the key that begins its faults: its id, or its place in the list."""
    for index, item in enumerate(_list(raw, "labs")):
        named = isinstance(item, dict) and isinstance(item.get("id"), str)
        yield (item["id"] if named else f"labs.{index}"), item


def _list(raw: Mapping[str, Any], name: str) -> list[Any]:
    value = raw.get(name)
    return value if isinstance(value, list) else []


def _repeated_ids(raw: Mapping[str, Any], file: str) -> Iterator[Fault]:
    """Yields a fault for each id that two questions or two labs share."""
    for ids in ([key for key, _ in _named_questions(raw)], [key for key, _ in _named_labs(raw)]):
        for key in sorted({key for key in ids if ids.count(key) > 1}):
            yield Fault(file, join_key(key, "id"), "two have this id: give each its own")


def validate(adapter: TypeAdapter[Part], items: Iterable[tuple[str, Any]], file: str) -> tuple[list[Part], list[Fault]]:
    """Validate parts, each with its key; return the valid ones, and the first fault of every key of the others. A part
    that has unknown keys and no other fault is returned without them, so that what else is wrong is found at once."""
    parts: list[Part] = []
    faults: dict[str, Fault] = {}
    for key, raw in items:
        written = drop_remarks(raw)
        item = fill_in_middle(written)
        try:
            parts.append(adapter.validate_json(json.dumps(item), strict=True))
        except ValidationError as error:
            reasons = dict(explain_misread(error, item, _known_keys, _choices()))
            if ("draw",) in reasons and "template" not in written:
                reasons.pop(("template",), None)  # of a kind that draws nothing; the author never wrote it
            for place, why in reasons.items():
                where = join_key(key, *place)
                faults.setdefault(where, Fault(file, where, why))
            unknown = all(detail["type"] == "extra_forbidden" for detail in error.errors(include_url=False))
            if unknown and (rest := drop_keys(written, reasons)) != written:
                valid, others = validate(adapter, [(key, rest)], file)
                parts += valid
                faults = {fault.key: fault for fault in others} | faults
    return parts, list(faults.values())


def drop_keys(value: Any, places: Iterable[tuple[str | int, ...]]) -> Any:
    """Returns a JSON value without the keys at these places."""
    rest = json.loads(json.dumps(value))
    for *path, last in places:
        reduce(getitem, path, rest).pop(last, None)
    return rest


def _known_keys(steps: Sequence[str]) -> Iterable[str]:
    """Returns the keys of the part that holds a key, by the names in pydantic's location of the key."""
    part = _parts().get(steps[-2], Quiz) if len(steps) > 1 else Quiz
    return [field.alias or name for name, field in part.model_fields.items()]


@cache
def _parts() -> Mapping[str, type[BaseModel]]:
    """The class of every part: those of questions and labs by the names of their kinds, and what is in these by its
    key."""
    questions = {name: kind.question for name, kind in installed_kinds().items()}
    labs = {name: kind.lab for name, kind in lab_kinds().items()}
    inside = {
        key: part
        for model in (*labs.values(), *questions.values())
        for key, field in model.model_fields.items()
        for part in _models_in(field.annotation)
    }
    return {**inside, **labs, **questions, **PARTS}


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yields the models that a type names, at any depth."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)


@cache
def _choices() -> Mapping[str, str]:
    """Returns the values of the key that selects the class of a part."""
    *kinds, last = installed_kinds()
    return {
        "kind": f"{', '.join(kinds)} or {last}; {' or '.join(lab_kinds())} for a lab",
        "by": "options, outcome, stage, threshold, measurement or expression",
    }
