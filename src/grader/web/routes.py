"""All pages: those of learners, `/instructor`, sign-in, and their files."""

from fastapi import Request
from fastapi.responses import Response

from grader.gate.late_routes import page_router
from grader.web.author import draft
from grader.web.cohort import alike_page, answers_page, learner_page, scripts_page, slides
from grader.web.frame import assets
from grader.web.instructor import (
    courses,
    dates,
    extensions,
    gradebook,
    learner_story,
    people,
    platforms,
    regrades,
    seen_as,
    service,
    statistics,
    today,
)
from grader.web.instructor.reviewing import reel, review, review_list, review_script
from grader.web.learner import answering, media, pages
from grader.web.platform import lti
from grader.web.signing_in import devices, links, oidc

router = page_router()
for room in (pages, media, answering, links, oidc, devices, today, review_list, review, review_script, people,
             gradebook, learner_story, reel, statistics, extensions, service, seen_as, regrades, lti, platforms,
             courses, dates, answers_page, scripts_page, slides, learner_page, alike_page, draft):  # fmt: skip
    router.routes.extend(room.router.routes)


@router.get("/favicon.ico")
async def favicon(request: Request) -> Response:
    """The icon, at the address where browsers look for it."""
    return await assets.static_file("icon.svg", request.scope)


@router.get("/static/{path:path}")
async def static_file(path: str, request: Request) -> Response:
    """Styles, scripts and fonts."""
    return await assets.static_file(path, request.scope)
