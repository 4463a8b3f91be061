"""The content: what is loaded and certified now, replaced as a whole or not at all, and what was before, by digest."""

import json
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Any

import structlog
from sqlalchemy.orm import Session

from grader.certify.keys import find_refused_keys
from grader.domain.pages.media import Media
from grader.errors import ContentError, ContentLost, Fault, InvalidAnswer, NotFound, Outdated
from grader.grading.pipeline import Pipeline
from grader.library import NOTHING_PASSED, Library, PassedChecks, load, load_files
from grader.library.media import read_media
from grader.library.snapshot import compute_digest
from grader.questions import Question, carry_over, show_answer
from grader.store import contents
from grader.store.engine.database import Database
from grader.store.tables import Submission
from grader.store.upkeep.installation import hidden_case_secret

PIPELINES = 64
"""Pipelines that are held; one is as large as the models and the quiz."""

NO_CONTENT = Library(Path(), {})

log = structlog.get_logger()


class Archive:
    """Every content that a server of this database has loaded, by digest. Thread-safe. A submission is graded with the
    content that it was made against, also by a worker that has never loaded it."""

    def __init__(self, database: Database, passed: PassedChecks = NOTHING_PASSED) -> None:
        self.secret = hidden_case_secret(database)
        self.passed = passed
        self._database = database
        self._held: OrderedDict[str, Pipeline] = OrderedDict()
        self._lost: set[str] = set()
        """The digests of contents that could not be loaded, which no page tries again."""
        self._lock = Lock()

    def keep(self, course: str, pipeline: Pipeline) -> None:
        """Keeps the content of a pipeline, all quizzes or none, as the one that a course uses from now on."""
        library = pipeline.library
        with self._database.write() as session:
            self._database.lock(session, "content")
            for quiz, files in library.sources.items():
                contents.keep(session, quiz, library.digest(quiz), files)
            media = {path: file.body for path, file in library.media.items()}
            if media:  # those of the texts of lessons too, which no digest of a quiz covers
                named = compute_digest({path: file.sha256 for path, file in library.media.items()})
                contents.keep(session, contents.NO_QUIZ, f"media-{named}", media)
            contents.use(session, course, library.digests)
        with self._lock:
            for digest in library.digests.values():
                self._hold(digest, pipeline)

    def get_pipeline(self, quiz: str, digest: str) -> Pipeline:
        """Returns the pipeline that grades a quiz with the content of this digest. Raises ContentLost."""
        with self._lock:
            held = self._held.get(digest) or self._taken(quiz, digest)
            self._hold(digest, held)
        return held

    def carry_over(self, row: Submission, digest: str) -> Any:
        """Returns a stored answer as one to its question in the content of this digest. Raises NotFound, ContentLost
        and, where it is none, InvalidAnswer. Where the content that was answered is lost, the answer stays as it is."""
        answer = json.loads(row.answer)
        if digest == row.content_digest or (earlier := self._find_answered(row)) is None:
            return answer
        return carry_over(earlier, self.get_pipeline(row.quiz, digest).library.question(row.quiz, row.question), answer)

    def show_in(self, digests: Mapping[str, str], row: Submission) -> Any:
        """Returns a stored answer as it is shown beside its question in the content of these digests: in words, where
        it is no answer to that any more; None where the answer is not kept."""
        answer, digest = json.loads(row.answer) if row.answer else None, digests.get(row.quiz)
        if answer is None or digest is None:
            return answer
        try:
            return self.carry_over(row, digest)
        except (NotFound, ContentLost):
            return answer
        except InvalidAnswer:
            earlier = self._find_answered(row)
            return answer if earlier is None else show_answer(earlier, answer)

    def _find_answered(self, row: Submission) -> Question | None:
        """Returns the question as it was answered; None if its content is lost. Raises NotFound."""
        if row.content_digest in self._lost:
            return None
        try:
            pipeline = self.get_pipeline(row.quiz, row.content_digest)
        except ContentLost as error:
            log.warning("answers cannot be compared with their question", quiz=row.quiz, why=str(error))
            self._lost.add(row.content_digest)
            return None
        return pipeline.library.question(row.quiz, row.question)

    def find_media(self, sha256: str, name: str) -> Media | None:
        """Returns a picture or file of any content that was loaded before."""
        with self._database.read() as session:
            return contents.find_media(session, sha256, name)

    def forget_other_courses(self, courses: Collection[str]) -> None:
        """Lets courses that are not among these use the content of all courses, though they had their own."""
        with self._database.write() as session:
            self._database.lock(session, "content")
            for course in contents.list_courses(session) - {*courses}:
                contents.use(session, course, {})

    def current_library(self, session: Session, course: str, quiz: str) -> Library:
        """Returns the content with this quiz as servers use it now; without it if it is gone. Raises ContentLost."""
        digest = contents.in_use(session, course, quiz)
        return NO_CONTENT if digest is None else self.get_pipeline(quiz, digest).library

    def _taken(self, quiz: str, digest: str) -> Pipeline:
        with self._database.read() as session:
            files = contents.read_files(session, digest)
        if files is None:
            raise ContentLost(f"The database does not hold the content {digest} of quiz {quiz!r} in full.")
        try:
            library = load_files(files, self.passed)
        except ContentError as error:
            raise ContentLost(f"The content {digest} of quiz {quiz!r} can no longer be loaded: {error}") from error
        if library.digests.get(quiz) != digest:
            raise ContentLost(f"The files kept as {digest} make other content: {library.digests.get(quiz)}.")
        log.info("content taken from the database", quiz=quiz, digest=digest)
        return Pipeline(library, secret=self.secret)

    def _hold(self, digest: str, pipeline: Pipeline) -> None:
        self._held[digest] = pipeline
        self._held.move_to_end(digest)
        if len(self._held) > PIPELINES:
            self._held.popitem(last=False)


