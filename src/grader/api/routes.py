"""All routes of the JSON API, with health."""

from fastapi import APIRouter, FastAPI

from grader.api import health
from grader.api.learning import devices, events, kits, labs, quizzes, submissions
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
for router, tag in (
    (quizzes.router, "quizzes"),
    (kits.router, "quizzes"),
    (submissions.router, "submissions"),
    (on_behalf.router, "submissions"),
    (events.router, "submissions"),
    (reviews.router, "reviews"),
    (saved_comments.router, "reviews"),
    (labs.router, "labs"),
    (people.router, "people"),
    (courses.router, "courses"),
    (devices.router, "devices"),
    (roster.router, "people"),
    (results.router, "results"),
    (gradebook.router, "results"),
    (statistics.router, "results"),
    (extensions.router, "dates"),
    (regrades.router, "regrades"),
    (platforms.router, "platforms"),
    (webhooks.router, "webhooks"),
):
    v1.include_router(router, tags=[tag])


def include_in(app: FastAPI | APIRouter) -> None:
    """Adds all routes to an app, in the order in which they are looked through. Answers come first, in routers that
    include no other: FastAPI asks all routers inside a router, with every request, whether routes have changed."""
    for answers in (submissions.answers, on_behalf.answers):
        app.include_router(answers, tags=["submissions"])
    app.include_router(v1)
    app.include_router(health.router, tags=["health"])
