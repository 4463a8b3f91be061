"""Quiz and Question: the JSON of the course's quiz widget, plus optional keys of this service."""

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from grader.domain.lab import Lab, LabConfig
from grader.domain.policy import Policy
from grader.domain.rubric import Rubric, SecondMarking
from grader.domain.run import Limits
from grader.domain.verify import Verify

ModelXml = Callable[[str], str]
"""Returns the MJCF text of a model of the content folder by name; raises NotFound if there is none."""


def _index_of_option(answer: int, info: ValidationInfo) -> int:
    options = info.data.get("options")
    if options is not None and answer >= len(options):
        which = {"answer": answer, "last": len(options) - 1}
        raise PydanticCustomError("option_index", "there is no option {answer}: they go from 0 to {last}", which)
    return answer


def _one_for_each_option(whys: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    options = info.data.get("options")
    if whys and options is not None and len(whys) != len(options):
        counts = {"whys": len(whys), "options": len(options)}
        raise PydanticCustomError("whys", "there are {whys} sentences for {options} options: give each its own", counts)
    return whys


Whys = Annotated[tuple[str, ...], AfterValidator(_one_for_each_option)]
"""A sentence on each of the `options`, a field that must be declared before it: why it is right or wrong."""

Reveal = Literal["direction", "size", "value"]
"""What the feedback on a wrong answer gives away, before the solution may be seen; each level includes the ones before.

- `direction`: whether it is too high or too low, or what is wrong;
- `size`: about how far it is off, and the slip behind it;
- `value`: what was expected.
"""

OptionIndex = Annotated[int, Field(ge=0, strict=True), AfterValidator(_index_of_option)]
"""The 0-based index of one of the `options`, a field that must be declared before it."""


class QuestionPart(BaseModel):
    """The fields of every question. Loading adds a missing `id` by position: q1, q2, ..."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    q: str = Field(min_length=1)
    label: str | None = None
    title: str | None = None
    explain: str | None = None
    points: float = Field(default=1.0, gt=0, le=1000, strict=True, allow_inf_nan=False)
    attempts: int | None = Field(default=None, ge=1, strict=True)
    verify: Verify | None = None


class ChoiceQuestion(QuestionPart):
    """One right option; `answer` is its 0-based index."""

    kind: Literal["mcq", "debug"]
    options: tuple[str, ...] = Field(min_length=2)
    answer: OptionIndex
    whys: Whys = ()


class PredictQuestion(QuestionPart):
    """A choice that the learner makes before running the simulation in `sim`."""

    kind: Literal["predict"]
    options: tuple[str, ...] = Field(min_length=2)
    answer: OptionIndex
    whys: Whys = ()
    sim: LabConfig | None = None


class NumericQuestion(QuestionPart):
    """A number in `unit`, correct within `tol` (absolute, in that unit; default 2 % of |answer|)."""

    kind: Literal["numeric"]
    answer: float = Field(allow_inf_nan=False, strict=True)
    tol: float | None = Field(default=None, ge=0, allow_inf_nan=False, strict=True)
    unit: str | None = None
    reveal: Reveal | None = None

    @property
    def tolerance(self) -> float:
        """Absolute, in the question's unit. Source: the course's own quiz widget."""
        return self.tol if self.tol is not None else 0.02 * abs(self.answer)


class OpenQuestion(QuestionPart):
    """A text that an instructor reviews; `reference` is a model answer."""

    kind: Literal["open"]
    reference: str | None = None
    rubric: Rubric = ()


class CheckSpec(BaseModel):
    """The kind of an exercise, and its parameters, tolerances and cases."""

    model_config = ConfigDict(frozen=True, extra="allow")

    kind: str

    @property
    def parameters(self) -> Mapping[str, Any]:
        """All keys but `kind`; the kind validates them."""
        return self.model_extra or {}


class CodeQuestion(QuestionPart):
    """An exercise: a script whose function `entry` is called in the jail and judged by an independent simulation."""

    kind: Literal["code"]
    starter: str | None = None
    entry: str = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")
    check: CheckSpec
    limits: Limits = Limits()
    rubric: Rubric = ()
    reveal: Reveal | None = None


Reviewable = OpenQuestion | CodeQuestion
"""The questions that may have a rubric."""

Question = Annotated[
    ChoiceQuestion | PredictQuestion | NumericQuestion | OpenQuestion | CodeQuestion,
    Field(discriminator="kind"),
]


class LessonHead(BaseModel):
    """What the page of a lesson says of it: its name without the number, and a sentence."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str = Field(min_length=1)
    summary: str | None = None


class Quiz(BaseModel):
    """One file of questions and labs.

    `lesson` is about the lesson that the quiz is of. `anonymous` keeps the learners' names from their reviewers;
    `second_marking` has answers marked a second time.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    title: str
    lesson: LessonHead | None = None
    policy: Policy = Policy()
    anonymous: bool = True
    second_marking: SecondMarking | None = None
    questions: tuple[Question, ...] = ()
    labs: tuple[Lab, ...] = ()
