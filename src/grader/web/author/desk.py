"""AuthorDesk: a content folder that is being written. It reads, checks and saves one question at a time."""

import hashlib
import json
import os
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Condition, Thread
from typing import NamedTuple, Self

from grader.errors import ContentError, Fault, NotFound, Outdated
from grader.grading.checking import check_content
from grader.grading.pipeline import Pipeline
from grader.grading.report import Report
from grader.grading.selection import Selection
from grader.library import Library, PassedChecks, load
from grader.library.files import QUIZ_BYTES_MAX, read_text
from grader.library.question_text import find_id, find_question
from grader.library.quiz_files import list_quiz_files, outline_quiz
from grader.library.scaffold import add_exercise, add_question

WATCHED = (
    "quizzes/**/*", "lessons/*.md", "models/**/*", "programs/**/*", "images/**/*", "files/**/*",
    "reference_solutions/*/*/*.*",
)  # fmt: skip

CHANGED = "The file has changed since you read it: nothing was saved. Copy what you typed, and read the page again."

WHOLE = (
    "Nothing was saved: this is the text of one question, and the whole file was shown, since it cannot be read as it "
    "is. Mend the question within the text of the file."
)

TAG = re.compile(r"([0-9a-f]{16})-(\d{1,9})-(\d{1,9})")

OpenPipeline = Callable[[Library], AbstractContextManager[Pipeline]]


@dataclass
class Check:
    """A check of one question at one revision of the folder: what it does now, and its report once it is done."""

    revision: str
    doing: str = "starting"
    report: Report | None = None


@dataclass(frozen=True)
class Tag:
    """What a page shows of a file: of the text with this `digest` all but the characters `before` and `after` it. So
    what is saved takes the place of what was shown, whatever its own id or syntax has become."""

    digest: str
    before: int
    after: int

    @classmethod
    def compute(cls, text: str, start: int, end: int) -> Self:
        """Returns the tag of a part of a text."""
        return cls(hash_text(text), start, len(text) - end)

    @classmethod
    def read(cls, tag: str) -> Self | None:
        """Returns a tag that was written as text; None for what is none."""
        match = TAG.fullmatch(tag)
        return cls(match[1], int(match[2]), int(match[3])) if match else None

    def __str__(self) -> str:
        return f"{self.digest}-{self.before}-{self.after}"

    @property
    def is_part(self) -> bool:
        """Whether it is of less than the whole text."""
        return bool(self.before or self.after)

    def fits(self, text: str) -> bool:
        """Whether the text is still the same."""
        return self.digest == hash_text(text) and self.before + self.after <= len(text)


class SavedQuestion(NamedTuple):
    """The id of the question that was saved, which its author may have changed, and the tag of its source now."""

    question: str
    tag: str


def hash_text(text: str) -> str:
    """Returns a digest of a text, by which a change is noticed."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


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
        path = by_id.get(quiz) or by_name.get(quiz)
        if path is None:
            raise NotFound(f"There is no quiz {quiz!r}.")
        return path

    def read_source(self, quiz: str, question: str) -> tuple[str, str, bool]:
        """Returns the source of a question, the tag under which it is saved, and whether it is that of the whole file,
        as while the question cannot be found in it. Raises NotFound."""
        file = self.find_file(quiz)
        text = self._read_file(file)
        try:
            start, end = find_question(text, question, file)
        except NotFound:
            return text, str(Tag.compute(text, 0, len(text))), True
        return text[start:end], str(Tag.compute(text, start, end)), False

    def save_source(self, quiz: str, question: str, source: str, tag: str) -> SavedQuestion:
        """Writes a source in place of what `read_source` gave with this tag, a question or the whole file. Raises
        NotFound, and Outdated where the file has changed since."""
        file = self.find_file(quiz)
        with self.changed:
            text, shown = self._read_file(file), Tag.read(tag)
            if shown is None or not shown.fits(text):
                raise Outdated(CHANGED)
            if not shown.is_part and is_lone_question(source):
                raise Outdated(WHOLE)
            place, end = self.root / file, len(text) - shown.after
            saved = text[: shown.before] + (source.strip() if shown.is_part else source) + text[end:]
            with tempfile.NamedTemporaryFile("wb", dir=place.parent, prefix=".saving-", delete=False) as new:
                new.write(saved.encode())
            Path(new.name).chmod(place.stat().st_mode & 0o777)
            if self._read_file(file) != text:  # by an editor of another program meanwhile
                Path(new.name).unlink()
                raise Outdated(CHANGED)
            Path(new.name).replace(place)
        now = find_id(saved, shown.before, file) if shown.is_part else None
        return SavedQuestion(now or question, str(Tag.compute(saved, shown.before, len(saved) - shown.after)))

    def add_question(self, quiz: str, kind: str) -> str:
        """Adds an example of a kind of question, or `exercise:` and a kind of exercise, at the end of a quiz. Returns
        its id. Raises NotFound, Conflict, and ContentError where the quiz cannot be read."""
        with self.changed:
            sort, _, name = kind.rpartition(":")
            (add_exercise if sort == "exercise" else add_question)(self.root, quiz, name)
            return dict(self.list_questions())[quiz][-1]

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
    """Yields the faults that are about a question first, then those of its file, then all others."""
    yield from sorted(faults, key=lambda fault: (fault.file != file, fault.key.partition(".")[0] != question, fault))
