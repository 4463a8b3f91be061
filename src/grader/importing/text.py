"""The text of a lesson that is imported: its lines, of which some are replaced, as the parser's tokens name them."""

from collections.abc import Callable, Iterator
from functools import partial
from urllib.parse import unquote

from markdown_it.token import Token

from grader.importing.addresses import Addresses, list_addresses, read_tags
from grader.importing.passages import write_widget
from grader.library.lesson_text import PARSER
from grader.library.markdown.front_matter import write_front_matter

FOREIGN = ("iframe", "script", "object", "embed", "video", "audio", "canvas", "form", "style")
"""Elements that no page here keeps."""


class Text:
    """The Markdown of a lesson without front matter. Nothing inside of quotations is replaced but addresses."""

    def __init__(self, body: str) -> None:
        self.lines = body.split("\n")
        self.references: dict[str, object] = {}
        self.tokens = PARSER.parse(body, self.references)
        self.passages: dict[tuple[int, int], str] = {}
        self.fences = [token for token in self._list_unquoted() if token.type == "fence"]
        own = set(map(id, self.fences))
        self.quoted = [token for token in self.tokens if token.type == "fence" and id(token) not in own]

    def _list_unquoted(self) -> Iterator[Token]:
        depth = 0
        for token in self.tokens:
            depth += token.nesting * (token.type.startswith("blockquote_"))
            if not depth:
                yield token

    @property
    def has_prose(self) -> bool:
        """Whether there is text beside the blocks that are replaced and the headings."""
        prose = ("inline", "html_block", "fence", "code_block", "display")
        headings = {id(inner) for outer, inner in self._pairs() if outer.type == "heading_open"}
        return any(
            token.type in prose and tuple(token.map or (0, 0)) not in self.passages and id(token) not in headings
            for token in self.tokens
        )

    def _pairs(self) -> Iterator[tuple[Token, Token]]:
        return zip(self.tokens, self.tokens[1:], strict=False)

    def replace(self, lines: tuple[int, int], passage: str) -> None:
        """Puts a passage in the place of lines (from, until)."""
        self.passages[lines] = passage

    def find_title(self) -> str:
        """Returns the first heading of level 1, as it is written; empty where there is none."""
        return next((inner.content for outer, inner in self._pairs() if outer.tag == "h1" and outer.nesting > 0), "")

    def write(self, title: str, addresses: Addresses, remark: Callable[[int, str], None]) -> str:
        """Returns the file of the lesson's text. `remark` is called with the line and the reason of what is missing."""
        self._arrange_headings()
        self._replace_widgets(addresses.source, remark)
        self._replace_addresses(addresses, remark)
        plain = " ".join(title.split())  # a page writes the number before it
        own = plain.removeprefix("Lesson ").removeprefix(addresses.lesson).lstrip(" :.–—-")
        parts, at = [f"# {own or plain}"], 0
        for (begin, end), passage in sorted(self.passages.items()):
            if begin >= at:
                parts += ["\n".join(self.lines[at:begin]), passage]
                at = end
        parts.append("\n".join(self.lines[at:]))
        body = "\n\n".join(part.strip("\n") for part in parts if part.strip("\n"))
        head = write_front_matter({"source": addresses.source}) + "\n" if addresses.source else ""
        return f"{head}{body}\n"

    def _arrange_headings(self) -> None:
        """Takes the title out, and writes the other headings from level 2 on, none of which skips a level."""
        level, has_title = 1, False
        for outer, inner in self._pairs():
            if outer.type != "heading_open":
                continue
            begin, end = outer.map or (0, 0)
            if outer.level:  # in a list or quotation, where a page has no heading
                mark = "#" * int(outer.tag[1:])
                self.lines[begin] = self.lines[begin].replace(f"{mark} {inner.content}", f"**{inner.content}**")
            elif outer.tag == "h1" and not has_title:
                has_title = True
                self.replace((begin, end), "")
            else:
                level = min(max(int(outer.tag[1:]), 2), level + 1)
                self.replace((begin, end), f"{'#' * level} {' '.join(inner.content.split())}")

    def _replace_widgets(self, source: str, remark: Callable[[int, str], None]) -> None:
        for token in self._list_unquoted():
            tags = read_tags(token.content) if token.type == "html_block" else []
            foreign = [(tag, address) for tag, address in tags if tag in FOREIGN]
            if foreign and token.map:
                tag, address = foreign[0]
                own = address if address.startswith(("https://", "http://")) else ""
                remark(token.map[0] + 1, f"<{tag}> does not run here: a link stands in its place")
                self.replace((token.map[0], token.map[1]), write_widget(tag, "", own or source))

    def _replace_addresses(self, addresses: Addresses, remark: Callable[[int, str], None]) -> None:
        named: dict[tuple[int, int], list[str]] = {}
        for token in self.tokens:
            if token.map and (targets := list(list_addresses(token))):
                named.setdefault((token.map[0], token.map[1]), []).extend(targets)
        references = self.references.get("references")
        for reference in references.values() if isinstance(references, dict) else ():
            named.setdefault((reference["map"][0], reference["map"][1]), []).append(reference["href"])
        for (begin, end), targets in named.items():
            tell = partial(remark, begin + 1)
            for at in range(begin, end):
                self.lines[at] = addresses.replace(self.lines[at], self._in_line(self.lines[at], targets), tell)

    def _in_line(self, line: str, targets: list[str]) -> list[str]:
        return [address for address in targets if address in line or unquote(address) in line]
