"""All routes of the JSON API, with health."""

from fastapi import APIRouter, FastAPI

from grader.api import health
from grader.api.learning import devices, events, films, kits, labs, me, quizzes, submissions
from grader.api.services import on_behalf, platforms, results, roster, webhooks
from grader.api.teaching import (
    courses,
    extensions,
    gradebook,
    line_comments,
    people,
    policies,
    regrades,
    reviews,
    saved_comments,
    statistics,
)

ROOMS = (
    quizzes, kits, submissions, films, on_behalf, events, reviews, saved_comments, line_comments, labs, people, me,
    courses, devices, roster, results, gradebook, statistics, extensions, policies, regrades, platforms, webhooks,
    health,
)  # fmt: skip


def include_in(app: FastAPI | APIRouter) -> None:
    """Adds all routes to an app, in the order in which they are looked through: answers come first. They are added as
    they are: `include_router` would build each of them two more times, and ask with every request whether they have
    changed."""
    for router in (submissions.answers, on_behalf.answers, *(room.router for room in ROOMS)):
        app.routes.extend(router.routes)
