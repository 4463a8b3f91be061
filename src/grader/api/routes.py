"""All routes of this room."""

from fastapi import APIRouter

from grader.api import events, health, labs, quizzes, reviews, signin, submissions
from grader.api.context import bearer
from grader.api.gate import PREFIX

v1 = APIRouter(prefix=PREFIX, dependencies=[bearer])
v1.include_router(quizzes.router)
v1.include_router(submissions.router)
v1.include_router(events.router)
v1.include_router(reviews.router)
v1.include_router(labs.router)

router = APIRouter()
router.include_router(v1)
router.include_router(health.router)
router.include_router(signin.router)
