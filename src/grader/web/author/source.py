"""ShownSource: the part of a file that a page shows. Tag: by what it is found again when it is saved."""

import hashlib
import re
from dataclasses import dataclass
from typing import NamedTuple, Self

from grader.errors import Fault
from grader.library.json_text import parse_json
from grader.library.quiz_files import is_markdown

TAG = re.compile(r"([0-9a-f]{16})-([0-9a-f]{16})-(\d{1,9})-(\d{1,9})-(\d{1,9})")

LINE = re.compile(r"line (\d+)(?:, column (\d+))?(?=: |$)")
"""A line at the head of a fault's key or, in Markdown, of its reason."""


@dataclass(frozen=True)
class Tag:
    """What a page shows of a file: of the text with the digest `file` the `length` characters with the digest `part`,
    all but those `before` and `after` them. So what is saved takes the place of what was shown, whatever its own id or
    syntax has become, and whatever has become of the rest of the file."""

    file: str
    part: str
    length: int
    before: int
    after: int

    @classmethod
    def compute(cls, text: str, start: int, end: int) -> Self:
        """Returns the tag of a part of a text."""
        return cls(hash_text(text), hash_text(text[start:end]), end - start, start, len(text) - end)

    @classmethod
    def read(cls, tag: str) -> Self | None:
        """Returns a tag that was written as text; None for what is none."""
        match = TAG.fullmatch(tag)
        return cls(match[1], match[2], int(match[3]), int(match[4]), int(match[5])) if match else None

    def __str__(self) -> str:
        return f"{self.file}-{self.part}-{self.length}-{self.before}-{self.after}"

    @property
    def is_part(self) -> bool:
        """Whether it is of less than the whole text."""
        return bool(self.before or self.after)

    def find(self, text: str) -> tuple[int, int] | None:
        """Returns where the part begins and ends in the text of the file now; None where it has changed itself. In a
        file that has changed elsewhere it stands as far from the beginning as it did, or as far from the end."""
        starts = [self.before]
        if self.file != hash_text(text):
            starts = [self.before, len(text) - self.after - self.length] if self.is_part and self.length else []
        for start in starts:
            end = start + self.length
            if start >= 0 and end <= len(text) and hash_text(text[start:end]) == self.part:
                return start, end
        return None


def hash_text(text: str) -> str:
    """Returns a digest of a text, by which a change is noticed."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class ShownSource(NamedTuple):
    """The characters of a file's `text` from `start` to `end`: those of a question, or all, as while it cannot be
    found."""

    file: str
    text: str
    start: int
    end: int

    @property
    def source(self) -> str:
        """What is shown."""
        return self.text[self.start : self.end]

    @property
    def tag(self) -> str:
        """The tag under which it is saved."""
        return str(Tag.compute(self.text, self.start, self.end))

    @property
    def is_whole(self) -> bool:
        """Whether it is the whole file."""
        return self.end - self.start == len(self.text)

    def place(self, fault: Fault) -> Fault:
        """Returns a fault of the file with its line in what is shown. One of broken JSON that is shown is read from
        there alone: in the file the next question is where it is noticed."""
        if fault.file != self.file or self.is_whole:
            return fault
        if is_markdown(self.file):
            return Fault(self.file, self._place_line(fault.key), self._place_line(fault.why))
        if LINE.match(fault.key) is None:
            return fault
        own = parse_json(self.source, self.file)
        return own if isinstance(own, Fault) else Fault(self.file, self._place_line(fault.key), fault.why)

    def _place_line(self, words: str) -> str:
        """Returns words that begin with a line of the file with that of what is shown, or say that it is the file's."""
        match = LINE.match(words)
        if match is None:
            return words
        line = int(match[1]) - self.text.count("\n", 0, self.start)
        column = int(match[2] or 1)
        if line == 1:
            column -= self.start - self.text.rfind("\n", 0, self.start) - 1
        if not 1 <= line <= self.source.count("\n") + 1 or column < 1:
            return f"{match[0]} of the file{words[match.end() :]}"
        return f"line {line}{f', column {column}' if match[2] else ''}{words[match.end() :]}"
