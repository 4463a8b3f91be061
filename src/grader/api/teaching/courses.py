"""`/courses`: the courses that the caller teaches; an administrator makes new ones."""

from typing import Any

from fastapi import Request

from grader.api.bodies import RequestBody
from grader.api.paging import Cut, Page
from grader.api.views import NewCourse, TaughtCourseView
from grader.courses.people import courses, invitations
from grader.gate.callers import Instructor, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices

router = api_router("courses")


class CourseBody(RequestBody):
    """The course to make."""

    name: str


@router.get("/courses", response_model=Page[TaughtCourseView], responses=refusals(401, 403, 422, 429))
def list_courses(who: Instructor, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists the courses that the caller teaches and has made or added on the page Courses.

    A restricted token lists none.
    """
    with services.database.read() as session:
        taught = courses.list_taught(session, who)
    return cut([vars(course) | {"member": course.member.id, "name": course.member.name} for course in taught])


@router.post("/courses", status_code=201, response_model=NewCourse, responses=refusals(401, 403, 409, 413, 422, 429))
def make_course(body: CourseBody, who: Instructor, services: AppServices, request: Request) -> dict[str, Any]:
    """Makes a course, whose instructor the caller becomes. The sign-in link is shown this once.

    For instructors of the course `default`. 409 if somebody has the course already. A restricted token makes none.
    """
    with services.database.write() as session:
        member = courses.make_course(services.database, session, who, body.name)
        link = invitations.invite_member(session, who, member)
    url = f"{services.origin_of(request)}/signin?code={link.code}"
    return {"course": member.course, "member": member.id, "url": url, "expires_at": link.expires_at}
