"""Quiz: the JSON of the course's quiz widget, plus optional keys of this service."""

from pydantic import BaseModel, ConfigDict, Field

from grader.domain.policy import Policy
from grader.domain.rubric import SecondMarking
from grader.labs import AnyLab
from grader.questions.registry import AnyQuestion


class LessonHead(BaseModel):
    """What the page of a lesson says of it: its name without the number, and a sentence."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str = Field(min_length=1)
    summary: str | None = None


class Quiz(BaseModel):
    """One file of questions and labs. `lesson` is about the lesson that the quiz is of. `default_policy`, the
    key `policy`, holds where a course has set nothing else: `read_policies` tells what is in force. `anonymous` keeps
    the learners' names from their reviewers; `second_marking` has answers marked a second time."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)  # kinds are loaded at first use

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    title: str
    lesson: LessonHead | None = None
    default_policy: Policy = Field(default=Policy(), alias="policy")
    anonymous: bool = True
    second_marking: SecondMarking | None = None
    questions: tuple[AnyQuestion, ...] = ()
    labs: tuple[AnyLab, ...] = ()
