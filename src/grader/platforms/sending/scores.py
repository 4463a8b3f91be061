"""Sends scores to learning platforms: final and changed ones only, and never over what a person has entered.

What a platform has is read before every score, where the launch granted that. A value that is none of ours was entered
by a person: the score becomes a dead letter, and is sent when a person replays it. A try whose outcome is unknown, such
as one before a kill, is settled in the same way, unless it was of another score: that one may still be on its way, and
arrive after the reading. A platform refuses it only if it has taken a later timestamp, so the score is sent once more.

Source: LTI Assignment and Grade Services 2.0, sections 3.3 and 3.4.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from http import HTTPStatus

from sqlalchemy.orm import Session

from grader.courses.answering.access import LearnerAccess, read_access
from grader.courses.people.identity import Identity, Role
from grader.courses.rules.policy import Visibility
from grader.domain.addresses import RefusedURL
from grader.domain.platform import ScoreTarget
from grader.library import Library
from grader.platforms.sending.access_tokens import AccessTokens, NoToken
from grader.platforms.sending.failures import TooSlow, Unreachable
from grader.platforms.sending.line_items import READ_RESULT, SCORE, CallFailed, LineItems, add_path, choose_scopes
from grader.platforms.sending.outgoing import Response
from grader.platforms.sending.replies import (
    Again,
    DeadLetter,
    DeliveryFailure,
    HeldReply,
    Later,
    Reply,
    SentReply,
    UnneededReply,
    retry_after_s,
)
from grader.platforms.sending.score import PlatformResult, Score, compute_score
from grader.store import outbox, results
from grader.store.outbox import Delivery, Destination
from grader.store.reviewing import reviews
from grader.store.tables import Member, now

MEDIA_SCORE = "application/vnd.ims.lis.v1.score+json"
MEDIA_RESULTS = "application/vnd.ims.lis.v2.resultcontainer+json"

TRIED_MAX = 8
"""Tries of unknown outcome that are remembered."""

RETRIED = (HTTPStatus.REQUEST_TIMEOUT, HTTPStatus.TOO_EARLY, HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.UNAUTHORIZED,
           HTTPStatus.FORBIDDEN)  # fmt: skip
"""Statuses after which another try may help, beside 3xx and 5xx. A 401 to a new token may be that of a platform
restarting; Canvas throttles with 403, and rights that are missing today may be given tomorrow. A redirection is never
followed: the score would go to an address that no launch told; one to a page of maintenance is over some day."""

NO_PLACE = (
    "A try failed, and since then no link of the platform leads to this place and takes scores: launch it again by a "
    "link that does."
)

CURE_OF_ADDRESS = (
    "If the host is in your own network, name it in GRADER_PRIVATE_HOSTS of every server and every worker, and replay "
    "the delivery."
)

SECOND = timedelta(seconds=1)

LibraryNow = Callable[[Session, str, str], Library]
"""The content of (course, quiz) as servers use it now."""

FindTarget = Callable[[Session, Delivery], ScoreTarget | None]
"""Where the score of a row of the outbox goes."""


@dataclass(frozen=True)
class PreparedScore:
    """A score on its way. `known` are our own scores that the platform may show, those that went to other columns of it
    too: a link may lead to another column than before. `is_first` if the column has taken none.
    `is_contested` if another score of ours may still arrive and replace the one that the platform shows."""

    target: ScoreTarget
    score: Score
    label: str
    timestamp: datetime
    known: Sequence[Score]
    is_first: bool
    is_contested: bool
    forced: bool

    @property
    def clears_comment(self) -> bool:
        """Whether the platform may show a comment that has been taken back."""
        return any(score.comment for score in self.known)


@dataclass(frozen=True)
class Scores:
    """The sender of scores."""

    current_library: LibraryNow
    score_target: FindTarget
    tokens: AccessTokens
    line_items: LineItems
    clock: Callable[[], datetime] = now

    def prepare(self, session: Session, row: Delivery, _destination: Destination) -> PreparedScore | Reply:
        """Computes the score as it is now, and stores that it is tried: a later try may have to know."""
        library = self.current_library(session, row.course, row.quiz)
        theirs = results.find_of_learner(session, row.course, row.learner, row.quiz)
        quiz = library.quizzes.get(row.quiz)
        worth = {} if quiz is None else {question.id: question.points for question in quiz.questions}
        remarks = reviews.read_remarks(session, [result.submission_id for result in theirs.values()])
        score = compute_score(theirs, worth, row.question, remarks)
        sent, tried = read_sent(row), read_tried(row)
        if score is None or is_no_student(session, row) or not is_news(score, sent, tried, forced=row.forced):
            return UnneededReply()
        questions = [row.question] if row.question else [*theirs]
        access = read_access(session, library, Identity(row.learner, "", Role.STUDENT, row.course))
        if (held := is_withheld(access, row.quiz, questions, self.clock())) is not None:
            return held
        others = outbox.list_same_scores(session, row)
        target = self.score_target(session, row)
        if target is None:
            return DeadLetter(NO_PLACE) if tried and not others else UnneededReply()
        if SCORE not in target.scopes:
            return DeadLetter("The platform lets us send no scores: the launch did not grant the scope.")
        timestamp = self.clock().astimezone(UTC).replace(microsecond=0)
        if row.timestamp is not None and timestamp < row.timestamp + SECOND:
            return Later((row.timestamp + SECOND - self.clock()).total_seconds())
        known = [score for one in (row, *others) for score in read_known(one)]
        row.timestamp = timestamp
        tries = tried if tried[-1:] == [score] else [*tried, score]
        row.tried = json.dumps([score.to_json() for score in tries[-TRIED_MAX:]])
        title = row.quiz if quiz is None else quiz.title
        label = f"{title}: {row.question}" if row.question else title
        contested = is_contested(score, sent, tried)
        return PreparedScore(target, score, label, timestamp, known, sent is None, contested, row.forced)

    async def send(self, prepared: PreparedScore) -> Reply:
        """Sends a score, if the platform has none of a person's."""
        try:
            url = await self.line_items.url_of(prepared.target, prepared.label, prepared.score.maximum)
            result = await self._result(prepared, url)
            if result is not None and (reply := before(prepared, result)) is not None:
                return reply
            return await self._post(prepared, url)
        except (DeliveryFailure, CallFailed, NoToken, RefusedURL, Unreachable) as failed:
            return self._reply_after(failed)

    def _reply_after(self, failed: Exception) -> Reply:
        match failed:
            case DeliveryFailure():
                return failed.reply
            case CallFailed():
                return self.reply_to(failed.response)
            case NoToken():
                reply = self.reply_to(failed.response)
                return DeadLetter(str(failed)) if isinstance(reply, DeadLetter) else reply
            case RefusedURL():
                return DeadLetter(f"The platform's address is not allowed: {failed} {CURE_OF_ADDRESS}")
            case _:
                return Again(str(failed), is_slow=isinstance(failed, TooSlow))

    async def _result(self, prepared: PreparedScore, url: str) -> PlatformResult | None:
        """Says what the platform shows now; None if it does not let us read it."""
        target = prepared.target
        if READ_RESULT not in target.scopes:
            return None
        address = add_path(url, "results", user_id=target.lti_user_id)
        response = await self._call(target, "GET", address, {"Accept": MEDIA_RESULTS})
        if response.status == HTTPStatus.NOT_FOUND:
            raise DeliveryFailure(self._gone(target, response))
        if response.status != HTTPStatus.OK:
            raise CallFailed(response)
        return PlatformResult.parse(response.json() if response.body else [], target.lti_user_id)

    async def _post(self, prepared: PreparedScore, url: str) -> Reply:
        target, score = prepared.target, prepared.score
        body = score.body(target.lti_user_id, prepared.timestamp, clears_comment=prepared.clears_comment)
        response = await self._call(target, "POST", add_path(url, "scores"), {"Content-Type": MEDIA_SCORE}, body)
        if HTTPStatus.OK <= response.status < HTTPStatus.MULTIPLE_CHOICES:
            return SentReply(score.to_json())
        if response.status == HTTPStatus.NOT_FOUND:
            return self._gone(target, response)
        if response.status in (HTTPStatus.CONFLICT, HTTPStatus.BAD_REQUEST):
            return after_refusal(prepared, await self._result(prepared, url), response)
        return self.reply_to(response)

    async def _call(
        self, target: ScoreTarget, method: str, url: str, headers: Mapping[str, str], body: bytes | None = None
    ) -> Response:
        scopes = choose_scopes(target.scopes)
        return await self.tokens.request(target.platform, scopes, method, url, headers=headers, body=body)

    def _gone(self, target: ScoreTarget, response: Response) -> Reply:
        """Returns a line item that we found ourselves is looked up anew at the next try, which a person decides on."""
        if not target.line_item_url:
            self.line_items.forget(target)
        return DeadLetter(f"The platform has no such line item or learner: 404 {response.text}".strip())

    def reply_to(self, response: Response) -> Reply:
        """Says whether another try may help after an answer that is no success."""
        status, text = response.status, f"The platform answered {response.status} {response.text}".strip()
        is_redirection = HTTPStatus.MULTIPLE_CHOICES <= status < HTTPStatus.BAD_REQUEST
        if status in RETRIED or status >= HTTPStatus.INTERNAL_SERVER_ERROR or is_redirection:
            return Again(text, retry_after_s(response.headers, self.clock()))
        return DeadLetter(text)


