"""The desk: what everything about reviewing works with."""

from dataclasses import dataclass

from sqlalchemy.orm import Session

from grader.courses.answering.policies import read_policies
from grader.courses.people.pseudonyms import Blinding
from grader.domain.rubric import SecondMarking
from grader.errors import NotFound
from grader.library import Library
from grader.questions import Question
from grader.store.engine.database import Database
from grader.store.tables import Submission


@dataclass(frozen=True)
class Desk:
    """What reviewing works with: the database, the content as it is now, and what keeps reviewers blind."""

    database: Database
    library: Library
    blinding: Blinding

    def lock(self, session: Session, course: str) -> None:
        """Lets only one transaction at a time claim, mark or recompute in a course."""
        self.database.lock(session, f"reviews\n{course}")

    def hold(self, session: Session, submission: Submission) -> None:
        """As `lock`; and until the transaction ends, the submission gets no verdict from any other."""
        self.lock(session, submission.course)
        self.database.lock_learner(session, submission.course, submission.learner)
        session.refresh(submission)

    def question(self, submission: Submission) -> Question | None:
        """Returns the question as it is now; None if the content has lost it."""
        try:
            return self.library.question(submission.quiz, submission.question)
        except NotFound:
            return None

    def second_marking(self, submission: Submission) -> SecondMarking:
        """Returns the rule for second marks of the submission's quiz; by default no answer is marked twice."""
        quiz = self.library.quizzes.get(submission.quiz)
        return (quiz and quiz.second_marking) or SecondMarking(share=0.0)

    def list_averaged(self, session: Session, course: str) -> set[str]:
        """Returns the quizzes in which all attempts count, and so wait for a reviewer."""
        policies = read_policies(session, self.library, course, self.library.quizzes)
        return {quiz for quiz, policy in policies.items() if policy.counts == "average"}

    def is_anonymous(self, quiz: str) -> bool:
        """Says whether reviewers of a quiz see pseudonyms; also where the content has lost the quiz."""
        loaded = self.library.quizzes.get(quiz)
        return loaded is None or loaded.anonymous
