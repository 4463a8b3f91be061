"""Policy, Extension and Progress: when a quiz may be answered, what counts, and what a learner may see when."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Literal

from pydantic import AfterValidator, AwareDatetime, BaseModel, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticCustomError

EARLIEST, LATEST = datetime(2000, 1, 1, tzinfo=UTC), datetime(2200, 1, 1, tzinfo=UTC)
"""Years outside are typing errors; near year 1 and 9999 a moment cannot be converted to UTC."""


def _utc(moment: datetime) -> datetime:
    return moment.astimezone(UTC)


Moment = Annotated[AwareDatetime, Field(ge=EARLIEST, lt=LATEST), AfterValidator(_utc)]
"""ISO 8601 with an offset, such as 2026-03-01T18:00+01:00; kept in UTC."""

Share = Annotated[float, Field(ge=0, le=1, strict=True, allow_inf_nan=False)]


class PolicyPart(BaseModel):
    """Frozen, and strict about its keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Late(PolicyPart):
    """Late answers are taken until `until`; points are multiplied by `per_day` for every day started since `due`.
    `floor` is the smallest multiplier. `until` is required: solutions stay closed while answers are still taken."""

    per_day: Share
    floor: Share = 0.0
    until: Moment


ONE_BY_ONE = "one by one"
"""The context of a validation that checks each value, but not whether the values fit each other."""


LATE_UNTIL = "needs a due date, and an until that is later"
"""Why dates of late answers are refused."""


def _after_opens(due: datetime | None, info: ValidationInfo) -> datetime | None:
    opens = info.data.get("opens")
    if info.context != ONE_BY_ONE and due is not None and opens is not None and due <= opens:
        raise PydanticCustomError("policy", "must be later than opens")
    return due


def _after_due(late: Late | None, info: ValidationInfo) -> Late | None:
    if info.context == ONE_BY_ONE or late is None or "due" not in info.data:
        return late
    due = info.data["due"]
    if due is None or late.until <= due:
        raise PydanticCustomError("policy", LATE_UNTIL)
    return late


def _with_due(when: str, info: ValidationInfo) -> str:
    if info.context != ONE_BY_ONE and when == "after_due" and info.data.get("due", when) is None:
        raise PydanticCustomError("policy", "after_due needs a due date: add due")
    return when


class Policy(PolicyPart):
    """The rules of one quiz; every key may be left out. A question's own `attempts` overrides the quiz's. Answers are
    taken from `opens` to `due`, both included, and where `late` is given until its `until`. `counts` says which
    attempts make the points. `feedback` says when a learner sees how an answer was graded, `solutions` when the right
    answer and its explanation: never before the feedback. `after_due` means once the learner can hand in no more
    answers, so that no late answer copies a published solution."""

    attempts: int | None = Field(default=None, ge=1, strict=True)
    opens: Moment | None = None
    due: Annotated[Moment | None, AfterValidator(_after_opens)] = None
    late: Annotated[Late | None, AfterValidator(_after_due)] = None
    counts: Literal["best", "latest", "average"] = "best"
    feedback: Annotated[Literal["immediate", "after_due", "after_publish"], AfterValidator(_with_due)] = "immediate"
    solutions: Annotated[
        Literal["with_feedback", "when_right_or_spent", "after_due", "never"], AfterValidator(_with_due)
    ] = "when_right_or_spent"

    @property
    def shows_feedback_at_once(self) -> bool:
        """Whether learners see with every verdict how they were graded."""
        return self.feedback == "immediate"


class Extension(PolicyPart):
    """Later dates, and further attempts at every question of the quiz, for one learner. Dates that are earlier than the
    policy's change nothing."""

    due: Moment | None = None
    until: Moment | None = None
    attempts: int = Field(default=0, ge=0, le=1000, strict=True)


@dataclass(frozen=True)
class Progress:
    """Counts of a learner's attempts at a question, from which decisions are made without reading the attempts. `used`
    counts the attempts against the limit, `pending` those of them without a verdict. `solved` says whether an attempt
    is right."""

    used: int = 0
    pending: int = 0
    solved: bool = False