def read_sent(row: Delivery) -> Score | None:
    """Returns the score that the column of a row is known to have taken."""
    return None if row.sent is None else Score.from_json(row.sent)


def read_tried(row: Delivery) -> list[Score]:
    """Returns the scores of which it is not known whether the column of a row took them, in the order of tries."""
    return [Score.from_json(item) for item in json.loads(row.tried or "[]")]


def read_known(row: Delivery) -> list[Score]:
    """Returns the scores of ours that the column of a row may show."""
    sent = read_sent(row)
    return [*read_tried(row), *([] if sent is None else [sent])]


def is_news(score: Score, sent: Score | None, tried: Sequence[Score], *, forced: bool) -> bool:
    """Says whether a score says something new. After a final one no pending one is sent: it would clear the grade."""
    if forced:
        return True
    if not score.is_final and any(earlier.is_final for earlier in (*tried, *([sent] if sent is not None else []))):
        return False
    return bool(tried) or score != sent


def is_contested(score: Score, sent: Score | None, tried: Sequence[Score]) -> bool:
    """Says whether another score may still arrive and replace this one, where the platform shows this one. `tried` is
    in the order of timestamps, and what a platform has taken keeps out all that is earlier. So nothing replaces this
    score if its tries all came after those of others, and it was not `sent` before them."""
    same = [replace(earlier, activity=score.activity) == score for earlier in tried]
    if all(same):
        return False
    was_sent = sent is not None and replace(sent, activity=score.activity) == score
    return was_sent or len(tried) >= TRIED_MAX or not any(same) or not all(same[same.index(True) :])


