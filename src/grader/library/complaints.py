"""What pydantic complains of, in an author's words: where it stands, what is wrong, and the cure."""

import difflib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from grader.domain import verify
from grader.domain.lab import Button, IntegratorsLab, LabConfig, Plot, Readout, Select, SimLab, Slider, Trace
from grader.domain.quiz import ChoiceQuestion, CodeQuestion, NumericQuestion, OpenQuestion, PredictQuestion, Quiz
from grader.domain.run import Limits

PARTS: Mapping[str, type[BaseModel]] = {
    "mcq": ChoiceQuestion,
    "debug": ChoiceQuestion,
    "predict": PredictQuestion,
    "numeric": NumericQuestion,
    "open": OpenQuestion,
    "code": CodeQuestion,
    "options": verify.ByOptions,
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
    "outcome": verify.ByOutcome,
    "stage": verify.ByStage,
    "threshold": verify.ByThreshold,
    "servo": verify.Servo,
    "measurement": verify.ByMeasurement,
    "expression": verify.ByExpression,
}
"""The class whose keys are allowed at a place, by the last word of pydantic's way to it."""

CHOICES = {
    "kind": "mcq, debug, predict, numeric, open or code; simlab or integrators for a lab",
    "by": "options, outcome, stage, threshold, measurement or expression",
}
"""What may stand at the key that says which class a part is of."""


def place(detail: ErrorDetails, item: Any) -> Iterator[str | int]:
    """Where a complaint stands in the JSON: pydantic's way, without the names of the classes that it tried."""
    for step in detail["loc"]:
        inside = item if isinstance(item, dict) else range(len(item)) if isinstance(item, list) else ()
        is_there = step in inside
        if is_there:
            item = item[step]
        if is_there or (detail["type"] == "missing" and step == detail["loc"][-1]):
            yield step
    if detail["type"].startswith("union_tag") and isinstance(item, dict):
        yield detail["ctx"]["discriminator"].strip("'") if "controls" not in detail["loc"] else "type"


def complaint(detail: ErrorDetails) -> str:
    """What is wrong, and the cure."""
    match detail["type"]:
        case "missing":
            return "is missing: add it"
        case "extra_forbidden":
            steps = [step for step in detail["loc"] if isinstance(step, str)]
            return f"unknown key: {suggestion(steps)}remove it, or begin it with x-"
        case "union_tag_not_found":
            name = detail["ctx"]["discriminator"].strip("'")
            near = difflib.get_close_matches(name, map(str, detail["input"]), n=1, cutoff=0.7)
            return f"is missing: {f'rename {near[0]!r}' if near else 'add it'} ({CHOICES.get(name, '')})"
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
