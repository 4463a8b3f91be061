"""The content: what is loaded and certified now, replaced as a whole or not at all, and what was before, by digest."""

from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from pathlib import Path
from threading import Lock

import structlog
from sqlalchemy.orm import Session

from grader.certify.keys import find_refused_keys
from grader.errors import ContentError, ContentLost, Fault
from grader.grading.pipeline import Pipeline
from grader.library import Library, load, load_files
from grader.store import contents
from grader.store.engine.database import Database
from grader.store.upkeep.installation import hidden_case_secret

PIPELINES = 64
"""Pipelines that are held; one is as large as the models and the quiz."""

NO_CONTENT = Library(Path(), {})

log = structlog.get_logger()


class Archive:
    """Every content that a server of this database has loaded, by digest. Thread-safe. A submission is graded with the
    content that it was made against, also by a worker that has never loaded it."""

    def __init__(self, database: Database) -> None:
        self.secret = hidden_case_secret(database)
        self._database = database
        self._held: OrderedDict[str, Pipeline] = OrderedDict()
        self._lock = Lock()

    def keep(self, course: str, pipeline: Pipeline) -> None:
        """Keeps the content of a pipeline, all quizzes or none, as the one that a course uses from now on."""
        library = pipeline.library
        with self._database.write() as session:
            self._database.lock(session, "content")
            for quiz, files in library.sources.items():
                contents.keep(session, quiz, library.digest(quiz), files)
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

    def forget_other_courses(self, courses: Collection[str]) -> None:
        """Lets courses that are not among these use the content of all courses, though they had their own."""
        with self._database.write() as session:
            self._database.lock(session, "content")
            for course in contents.courses(session) - {*courses}:
                contents.use(session, course, {})

    def current_library(self, session: Session, course: str, quiz: str) -> Library:
        """Returns the content with this quiz as servers use it now; without it if it is gone. Raises ContentLost."""
        digest = contents.in_use(session, course, quiz)
        return NO_CONTENT if digest is None else self.get_pipeline(quiz, digest).library

    def _taken(self, quiz: str, digest: str) -> Pipeline:
        with self._database.read() as session:
            files = contents.files_of(session, digest)
        if files is None:
            raise ContentLost(f"The database does not hold the content {digest} of quiz {quiz!r} in full.")
        try:
            library = load_files(files)
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
        self.pipeline = Pipeline(certify(load(root)), secret=archive.secret)
        archive.keep(course, self.pipeline)

    @property
    def library(self) -> Library:
        """The quizzes and models that are loaded now."""
        return self.pipeline.library

    def reload(self) -> None:
        """Loads the folder again. Raises ContentError as when it was made, and then keeps what was loaded before."""
        with self._reloading:
            try:
                library = certify(load(self._root), self.library)
            except ContentError as error:
                self.refused = error.faults
                raise
            self.refused = ()
            pipeline = replace(self.pipeline, library=library)
            self.archive.keep(self._course, pipeline)  # before the first submission that is made against it
            self.pipeline = pipeline
        for listener in self._listeners:
            listener()
        log.info("content loaded", course=self._course, quizzes=len(self.library.quizzes))


def certify(library: Library, known: Library = NO_CONTENT) -> Library:
    """Returns the library itself. Raises ContentError for every answer key that simulation refuses. Quizzes that are
    the same in a `known` library, with their models, are not derived again."""
    changed = [quiz for quiz, digest in library.digests.items() if known.digests.get(quiz) != digest]
    if faults := list(find_refused_keys(library, changed)):
        raise ContentError(faults)
    return library


class Contents:
    """The contents of all courses: one folder for each in `folders`, and `root` for every other."""

    def __init__(self, root: Path, folders: Mapping[str, Path], database: Database) -> None:
        """Loads all folders. Raises ContentError."""
        self.archive = Archive(database)
        self._listeners: list[Callable[[], None]] = []
        self._all = {course: self._loaded(course, folder) for course, folder in folders.items()}
        self._every = self._loaded(contents.EVERY, root)
        self.archive.forget_other_courses({contents.EVERY, *folders})

    def _loaded(self, course: str, folder: Path) -> Content:
        return Content(course, folder, self.archive, self._listeners)

    def add_listener(self, listener: Callable[[], None]) -> None:
        """Calls `listener` whenever a folder was loaded again."""
        self._listeners.append(listener)

    def of(self, course: str) -> Content:
        """Returns the content of a course."""
        return self._all.get(course, self._every)

    def libraries(self) -> dict[str, Library]:
        """Returns every library by its course; the one for all other courses under the empty name."""
        return {contents.EVERY: self._every.library} | {course: one.library for course, one in self._all.items()}

    def reload_or_log(self) -> None:
        """Loads every folder again, for a signal handler: faults are logged, not raised."""
        for content in (self._every, *self._all.values()):
            try:
                content.reload()
            except ContentError as error:
                log.error("content refused; the old one stays", faults=[str(fault) for fault in error.faults])
