"""The JSON schema that editors use: it accepts all content of ours, and refuses nothing that the service reads."""

import copy
import json
import random

import jsonschema_rs
import pytest
from jsonschema import Draft202012Validator
from pydantic import ValidationError

from grader.exercises.running.planning import load_kinds, read_parameters
from grader.library.checking.schema import read_quiz
from grader.library.json_schema import build_quiz_schema
from grader.questions import Question
from grader.questions.kinds.script import ScriptQuestion
from library.mutations import contents, list_mutations, mutate
from support.command_line import grader


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    schema = build_quiz_schema()
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


QUIZZES = [
    (number, name)
    for number, files in enumerate(contents())
    for name in files
    if name.startswith("quizzes/") and ".json" in name
]


@pytest.mark.parametrize(("number", "name"), QUIZZES)
def test_all_content_of_ours_is_valid(number: int, name: str, validator: Draft202012Validator) -> None:
    assert [error.message for error in validator.iter_errors(json.loads(contents()[number][name]))] == []


@pytest.mark.slow
def test_what_the_schema_refuses_the_service_refuses_too() -> None:
    """And what is misspelt or of the wrong type an editor marks: most of what the service refuses by its shape."""
    validator = jsonschema_rs.Draft202012Validator(build_quiz_schema())
    refused, missed = 0, list[str]()
    for mutation in random.Random(1).sample(list(list_mutations()), 1000):
        quiz = mutate(json.loads(contents()[mutation.content][mutation.file]), mutation)
        is_valid = validator.is_valid(quiz)
        told = read_quiz(json.loads(json.dumps(quiz)), "")
        if told.faults or any(map(has_wrong_parameters, told.questions)):
            refused += 1
            missed += [str(mutation)] * is_valid
        else:
            assert is_valid, str(mutation)
    assert refused > 300
    assert len(missed) < refused / 5, missed


def has_wrong_parameters(question: Question) -> bool:
    """Whether an exercise's `check` is refused by its shape, which is found when it is rehearsed."""
    if not isinstance(question, ScriptQuestion):
        return False
    kind = load_kinds().get(question.check.kind)
    try:
        if kind is not None:
            read_parameters(kind, question)
    except ValidationError:
        return True
    return kind is None


def test_a_misspelt_key_is_marked_where_it_stands(validator: Draft202012Validator) -> None:
    number, name = next((number, name) for number, name in QUIZZES if name.endswith("1.3-check.json"))
    quiz = json.loads(contents()[number][name])
    wrong = copy.deepcopy(quiz)
    wrong["questions"][0]["anwser"] = 1
    (error,) = validator.iter_errors(wrong)
    assert list(error.path) == ["questions", 0]
    wrong = quiz | {"$schema": "../quiz.schema.json", "x-note": "mine", "titel": "T"}
    (error,) = validator.iter_errors(wrong)
    assert "'titel' does not match" in error.message


def test_the_command_prints_the_schema() -> None:
    done = grader("schema")
    assert json.loads(done.stdout) == build_quiz_schema()
