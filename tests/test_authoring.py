"""docs/authoring.md names every way to verify and every parameter, and its example is certified."""

import json
import re
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel, TypeAdapter

from grader.certify import certify_question
from grader.domain.quiz import Question
from grader.domain.verify import Servo, Verify
from grader.grading.exercise import CHECKERS
from grader.grading.rk4.parameters import OrderCheck, Rk4Case, Rk4Parameters, Start
from grader.grading.threshold.parameters import ThresholdParameters
from grader.grading.variant import Number

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/authoring.md").read_text(encoding="utf-8")
WAYS = get_args(get_args(Verify)[0])
PARTS = [*WAYS, Servo, ThresholdParameters, Rk4Parameters, Rk4Case, OrderCheck, Start, Number]


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.__name__)
def test_every_key_is_named(part: type[BaseModel]) -> None:
    named = set(re.findall(r"`([a-z_0-9]+)`", PAGE))
    assert set(part.model_fields) <= named


def test_every_kind_of_check_has_its_section() -> None:
    assert set(re.findall(r'^### `"kind": "(\w+)"`', PAGE, re.MULTILINE)) == set(CHECKERS)


def test_the_example_is_certified() -> None:
    (example,) = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)
    question = TypeAdapter[Question](Question).validate_python({"id": "q1", **json.loads(example)})
    certificate = certify_question(question, lambda name: (ROOT / f"models/{name}.xml").read_text(encoding="utf-8"))
    assert certificate is not None
    assert certificate.ok, certificate.why
