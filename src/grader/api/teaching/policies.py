"""`/quizzes/{quiz}/policy`: the dates and rules of a quiz in the caller's course."""

from typing import Annotated, Any

from fastapi import Header, Response
from pydantic import ConfigDict, WithJsonSchema

from grader.api.bodies import RequestBody
from grader.api.views import CoursePolicyView
from grader.courses.answering.policies import CoursePolicy, change_policy, read_course_policy
from grader.errors import Unconditional
from grader.gate.callers import Instructor, api_router
from grader.gate.conditional import is_unchanged
from grader.gate.problems import refusals
from grader.gate.services import AppServices

router = api_router("dates")

Scalar = str | int | float | bool | None
"""What a value may be before it is checked: nothing is nested but `late`."""

Moment = Annotated[Scalar, WithJsonSchema({"type": ["string", "null"], "format": "date-time"})]
Word = Annotated[Scalar, WithJsonSchema({"type": "string"})]


class PolicyBody(RequestBody):
    """The values that the course sets in place of those of the content, as under `policy` in a quiz file. A key that is
    left out has the content's value; null takes a date or a limit away. The values are checked as those of a quiz
    file are."""

    model_config = ConfigDict(extra="allow")

    __pydantic_extra__: dict[str, Scalar]

    attempts: Annotated[Scalar, WithJsonSchema({"type": ["integer", "null"], "minimum": 1})] = None
    opens: Moment = None
    due: Moment = None
    late: Annotated[dict[str, Scalar] | Scalar, WithJsonSchema({"type": ["object", "null"]})] = None
    counts: Word = None
    feedback: Word = None
    solutions: Word = None


@router.get("/quizzes/{quiz_id}/policy", response_model=CoursePolicyView, responses=refusals(401, 403, 404, 422, 429))
def show_policy(quiz_id: str, who: Instructor, services: AppServices, response: Response) -> dict[str, Any]:
    """Shows the dates and rules of a quiz in the caller's course, and which of them the course has set."""
    quiz = services.content.get(who.course).library.quiz(quiz_id)
    with services.database.read() as session:
        return describe_policy(read_course_policy(session, quiz, who.course), response)


@router.put(
    "/quizzes/{quiz_id}/policy",
    response_model=CoursePolicyView,
    responses=refusals(401, 403, 404, 412, 413, 422, 428, 429),
)
def put_policy(
    quiz_id: str, body: PolicyBody, who: Instructor, services: AppServices, response: Response, *,
    if_match: Annotated[str | None, Header(max_length=255)] = None,
) -> dict[str, Any]:  # fmt: skip
    """Sets dates and rules of a quiz for the caller's course alone, and counts its results again.

    It replaces all that the course had set; `{}` goes back to the content's values. `If-Match` is the ETag of what you
    saw, or `*`.
    """
    library = services.content.get(who.course).library
    quiz = library.quiz(quiz_id)
    if if_match is None:
        raise Unconditional("Name the ETag of the policy in If-Match.")
    changed = change_policy(
        services.database, library, who, quiz, body.model_dump(exclude_unset=True),
        is_current=lambda now: is_unchanged(if_match, compute_etag(now)),
    )  # fmt: skip
    return describe_policy(changed, response)


def describe_policy(policy: CoursePolicy, response: Response) -> dict[str, Any]:
    """The policy as plain JSON; sets the ETag of the response."""
    response.headers["ETag"] = compute_etag(policy)
    return {
        "quiz": policy.quiz,
        "policy": policy.in_force,
        "content": policy.default,
        "changes": policy.changes,
        "conflicts": policy.conflicts,
        "changed_by": policy.changed_by,
        "changed_at": policy.changed_at,
    }


def compute_etag(policy: CoursePolicy) -> str:
    """Changes whenever a value does."""
    return f'"{policy.version}"'
