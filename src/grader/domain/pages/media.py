"""Pictures and files of a content folder, which pages show and offer: their types, told by their bytes, and their
addresses, which name the sha256 of what they lead to."""

import hashlib
import html
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePosixPath
from urllib.parse import quote, unquote
from xml.parsers import expat

from grader.domain.pages.prose import TOKEN

FOLDERS = ("images/", "files/")
"""The folders of which anything is served; what else a content folder holds never is."""

ADDRESS = "/media/"
"""What the addresses begin with."""

PICTURES = {
    "image/png": (".png",),
    "image/jpeg": (".jpg", ".jpeg"),
    "image/gif": (".gif",),
    "image/webp": (".webp",),
    "image/svg+xml": (".svg",),
}
SVG = "image/svg+xml"
DOWNLOADS = {
    "application/zip": (".zip", ".npz"),
    "application/xml": (".xml",),
    "text/csv": (".csv",),
    "text/plain": (".txt",),
}
ENDINGS = {ending: kind for kind, endings in (PICTURES | DOWNLOADS).items() for ending in endings}

SIGNATURES = (
    (re.compile(rb"\x89PNG\r\n\x1a\n"), "image/png"),
    (re.compile(rb"\xff\xd8\xff"), "image/jpeg"),
    (re.compile(rb"GIF8[79]a"), "image/gif"),
    (re.compile(rb"RIFF....WEBP", re.DOTALL), "image/webp"),
    (re.compile(rb"PK(?:\x03\x04|\x05\x06)"), "application/zip"),
)
"""What files begin with. Source: https://mimesniff.spec.whatwg.org, and APPNOTE.TXT of ZIP."""

HEAD_CHARS = 64 << 10
"""Characters in which the first element of an XML file must begin."""

LINK = re.compile(r"""(\s(?:src|href)\s*=\s*)("[^"]*"|'[^']*'|[^\s"'>]+)""", re.IGNORECASE)
LINKED = ("img", "a")


@dataclass(frozen=True)
class Media:
    """One file; `path` is relative to the content folder, `type` its media type."""

    path: str
    type: str
    body: bytes

    @cached_property
    def sha256(self) -> str:
        """The digest of its bytes."""
        return hashlib.sha256(self.body).hexdigest()

    @property
    def name(self) -> str:
        """Its name without folders."""
        return PurePosixPath(self.path).name

    @property
    def address(self) -> str:
        """Where the service has it."""
        return f"{ADDRESS}{self.sha256}/{quote(self.name)}"


def is_served(path: str) -> bool:
    """Whether files with this ending are served."""
    return PurePosixPath(path).suffix.lower() in ENDINGS


def find_type(path: str, body: bytes) -> str:
    """Returns the media type of a file, by its bytes and its ending, which must agree. Raises ValueError with what is
    wrong and the cure."""
    wanted, sniffed = ENDINGS[PurePosixPath(path).suffix.lower()], sniff_type(body)
    texts = {"text/csv": (SVG, "application/xml", "text/plain"), "application/xml": (SVG,)}
    texts["text/plain"] = texts["text/csv"]
    if sniffed != wanted and sniffed not in texts.get(wanted, ()):
        endings = (PICTURES | DOWNLOADS).get(sniffed, ())
        cure = f"it is {sniffed}: end its name in {endings[0]}" if endings else "save it again"
        raise ValueError(f"is not what its name says, {wanted}; {cure}")
    return wanted


def sniff_type(body: bytes) -> str:
    """Returns the media type that the bytes of a file have; empty for none that is served."""
    for signature, kind in SIGNATURES:
        if signature.match(body):
            return kind
    try:
        text = body.decode("utf-8-sig")
    except UnicodeDecodeError:
        return ""
    if "\0" in text:
        return ""
    return _sniff_xml(text) or "text/plain"


def _sniff_xml(text: str) -> str:
    """Returns the type of an XML text by its first element; empty for what is no XML."""
    names: list[str] = []
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = lambda name, _: names.append(name)
    with suppress(expat.ExpatError):  # after the first element nothing matters
        parser.Parse(text.lstrip()[:HEAD_CHARS])
    if not names:
        return ""
    return SVG if names[0].rpartition(" ")[2] == "svg" else "application/xml"


def find_path(address: str) -> str | None:
    """Returns the path that an author's address names in the content folder; None for other addresses. `../` may stand
    before it, as an editor wants it in the text of a lesson."""
    path = unquote(html.unescape(address)).removeprefix("./").removeprefix("../")
    return path if path.startswith(FOLDERS) else None


def replace_addresses(text: str, find: Callable[[str], str | None]) -> str:
    """Returns an HTML text with other addresses of pictures and links, where `find` gives one for the old."""

    def replace_link(match: re.Match[str]) -> str:
        new = find(html.unescape(match[2].strip("\"'")))
        return match[0] if new is None else f'{match[1]}"{html.escape(new)}"'

    def replace_tag(match: re.Match[str]) -> str:
        is_link = (match["name"] or "").lower() in LINKED
        return LINK.sub(replace_link, match[0]) if is_link else match[0]

    return TOKEN.sub(replace_tag, text)


def find_named(media: Mapping[str, Media], address: str) -> Media | None:
    """Returns the file that an author's address names, if it is there."""
    return media.get(find_path(address) or "")


def find_address(media: Mapping[str, Media], address: str) -> str | None:
    """Returns the served address of the file that an author's address names; None where there is none."""
    file = find_named(media, address)
    return None if file is None else file.address
