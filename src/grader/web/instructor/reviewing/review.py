"""`/instructor/review/{id}`: one answer with its question and verdict, and the form of its review. It needs no script.
Opening an answer that waits claims it, so that two reviewers never mark the same one."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import Depends, Query, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.courses.answering.access import read_access
from grader.courses.people.identity import Identity, Role
from grader.courses.people.namesakes import make_marks
from grader.courses.reviewing import comments, reviews
from grader.courses.reviewing.blinding import hide_names
from grader.courses.reviewing.desk import Desk
from grader.courses.rules.policy import format_moment
from grader.courses.rules.rubric import Mark
from grader.domain.verdict import NO_COMMENT, REVIEW, Status
from grader.errors import CallerError, NotFound, Outdated, Unprocessable
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.library import Library
from grader.questions import Question, kind_of, show_answer
from grader.store import submissions
from grader.store.reviewing import reviews as stored
from grader.store.reviewing.reviews import AGREED, DIFFERS, WaitingQuestion, find_comments
from grader.store.tables import Submission, now
from grader.web.frame.inputs import Form, Instructor, Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.reviewing.review_list import ALL, DIFFER, FIRST, PAGE, SECOND, Choice, name_learner
from grader.web.learner.pages import show_sign_in
from grader.web.text.prose import cached_prose
from grader.web.text.questions import list_titles, present_question
from grader.web.verdict.card import build_card
from grader.web.verdict.work import GivenAnswer, read_comments, read_in_full

COUNTED_MAX = 1000
"""Answers that are counted of those that wait."""

CHANGED = "The answer was marked or graded again since you opened it. Look at it once more, then decide."
NOTHING_TICKED = "Tick what holds, or give points; 0 points where nothing does."
NO_POINTS = "Give points."

router = page_router()


@dataclass(frozen=True)
class ReviewForm:
    """The fields of a review's form, as they were typed."""

    ticked: frozenset[str] = frozenset()
    points: str = ""
    comment: str = ""
    saved: str = ""
    """The id of the saved comment that is chosen."""


@dataclass(frozen=True)
class Sitting:
    """An instructor at the desk, with a list."""

    services: AppServices
    who: Instructor
    chosen: Choice

    @property
    def desk(self) -> Desk:
        """What reviewing in the instructor's course works with."""
        return self.services.desk_of(self.who.course)

    @property
    def is_second(self) -> bool:
        """Whether the answers of the list get their second mark."""
        return self.chosen.which == SECOND

    def redirect(self, path: str, **query: str) -> RedirectResponse:
        """To a page of the desk, which tells what was `said` of the `last` answer."""
        more = f"&{urlencode(query)}" if query else ""
        return RedirectResponse(f"{path}?{self.chosen.query}{more}", 303)


AtDesk = Annotated[Sitting, Depends()]


@router.post(f"{PAGE}/next")
def open_next(at: AtDesk) -> Response:
    """Redirects to the answer of a list that this reviewer holds; else claims the one that has waited longest. To the
    list once nothing waits."""
    return claim_next(at)


@router.post(f"{PAGE}/{{submission_id}}/claim")
def claim(submission_id: str, at: AtDesk) -> Response:
    """Claims an answer, and redirects to it. Raises Unauthorized, Forbidden, NotFound, Conflict."""
    with at.services.database.write() as session:
        at.desk.lock(session, at.who.course)
        reviews.claim(session, at.who, get_submission(session, at.who, submission_id), second=at.is_second)
    return at.redirect(f"{PAGE}/{submission_id}")