@dataclass(frozen=True)
class Draft:
    """What the folder of a course holds now, in use or not. `library` is None where a file has a fault; with an answer
    key that simulation refuses there are `faults` as well."""

    library: Library | None
    faults: tuple[Fault, ...] = ()

    @property
    def revision(self) -> str:
        """A digest of all quizzes with what their verdicts depend on: another one after each change."""
        return "" if self.library is None else revise(self.library)


def revise(library: Library) -> str:
    """Returns the revision of a library: a digest of all that verdicts and pages depend on."""
    return compute_digest(library.digests, {lesson: repr(text) for lesson, text in library.lessons.items()})


MOVED_ON = "The folder has changed since you looked at it, and nothing was published: read the changes again."


class Content:
    """The content of a course. Take `pipeline` once per request: it is a snapshot that does not change."""

    def __init__(
        self, course: str, root: Path, archive: Archive, listeners: Collection[Callable[[], None]] = ()
    ) -> None:
        """Loads the folder, and keeps what it holds in the archive; calls `listeners` after a reload. Raises
        ContentError, also for an answer key that simulation refuses."""
        self._course, self._root, self.archive = course, root, archive
        self._reloading = Lock()
        self._listeners = listeners
        self.refused: tuple[Fault, ...] = ()
        """What was wrong with the folder when it was last loaded again; the content before it stays in use."""
        self.pipeline = Pipeline(self._load(), secret=archive.secret)
        archive.keep(course, self.pipeline)

    @property
    def library(self) -> Library:
        """The quizzes and models that are loaded now."""
        return self.pipeline.library

    def find_media(self, sha256: str, name: str, *, with_draft: bool) -> Media | None:
        """Returns the picture or file that an address names: of the content in use, of one before it, which old
        verdicts show, and `with_draft` of the folder as it is now."""
        media = self.library.find_media(sha256, name) or self.archive.find_media(sha256, name)
        if media is None and with_draft:
            draft = read_media(self._root)[0].values()
            media = next((file for file in draft if (file.sha256, file.name) == (sha256, name)), None)
        return media

    def read_draft(self) -> Draft:
        """Loads the folder without using it."""
        with self._reloading:
            try:
                library = load(self._root, passed=self.archive.passed)
            except ContentError as error:
                return Draft(None, error.faults)
            return Draft(library, tuple(self._find_refused_keys(library, self.library)))

    def reload(self, revision: str | None = None) -> None:
        """Loads the folder again. Raises ContentError as when it was made, and then keeps what was loaded before;
        Outdated, where a `revision` is given and the folder has another one."""
        with self._reloading:
            try:
                library = self._load(self.library)
            except ContentError as error:
                self.refused = error.faults
                raise
            if revision not in (None, revise(library)):
                raise Outdated(MOVED_ON)
            self.refused = ()
            pipeline = replace(self.pipeline, library=library)
            self.archive.keep(self._course, pipeline)  # before the first submission that is made against it
            self.pipeline = pipeline
        for listener in self._listeners:
            listener()
        log.info("content loaded", course=self._course, quizzes=len(self.library.quizzes))

    def _load(self, known: Library = NO_CONTENT) -> Library:
        """Returns what the folder holds. Raises ContentError, also for every answer key that simulation refuses.
        Quizzes that are the same in a `known` library, with their models, are not derived again."""
        library = load(self._root, passed=self.archive.passed)
        if faults := list(self._find_refused_keys(library, known)):
            raise ContentError(faults)
        return library

    def _find_refused_keys(self, library: Library, known: Library) -> Iterator[Fault]:
        """Yields a fault for every answer key of a changed quiz that simulation refuses."""
        changed = [quiz for quiz, digest in library.digests.items() if known.digests.get(quiz) != digest]
        yield from find_refused_keys(library, changed, self.archive.passed)


class Contents:
    """The contents of all courses: one folder for each in `folders`, and `root` for every other."""

    def __init__(
        self, root: Path, folders: Mapping[str, Path], database: Database, passed: PassedChecks = NOTHING_PASSED
    ) -> None:
        """Loads all folders; what has `passed` before is not checked again. Raises ContentError."""
        self.archive = Archive(database, passed)
        self._listeners: list[Callable[[], None]] = []
        self._all = {course: self._loaded(course, folder) for course, folder in folders.items()}
        self._every = self._loaded(contents.EVERY, root)
        self.archive.forget_other_courses({contents.EVERY, *folders})

    def _loaded(self, course: str, folder: Path) -> Content:
        return Content(course, folder, self.archive, self._listeners)

    def add_listener(self, listener: Callable[[], None]) -> None:
        """Calls `listener` whenever a folder was loaded again."""
        self._listeners.append(listener)

    def get(self, course: str) -> Content:
        """Returns the content of a course."""
        return self._all.get(course, self._every)

    def list_sharing(self, course: str, courses: Iterable[str]) -> list[str]:
        """Returns which of some courses use the folder of a course, this one first."""
        own = self.get(course)
        return [course, *(other for other in courses if other != course and self.get(other) is own)]

    def libraries(self) -> dict[str, Library]:
        """Returns every library by its course; the one for all other courses under the empty name."""
        return {contents.EVERY: self._every.library} | {
            course: content.library for course, content in self._all.items()
        }

    def reload_or_log(self) -> None:
        """Loads every folder again, for a signal handler: faults are logged, not raised."""
        for content in (self._every, *self._all.values()):
            try:
                content.reload()
            except ContentError as error:
                log.error("content refused; the old one stays", faults=[str(fault) for fault in error.faults])
