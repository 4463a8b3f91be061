"""A class of learners whose answers are handed in, reviewed and counted as the service does it."""

from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import select

from grader.courses.answering import results
from grader.courses.answering.intake import NewAnswer, Receipt, store_answers
from grader.courses.people.identity import Identity, Role
from grader.courses.people.tokens import create_token
from grader.courses.sending.outbox import send_scores
from grader.domain.verdict import Status, Verdict, apply_review
from grader.grading.content import Contents
from grader.store.engine.database import Database
from grader.store.results import find_of_learner
from grader.store.tables import Credential, Member, Submission

COURSE = "robots"


@dataclass
class Class:
    """Learners of one course, in a database, with the content of a folder."""

    database: Database
    contents: Contents
    learners: list[Identity] = field(default_factory=list)

    def enrol(self, names: list[str], role: Role = Role.STUDENT) -> None:
        """Makes members with tokens."""
        with self.database.write() as session:
            for name in names:
                token = create_token(session, name, role, COURSE)
                credential = session.get_one(Credential, token.split("_")[1])
                who = Identity(credential.member, name, role, COURSE, credential=credential.id)
                self.learners.append(who)

    def answer(self, given: list[tuple[Identity, str, Any]]) -> None:
        """Hands in answers to (learner, question), all in one transaction."""
        pipeline = self.contents.get(COURSE).pipeline
        waiting = []
        for who, question, answer in given:
            parsed = pipeline.read("small", question, answer)
            waiting.append(NewAnswer(who, pipeline.library, parsed, pipeline.judge(parsed)))
        with self.database.write() as session:
            outcomes = store_answers(self.database, session, waiting)
        assert all(isinstance(outcome, Receipt) for outcome in outcomes)

    def review(self, who: Identity, points: float, comment: str | None = None) -> None:
        """Decides on the learner's open answers."""
        verdict = Verdict(status=Status.PARTIAL if points < 1 else Status.CORRECT, points=points, max_points=1.0)
        if comment is not None:
            verdict = apply_review(verdict, points, comment)
        with self.database.write() as session:
            theirs = select(Submission).where(Submission.learner == who.id, Submission.question == "q4")
            for submission in session.scalars(theirs).all():
                results.append_verdict(
                    self.database, self.contents.get(COURSE).library, session, submission, verdict,
                    cause="review", reviewer="tina",
                )  # fmt: skip

    def send_scores(self, question: str = "", learner: str | None = None) -> None:
        with self.database.write() as session:
            send_scores(self.database, session, COURSE, "small", question, learner=learner)

    def points(self, who: Identity) -> float:
        """What counts for a learner in the quiz."""
        with self.database.read() as session:
            results = find_of_learner(session, COURSE, who.id, "small")
        return sum(result.points for result in results.values())


def ids(database: Database) -> dict[str, str]:
    """The names of members by id."""
    with database.read() as session:
        return {member.id: member.name for member in session.scalars(select(Member))}
