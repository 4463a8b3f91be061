"""The policy that is in force for a quiz in a course: everything that knows dates and rules reads it here, and
instructors change it. The values of the content hold wherever the course has set nothing else."""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.answering.results import recount_quiz
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity
from grader.courses.rules.policy import policy_in_force
from grader.domain.misread import drop_remarks
from grader.domain.policy import Policy
from grader.errors import Outdated, Unprocessable
from grader.library import Library, list_policy_faults
from grader.questions import Quiz
from grader.store import policies
from grader.store.engine.database import Database


@dataclass(frozen=True)
class CoursePolicy:
    """The policy of a quiz in a course: the values of the content, those that the course has set in their place as
    plain JSON, and who set them when."""

    quiz: str
    default: Policy
    changes: Mapping[str, Any]
    changed_by: str | None = None
    changed_at: datetime | None = None

    @property
    def in_force(self) -> Policy:
        """What holds."""
        return policy_in_force(self.default, json.dumps(self.changes) if self.changes else None)

    @property
    def conflicts(self) -> list[str]:
        """What does not fit together any more, since the content has changed after the course's values were set."""
        return list_policy_faults(self.in_force.model_dump(mode="json"))

    @property
    def version(self) -> str:
        """The same as long as no value changes, neither in the content nor in the course."""
        text = json.dumps([self.default.model_dump(mode="json"), self.changes], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:24]


def read_policies(session: Session, library: Library, course: str, quizzes: Iterable[str]) -> dict[str, Policy]:
    """Returns the policies in force of quizzes in a course, by quiz; of those alone that the content has."""
    changes = policies.read_of_course(session, course)
    here = [library.quizzes[id_] for id_ in quizzes if id_ in library.quizzes]
    return {quiz.id: policy_in_force(quiz.default_policy, changes.get(quiz.id)) for quiz in here}


def read_course_policy(session: Session, quiz: Quiz, course: str) -> CoursePolicy:
    """Returns the policy of a quiz in a course, and where its values come from."""
    row = policies.find(session, course, quiz.id)
    if row is None:
        return CoursePolicy(quiz.id, quiz.default_policy, {})
    return CoursePolicy(quiz.id, quiz.default_policy, json.loads(row.changes), row.changed_by, row.changed_at)


def change_policy(
    database: Database, library: Library, who: Identity, quiz: Quiz, wanted: Mapping[str, Any], *,
    is_current: Callable[[CoursePolicy], bool],
) -> CoursePolicy:  # fmt: skip
    """Sets values of a quiz's policy in the instructor's course, takes back all others that were set, and counts the
    results of the quiz again. `wanted` is plain JSON by key; `is_current` says whether the caller has seen the policy
    as it is. Raises Outdated if not, and Unprocessable with a line for each fault."""
    values = drop_remarks(quiz.default_policy.model_dump(mode="json") | dict(wanted))
    if faults := list_policy_faults(values):
        raise Unprocessable("\n".join(faults))
    changes = Policy.model_validate(values).model_dump(mode="json", include=set(wanted))
    with database.write() as session:
        database.lock(session, f"policies\n{who.course}")
        before = read_course_policy(session, quiz, who.course)
        if not is_current(before):
            raise Outdated("The dates and rules have changed since you saw them; look at them again.")
        policies.put(session, who.course, quiz.id, json.dumps(changes) if changes else None, who.user)
        session.flush()
        record(session, who, who.course, Action.POLICY_CHANGED, quiz.id, before=before.changes, after=changes)
        after = read_course_policy(session, quiz, who.course)
    recount_quiz(database, library, who.course, quiz.id)
    return after
