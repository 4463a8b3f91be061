"""A question as a student sees it in every state: before an answer, after a wrong and a right one, after it is due."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any

from grader.courses.answering.access import LearnerAccess
from grader.courses.rules.policy import Visibility, redact_json
from grader.domain.plugins import describe_error
from grader.domain.policy import Policy, Progress
from grader.domain.verdict import Status, Verdict
from grader.errors import Fault, InvalidAnswer
from grader.library import Library
from grader.questions import Fields, Question, Quiz, grade_answer, is_own, kind_of, show_answer
from grader.web.frame.rendering import templates
from grader.web.learner.lesson import AskedQuestion, TypedAnswer, describe_question
from grader.web.text.questions import present_question
from grader.web.text.statuses import Badge, describe_status
from grader.web.verdict.work import GivenAnswer, Work, describe_place

STATES = {"unanswered": "Unanswered", "wrong": "Wrong", "right": "Right", "due": "After due"}

MARGIN = timedelta(minutes=1)


@dataclass(frozen=True)
class SampleAnswer:
    """An answer as people might give it, how it is read, and what it gets."""

    text: str
    read_as: str
    badge: Badge
    points: float


@dataclass(frozen=True)
class Preview:
    """A question in one state. `note` says why the state is not shown; `asked` is None then."""

    asked: AskedQuestion | None
    note: str = ""


def list_samples(question: Question) -> list[SampleAnswer]:
    """Returns how answers that people might give are read and judged."""
    kind = kind_of(question)
    samples = []
    for answer in kind.sample_answers(question):
        verdict = grade_answer(question, answer)
        is_read = verdict.status is not Status.INVALID_ANSWER
        read_as = (verdict.read_as or "") if is_read else verdict.diagnosis or ""
        text = answer if isinstance(answer, str) else show_answer(question, answer)
        samples.append(SampleAnswer(text, read_as, describe_status(verdict.status, withheld=False), verdict.points))
    return samples


def find_answer(question: Question, status: Status) -> tuple[Any, Verdict] | None:
    """Returns an answer to show with its verdict: of the status, or one of which a person decides."""
    for answer in kind_of(question).sample_answers(question):
        verdict = grade_answer(question, answer)
        if verdict.status in (status, Status.NEEDS_REVIEW):
            return answer, verdict
    return None


def build_preview(
    library: Library, quiz: Quiz, question: Question, state: str, policy: Policy | None = None
) -> Preview:
    """Returns a question in one of STATES, by a policy: by default that of its quiz."""
    policy = policy or quiz.default_policy
    if state == "due" and policy.due is None:
        return Preview(None, "This quiz has no due date: write one into its policy.")
    sample = None
    if state != "unanswered":
        sample = find_answer(question, Status.CORRECT if state == "right" else Status.INCORRECT)
        if sample is None and kind_of(question).is_script:
            return Preview(None, "A script is judged by a run: see the reference programs below.")
        if sample is None:
            return Preview(None, "This kind names no answer for this state: answer below, under Unanswered.")
    return Preview(build_asked(library, quiz, question, sample, policy, is_over=state == "due"))


CARD = '{% from "question.html" import question_card with context %}{{ question_card(quiz, asked, 1, "") }}'


def find_unshown(library: Library, is_wanted: Callable[[str, str], bool]) -> Iterator[Fault]:
    """Yields the questions of kinds of other packages whose templates fail, in any of STATES."""
    card = templates.env.from_string(CARD)
    for quiz in library.quizzes.values():
        for question in quiz.questions:
            kind = kind_of(question)
            if kind.is_script or is_own(kind) or not is_wanted(quiz.id, question.id):
                continue
            try:
                for state in STATES:
                    asked = build_preview(library, quiz, question, state).asked
                    if asked is not None:
                        card.render(quiz=quiz, asked=asked)
            except Exception as error:  # code of another package: anything may be raised
                what = describe_error(error, type(kind).__module__)
                why = f"its page cannot be shown: the template or a method of the kind raises {what}"
                yield Fault(library.file(quiz.id), question.id, why)


def try_form(library: Library, quiz: Quiz, question: Question, fields: Fields) -> Preview:
    """Returns a question after the answer of a form, as the first attempt; with what is wrong with it where it cannot
    be read."""
    kind = kind_of(question)
    try:
        answer = kind.from_form(question, fields)
        verdict = grade_answer(question, answer)
        if verdict.status is Status.INVALID_ANSWER:
            raise InvalidAnswer(verdict.diagnosis or "")
    except InvalidAnswer as error:
        typed = TypedAnswer(quiz.id, question.id, fields, str(error))
        return Preview(build_asked(library, quiz, question, None, quiz.default_policy, typed=typed))
    return Preview(build_asked(library, quiz, question, (answer, verdict), quiz.default_policy))


def build_asked(
    library: Library, quiz: Quiz, question: Question, sample: tuple[Any, Verdict] | None, policy: Policy, *,
    is_over: bool = False, typed: TypedAnswer | None = None,
) -> AskedQuestion:  # fmt: skip
    """Returns a question with an answer and its verdict, redacted as a student sees it."""
    solved = sample is not None and sample[1].status is Status.CORRECT
    progress = Progress() if sample is None else Progress(used=1, solved=solved)
    at = choose_moment(policy, is_over=is_over)
    policies: Mapping[str, Policy] = {quiz.id: policy}
    access = LearnerAccess(library, policies, "student", at, {(quiz.id, question.id): progress}, {}, {})
    decision = access.decide(quiz.id, question.id)
    attempt = None
    if sample is not None:
        answer, verdict = sample
        shown = redact_json(verdict, decision)
        attempt = GivenAnswer("preview", 1, at, answer, "done", shown, decision.withheld)
    place = describe_place(access, quiz, question, attempt, None)
    if attempt is not None and attempt.is_decided and decision.shown >= Visibility.FEEDBACK:
        place = replace(place, points=sample[1].points if sample else None)
    view = present_question(library, quiz.id, question) | {"path": f"/try/{quiz.id}/{question.id}"}
    return describe_question(
        view, question, quiz.id, Work(access, {(quiz.id, question.id): place}, lambda _: None), typed
    )


def choose_moment(policy: Policy, *, is_over: bool) -> datetime:
    """Returns a moment at which answers are taken; where it `is_over`, one at which none is taken any more."""
    closes = policy.late.until if policy.late is not None else policy.due
    if is_over and closes is not None:
        return closes + MARGIN
    now = datetime.now(UTC)
    if policy.opens is not None and now < policy.opens:
        return policy.opens + MARGIN
    return policy.due - MARGIN if policy.due is not None and now > policy.due else now
