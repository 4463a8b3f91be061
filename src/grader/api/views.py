"""The shapes of what the routes answer, where no other module has them. Fields that are null say so."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from grader.api.bodies import ResponseBody
from grader.courses.people.identity import Role, Scope
from grader.domain.policy import Policy
from grader.questions import installed_kinds


class QuizSummary(ResponseBody):
    """A quiz as an item of the list."""

    id: str
    title: str
    questions: int
    points: float
    opens: datetime | None
    due: datetime | None


class QuestionView(ResponseBody):
    """A question as a learner sees it; each kind has further fields, such as `options` or `unit`."""

    model_config = ConfigDict(extra="allow")

    id: str
    kind: Annotated[str, Field(json_schema_extra={"enum": [*installed_kinds()]})]
    label: str | None
    title: str | None
    q: str
    points: float
    attempts: int | None


class QuizView(ResponseBody):
    """A quiz as a learner sees it."""

    id: str
    title: str
    policy: dict[str, Any]
    questions: list[QuestionView]
    labs: list[dict[str, Any]]


class LoadedQuiz(ResponseBody):
    """A quiz that was loaded, with the digest of its content."""

    id: str
    digest: str


class LoadedContent(ResponseBody):
    """The content that was loaded."""

    quizzes: list[LoadedQuiz]


class ExtensionView(ResponseBody):
    """An extension for one learner."""

    learner: str
    user: str
    due: datetime | None
    until: datetime | None
    attempts: int
    granted_by: str


class GivenExtension(ExtensionView):
    """An extension, and when it was given."""

    created_at: datetime


class CoursePolicyView(ResponseBody):
    """The policy of a quiz that is in force in a course, the one of the content, and the `changes` of the course with
    who made them. `conflicts` names what does not fit together any more since the content has changed."""

    quiz: str
    policy: Policy
    content: Policy
    changes: dict[str, Any]
    conflicts: list[str]
    changed_by: str | None
    changed_at: datetime | None


class LearnerKey(ResponseBody):
    """A person as another system knows them; in the namespace `grader`, the id of a member whom none knows."""

    namespace: str
    id: str


class CallerView(ResponseBody):
    """The member whose credential was sent; `scopes` of a restricted token, null for all rights of the role."""

    id: str
    user: str
    role: Role
    course: str
    scopes: list[Scope] | None


class PlatformCourse(ResponseBody):
    """A course of a learning platform."""

    platform: str
    course: str


class MemberView(ResponseBody):
    """A member of the course. `way_in` says how the member is found again, `platforms` from where launches come,
    `named_by` which instructor set the name; null while it follows platforms and rosters.
    `same_email` are other members with the same address: perhaps one person on two rosters. They are never merged: an
    address on another roster may be anybody's, and merging would hand over the work of its owner."""

    id: str
    name: str
    named_by: str | None
    role: Role
    way_in: Literal["name", "oidc", "lms", "lti", "browser"]
    created_at: datetime
    learner: LearnerKey
    email: str | None
    platforms: list[PlatformCourse]
    same_email: list[str]


class NewInvitation(ResponseBody):
    """A new invitation with its link."""

    id: str
    name: str
    member: str
    role: Role
    url: str
    expires_at: datetime


class CredentialView(ResponseBody):
    """A token or a link without its secret. `scopes` are null for all that the role may; `label` names a device."""

    id: str
    name: str
    member: str
    role: Role
    scopes: list[Scope] | None
    label: str | None
    created_at: datetime
    created_by: str | None
    expires_at: datetime | None
    last_used_at: datetime | None


class NewToken(ResponseBody):
    """A new token: the only time that it is shown."""

    token: str


class NewDeviceView(ResponseBody):
    """The codes of a device that asks for a token, as RFC 8628 names them. Times are in seconds."""

    device_code: str
    user_code: str
    verification_uri: str
    verification_uri_complete: str
    interval: int
    expires_in: int


class DeviceTokenView(ResponseBody):
    """The token of a device, as RFC 6749 names it: the only time that it is shown. `expires_in` is in seconds."""

    access_token: str
    token_type: str
    expires_in: int
    scope: str
    user: str
    course: str


class CourseView(ResponseBody):
    """The course, and the link with which learners join it; null while it is closed to them."""

    course: str
    join_url: str | None


class TaughtCourseView(ResponseBody):
    """A course in which the caller is an instructor: who they are in it, how many learners it has, and whether the
    token or session is of it."""

    course: str
    member: str
    name: str
    learners: int
    is_current: bool


class NewCourse(ResponseBody):
    """A new course, and a single-use link with which its first instructor signs in."""

    course: str
    member: str
    url: str
    expires_at: datetime


class AuditView(ResponseBody):
    """Who did what in the course."""

    id: str
    at: datetime
    actor: str | None
    name: str | None
    action: str
    subject: str
    detail: dict[str, Any]


class ResultView(ResponseBody):
    """A row of the feed: what counts for a learner at a question from here on. `member` is the learner's id here."""

    user: str
    submission_id: str
    learner: LearnerKey
    member: str
    quiz: str
    question: str
    attempt: int | None
    points: float
    max_points: float
    is_late: bool
    is_final: bool
    revision: int
    created_at: datetime


class StatisticsView(ResponseBody):
    """The statistics of a quiz; the numbers are of learners."""

    quiz: str
    learners: int
    questions: list[dict[str, Any]]


class Check(ResponseBody):
    """What one check of readiness found."""

    model_config = ConfigDict(extra="allow")

    ok: bool


class Ready(ResponseBody):
    """What all checks found."""

    status: Literal["ready"]
    checks: dict[str, Check]
