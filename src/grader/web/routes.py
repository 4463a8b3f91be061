"""All pages: those of learners, `/instructor`, sign-in, and their files."""

from fastapi import APIRouter, Request
from fastapi.responses import Response

from grader.web.frame import assets
from grader.web.instructor import (
    extensions,
    gradebook,
    people,
    platforms,
    regrades,
    review,
    review_list,
    seen_as,
    service,
    statistics,
    today,
)
from grader.web.learner import answering, pages
from grader.web.platform import lti
from grader.web.signing_in import links, oidc

router = APIRouter(include_in_schema=False)
router.include_router(pages.router)
router.include_router(answering.router)
router.include_router(links.router)
router.include_router(oidc.router)
router.include_router(today.router)
router.include_router(review_list.router)
router.include_router(review.router)
router.include_router(people.router)
router.include_router(gradebook.router)
router.include_router(statistics.router)
router.include_router(extensions.router)
router.include_router(service.router)
router.include_router(seen_as.router)
router.include_router(regrades.router)
router.include_router(lti.router)
router.include_router(platforms.router)


@router.get("/favicon.ico")
async def favicon(request: Request) -> Response:
    """The icon, at the address where browsers look for it."""
    return await assets.static_file("icon.svg", request.scope)


@router.get("/static/{path:path}")
async def static_file(path: str, request: Request) -> Response:
    """Styles, scripts and fonts."""
    return await assets.static_file(path, request.scope)
