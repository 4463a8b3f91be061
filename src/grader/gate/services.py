"""The objects that all routes of an app share, for the API and the pages."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any

from fastapi import Depends, FastAPI, Request
from sqlalchemy.orm import Session

from grader.courses.answering.access import require_opened
from grader.courses.answering.intake import NewAnswer, Receipt
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import DEFAULT_COURSE, Identity
from grader.courses.people.pseudonyms import Blinding
from grader.courses.reporting.class_answers import ClassReader
from grader.courses.reporting.quiz_statistics import Statistics
from grader.courses.reviewing.desk import Desk
from grader.domain.policy import Policy
from grader.gate.admission import AdmissionRules
from grader.gate.lab_runs import LabRuns
from grader.gate.monitoring import Monitor
from grader.gate.openid import Provider
from grader.gate.readiness import Readiness
from grader.gate.sessions import SessionCookies
from grader.gate.streams import Streams
from grader.grading.content import Contents
from grader.grading.pipeline import Pipeline
from grader.library import Library
from grader.platforms.tool import Tool
from grader.settings import Settings
from grader.store import people
from grader.store.engine.database import Database
from grader.store.engine.group_commit import GroupCommit
from grader.store.tables import Submission


@dataclass(frozen=True, kw_only=True)
class Services:
    """The objects of one app. Routes get them as `AppServices`."""

    settings: Settings
    database: Database
    content: Contents
    writer: GroupCommit[NewAnswer, Receipt]
    blinding: Blinding
    labs: LabRuns
    admission: AdmissionRules
    monitor: Monitor
    readiness: Readiness
    provider: Provider | None
    """The OpenID provider; None without one in the settings."""
    tool: Tool | None
    """The LTI tool; None without the packages of the extra `lti`."""
    statistics: Statistics
    classes: ClassReader
    streams: Streams = field(default_factory=Streams)

    @property
    def sessions(self) -> SessionCookies:
        """The sessions of browsers."""
        is_secure = self.settings.origin.startswith("https:")
        return SessionCookies(self.database, secure=is_secure, anonymous=self.settings.is_local)

    def desk_of(self, course: str) -> Desk:
        """Returns what reviewing in a course works with, on its content as it is now."""
        return Desk(self.database, self.content.get(course).library, self.blinding)

    def get_pipeline(self, who: Identity) -> Pipeline:
        """Returns the pipeline that reads and grades the answers of a user's course."""
        return self.content.get(who.course).pipeline

    def reload_content(self, who: Identity, revision: str | None = None) -> Library:
        """Loads the content folder of an instructor's course again, and records it. Raises ContentError with every
        fault, and Outdated where a `revision` is given and the folder has another one; what was loaded before then
        stays."""
        content = self.content.get(who.course)
        content.reload(revision)
        digests = {quiz_id: content.library.digest(quiz_id) for quiz_id in content.library.quizzes}
        with self.database.write() as session:
            for course in self.list_sharing(session, who.course):
                record(session, who, course, Action.CONTENT_RELOADED, **digests)
        return content.library

    def list_sharing(self, session: Session, course: str) -> list[str]:
        """Returns the courses that use the content folder of a course, this one first."""
        return self.content.list_sharing(course, people.list_courses(session))

    def library_for(self, who: Identity | None) -> Library:
        """Returns the current content of a user's course, with a learner's own numbers; of the default course for a
        browser without a session."""
        pipeline = self.content.get(DEFAULT_COURSE if who is None else who.course).pipeline
        return pipeline.poser.library_of("" if who is None else who.drawn_for)

    def answers_in(self, library: Library) -> Callable[[Submission], Any]:
        """Returns what reads a stored answer as it is shown beside its question in this library."""
        return partial(self.content.archive.show_in, library.digests)

    def require_opened(self, library: Library, who: Identity, quiz: str) -> Policy:
        """As the function, in a transaction of its own. Raises Conflict, NotFound."""
        with self.database.read() as session:
            return require_opened(session, library, who, quiz)

    def origin_of(self, request: Request) -> str:
        """Returns the origin under which a client reached the service; AdmissionMiddleware has checked its host."""
        return self.settings.origin if self.settings.public_origin else str(request.base_url).rstrip("/")


def get_services(app: FastAPI) -> Services:
    """Returns the services of an app, typed: the only place that looks them up."""
    services: Services = app.state.services
    return services


async def get_services_for(request: Request) -> Services:
    """Returns the services of the app that serves a request."""
    return get_services(request.app)


AppServices = Annotated[Services, Depends(get_services_for)]