@router.get(f"{PAGE}/{{submission_id}}")
def show(
    request: Request, submission_id: str, services: AppServices, who: Visitor, chosen: Choice, *,
    said: Annotated[str, Query(max_length=16)] = "", last: Annotated[str, Query(pattern="^[0-9a-f]{0,32}$")] = "",
) -> Response:  # fmt: skip
    """One answer and the form of its review; to anyone but an instructor, how to sign in. Raises NotFound."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    return render(request, Sitting(services, who, chosen), submission_id, said=said, last=last)


@router.post(f"{PAGE}/{{submission_id}}")
def act(request: Request, submission_id: str, at: AtDesk, form: Form) -> Response:
    """Decides, gives the answer back, or works with saved comments; `do` says which. Shows the page again with what was
    typed if it is refused. Raises Unauthorized, Forbidden, NotFound."""
    do, typed = form.get("do", ""), parse_typed(form)
    try:
        if do in ("next", "decide"):
            said = decide(at, submission_id, typed, form.get("version", ""))
            if do == "next":
                return claim_next(at, said=said, last=submission_id)
            return at.redirect(f"{PAGE}/{submission_id}", said=said)
        if do == "withdraw":
            withdraw(at, submission_id, form.get("version", ""))
            return at.redirect(f"{PAGE}/{submission_id}", said="withdrawn")
        if do == "release":
            release(at, submission_id)
            return at.redirect(PAGE)
        typed = change_comments(at, submission_id, typed, do)
    except NotFound:
        raise
    except CallerError as error:
        status = 422 if isinstance(error, Unprocessable) else 409
        return render(request, at, submission_id, status, typed=typed, trouble=str(error))
    return render(request, at, submission_id, typed=typed)


def claim_next(at: Sitting, **query: str) -> RedirectResponse:
    """To the next answer of a list, claimed; to the list once nothing waits."""
    with at.services.database.write() as session:
        at.desk.lock(session, at.who.course)
        row = find_first(at, session)
        if row is None:
            return at.redirect(PAGE, **({"said": "none"} | query))
        reviews.claim(session, at.who, row, second=at.is_second)
    waiting = replace(at, chosen=replace(at.chosen, which=FIRST)) if at.chosen.which == ALL else at
    return waiting.redirect(f"{PAGE}/{row.id}", **query)


def find_first(at: Sitting, session: Session) -> Submission | None:
    """Returns the answer of a list that the reviewer holds, else the one that has waited longest, if one waits."""
    if at.chosen.which == DIFFER:
        differ = stored.list_disagreements(session, at.chosen.wanted(at.who), None, 1, at.who.id)
        return differ[0][0] if differ else None
    try:
        return reviews.next_to_claim(session, at.chosen.queue(at.desk, session, at.who), at.who, own_first=True)
    except NotFound:
        return None


def get_submission(session: Session, who: Identity, submission_id: str) -> Submission:
    """Returns a submission of the instructor's course. Raises NotFound."""
    row = submissions.get(session, submission_id) if submission_id.isalnum() else None
    if row is None or not who.may_see(row.learner, row.course):
        raise NotFound("There is no such submission.")
    return row


def decide(at: Sitting, submission_id: str, typed: ReviewForm, version: str) -> str:
    """Keeps a mark; returns what is to be said of it. Raises Conflict, Outdated, Unprocessable, NotFound."""
    with at.services.database.write() as session:
        row = hold(at, session, submission_id, version)
        mark = parse_mark(typed, has_rubric=bool(list_rubric(at.desk.question(row))))
        if not (at.is_second or reviews.waits_for_second(session, row, at.who)):
            reviews.decide(at.desk, session, at.who, row, mark)
            return "decided"
        return "agree" if reviews.mark_second(at.desk, session, at.who, row, mark).second == AGREED else "differ"


def withdraw(at: Sitting, submission_id: str, version: str) -> None:
    """Takes the marks of an answer back. Raises Conflict, Outdated, NotFound."""
    with at.services.database.write() as session:
        reviews.withdraw(at.desk, session, at.who, hold(at, session, submission_id, version))


def hold(at: Sitting, session: Session, submission_id: str, version: str) -> Submission:
    """Returns an answer that gets no other verdict until the transaction ends. Raises NotFound, and Outdated where it
    got one since the page was shown."""
    row = get_submission(session, at.who, submission_id)
    at.desk.hold(session, row)
    if str(row.version) != version:
        raise Outdated(CHANGED)
    return row


