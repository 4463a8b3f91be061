"""The draft of a course in the service: what its content folder changes, what the keys say of it, and Publish."""

from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import urlencode

from fastapi import Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.certify.keys import propose_for_question
from grader.courses.answering.policies import read_policies
from grader.courses.reviewing.rubric_changes import count_followers
from grader.errors import ContentError, NotFound, Outdated
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.grading.content import Draft, revise
from grader.library import Library
from grader.library.changes import ADDED, CHANGED, REMOVED, Change, list_changes
from grader.library.edits import join_path
from grader.questions import kind_of
from grader.store import results
from grader.web.author.preview import STATES, build_preview, list_samples
from grader.web.frame.inputs import Form, Instructor
from grader.web.frame.rendering import page
from grader.web.instructor.certificates import list_certificates
from grader.web.text.numbers import write_points
from grader.web.text.questions import list_titles

PAGE = "/instructor/draft"

Answered = Mapping[tuple[str, str], Mapping[float, int]]
"""How many learners have answered, by quiz and question, and by what their results are out of."""

NO_REVISION = "The form names no revision: read the changes again, and publish from the page."

router = page_router()


@router.get(PAGE)
def show_draft(request: Request, services: AppServices, who: Instructor) -> Response:
    """What the folder changes beside the content that is in use, and what is wrong with it. Raises Unauthorized,
    Forbidden."""
    return render(request, services, who)


@router.post(PAGE)
def publish(request: Request, services: AppServices, who: Instructor, form: Form) -> Response:
    """Publishes the folder, if it is as the form's `revision` says. With a fault, or after another change, nothing is
    published, and the page says why. Raises Unauthorized, Forbidden."""
    try:
        services.reload_content(who, form.get("revision", ""))
    except Outdated as error:
        return render(request, services, who, str(error) if form.get("revision") else NO_REVISION, 412)
    except ContentError:
        return render(request, services, who, "Nothing was published: mend the faults below.", 422)
    query = {"loaded": "published", "regrade": form.get("regrade", "")}
    return RedirectResponse(f"/instructor/content?{urlencode({name: it for name, it in query.items() if it})}", 303)


@router.get(f"{PAGE}/{{quiz_id}}/{{question_id}}")
def show_question(
    quiz_id: str, question_id: str, request: Request, services: AppServices, who: Instructor, *,
    state: str = "unanswered",
) -> Response:  # fmt: skip
    """A question of the folder in a state, as a student of the course will see it, with its certificate or a proposal.
    Raises NotFound, Unauthorized, Forbidden."""
    library = services.content.get(who.course).read_draft().library
    if library is None:
        raise NotFound("The folder has faults: mend them, and its questions can be seen.")
    quiz, question = library.find(quiz_id, question_id)
    chosen = state if state in STATES else "unanswered"
    with services.database.read() as session:
        policy = read_policies(session, library, who.course, [quiz_id])[quiz_id]
    passed = services.content.archive.passed
    rows = list_certificates(library, passed)
    return page(
        request, "draft_question.html", who=who, quiz=quiz, question=question_id, state=chosen, states=STATES,
        preview=build_preview(library, quiz, question, chosen, policy), samples=list_samples(question), seen_as=True,
        starter=library.starter(question) if kind_of(question).is_script else None, learner="",
        proposals=[proposal.to_json() for proposal in propose_for_question(library, quiz_id, question, passed)],
        certificates=[row for row in rows if (row["quiz"], row["question"]) == (quiz_id, question_id)],
    )  # fmt: skip


def render(request: Request, services: AppServices, who: Instructor, trouble: str = "", status: int = 200) -> Response:
    """Renders the page of the draft."""
    content = services.content.get(who.course)
    draft, now = content.read_draft(), content.library
    changes = list_changes(now, draft.library) if draft.library is not None else []
    with services.database.read() as session:
        sharing = services.list_sharing(session, who.course)
        answered = count_answered(session, sharing, changes)
    marked = {} if draft.library is None else count_marked(services, who.course, draft.library, changes)
    rows = [describe_change(change, now, draft, answered, marked) for change in changes]
    remarks = (
        [warning for warning in draft.library.warnings if warning not in now.warnings]
        if draft.library is not None
        else []
    )
    return page(
        request, "draft.html", status, who=who, draft=draft, rows=rows, trouble=trouble, remarks=remarks,
        others=len(sharing) - 1,
        is_same=draft.library is not None and draft.revision == revise(now),
        to_regrade=[f"{row['quiz']}/{row['part']}" for row in rows if row["regrade"]],
    )  # fmt: skip


