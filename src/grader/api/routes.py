"""All routes of the JSON API, with health."""

from fastapi import APIRouter, FastAPI

from grader.api import health
from grader.api.learning import devices, events, labs, quizzes, submissions
from grader.api.services import on_behalf, platforms, results, roster, webhooks
from grader.api.teaching import (
    courses,
    extensions,
    gradebook,
    people,
    regrades,
    reviews,
    saved_comments,
    statistics,
)
from grader.gate.admission import PREFIX
from grader.gate.callers import bearer

v1 = APIRouter(prefix=PREFIX, dependencies=[bearer])
v1.include_router(quizzes.router)
v1.include_router(submissions.router)
v1.include_router(on_behalf.router)
v1.include_router(events.router)
v1.include_router(reviews.router)
v1.include_router(saved_comments.router)
v1.include_router(labs.router)
v1.include_router(people.router)
v1.include_router(courses.router)
v1.include_router(devices.router)
v1.include_router(roster.router)
v1.include_router(results.router)
v1.include_router(gradebook.router)
v1.include_router(statistics.router)
v1.include_router(extensions.router)
v1.include_router(regrades.router)
v1.include_router(platforms.router)
v1.include_router(webhooks.router)


def include_in(app: FastAPI | APIRouter) -> None:
    """Adds all routes to an app, in the order in which they are looked through. Answers come first, in routers that
    include no other: FastAPI asks all routers inside a router, with every request, whether routes have changed."""
    for router in (submissions.answers, on_behalf.answers, v1, health.router):
        app.include_router(router)
