"""From parsed JSON to a Quiz; what does not fit is told in an author's words, key by key."""

import difflib
import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from grader.domain.lab import Button, IntegratorsLab, Lab, LabConfig, Plot, Readout, Select, SimLab, Slider, Trace
from grader.domain.quiz import (
    ChoiceQuestion,
    CodeQuestion,
    NumericQuestion,
    OpenQuestion,
    PredictQuestion,
    Question,
    Quiz,
)
from grader.domain.run import Limits
from grader.errors import Fault
from grader.library.json_text import JsonObject, join, without_remarks

QUIZ = TypeAdapter[Quiz](Quiz)
QUESTION = TypeAdapter[Question](Question)
LAB = TypeAdapter[Lab](Lab)

PARTS: Mapping[str, type[BaseModel]] = {
    "mcq": ChoiceQuestion,
    "debug": ChoiceQuestion,
    "predict": PredictQuestion,
    "numeric": NumericQuestion,
    "open": OpenQuestion,
    "code": CodeQuestion,
    "limits": Limits,
    "simlab": SimLab,
    "integrators": IntegratorsLab,
    "sim": LabConfig,
    "slider": Slider,
    "select": Select,
    "button": Button,
    "readouts": Readout,
    "plots": Plot,
    "traces": Trace,
}
"""The class whose keys are allowed at a place, by the last word of pydantic's way to it."""

KINDS = ("mcq", "debug", "predict", "numeric", "open", "code")

Part = TypeVar("Part")


def read_quiz(raw: dict[str, Any], file: str) -> Quiz | list[Fault]:
    """The quiz with ids given by position, or every fault of its keys and values."""
    quizzes, faults = validate(QUIZ, [("", shell(raw))], file)
    questions, question_faults = validate(QUESTION, named_questions(raw), file)
    labs, lab_faults = validate(LAB, named_labs(raw), file)
    faults += [*question_faults, *lab_faults, *list_faults(raw, file), *repeated_ids(raw, file)]
    if faults:
        return faults
    return quizzes[0].model_copy(update={"questions": tuple(questions), "labs": tuple(labs)})


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


def place(detail: ErrorDetails, item: Any) -> Iterator[str | int]:
    """Where a complaint stands in the JSON: pydantic's way, without the names of the classes that it tried."""
    for step in detail["loc"]:
        is_there = step in item if isinstance(item, dict) else isinstance(item, list) and isinstance(step, int)
        if is_there:
            item = item[step]
        if is_there or (detail["type"] == "missing" and step == detail["loc"][-1]):
            yield step
    if detail["type"].startswith("union_tag") and isinstance(item, dict):
        yield "type" if "controls" in detail["loc"] else "kind"


def complaint(detail: ErrorDetails) -> str:
    """What is wrong, and the cure."""
    match detail["type"]:
        case "missing":
            return "is missing: add it"
        case "extra_forbidden":
            steps = [step for step in detail["loc"] if isinstance(step, str)]
            return f"unknown key: {suggestion(steps)}remove it, or begin it with x-"
        case "union_tag_not_found":
            near = difflib.get_close_matches("kind", map(str, detail["input"]), n=1, cutoff=0.7)
            return f"is missing: {f'rename {near[0]!r}' if near else 'add it'}, one of {', '.join(KINDS)}"
        case "union_tag_invalid":
            return f"there is no {detail['ctx']['tag']!r}: one of {detail['ctx']['expected_tags']}"
        case "option_index":
            return detail["msg"]
    message = detail["msg"].replace("Input should", "must").replace("String should", "must")
    given = detail["input"]
    return f"{message}, not {given!r}"[:300] if isinstance(given, int | float | str | None) else message


def suggestion(steps: list[str]) -> str:
    """The known key that was probably meant."""
    known: Iterable[str] = (PARTS[steps[-2]] if len(steps) > 1 and steps[-2] in PARTS else Quiz).model_fields
    near = difflib.get_close_matches(steps[-1], known, n=1)
    near = near or [name for name in known if len(name) > 2 and steps[-1].startswith(name)][:1]
    return f"write {near[0]!r}, or " if near else ""
