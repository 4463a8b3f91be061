"""Reads the text of a lesson: Markdown in which empty fences place quizzes and labs. Regular expressions read no
Markdown: markdown-it-py parses it (CommonMark with tables)."""

import html
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import PurePath
from types import MappingProxyType

from markdown_it.token import Token

from grader.domain.pages.markup import plain_text, quoted
from grader.domain.pages.media import Media, find_named, find_path
from grader.errors import Fault
from grader.library.checking.prose_remarks import list_prose_remarks
from grader.library.lesson_ids import find_lesson_id
from grader.library.markdown.front_matter import read_front_matter, split_front_matter
from grader.library.markdown.parser import make_parser, split_blocks
from grader.library.media import place_in_text
from grader.questions import Quiz

LESSON_BYTES_MAX = 256 << 10
BLOCKS_MAX = 2000
"""Paragraphs, lists, tables and the like of one lesson."""

PARSER = make_parser(of_lessons=True)

UNFIT = re.compile(r"[^a-z0-9]+")
LINKS = ("https://", "http://", "mailto:", "/lessons/")
"""What a link may begin with, besides `#` and a heading of this lesson."""

PLACES = ("quiz", "lab")

OUTPUT = "output"
"""The word after the fence of what a program printed."""

NAME = re.compile(r"\d+(?:\.\d+)*")
"""What the file of a lesson is called, without its ending."""

HEAD = ("source",)
"""Keys of the front matter."""


@dataclass(frozen=True)
class Prose:
    """HTML with TeX between dollars, one string a block. It is not yet sanitised."""

    blocks: tuple[str, ...]


@dataclass(frozen=True)
class Heading:
    """A heading of level 2 to 6; `html` is not yet sanitised, `anchor` is unique in its lesson."""

    level: int
    anchor: str
    html: str


@dataclass(frozen=True)
class Placement:
    """The place of a quiz, or of one of its labs where `lab` is not empty."""

    quiz: str
    lab: str = ""


@dataclass(frozen=True)
class LessonText:
    """What an author wrote around the quizzes of a lesson; `title` is HTML that is not yet sanitised. `source` is the
    address of the page that the lesson was imported from, empty where there is none."""

    id: str
    title: str
    parts: tuple[Prose | Heading | Placement, ...]
    source: str = ""


@dataclass
class _Reading:
    """The parts read so far, with their faults and remarks."""

    file: str
    quizzes: Mapping[str, Quiz]
    media: Mapping[str, Media]
    title: str = ""
    source: str = ""
    parts: list[Prose | Heading | Placement] = field(default_factory=list)
    anchors: set[str] = field(default_factory=set)
    links: list[tuple[int, str]] = field(default_factory=list)
    level: int = 0
    faults: list[Fault] = field(default_factory=list)
    remarks: list[Fault] = field(default_factory=list)

    @property
    def lesson(self) -> str:
        """The lesson's id."""
        return PurePath(self.file).stem

    def fault(self, line: int, why: str) -> None:
        self.faults.append(Fault(self.file, f"line {line}", why))

    def add_heading(self, line: int, level: int, markup: str) -> None:
        """Add a heading; the first of all is the title."""
        if (level == 1) != (self.level == 0):
            why = "the first heading must be the title: begin it with one #"
            self.fault(line, why if self.level == 0 else "a lesson has one title: begin other headings with ##")
        elif level > self.level + 1:
            self.fault(line, f"the heading skips a level: begin it with {'#' * (self.level + 1)}")
        self.level = level
        if level == 1:
            self.title = markup
            return
        base = UNFIT.sub("-", plain_text(markup).lower()).strip("-") or "part"
        number = 1
        while (anchor := base if number == 1 else f"{base}-{number}") in self.anchors:
            number += 1
        self.anchors.add(anchor)
        self.parts.append(Heading(level, anchor, markup))

    def add_block(self, line: int, markup: str) -> None:
        """Add a block of prose, with the remarks that any author's text gets."""
        markup = place_in_text(markup, self.media)
        self.remarks += [Fault(self.file, f"line {line}", why) for why in list_prose_remarks(markup)]
        last = self.parts[-1] if self.parts else None
        if isinstance(last, Prose):
            self.parts[-1] = Prose((*last.blocks, markup))
        else:
            self.parts.append(Prose((markup,)))

    def add_place(self, line: int, token: Token) -> None:
        """Add the place of a quiz or lab that a fence names."""
        sort, *names = token.info.split()
        example = "```quiz 1-check" if sort == "quiz" else "```lab 1-labs/rod"
        if len(names) != 1 or token.content.strip():
            self.fault(line, f"must name one {sort} and hold nothing, such as {example}; JSON stands in quizzes/")
            return
        quiz_id, _, lab_id = names[0].partition("/")
        place, quiz = Placement(quiz_id, lab_id), self.quizzes.get(quiz_id)
        if quiz is None:
            self.fault(line, f"there is no quiz {quoted(quiz_id)} in quizzes/: correct its id")
        elif find_lesson_id(quiz_id) != self.lesson:
            own = find_lesson_id(quiz_id)
            self.fault(line, f"the quiz {quoted(quiz_id)} is of lesson {own}: place it in lessons/{own}.md")
        elif (sort == "lab") != bool(lab_id) or (lab_id and lab_id not in {lab.id for lab in quiz.labs}):
            self.fault(line, f"{quoted(names[0])} is no {sort}: write {example}")
        elif place in self.parts:
            self.fault(line, f"{quoted(names[0])} is placed twice: delete one")
        self.parts.append(place)

    def check_links(self) -> None:
        """Find links that lead nowhere."""
        for line, address in self.links:
            if find_path(address) is not None:
                if find_named(self.media, address) is None:
                    why = f"the file {quoted(address)} is not there: put it into the content folder"
                    self.remarks.append(Fault(self.file, f"line {line}", why))
                continue
            anchor = address.removeprefix("#")
            if address.startswith("#") and anchor not in self.anchors | set(self.quizzes):
                known = ", ".join(f"#{name}" for name in sorted(self.anchors)[:10]) or "none"
                self.fault(line, f"no heading has the anchor {quoted(address)}; the anchors are: {known}")
            elif not address.startswith(("#", *LINKS)):
                self.fault(
                    line,
                    f"the link {quoted(address)} leads nowhere: begin it with https://, /lessons/, files/ or #",
                )

    def read_head(self, front: str) -> None:
        """Read the keys of the front matter."""
        head = read_front_matter(front, self.file)
        if isinstance(head, Fault):
            self.faults.append(head)
            return
        self.source = str(head.get("source", ""))
        if unknown := sorted(head.keys() - {*HEAD}):
            self.fault(1, f"front matter: unknown key {unknown[0]}: it may have {', '.join(HEAD)}")
        if self.source and not self.source.startswith(("https://", "http://")):
            self.fault(1, "front matter: source must be an address that begins with https://")


