"""Imports quizzes and labs from a lesson in Markdown: its fenced `quiz` and `lab` blocks become quiz JSON.

The course's format: a fence of backquotes (or tildes) whose first word is `quiz`, `debug` or `lab`, the latter followed
by the kind (`simlab`, which may be left out, or `integrators`), around one JSON object. `sim` and `simlab` are short
for `lab simlab`. Quiz blocks with the same id form one quiz, and so do `debug` blocks that ask something; all labs of
a lesson go into one file.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pydantic import TypeAdapter

from grader.domain.lab import LabConfig
from grader.errors import ContentError, Fault
from grader.labs import compile_lab
from grader.library.json_text import json_faults, parse_json
from grader.library.schema import LAB, QUIZ, Part, validate
from grader.library.semantics import LAB_KINDS, unknown_kind
from grader.questions import AnyKind, installed_kinds, kind_of

FENCE = re.compile(r"^( {0,3})(`{3,}|~{3,})[ \t]*([^`\n]*?)[ \t]*$")
TITLE = re.compile(r"^#[ \t]+(.+?)[ \t#]*$")
NEWLINE = re.compile(r"\r\n|\r|\n")
UNFIT = re.compile(r"[^A-Za-z0-9._-]+")
SLUG = re.compile(r"[^a-z0-9]+")
SIMULATIONS = (("sim",), ("simlab",))
"""What a fence may begin with in place of `lab simlab`."""


@dataclass(frozen=True)
class Block:
    """A fenced block: the words after the fence, the text inside, its first line, and whether its end was found."""

    words: tuple[str, ...]
    text: str
    line: int
    closed: bool


@dataclass(frozen=True)
class Lesson:
    """Quiz JSON by quiz id: the lesson's quizzes, and its labs under `<name>-labs`; and remarks for the author.
    `faults` are those of labs, which were left out."""

    quizzes: dict[str, dict[str, Any]]
    remarks: tuple[Fault, ...] = ()
    faults: tuple[Fault, ...] = ()


def import_lesson(markdown: str, name: str = "lesson") -> Lesson:
    """Returns the quizzes and labs of a lesson. What this service does not have is a remark, and costs nothing else.

    A lab with faults is left out of a lesson that has quizzes. Does not check what needs the content folder: models,
    keyframes, runs. Raises ContentError with all faults where a quiz has one or there is no quiz, each with the
    lesson's name, the line and the reason.
    """
    markdown = markdown.removeprefix("\ufeff")
    reading = _Reading(name)
    for block in blocks(markdown):
        if block.words[:1] == ("quiz",):
            reading.add_quiz(block)
        elif block.words[:1] == ("lab",):
            reading.add_lab(block, block.words[1:2])
        elif block.words[:1] in SIMULATIONS:
            reading.add_lab(block)
        elif block.words and (kind := kind_of_fence(block.words[0])) is not None:
            reading.add_question(block, kind)
    asks = bool(reading.quizzes)
    heading = next((found[1] for line in NEWLINE.split(markdown) if (found := TITLE.match(line))), name)
    reading.finish(heading)
    if not reading.quizzes and not reading.lab_faults and not reading.faults and not reading.remarks:
        reading.fault(1, "no quiz or lab block here: begin one with ```quiz or ```lab simlab")
    if reading.faults or (reading.lab_faults and not asks):
        raise ContentError(sorted(reading.faults + reading.lab_faults))
    return Lesson(reading.quizzes, tuple(sorted(reading.remarks)), tuple(sorted(reading.lab_faults)))


def blocks(markdown: str) -> Iterator[Block]:
    """Yields every fenced block, in order, but none inside a quote. Source: CommonMark, fenced code blocks."""
    opened: tuple[str, str, str, int] | None = None
    inside: list[str] = []
    for number, line in enumerate(NEWLINE.split(markdown), 1):
        fence = FENCE.match(line)
        if opened is None:
            if fence is not None:
                opened, inside = (fence[1], fence[2], fence[3], number), []
            continue
        indent, mark, words, begun = opened
        if fence is not None and not fence[3] and fence[2][0] == mark[0] and len(fence[2]) >= len(mark):
            yield Block(tuple(words.split()), "\n".join(inside), begun, closed=True)
            opened = None
        else:
            inside.append(line.removeprefix(indent))
    if opened is not None:
        yield Block(tuple(opened[2].split()), "\n".join(inside), opened[3], closed=False)


def kind_of_fence(word: str) -> AnyKind | None:
    """Returns the kind of question whose blocks begin with a word, if there is one."""
    return next((kind for kind in installed_kinds().values() if word in kind.fences), None)


class _Reading:
    """The quizzes and labs read so far, and their faults."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.base = UNFIT.sub("-", name).strip("-._")[:50] or "lesson"
        self.faults: list[Fault] = []
        self.lab_faults: list[Fault] = []
        self.remarks: list[Fault] = []
        self.quizzes: dict[str, dict[str, Any]] = {}
        self.lines: dict[str, int] = {}
        self.labs: list[dict[str, Any]] = []

    def fault(self, line: int, why: str) -> None:
        self.faults.append(Fault(self.name, f"line {line}", why))

    def remark(self, line: int, why: str) -> None:
        self.remarks.append(Fault(self.name, f"line {line}", why))

    def add_question(self, block: Block, kind: AnyKind) -> None:
        """Add the question, or the questions, of a block that begins with the word of a kind."""
        raw = self._object(block)
        asked = None if raw is None else raw if "questions" in raw else kind.import_block(raw)
        if isinstance(asked, str):
            self.remark(block.line, asked)
        elif asked is not None:
            self._add_questions(asked, block)

    def add_quiz(self, block: Block) -> None:
        """Add a quiz, or the questions of a further block with the same id. A single question becomes a quiz."""
        raw = self._object(block)
        if raw is not None:
            self._add_questions(raw, block)

    def _add_questions(self, raw: Mapping[str, Any], block: Block) -> None:
        quiz = raw if "questions" in raw else {"questions": [raw]}
        quiz = {"id": f"{self.base}-check", "title": "Knowledge check", **quiz}
        if not isinstance(quiz["questions"], list):
            self.fault(block.line, "questions must be a list")
            return
        self._check_questions(quiz, block.line)
        quiz_id = str(quiz["id"])
        self.lines.setdefault(quiz_id, block.line)
        known = self.quizzes.setdefault(quiz_id, {**quiz, "questions": []})
        known["questions"] += quiz["questions"]

    def _check_questions(self, quiz: dict[str, Any], line: int) -> None:
        checked = self._validate(QUIZ, {**quiz, "questions": _named(quiz["questions"])}, line)
        for question in checked.questions if checked is not None else ():
            if (lab := kind_of(question).lab(question)) is not None:
                self._check_programs(lab, f"{question.id}.sim", line)

    def add_lab(self, block: Block, kinds: tuple[str, ...] = ()) -> None:
        """Add a lab without faults; `kinds` is what the fence says of its kind."""
        begun = [inner.words[0] for inner in blocks(block.text) if inner.words]
        if any(word == "quiz" or kind_of_fence(word) is not None for word in begun):
            self.fault(block.line, "this lab block never ends: close it before the quiz that follows")
            return
        others, self.faults = self.faults, []
        lab = self._lab(block, kinds)
        if self.faults:
            self.remark(block.line, "this lab is left out: correct its faults and import the lesson again")
        elif lab is not None:
            self.labs.append(lab)
        self.lab_faults += self.faults
        self.faults = others

    def _lab(self, block: Block, kinds: tuple[str, ...]) -> dict[str, Any] | None:
        """Read a lab, whose default id comes from its title."""
        raw = self._object(block)
        if raw is None:
            return None
        kind = str(raw.get("kind", next(iter(kinds), LAB_KINDS[0])))
        if kind not in LAB_KINDS:
            self.remark(block.line, unknown_kind(kind))
        taken = {str(lab["id"]) for lab in self.labs}
        lab = {"id": _slug(str(raw.get("title") or kind), taken), "kind": kind, **raw}
        if str(lab["id"]) in taken:
            self.fault(block.line, f"two labs have the id {lab['id']!r}: give each its own")
            return None
        checked = self._validate(LAB, lab, block.line)
        if isinstance(checked, LabConfig):
            self._check_programs(checked, str(lab["id"]), block.line)
        return lab

    def finish(self, title: str) -> None:
        """Find repeated ids over all blocks, and put the labs into a quiz of their own."""
        for quiz_id, quiz in self.quizzes.items():
            ids = [str(q["id"]) for q in _named(quiz["questions"]) if isinstance(q, dict)]
            for question_id in sorted({i for i in ids if ids.count(i) > 1}):
                self.fault(self.lines[quiz_id], f"two questions of {quiz_id!r} have the id {question_id!r}: rename one")
        name = f"{self.base}-labs"
        if self.labs and name in self.quizzes:
            self.fault(self.lines[name], f"the labs of this lesson have the id {name!r}: give this quiz another one")
        elif self.labs:
            self.quizzes[name] = {"id": name, "title": f"Labs of {title}", "labs": self.labs}

    def _object(self, block: Block) -> dict[str, Any] | None:
        if not block.closed:
            self.fault(block.line, f"this {block.words[0]} block never ends: close it with the same fence")
            return None
        raw = parse_json("\n" * block.line + block.text, self.name)  # so that line numbers are those of the lesson
        if isinstance(raw, Fault):
            self.faults.append(raw if raw.key.startswith("line") else replace(raw, key=f"line {block.line}"))
            return None
        faults = list(json_faults(raw, self.name, ""))
        for fault in faults:
            self.fault(block.line, f"{fault.key}: {fault.why}")
        if not isinstance(raw, dict):
            self.fault(block.line, "the block must be one JSON object")
        return raw if isinstance(raw, dict) and not faults else None

    def _validate(self, adapter: TypeAdapter[Part], raw: dict[str, Any], line: int) -> Part | None:
        parts, faults = validate(adapter, [("", raw)], self.name)
        for fault in faults:
            self.fault(line, f"{fault.key}: {fault.why}")
        return parts[0] if parts else None

    def _check_programs(self, config: LabConfig, where: str, line: int) -> None:
        try:
            compile_lab(config, where)
        except ContentError as error:
            for fault in error.faults:
                self.fault(line, f"{fault.key}: {fault.why}")


def _named(questions: list[Any]) -> list[Any]:
    """Returns the questions, with default ids by position."""
    return [{"id": f"q{i}", **q} if isinstance(q, dict) else q for i, q in enumerate(questions, 1)]


def _slug(title: str, taken: set[str]) -> str:
    """Returns an id made from a title that is not yet taken."""
    base = SLUG.sub("-", title.lower()).strip("-")[:40].strip("-") or "lab"
    return next(name for name in (base, *(f"{base}-{i}" for i in range(2, 1000))) if name not in taken)
