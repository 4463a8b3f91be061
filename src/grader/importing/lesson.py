"""Imports a lesson in Markdown: its fenced `quiz` and `lab` blocks become quiz JSON, the rest the text of the lesson.

The course's format: a fence of backquotes (or tildes) whose first word is `quiz`, `debug` or `lab`, the latter followed
by the kind (`simlab`, which may be left out, or `integrators`), around one JSON object. `sim` and `simlab` are short
for `lab simlab`. Quiz blocks with the same id form one quiz, and so do `debug` blocks that ask something; all labs of
a lesson go into one file. In the text an empty fence stands where each of them was.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any

from markdown_it.token import Token
from pydantic import TypeAdapter

from grader.domain.lab import Lab, LabConfig
from grader.domain.pages.media import replace_addresses
from grader.errors import ContentError, Fault
from grader.importing.addresses import Addresses
from grader.importing.passages import PRINTED, write_case, write_fence, write_program, write_widget
from grader.importing.text import Text
from grader.labs import DEFAULT, lab_adapter, lab_kind_of, lab_kinds
from grader.library.checking.schema import QUIZ, Part, validate
from grader.library.checking.semantics import unknown_kind
from grader.library.json_text import json_faults, parse_json
from grader.library.lesson_ids import find_lesson_id
from grader.library.lesson_text import find_number
from grader.library.markdown.front_matter import read_front_matter, split_front_matter
from grader.questions import AnyKind, installed_kinds, kind_of

UNFIT = re.compile(r"[^A-Za-z0-9._-]+")
SLUG = re.compile(r"[^a-z0-9]+")
SIMULATIONS = ("sim", "simlab")
"""What a fence may begin with in place of `lab simlab`."""

NO_NUMBER = "the text of the lesson is left out: its file has no number; name it such as 1.3-integrators.md"


QUIZ_FENCE = "quiz"
NEAR = 0.75
"""How much another word is like it that is taken for a slip: `quizz`, `Quiz`, `quizzes` no more."""


@dataclass(frozen=True)
class Block:
    """A fenced block: the words after the fence, the text inside, its first line, its lines (from, until), and whether
    its end was found."""

    words: tuple[str, ...]
    text: str
    line: int
    lines: tuple[int, int]
    closed: bool


@dataclass(frozen=True)
class Lesson:
    """Quiz JSON by quiz id: the lesson's quizzes, and its labs under `<name>-labs`; `text` is the file of the lesson's
    own text, `lessons/<id>.md`, empty where it has no number, and `media` the pictures and files that it shows, by
    path. `remarks` are for the author; `faults` are those of labs, which were left out."""

    quizzes: dict[str, dict[str, Any]]
    remarks: tuple[Fault, ...] = ()
    faults: tuple[Fault, ...] = ()
    id: str = ""
    text: str = ""
    media: dict[str, bytes] = field(default_factory=dict)

    def list_files(self, out: Path) -> dict[Path, bytes]:
        """Returns the files of a content folder: quizzes in `out`, the text and the pictures in the folders beside it
        where it is called quizzes, else in folders inside it."""
        root = out.parent if out.name == "quizzes" else out
        quizzes = {
            out / f"{quiz_id}.json": (json.dumps(quiz, ensure_ascii=False, indent=2) + "\n").encode()
            for quiz_id, quiz in self.quizzes.items()
        }
        text = {root / f"lessons/{self.id}.md": self.text.encode()} if self.text else {}
        return quizzes | text | {root / path: body for path, body in self.media.items()}


def import_lesson(markdown: str, name: str = "lesson", folder: Path | None = None, source: str = "") -> Lesson:
    """Returns the quizzes, the labs and the text of a lesson. What this service does not have is a remark, and costs
    nothing else. `folder` has the pictures, `source` is the address of the original page; the front matter may have it.

    A lab with faults is left out of a lesson that has quizzes. Does not check what needs the content folder: models,
    keyframes, runs. Raises ContentError with all faults where a quiz has one or there is nothing to read, each with the
    lesson's name, the line and the reason.
    """
    front, body = split_front_matter(markdown.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n"))
    head = read_front_matter(front, name)
    text = Text(body)
    reading = _Reading(name, find_number(name) or find_named_lesson(text))
    if isinstance(head, Fault):
        reading.remarks.append(head)
        head = {}
    addresses = Addresses(reading.base, folder, source or str(head.get("source", "")))
    reading.addresses = addresses
    for token in text.fences:
        reading.read_block(text, read_fenced_block(token, text))
    for token in text.quoted:
        if QUIZ_FENCE in token.info.split()[:1]:
            reading.remark((token.map or (0, 0))[0] + 1, "a quiz in a quotation stays text: take the > away to ask it")
    title = text.find_title() or str(head.get("title") or name)
    asks = bool(reading.quizzes)
    reading.finish(title)
    if not reading.quizzes and not reading.lab_faults and not reading.faults and not text.has_prose:
        reading.fault(1, "no quiz or lab block here, and no text: begin a block with ```quiz or ```lab simlab")
    if reading.faults or (reading.lab_faults and not asks):
        raise ContentError(sorted(reading.faults + reading.lab_faults))
    written = ""
    if reading.number:
        written = text.write(title, addresses, reading.remark)
    elif text.has_prose:
        reading.remark(1, NO_NUMBER)
    remarks, faults = tuple(sorted(reading.remarks)), tuple(sorted(reading.lab_faults))
    return Lesson(reading.quizzes, remarks, faults, reading.number, written, addresses.media)


def read_fenced_block(token: Token, text: Text) -> Block:
    """Returns the fenced block of a token."""
    begin, end = token.map or (0, 0)
    closed = end - begin > 1 and text.lines[end - 1].strip().startswith(token.markup)
    words = tuple(token.info.split())
    return Block(words, token.content.removesuffix("\n"), begin + 1, (begin, end), closed)


def find_named_lesson(text: Text) -> str:
    """Returns the number of the first quiz that has an id with one; empty where none has."""
    for token in text.fences:
        raw = parse_json(token.content, "") if token.info.split()[:1] == ["quiz"] else None
        if isinstance(raw, dict) and isinstance(raw.get("id"), str) and find_lesson_id(raw["id"])[0].isdigit():
            return find_lesson_id(raw["id"])
    return ""


def kind_of_fence(word: str) -> AnyKind | None:
    """Returns the kind of question whose blocks begin with a word, if there is one."""
    return next((kind for kind in installed_kinds().values() if word in kind.fences), None)


class _Reading:
    """The quizzes and labs read so far, and their faults; `number` is that of the lesson, empty where it has none."""

    addresses: Addresses

    def __init__(self, name: str, number: str) -> None:
        self.name, self.number = name, number
        self.base = number or UNFIT.sub("-", name).strip("-._")[:50] or "lesson"
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

    def read_block(self, text: Text, block: Block) -> None:
        """Reads a fenced block, and puts what stands for it into the text."""
        word, *more = block.words or ("",)
        passage: str | None = None
        if word == QUIZ_FENCE:
            passage = self.add_quiz(block)
        elif word == "lab" or word in SIMULATIONS:
            passage = self.add_lab(block, tuple(more[:1]) if word == "lab" else ())
        elif (kind := kind_of_fence(word)) is not None:
            passage = self.add_question(block, kind)
        elif word == "io":
            raw = parse_json(block.text, self.name)
            passage = write_program(block.text, None if isinstance(raw, Fault) else raw)
        elif word == "widget":
            passage = self.write_widget(" ".join(block.words), block)
        elif word in PRINTED:
            passage = write_fence("output", block.text)
        elif get_close_matches(word.casefold(), [QUIZ_FENCE], 1, NEAR):
            self.fault(block.line, f"a block {word!r} is read as text, with its answers: begin it with ```{QUIZ_FENCE}")
        if passage is not None:
            text.replace(block.lines, passage)

    def write_widget(self, kind: str, block: Block) -> str:
        """Returns what stands for a widget that does not run here."""
        raw = parse_json(block.text, self.name)
        title = str(raw.get("title") or "") if isinstance(raw, dict) else ""
        return write_widget(kind, title, self.addresses.source)

    def place(self, quiz_id: str, lab_id: str = "") -> str:
        """Returns the empty fence of a quiz or lab of this lesson; nothing for a quiz that has its place already, and
        for one of another lesson."""
        if find_lesson_id(quiz_id) != self.number:
            if self.number and not lab_id:
                why = f"the quiz {quiz_id!r} is not of lesson {self.number}: it stands on a page of its own"
                self.remark(self.lines.get(quiz_id, 1), f"{why}; begin its id with {self.number}-")
            return ""
        return f"```lab {quiz_id}/{lab_id}\n```" if lab_id else f"```quiz {quiz_id}\n```"

    def add_question(self, block: Block, kind: AnyKind) -> str:
        """Adds the question, or the questions, of a block that begins with the word of a kind. Returns what stands for
        it in the text."""
        raw = self._object(block)
        asked = None if raw is None else raw if "questions" in raw else kind.import_block(raw)
        if isinstance(asked, str):
            self.remark(block.line, asked)
            return write_case(raw or {})
        return "" if asked is None else self._add_questions(asked, block)

    def add_quiz(self, block: Block) -> str:
        """Adds a quiz, or the questions of a further block with the same id. A single question becomes a quiz. Returns
        what stands for it in the text."""
        raw = self._object(block)
        return "" if raw is None else self._add_questions(raw, block)

    def _add_questions(self, raw: Mapping[str, Any], block: Block) -> str:
        quiz = raw if "questions" in raw else {"questions": [raw]}
        quiz = {"id": f"{self.base}-check", "title": "Knowledge check", **quiz}
        if not isinstance(quiz["questions"], list):
            self.fault(block.line, "questions must be a list")
            return ""
        self._check_questions(quiz, block.line)
        quiz_id = str(quiz["id"])
        self.lines.setdefault(quiz_id, block.line)
        passage = "" if quiz_id in self.quizzes else self.place(quiz_id)
        known = self.quizzes.setdefault(quiz_id, {**quiz, "questions": []})
        known["questions"] += self._bring_media(quiz["questions"], block.line)
        return passage

    def _bring_media(self, raw: Any, line: int) -> Any:
        """Returns JSON whose texts name pictures and files as they are named in the content folder."""
        find = partial(self.addresses.resolve, tell=partial(self.remark, line))
        return self.addresses.replace_in_json(raw, lambda text: replace_addresses(text, find)) if self.number else raw

    def _check_questions(self, quiz: dict[str, Any], line: int) -> None:
        checked = self._validate(QUIZ, {**quiz, "questions": _named(quiz["questions"])}, line)
        for question in checked.questions if checked is not None else ():
            if (lab := kind_of(question).lab(question)) is not None:
                self._check_lab(lab, f"{question.id}.sim", line)

    def add_lab(self, block: Block, kinds: tuple[str, ...] = ()) -> str:
        """Adds a lab without faults; `kinds` is what the fence says of its kind. Returns what stands for it in the
        text."""
        begun = [token.info.split()[0] for token in Text(block.text).fences if token.info.strip()]
        if any(word == "quiz" or kind_of_fence(word) is not None for word in begun):
            self.fault(block.line, "this lab block never ends: close it before the quiz that follows")
            return ""
        others, self.faults = self.faults, []
        lab = self._lab(block, kinds)
        whole = not self.faults
        self.lab_faults += self.faults
        self.faults = others
        if lab is None or not whole:
            self.remark(block.line, "this lab is left out: correct its faults and import the lesson again")
            return self.write_widget(" ".join(block.words), block)
        self.labs.append(self._bring_media(lab, block.line))
        return self.place(f"{self.base}-labs", str(lab["id"]))

    def _lab(self, block: Block, kinds: tuple[str, ...]) -> dict[str, Any] | None:
        """Read a lab, whose default id comes from its title."""
        raw = self._object(block)
        if raw is None:
            return None
        kind = str(raw.get("kind", next(iter(kinds), DEFAULT)))
        if kind not in lab_kinds():
            self.remark(block.line, unknown_kind(kind))
        taken = {str(lab["id"]) for lab in self.labs}
        lab = {"id": _slug(str(raw.get("title") or kind), taken), "kind": kind, **raw}
        if str(lab["id"]) in taken:
            self.fault(block.line, f"two labs have the id {lab['id']!r}: give each its own")
            return None
        checked = self._validate(lab_adapter(), lab, block.line)
        if isinstance(checked, Lab):
            self._check_lab(checked, str(lab["id"]), block.line)
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

    def _check_lab(self, lab: Lab | LabConfig, where: str, line: int) -> None:
        for key, why in lab_kind_of(lab).faults(lab):
            self.fault(line, f"{where}.{key}: {why}" if key else f"{where}: {why}")


def _named(questions: list[Any]) -> list[Any]:
    """Returns the questions, with default ids by position."""
    return [{"id": f"q{i}", **q} if isinstance(q, dict) else q for i, q in enumerate(questions, 1)]


def _slug(title: str, taken: set[str]) -> str:
    """Returns an id made from a title that is not yet taken."""
    base = SLUG.sub("-", title.lower()).strip("-")[:40].strip("-") or "lab"
    return next(name for name in (base, *(f"{base}-{i}" for i in range(2, 1000))) if name not in taken)