def parse_mark(typed: ReviewForm, *, has_rubric: bool) -> Mark:
    """Returns the mark that was typed. Raises Unprocessable."""
    if len(typed.comment) > comments.REVIEW_CHARACTERS_MAX:
        raise Unprocessable(f"A comment has at most {comments.REVIEW_CHARACTERS_MAX} characters.")
    if not typed.points and not (has_rubric and typed.ticked):
        raise Unprocessable(NOTHING_TICKED if has_rubric else NO_POINTS)
    ticked = tuple(sorted(typed.ticked)) if has_rubric and typed.ticked else None
    return Mark(ticked, parse_points(typed.points) if typed.points else None, typed.comment.strip())


def parse_points(text: str) -> float:
    """Points as they were typed, with a point or a comma. Raises Unprocessable."""
    try:
        points = float(text.replace(",", "."))
    except ValueError:
        points = math.nan
    if not math.isfinite(points):
        raise Unprocessable("Points are a number, such as 1.5.")
    return points


def release(at: Sitting, submission_id: str) -> None:
    """Ends the claim, so that others may review the answer. Raises NotFound."""
    with at.services.database.write() as session:
        at.desk.lock(session, at.who.course)
        reviews.release(session, at.who, get_submission(session, at.who, submission_id))


def change_comments(at: Sitting, submission_id: str, typed: ReviewForm, do: str) -> ReviewForm:
    """Inserts, saves, replaces or deletes a saved comment; the form after it. Raises Unprocessable, Conflict."""
    with at.services.database.write() as session:
        row, text = get_submission(session, at.who, submission_id), typed.comment.strip()
        here = (row.quiz, row.question)
        kept = {comment.id: comment.text for comment in find_comments(session, row.course, *here)}
        if do == "insert" and typed.saved in kept:
            return replace(typed, comment="\n".join(filter(None, (text, kept[typed.saved]))))
        if do == "delete" and typed.saved in kept:
            comments.delete(session, at.who, typed.saved)
        elif do in ("save", "replace"):
            comments.check(text)
            if do == "replace" and typed.saved in kept:
                comments.change(session, at.who, typed.saved, text)
            elif text not in kept.values():  # a form that is sent twice saves one comment
                return replace(typed, saved=comments.save(at.services.database, session, at.who, here, text).id)
    return typed


def parse_typed(form: dict[str, str]) -> ReviewForm:
    """Says what a form holds."""
    ticked = frozenset(name.removeprefix("item-") for name in form if name.startswith("item-"))
    comment = form.get("comment", "").replace("\r\n", "\n")
    return ReviewForm(ticked, form.get("points", "").strip(), comment, form.get("saved", ""))


def restore_typed(given: GivenAnswer) -> ReviewForm:
    """Returns the form as the last reviewer of an answer left it; empty before the first."""
    review = next((finding for finding in (given.verdict or {}).get("findings", ()) if finding["id"] == REVIEW), None)
    if review is None:
        return ReviewForm()
    measured = review["measured"] or {}
    ticked = frozenset(item["id"] for item in measured.get("rubric", ()))
    comment = "" if review["message"] == NO_COMMENT else review["message"]
    by_hand = measured.get("by_hand") or not ticked
    return ReviewForm(ticked, f"{review['points']:.12g}" if by_hand else "", comment)


def list_rubric(question: Question | None) -> list[dict[str, Any]]:
    """Returns the items that a reviewer can tick."""
    return [] if question is None else [item.model_dump() for item in kind_of(question).rubric(question)]