def find_number(name: str) -> str:
    """Returns the first number in the name of a lesson's file, such as 1.3; empty where it has none."""
    match = NAME.search(name)
    return "" if match is None else match[0]


def read_lesson(
    markdown: str, file: str, quizzes: Mapping[str, Quiz], media: Mapping[str, Media] = MappingProxyType({})
) -> tuple[LessonText, list[Fault], list[Fault]]:
    """Returns the lesson of a file such as `lessons/1.3.md`, its faults and its remarks, each with its line."""
    reading = _Reading(file, quizzes, media)
    front, body = split_front_matter(markdown.replace("\r\n", "\n").replace("\r", "\n"))
    reading.read_head(front)
    if not NAME.fullmatch(reading.lesson) and reading.lesson not in {find_lesson_id(quiz_id) for quiz_id in quizzes}:
        reading.fault(1, f"{reading.lesson!r} is no lesson: name the file by its number, which begins its quizzes' ids")
    blocks = split_blocks(PARSER.parse(body))
    if len(blocks) > BLOCKS_MAX:
        reading.fault(1, f"has {len(blocks)} blocks, at most {BLOCKS_MAX} are read: split the lesson")
    for block in blocks[:BLOCKS_MAX]:
        _read_block(reading, block)
    if not reading.title:
        reading.fault(1, "has no title: begin it with a line such as # Integrators")
    reading.check_links()
    text = LessonText(reading.lesson, reading.title, tuple(reading.parts), reading.source)
    return text, reading.faults, reading.remarks


def _read_block(reading: _Reading, block: list[Token]) -> None:
    first = block[0]
    line = first.map[0] + 1 if first.map else 1
    for token in block:
        at = token.map[0] + 1 if token.map else line
        links = [inner.attrGet("href") for inner in token.children or () if inner.type == "link_open"]
        reading.links += [(at, str(address)) for address in links]
        if token.type == "heading_open" and token is not first:
            reading.fault(at, "a heading stands in a list or quotation: take it out")
    if first.type == "heading_open":
        markup = PARSER.renderer.render(block[1:-1], PARSER.options, {})
        reading.add_heading(line, int(first.tag[1:]), markup)
    elif first.type == "fence" and first.info.split()[:1] and first.info.split()[0] in PLACES:
        reading.add_place(line, first)
    elif first.type == "fence" and first.info.split()[:1] == [OUTPUT]:
        reading.add_block(line, f"<pre><samp>{html.escape(first.content, quote=False)}</samp></pre>\n")
    else:
        _name_callouts(block)
        for token in block:
            token.info = ""  # the language of code would become a class, which no page keeps
        reading.add_block(line, PARSER.renderer.render(block, PARSER.options, {}))


def _name_callouts(block: list[Token]) -> None:
    """Gives each quotation that begins with a mark such as `[!note]` its title, or the word itself, in bold."""
    for opening, inner in pairwise(token for token in block if token.type in ("blockquote_open", "inline")):
        if opening.type == "blockquote_open" and inner.content.startswith("[!"):
            first, _, rest = inner.content[2:].partition("\n")
            word, _, title = first.partition("]")
            name = title.lstrip("+-").strip() or word.capitalize()
            inner.children = PARSER.parseInline(f"**{name}**\\\n{rest}" if rest else f"**{name}**")[0].children
