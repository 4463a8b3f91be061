"""The addresses in a lesson: its pictures and files come along, links to other lessons lead to their pages here."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path, PurePosixPath
from urllib.parse import quote, unquote, urljoin, urlsplit

from markdown_it.token import Token

from grader.domain.pages.markup import quoted
from grader.domain.pages.media import PICTURES, find_type, is_served
from grader.errors import Fault
from grader.library.files import read_bytes
from grader.library.lesson_text import LINKS, find_number
from grader.library.media import FILE_BYTES_MAX

SHOWN = {ending for endings in PICTURES.values() for ending in endings}
QUOTES = (("](", ""), ("](<", ">"), ("]: ", ""), ('="', '"'), ("='", "'"))
"""What stands before and behind an address in Markdown and HTML."""

Tell = Callable[[str], None]


@dataclass
class Addresses:
    """Where the addresses of one lesson lead. `folder` is that of the lesson's file, None where it has none; `source`
    the address of the lesson's original page, or empty. `media` are the pictures and files that come along, by path."""

    lesson: str
    folder: Path | None
    source: str
    media: dict[str, bytes] = field(default_factory=dict)

    def resolve(self, address: str, tell: Tell) -> str | None:
        """Returns the address in place of one that is relative to the lesson; None where it stays. `tell` is called
        with what is missing."""
        parts = urlsplit(address)
        if not address or address.startswith(("#", "data:", *LINKS)) or parts.scheme or parts.netloc:
            return None
        path = PurePosixPath(unquote(parts.path))
        if is_served(path.name):
            return self._take(path, tell) or self._join(address)
        number = find_number(path.stem)
        if number and path.suffix in (".md", ".html", ""):
            return f"/lessons/{number}" + (f"#{parts.fragment}" if parts.fragment else "")
        if self.source:
            return urljoin(self.source, address)
        tell(f"the link {quoted(address)} leads nowhere here: say where the lesson came from (source)")
        return f"/lessons/{self.lesson}"

    def _take(self, path: PurePosixPath, tell: Tell) -> str | None:
        """Returns where a picture or file of the lesson's folder is now; None if it is not there."""
        absent = Fault("", "path", "")
        body = absent if self.folder is None else read_bytes(self.folder, str(path), FILE_BYTES_MAX)
        why = "" if not isinstance(body, Fault) else "is not in the lesson's folder" if body.key == "path" else body.why
        if not isinstance(body, Fault):
            try:
                place = self._place(path)
                find_type(place, body)
                self.media[place] = body
                return quote(place)
            except ValueError as error:
                why = str(error)
        tell(f"the file {quoted(str(path))} {why}: put it there, and import the lesson again")
        return None

    def _place(self, path: PurePosixPath) -> str:
        folder = "images" if path.suffix.lower() in SHOWN else "files"
        inner = path.relative_to(folder) if path.is_relative_to(folder) else path
        return f"{folder}/{self.lesson}/{inner}"

    def _join(self, address: str) -> str:
        """Returns the address of a file that is not there: at the original page, or where it would be here."""
        return urljoin(self.source, address) if self.source else quote(self._place(PurePosixPath(unquote(address))))

    def replace(self, text: str, addresses: Iterable[str], tell: Tell) -> str:
        """Returns some Markdown with other addresses in the places of these."""
        for address in dict.fromkeys(addresses):
            new = self.resolve(address, tell)
            if new is None:
                continue
            for before, behind in QUOTES:
                for old in dict.fromkeys((address, unquote(address))):
                    text = text.replace(f"{before}{old}{behind}", f"{before}{new}{behind}")
        return text

    def replace_in_json(self, value: object, replace: Callable[[str], str]) -> object:
        """Returns JSON with `replace` done in all its texts."""
        if isinstance(value, str):
            return replace(value)
        if isinstance(value, dict):
            return {name: self.replace_in_json(item, replace) for name, item in value.items()}
        return [self.replace_in_json(item, replace) for item in value] if isinstance(value, list) else value


def list_addresses(token: Token) -> Iterator[str]:
    """Yields the addresses of links and pictures in a token."""
    for inner in (token, *(token.children or ())):
        if inner.type in ("html_block", "html_inline"):
            yield from (value for _, value in read_tags(inner.content))
        elif address := inner.attrGet("href") or inner.attrGet("src"):
            yield str(address)


def read_tags(html: str) -> list[tuple[str, str]]:
    """Returns the tags of some HTML, each with its `src` or `href`, or nothing."""
    tags: list[tuple[str, str]] = []

    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            named = dict(attrs)
            tags.append((tag, named.get("src") or named.get("href") or ""))

    reader = Reader()
    reader.feed(html)
    reader.close()
    return tags
