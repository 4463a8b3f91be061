"""Reads the pictures and files that a content folder serves, and puts their addresses into authors' texts."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from grader.domain.pages.media import (
    ENDINGS,
    FOLDERS,
    Media,
    find_address,
    find_named,
    find_type,
    is_served,
    replace_addresses,
)
from grader.errors import Fault
from grader.library.files import list_files, read_bytes

FILE_BYTES_MAX = 4 << 20
FOLDER_BYTES_MAX = 64 << 20
"""Of all pictures and files of a content folder: a server keeps them in memory."""

FILES_MAX = 2000


def read_media(root: Path) -> tuple[dict[str, Media], list[Fault], list[Fault]]:
    """Returns what is served below images/ and files/, by path, faults, and remarks on files that are not served."""
    files: dict[str, Media] = {}
    faults: list[Fault] = []
    names = [name for folder in FOLDERS for name in list_files(root, folder, "**/*") if not (root / name).is_dir()]
    unserved = [name for name in names if not is_served(name)]
    why_not = f"is not served: its ending must be one of {', '.join(ENDINGS)}"
    remarks = [Fault(name, "ending", why_not) for name in unserved]
    left = FOLDER_BYTES_MAX
    for name in sorted({*names} - {*unserved}):
        body = read_bytes(root, name, FILE_BYTES_MAX)
        if isinstance(body, Fault):
            faults.append(body)
            continue
        left -= len(body)
        if left < 0 or len(files) == FILES_MAX:
            why = f"is over the limit of images/ and files/: {FILES_MAX} files, {FOLDER_BYTES_MAX >> 20} MB"
            return files, [*faults, Fault(name, "size", why)], remarks
        try:
            files[name] = Media(name, find_type(name, body), body)
        except ValueError as error:
            faults.append(Fault(name, "type", str(error)))
    return files, faults, remarks


def place_media(value: Any, media: Mapping[str, Media]) -> Any:
    """Returns JSON in which every text names pictures and files by their served addresses. Lists and objects are
    changed in place."""
    if isinstance(value, str):
        return place_in_text(value, media)
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in [*items]:
        value[key] = place_media(item, media)
    return value


def place_in_text(text: str, media: Mapping[str, Media]) -> str:
    """Returns an HTML text with the served addresses of the pictures and files that it names."""
    if not any(folder in text for folder in FOLDERS):
        return text
    return replace_addresses(text, lambda address: find_address(media, address))


def find_named_media(value: Any, media: Mapping[str, Media]) -> dict[str, Media]:
    """Returns the pictures and files that the texts of some JSON name, by path."""
    named: dict[str, Media] = {}

    def note(address: str) -> None:
        if (file := find_named(media, address)) is not None:
            named[file.path] = file

    def visit(part: Any) -> None:
        if isinstance(part, str) and any(folder in part for folder in FOLDERS):
            replace_addresses(part, note)
        elif isinstance(part, dict | list):
            for inner in part.values() if isinstance(part, dict) else part:
                visit(inner)

    visit(value)
    return named