def before(prepared: PreparedScore, result: PlatformResult) -> Reply | None:
    """Returns the reply without sending, from what the platform shows; None if the score is to be sent."""
    if is_settled(prepared, result):
        return SentReply(prepared.score.to_json())
    return DeadLetter(explain_overridden(result)) if is_a_persons(prepared, result) and not prepared.forced else None


def after_refusal(prepared: PreparedScore, result: PlatformResult | None, response: Response) -> Reply:
    """Returns the reply to a 400 or 409, which may say that the platform has something newer."""
    refusal = f"The platform answered {response.status} {response.text}".strip()
    if result is None:
        return DeadLetter(f"{refusal} (what it has may not be read)")
    if is_settled(prepared, result):
        return SentReply(prepared.score.to_json())
    if is_a_persons(prepared, result):
        return DeadLetter(explain_overridden(result))
    # Nothing newer is there: the platform's clock is ahead of ours, and a later timestamp will do.
    is_stale = result.score is not None or response.status == HTTPStatus.CONFLICT
    return Again(refusal) if is_stale else DeadLetter(refusal)


def is_settled(prepared: PreparedScore, result: PlatformResult) -> bool:
    """Whether the platform has the final score already, for good, with its comment: it is no pending one of the same
    points, and none with another comment, either."""
    score = prepared.score
    if prepared.is_contested or not score.is_final or result.score is None or not score.is_at(result):
        return False
    alike = [known for known in prepared.known if known.is_at(result)]
    has_comment = not score.comment or bool(alike)  # a person may have entered the same points
    return has_comment and all(known.is_final and known.comment == score.comment for known in alike)


def is_a_persons(prepared: PreparedScore, result: PlatformResult) -> bool:
    """Says whether a person has entered what the platform shows. A score of zero before our first one counts as none:
    platforms enter it by themselves when an answer is late."""
    ours = [prepared.score, *prepared.known]
    is_first_zero = prepared.is_first and not result.score
    return result.score is not None and not is_first_zero and not any(score.is_at(result) for score in ours)


def explain_overridden(result: PlatformResult) -> str:
    """Returns the reason of a dead letter that a person's grade stands against."""
    of = "" if result.maximum is None else f" of {result.maximum:g}"
    return f"Overridden by a person: the platform has {result.score:g}{of}. Replay it to replace that."


def is_no_student(session: Session, row: Delivery) -> bool:
    """Says whether a row is of somebody who tries questions as an instructor, or of a removed member."""
    member = session.get(Member, row.learner)
    return member is None or member.role != Role.STUDENT


def is_withheld(access: LearnerAccess, quiz: str, questions: Sequence[str], clock: datetime) -> HeldReply | None:
    """Whether the learner may not see yet how one of the questions was graded: then the platform does not show it."""
    closed = [
        decision
        for decision in (access.decide(quiz, name) for name in questions)
        if decision.shown < Visibility.FEEDBACK
    ]
    if not closed:
        return None
    closes = [decision.closes for decision in closed if decision.closes is not None and decision.closes > clock]
    return HeldReply((max(closes) - clock).total_seconds() + 1.0 if len(closes) == len(closed) else None)