def count_answered(session: Session, courses: Sequence[str], changes: list[Change]) -> Answered:
    """Returns how many learners of some courses have an attempt that counts, at the quizzes that change."""
    return {
        (quiz, question): by_maximum
        for quiz in sorted({change.quiz for change in changes})
        for question, by_maximum in results.count_learners(session, courses, quiz).items()
    }


def count_marked(
    services: AppServices, course: str, library: Library, changes: list[Change]
) -> dict[tuple[str, str], int]:
    """Returns how many learners have marks that publishing computes again, by quiz and changed question."""
    with services.database.read() as session:
        return {
            (change.quiz, change.part): count_followers(
                session, change.quiz, library.question(change.quiz, change.part), course
            )
            for change in changes
            if change.how == CHANGED and change.is_question and change.part
        }


def describe_change(
    change: Change, now: Library, draft: Draft, answered: Answered, marked: dict[tuple[str, str], int],
) -> dict[str, Any]:  # fmt: skip
    """Returns a change as cells of the table: what it is of, what happens, what that means."""
    assert draft.library is not None
    if change.lesson:
        meaning = "Learners read it on the page of the lesson."
        return {"quiz": f"lessons/{change.lesson}.md", "part": "", "how": change.how, "title": "Text of the lesson",
                "edits": change.edits, "regrade": False, "meaning": meaning, "points": "", "address": None}  # fmt: skip
    library = now if change.how == REMOVED else draft.library
    by_maximum = answered.get((change.quiz, change.part), {})
    learners = sum(by_maximum.values())
    if not change.part:
        learners = sum(sum(counts.values()) for (quiz, _), counts in answered.items() if quiz == change.quiz)
    title = library.quiz(change.quiz).title
    if change.part and change.is_question:
        title = list_titles(library)[change.quiz, change.part]
    return {
        "quiz": change.quiz, "part": change.part, "how": change.how, "title": title,
        "edits": [edit._replace(path=join_path(change.part, edit.path)) for edit in change.edits],
        "regrade": bool(learners and change.is_for_regrade),
        "meaning": describe_meaning(change, learners, marked.get((change.quiz, change.part), 0)),
        "points": describe_points(
            change.part, now.question(change.quiz, change.part).points, by_maximum,
            now=library.question(change.quiz, change.part).points,
        )
        if learners and change.is_for_regrade and "points" in change.keys
        else "",
        "address": f"{PAGE}/{change.quiz}/{change.part}"
        if change.part and change.is_question and change.how != REMOVED
        else None,
    }  # fmt: skip


def describe_points(question: str, before: float, by_maximum: Mapping[float, int], *, now: float) -> str:
    """Returns what other points of a question mean for the results of learners, whose number is given by what they are
    out of: they stay so until a regrade."""
    opening = f"The points of {question} change from {write_points(before)} to {write_points(now)}"
    others = [
        f"{'1 learner has results' if learners == 1 else f'{learners} learners have results'} out of {write_points(of)}"
        for of, learners in sorted(by_maximum.items())
        if of != now
    ]
    if not others:
        return f"{opening}, and all results are out of {write_points(now)} already."
    return (
        f"{opening}: {', '.join(others)}. They stay so until a regrade brings them to {write_points(now)}; what a "
        "reviewer decided stays."
    )


def describe_meaning(change: Change, learners: int, marked: int = 0) -> str:
    """Returns a sentence on what a change means for learners who have answered, of whom so many were `marked` by the
    rubric that changes."""
    have = "1 learner has answered" if learners == 1 else f"{learners} learners have answered"
    if change.how == ADDED:
        return "Learners see it once it is published."
    if change.is_question and not learners and change.part:
        return "Nobody has answered it yet."
    if change.how == REMOVED and learners:
        return f"{have}: it leaves their pages and the gradebook."
    if marked:
        again = f"publishing computes the marks by the rubric again, those of {marked} of them, at once"
        return f"{have}: {again}{'; other verdicts stay until you regrade them' if change.is_for_regrade else ''}."
    if change.is_for_regrade:
        return f"{have}: their verdicts stay until you regrade them."
    return "No verdict can differ."
