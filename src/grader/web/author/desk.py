"""AuthorDesk: a content folder that is being written. It reads, checks and saves one question at a time."""

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Condition, Thread
from typing import NamedTuple

from grader.errors import Conflict, ContentError, Fault, NotFound, Outdated
from grader.grading.checking import check_content
from grader.grading.pipeline import Pipeline
from grader.grading.report import Report
from grader.grading.selection import Selection
from grader.library import Library, PassedChecks, load
from grader.library.files import QUIZ_BYTES_MAX, read_text
from grader.library.question_text import find_name, find_question
from grader.library.quiz_files import list_quiz_files, name_quiz, outline_quiz
from grader.library.scaffold import add_exercise, add_question
from grader.web.author.source import ShownSource, Tag

WATCHED = (
    "quizzes/**/*", "lessons/*.md", "models/**/*", "programs/**/*", "images/**/*", "files/**/*",
    "reference_solutions/*/*/*.*",
)  # fmt: skip

CHANGED = "The file has changed since you read it: nothing was saved. Copy what you typed, and read the page again."

WHOLE = (
    "Nothing was saved: this is the text of one question, and the whole file was shown, since it cannot be read as it "
    "is. Mend the question within the text of the file."
)

OpenPipeline = Callable[[Library], AbstractContextManager[Pipeline]]


@dataclass
class Check:
    """A check of one question at one revision of the folder: what it does now, and its report once it is done."""

    revision: str
    doing: str = "starting"
    report: Report | None = None


class SavedQuestion(NamedTuple):
    """The name of the question that was saved, which its author may have changed, and the tag of its source now."""

    question: str
    tag: str


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

    def list_questions(self) -> list[tuple[str, dict[str, str]]]:
        """Returns the name of every quiz, and the ids of its questions by their names, also of those with faults;
        without files that are no JSON."""
        outlines = [(file, outline_quiz(self.root, file)) for file in list_quiz_files(self.root)]
        return [(name_quiz(it[0], file), it[1]) for file, it in outlines if it is not None]

    def find_file(self, quiz: str) -> str:
        """Returns the file of a quiz: by its id, else by its own name, as while it is no JSON. Raises NotFound."""
        files = list_quiz_files(self.root)
        by_id = {outline[0]: file for file in files if (outline := outline_quiz(self.root, file)) is not None}
        by_name = {Path(file).stem: file for file in files}
        path = by_id.get(quiz) or by_name.get(quiz)
        if path is None:
            raise NotFound(f"There is no quiz {quiz!r}.")
        return path

    def read_source(self, quiz: str, question: str, tag: str = "") -> ShownSource:
        """Returns the part that a page shows under this tag, as long as it stays the same, even if it is no question
        that can be read; else the source of a question by its name, else the whole file. Raises NotFound."""
        file = self.find_file(quiz)
        text, shown = self._read_file(file), Tag.read(tag)
        place = shown.find(text) if shown is not None and shown.is_part else None
        with suppress(NotFound):
            place = place or find_question(text, question, file)
        return ShownSource(file, text, *(place or (0, len(text))))

    def save_source(self, quiz: str, question: str, source: str, tag: str) -> SavedQuestion:
        """Writes a source in place of what `read_source` gave with this tag, a question or the whole file. Raises
        NotFound, and Outdated where that has changed since; the rest of the file may have."""
        file = self.find_file(quiz)
        with self.changed:
            text, shown = self._read_file(file), Tag.read(tag)
            place = shown.find(text) if shown is not None else None
            if shown is None or place is None:
                raise Outdated(CHANGED)
            if not shown.is_part and is_lone_question(source):
                raise Outdated(WHOLE)
            start, end = place
            saved = text[:start] + (source.strip() if shown.is_part else source) + text[end:]
            self._write_file(file, text, saved)
        now = find_name(saved, start, file) if shown.is_part else None
        return SavedQuestion(now or question, str(Tag.compute(saved, start, len(saved) - len(text) + end)))

    def _write_file(self, file: str, text: str, saved: str) -> None:
        """Writes a file at once in place of its text. Raises Outdated where another program has changed it."""
        place = self.root / file
        with tempfile.NamedTemporaryFile("wb", dir=place.parent, prefix=".saving-", delete=False) as new:
            new.write(saved.encode())
        Path(new.name).chmod(place.stat().st_mode & 0o777)
        if self._read_file(file) != text:
            Path(new.name).unlink()
            raise Outdated(CHANGED)
        Path(new.name).replace(place)

    def add_question(self, quiz: str, kind: str) -> str:
        """Adds an example of a kind of question, or `exercise:` and a kind of exercise, at the end of a quiz. Returns
        its name. Raises NotFound, Conflict, and ContentError where the quiz cannot be read."""
        file = self.find_file(quiz)
        with self.changed:
            outline = outline_quiz(self.root, file)
            if outline is not None and outline[0] != quiz:  # by this name another quiz would be begun
                raise Conflict(f"Nothing was added: mend the id of {file} first.")
            sort, _, name = kind.rpartition(":")
            (add_exercise if sort == "exercise" else add_question)(self.root, quiz, name)
            return list(dict(self.list_questions())[quiz])[-1]

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


def is_lone_question(text: str) -> bool:
    """Whether a text is the JSON of a question, where that of a whole quiz belongs."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return False
    return isinstance(value, dict) and "questions" not in value and "q" in value


def list_about(faults: list[Fault], file: str, question: str) -> Iterator[Fault]:
    """Yields the faults that are about a question, by its id, first, then those of its file, then all others."""
    yield from sorted(
        faults, key=lambda fault: (fault.file != file, not f"{fault.key}.".startswith(f"{question}."), fault)
    )
