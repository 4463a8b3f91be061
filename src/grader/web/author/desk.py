"""AuthorDesk: a content folder that is being written. It reads, checks and saves one question at a time."""

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Condition, Thread

from grader.errors import ContentError, Fault, NotFound, Outdated
from grader.grading.checking import Report, check_content
from grader.grading.pipeline import Pipeline
from grader.grading.selection import Selection
from grader.library import Library, PassedChecks, load
from grader.library.files import QUIZ_BYTES_MAX, read_text
from grader.library.question_text import find_question, replace_question
from grader.library.quiz_files import list_quiz_files, outline_quiz

WATCHED = ("quizzes/**/*", "lessons/*.md", "models/**/*", "programs/**/*", "reference_solutions/*/*/*.py")

CHANGED = "The file has changed since you read it: nothing was saved. Copy what you typed, and read the page again."

OpenPipeline = Callable[[Library], AbstractContextManager[Pipeline]]


@dataclass
class Check:
    """A check of one question at one revision of the folder: what it does now, and its report once it is done."""

    revision: str
    doing: str = "starting"
    report: Report | None = None


@dataclass
class AuthorDesk:
    """One folder. Threads may share it; one check runs at a time."""

    root: Path
    passed: PassedChecks
    open_pipeline: OpenPipeline
    checks: dict[tuple[str, str], Check] = field(default_factory=dict)
    changed: Condition = field(default_factory=Condition)

    @property
    def is_writable(self) -> bool:
        """Whether what is edited on the page can be written into the folder."""
        return os.access(self.root / "quizzes", os.W_OK)

    def read_revision(self) -> str:
        """Returns a digest of the names, sizes and times of all files: another one after each change."""
        digest = hashlib.sha256()
        for pattern in WATCHED:
            for path in sorted(self.root.glob(pattern)):
                try:
                    stat = path.stat()
                except OSError:  # an editor is writing it
                    continue
                digest.update(f"{path}\0{stat.st_size}\0{stat.st_mtime_ns}\n".encode())
        return digest.hexdigest()[:16]

    def list_questions(self) -> list[tuple[str, list[str]]]:
        """Returns the ids of every quiz and its questions, also of those with faults; without files that are no
        JSON."""
        outlines = (outline_quiz(self.root, file) for file in list_quiz_files(self.root))
        return [outline for outline in outlines if outline is not None]

    def find_file(self, quiz: str) -> str:
        """Returns the file of a quiz: by its id, else by its name, as while it is no JSON. Raises NotFound."""
        files = list_quiz_files(self.root)
        by_id = {outline[0]: file for file in files if (outline := outline_quiz(self.root, file)) is not None}
        by_name = {Path(file).stem: file for file in files}
        found = by_id.get(quiz) or by_name.get(quiz)
        if found is None:
            raise NotFound(f"There is no quiz {quiz!r}.")
        return found

    def read_source(self, quiz: str, question: str) -> tuple[str, str, bool]:
        """Returns the source of a question, the tag of its file, and whether it is that of the whole file, as while
        the question cannot be found in it. Raises NotFound."""
        file = self.find_file(quiz)
        text = self._read_file(file)
        try:
            start, end = find_question(text, question, file)
        except NotFound:
            return text, tag_of(text), True
        return text[start:end], tag_of(text), False

    def save_source(self, quiz: str, question: str, source: str, tag: str) -> None:
        """Writes the source of a question, or of the whole file where `read_source` gave that. Raises NotFound, and
        Outdated where the file has changed since it had this tag."""
        file = self.find_file(quiz)
        with self.changed:
            text = self._read_file(file)
            if tag_of(text) != tag:
                raise Outdated(CHANGED)
            whole = self.read_source(quiz, question)[2]
            place = self.root / file
            with tempfile.NamedTemporaryFile("wb", dir=place.parent, prefix=".saving-", delete=False) as new:
                new.write((source if whole else replace_question(text, question, source, file)).encode())
            Path(new.name).chmod(place.stat().st_mode & 0o777)
            if tag_of(self._read_file(file)) != tag:  # by an editor of another program meanwhile
                Path(new.name).unlink()
                raise Outdated(CHANGED)
            Path(new.name).replace(place)

    def _read_file(self, file: str) -> str:
        text = read_text(self.root, file, QUIZ_BYTES_MAX)
        if isinstance(text, Fault):
            raise NotFound(str(text))
        return text

    def load(self, quiz: str) -> Library | list[Fault]:
        """Returns the content with this quiz, or the faults of the folder."""
        try:
            return load(self.root, quiz, self.passed)
        except ContentError as error:
            return list(error.faults)

    def check(self, quiz: str, question: str) -> Check:
        """Returns the check of a question as the folder is now; begins it in a thread if need be."""
        revision = self.read_revision()
        with self.changed:
            known = self.checks.get((quiz, question))
            if known is not None and known.revision == revision:
                return known
            check = self.checks[quiz, question] = Check(revision)
        Thread(target=self._run, args=(check, Selection(quiz, question)), daemon=True).start()
        return check

    def _run(self, check: Check, only: Selection) -> None:
        def note(doing: str) -> None:
            check.doing = doing

        try:
            report = check_content(
                self.root, self.open_pipeline, lambda _: None, passed=self.passed, only=only, doing=note
            )
        except Exception as error:  # a check that fails must be told on the page
            report = Report(faults=[Fault(".", "check", f"the check itself failed: {error}")])
        with self.changed:
            check.report = report
            self.changed.notify_all()

    def wait_for_report(self, check: Check, seconds: float) -> Report | None:
        """Returns the report of a check, once it is done; None if it takes longer."""
        with self.changed:
            self.changed.wait_for(lambda: check.report is not None, seconds)
        return check.report


def tag_of(text: str) -> str:
    """Returns the tag of a file's text, by which a change is noticed."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def list_about(faults: list[Fault], file: str, question: str) -> Iterator[Fault]:
    """Yields the faults that are about a question first, then those of its file, then all others."""
    yield from sorted(faults, key=lambda one: (one.file != file, one.key.partition(".")[0] != question, one))
