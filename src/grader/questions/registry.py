"""Finds the installed kinds of question, and asks them: to validate authors' JSON, to read and to grade an answer."""

import inspect
import json
from collections.abc import Iterator, Mapping
from functools import cache, reduce
from importlib.metadata import EntryPoint
from operator import or_
from pathlib import Path
from typing import Annotated, Any

import structlog
from pydantic import Field, GetCoreSchemaHandler, TypeAdapter
from pydantic_core import CoreSchema

from grader.domain.plugins import find_points, load_point
from grader.domain.verdict import Status, Verdict
from grader.errors import InvalidAnswer, PluginError
from grader.questions.drawing import fill_in_middle, get_draw
from grader.questions.kind import TEMPLATE, Fields, QuestionKind
from grader.questions.question import Question

GROUP = "grader.question_kinds"
"""The entry-point group in which kinds of question are found."""

AnyKind = QuestionKind[Any, Any]

log = structlog.get_logger()


@cache
def installed_kinds() -> Mapping[str, AnyKind]:
    """Returns every installed kind by each of its names, in the order of the names of the entry points. Raises
    PluginError if two kinds claim one name, or if a kind cannot be loaded or is not whole."""
    kinds: dict[str, AnyKind] = {}
    for point in sorted(find_points(GROUP)):
        kind = load_kind(point)
        for name in kind.names:
            if name in kinds:
                raise PluginError(f"two installed kinds are called {name!r}, one of them in {point.value}: remove one")
            kinds[name] = kind
    if not kinds:
        raise PluginError("no kind of question is installed: install the grader again, such as with `make install`")
    return kinds


def load_kind(point: EntryPoint) -> AnyKind:
    """Makes the kind of an entry point. Raises PluginError."""
    kind: AnyKind = load_point(point, "question kind")
    if faults := "; ".join(kind_faults(kind)):
        raise PluginError(f"the question kind {point.name!r} ({point.value}) is not whole: {faults}")
    return kind


def kind_faults(kind: Any) -> Iterator[str]:
    """Yields what a kind lacks, with the cure."""
    if not isinstance(kind, QuestionKind):
        yield "derive it from grader.questions.QuestionKind"
        return
    model = getattr(kind, "question", None)
    if not (isinstance(model, type) and issubclass(model, Question)):
        yield "set `question` to a model that derives from grader.questions.Question"
    elif not kind.names:
        yield f"declare `kind: Literal[...]` in {model.__name__}, with the names that authors write"
    template = template_of(kind)
    if not template.is_file():
        yield f"put a template with its field at {template}"
    elif not kind.is_script and "macro field(" not in template.read_text(encoding="utf-8"):
        yield f"define the macro field(base, it) in {template}"


def template_of(kind: AnyKind) -> Path:
    """Returns where the template of a kind is: beside its module."""
    return Path(inspect.getfile(type(kind))).with_name(TEMPLATE)


def is_own(kind: AnyKind) -> bool:
    """Whether a kind is one of the grader's own, and not of another package."""
    return type(kind).__module__.startswith("grader.")


def kind_of(question: Question) -> AnyKind:
    """Returns the kind of a question."""
    return installed_kinds()[question.kind]


def show_answer(question: Question, answer: Any) -> str:
    """Returns an answer as plain text. Where the kind fails, of another package perhaps, the fault is logged, and the
    answer is told as it was stored: its page is there for a reviewer all the same."""
    try:
        return kind_of(question).show(question, answer)
    except Exception:  # code of another package: anything may be raised
        log.exception("a kind of question cannot show an answer", kind=question.kind)
        return answer if isinstance(answer, str) else json.dumps(answer)


def fill_form(question: Question, answer: Any) -> Fields:
    """Returns the fields of a form with an answer; none where the kind fails, as in `show_answer`."""
    try:
        return kind_of(question).to_form(question, answer)
    except Exception:  # code of another package: anything may be raised
        log.exception("a kind of question cannot fill in its form", kind=question.kind)
        return {}


def carry_over(earlier: Question, question: Question, answer: Any) -> Any:
    """Returns an answer to an `earlier` version of a question as one to `question`. Raises InvalidAnswer where it is
    none: another kind of question has taken the id, other numbers are drawn, or what was chosen is gone."""
    kind = kind_of(question)
    if kind is not kind_of(earlier):
        raise InvalidAnswer("Another kind of question is asked now.")
    if get_draw(earlier) != get_draw(question):
        raise InvalidAnswer("The answer was given for other numbers.")
    return kind.carry_over(earlier, question, answer)


def read_answer(question: Question, answer: Any) -> str:
    """Return the answer as it is understood, for the learner to confirm. Raises InvalidAnswer with one sentence: why
    the answer cannot be read, and what would be readable."""
    kind = kind_of(question)
    return kind.describe(question, kind.read(question, answer))


def grade_answer(question: Question, answer: Any) -> Verdict:
    """Grade any JSON value; one that cannot be read gets `invalid_answer` and the reason. Of a wrong answer only
    `explain`, and `expected` of a finding, may contain the right one."""
    kind = kind_of(question)
    try:
        given = kind.read(question, answer)
    except InvalidAnswer as error:
        return Verdict(status=Status.INVALID_ANSWER, points=0.0, max_points=question.points, diagnosis=str(error))
    additions = {"read_as": kind.describe(question, given), "explain": question.explain}
    return kind.grade(question, given).model_copy(update=additions)


def question_type() -> Any:
    """Returns the type of a question of any installed kind, for pydantic."""
    models = dict.fromkeys(kind.question for kind in installed_kinds().values())
    return Annotated[reduce(or_, models), Field(discriminator="kind")]


@cache
def question_adapter() -> TypeAdapter[Question]:
    """Returns what validates and dumps a question of any installed kind."""
    return TypeAdapter(question_type())


def parse_question(raw: Any) -> Question:
    """Validates the JSON value of one question. Raises pydantic.ValidationError."""
    return question_adapter().validate_json(json.dumps(fill_in_middle(raw)), strict=True)


class _OfInstalledKinds:
    """Validates a field of a model as a question of any installed kind. Such a model sets `defer_build`."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Returns the schema of all kinds, which are loaded here for the first time."""
        return handler.generate_schema(question_type())


AnyQuestion = Annotated[Question, _OfInstalledKinds()]
