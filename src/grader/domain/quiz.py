"""Quiz and Question, in the JSON that the course's authors already write (plus this service's optional keys)."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from grader.domain.lab import Lab, LabConfig
from grader.domain.run import Limits
from grader.domain.verify import Verify


def _index_of_option(answer: int, info: ValidationInfo) -> int:
    options = info.data.get("options")
    if options is not None and answer >= len(options):
        which = {"answer": answer, "last": len(options) - 1}
        raise PydanticCustomError("option_index", "there is no option {answer}: they go from 0 to {last}", which)
    return answer


OptionIndex = Annotated[int, Field(ge=0, strict=True), AfterValidator(_index_of_option)]
"""The 0-based index of one of the `options`, which must stand before it in the class."""


class QuestionPart(BaseModel):
    """What every question has. `id` is given by position where the author gave none."""

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


class PredictQuestion(QuestionPart):
    """A choice made before the simulation in `sim` may be run."""

    kind: Literal["predict"]
    options: tuple[str, ...] = Field(min_length=2)
    answer: OptionIndex
    sim: LabConfig | None = None


class NumericQuestion(QuestionPart):
    """A number in `unit`; right within `tol` (absolute, in that unit; 2 % of |answer| where it is not given)."""

    kind: Literal["numeric"]
    answer: float = Field(allow_inf_nan=False, strict=True)
    tol: float | None = Field(default=None, ge=0, allow_inf_nan=False, strict=True)
    unit: str | None = None

    @property
    def tolerance(self) -> float:
        """Absolute, in the question's unit. Source: the course's own quiz widget."""
        return self.tol if self.tol is not None else 0.02 * abs(self.answer)


class OpenQuestion(QuestionPart):
    """A text that an instructor reviews against `reference`."""

    kind: Literal["open"]
    reference: str | None = None


class CheckSpec(BaseModel):
    """Which registered checker judges an exercise, and with what parameters, tolerances and cases."""

    model_config = ConfigDict(frozen=True, extra="allow")

    kind: str

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Everything but the checker's name; the checker validates it."""
        return self.model_extra or {}


class CodeQuestion(QuestionPart):
    """An exercise: a script whose `entry` function is called in the jail and judged by simulating again."""

    kind: Literal["code"]
    starter: str | None = None
    entry: str = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")
    check: CheckSpec
    limits: Limits = Limits()


Question = Annotated[
    ChoiceQuestion | PredictQuestion | NumericQuestion | OpenQuestion | CodeQuestion,
    Field(discriminator="kind"),
]


class Quiz(BaseModel):
    """One file of questions, and of the labs that stand beside them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    title: str
    questions: tuple[Question, ...] = ()
    labs: tuple[Lab, ...] = ()
