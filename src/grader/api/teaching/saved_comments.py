"""`/reviews/comments`: texts that the reviewers of a question use again."""

from typing import Annotated, Any

from fastapi import Query
from pydantic import Field, StringConstraints

from grader.api.bodies import RequestBody
from grader.api.paging import NO_NUL, Cut, Page
from grader.courses.reviewing import comments
from grader.gate.callers import Instructor, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices
from grader.store.reviewing.reviews import find_comments
from grader.store.tables import SavedComment

router = api_router("reviews")

CommentText = Annotated[
    str, StringConstraints(strip_whitespace=True, min_length=1, max_length=comments.CHARACTERS_MAX, pattern=NO_NUL)
]
Name = Annotated[str, Query(max_length=64, pattern=NO_NUL)]


class TextBody(RequestBody):
    """The text of a comment."""

    text: CommentText


class CommentBody(TextBody):
    """A comment on a question."""

    quiz: str = Field(max_length=64)
    question: str = Field(max_length=64)


@router.get("/reviews/comments", response_model=Page, responses=refusals(401, 403, 422, 429))
def list_comments(quiz: Name, question: Name, who: Instructor, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists the comments saved for a question of the course, oldest first."""
    with services.database.read() as session:
        comments = find_comments(session, who.course, quiz, question)
    return cut([describe_comment(comment) for comment in comments])


@router.post("/reviews/comments", status_code=201, responses=refusals(401, 403, 404, 409, 413, 422, 429))
def save_comment(body: CommentBody, who: Instructor, services: AppServices) -> dict[str, Any]:
    """Saves a comment for all instructors of the course; at most 200 for a question."""
    services.content.get(who.course).library.question(body.quiz, body.question)
    with services.database.write() as session:
        comment = comments.save(services.database, session, who, (body.quiz, body.question), body.text)
    return describe_comment(comment)


@router.put("/reviews/comments/{comment_id}", responses=refusals(401, 403, 404, 413, 422, 429))
def change_comment(comment_id: str, body: TextBody, who: Instructor, services: AppServices) -> dict[str, Any]:
    """Changes the text of a comment; reviews that used it stay as they are."""
    with services.database.write() as session:
        return describe_comment(comments.change(session, who, comment_id, body.text))


@router.delete("/reviews/comments/{comment_id}", status_code=204, responses=refusals(401, 403, 404, 422, 429))
def delete_comment(comment_id: str, who: Instructor, services: AppServices) -> None:
    """Deletes a comment."""
    with services.database.write() as session:
        comments.delete(session, who, comment_id)


def describe_comment(comment: SavedComment) -> dict[str, Any]:
    """A saved comment as plain JSON."""
    return {name: getattr(comment, name) for name in ("id", "quiz", "question", "text", "saved_by", "saved_at")}