def render(
    request: Request,
    at: Sitting,
    submission_id: str,
    status: int = 200,
    *,
    typed: ReviewForm | None = None,
    **more: Any,
) -> Response:
    """Renders the page of one answer, with what was typed or was given before. Raises NotFound."""
    desk, who = at.desk, at.who
    with at.services.database.read() as session:
        row = get_submission(session, who, submission_id)
        seen = hide_names(desk, session, who, [row], submissions.read_verdicts(session, [row]))
        given = read_in_full(row, at.services.answers_in(desk.library)(row), seen.verdicts.get(row.id))
        written = read_comments(session, [row.id]).get(row.id, [])
        claim, review = stored.find_claim(session, row.id, now()), stored.find_review(session, row.id)
        marks = review if review is not None and review.second == DIFFERS else None
        waits_for_third = marks is not None and not stored.may_settle(session, marks, who.id)
        kept = find_comments(session, who.course, row.quiz, row.question)
        gives_second = reviews.waits_for_second(session, row, who)
        is_decided = stored.is_decided(session, row) and not gives_second
        learner = name_learner(row, seen.names, make_marks(session, who.course))
        waiting = sum(queue.answers for queue in list_waiting(at, session))
    card = build_card(given)
    if card is None or given.verdict is None:
        raise NotFound("This submission has no verdict yet.")
    question = desk.question(row)
    if more.get("said") == "decided":
        more["visible"] = describe_visibility(at, more.get("last") or row.id)
    elif more.get("said") == "withdrawn":
        more["taken_back"] = describe_withdrawal(at, row, given.verdict)
    context: dict[str, Any] = {
        "card": card,
        "id": row.id,
        "version": row.version,
        "learner": learner,
        "title": f"{row.quiz}: {list_titles(desk.library).get((row.quiz, row.question), row.question)}",
        "of": given.verdict["max_points"] if question is None else question.points,
        "claim": claim,
        "is_mine": claim is not None and claim.reviewer == who.id,
        "marks": marks,
        "waits_for_third": waits_for_third,
        "gives_second": gives_second,
        "is_decided": is_decided,
        "rubric": list_rubric(question),
        "comments": kept,
        "written": written,
        "typed": typed or restore_typed(given),
        "waiting": waiting,
        "chosen": at.chosen,
        **describe_question(desk.library, row.quiz, question, given),
    }
    return page(request, "review_answer.html", status, who=who, **(context | more))


def describe_withdrawal(at: Sitting, row: Submission, verdict: Mapping[str, Any]) -> str:
    """Says what counts after a mark was taken back, and what to do where the quiz has changed since it was graded."""
    if verdict["status"] == Status.NEEDS_REVIEW:
        return "Taken back: the answer waits for a reviewer again."
    digests = at.desk.library.digests
    is_old = row.quiz in digests and verdict["content_digest"] != digests[row.quiz]
    older = " The quiz has changed since it was graded: regrade it on the page Regrades." if is_old else ""
    return f"Taken back: what the grader found counts again.{older}"


def describe_visibility(at: Sitting, submission_id: str) -> str:
    """Says when the learner of a decided answer can see the decision. Raises NotFound."""
    with at.services.database.read() as session:
        row = get_submission(session, at.who, submission_id)
        if at.desk.question(row) is None:
            return "The learner cannot see it: the question is not part of the course at present."
        learner = Identity(row.learner, row.user, Role.STUDENT, row.course)
        access = read_access(session, at.desk.library, learner, (row.quiz, row.question))
    decision = access.decide(row.quiz, row.question)
    if decision.withheld is None:
        return "The learner can see it now."
    if access.policies[row.quiz].feedback == "after_due" and decision.closes is not None:
        return f"The learner can see it after {format_moment(decision.closes)}."
    return "The learner can see it once the feedback of the quiz is published, on the page Extensions."


def list_waiting(at: Sitting, session: Session) -> Sequence[WaitingQuestion]:
    """Says what waits in the list, by question."""
    if at.chosen.which == DIFFER:
        return stored.count_differing(session, at.who.course, COUNTED_MAX, at.who.id)
    return stored.count_waiting(session, at.chosen.queue(at.desk, session, at.who), COUNTED_MAX)


def describe_question(library: Library, quiz: str, question: Question | None, given: GivenAnswer) -> dict[str, Any]:
    """What the desk says of a question: its text, the answer to it, and the reference; the answer once it is gone."""
    if question is None:
        return {"answer": given.text}
    kind = kind_of(question)
    text = show_answer(question, given.answer)
    return {
        "view": present_question(library, quiz, question),
        "answer": text,
        "is_prose": kind.is_prose,
        "is_read": kind.is_prose and given.is_decided,
        "words": len(text.split()) if kind.is_prose else 0,
        "reference": cached_prose(kind.reference(question) or ""),
    }
