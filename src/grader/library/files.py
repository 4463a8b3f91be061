"""Reads files of a content folder, which must be inside it, regular, UTF-8 and not too large."""

import os
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path

from grader.errors import Fault

QUIZ_BYTES_MAX = 1 << 20
MODEL_BYTES_MAX = 4 << 20


def list_files(root: Path, folder: str, pattern: str) -> list[str]:
    """Returns the files of one folder that match a glob pattern, as sorted paths relative to the root. Names that begin
    with a dot are skipped, because editors and macOS create such files."""
    paths = (path.relative_to(root) for path in (root / folder).glob(pattern))
    return sorted(path.as_posix() for path in paths if not any(part.startswith(".") for part in path.parts))


def read_bytes(root: Path, name: str, bytes_max: int) -> bytes | Fault:
    """Returns the bytes of a file named relative to `root`, or its fault."""
    try:
        if why := _path_fault(root, name):
            return Fault(name, "path", why)
        if (root / name).stat().st_size > bytes_max:
            return Fault(name, "size", f"is larger than {bytes_max // 1024} KB: make it smaller")
        return (root / name).read_bytes()
    except OSError as error:
        return Fault(name, "path", f"cannot be read: {error.strerror}")


def read_text(root: Path, name: str, bytes_max: int) -> str | Fault:
    """Returns the text of a file named relative to `root`, or its fault."""
    data = read_bytes(root, name, bytes_max)
    try:
        return data if isinstance(data, Fault) else data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        return Fault(name, f"byte {error.start}", "is not UTF-8: save it as UTF-8")


ENDINGS = {"quizzes": (".json", ".md"), "lessons": (".md",), "models": (".xml",)}
"""What the files end in that are read, by folder."""

NEAR_ENDINGS = {".json5": ".json", ".jsonc": ".json", ".markdown": ".md", ".mjcf": ".xml", ".urdf": ".xml"}
"""Endings that are meant for another one."""


def list_unread_files(root: Path) -> Iterator[Fault]:
    """Yields a fault for each file whose ending is a misspelling of the one that is read, such as `.jsn`."""
    for folder, endings in ENDINGS.items():
        for file in list_files(root, folder, "*"):
            name, last = Path(file).with_suffix("").name, Path(file).suffix
            if last in endings or not (root / file).is_file():
                continue
            doubled = Path(name).suffix in endings  # Windows hides the second ending
            meant = NEAR_ENDINGS.get(last) or next(iter(get_close_matches(last.lower(), endings, 1)), "")
            if doubled or (meant and last[-1:].isalnum()):
                right = name if doubled else f"{name}{meant if meant in endings else endings[0]}"
                yield Fault(file, "ending", f"is not read: rename it to {folder}/{right}")


def _path_fault(root: Path, name: str) -> str | None:
    """Says why a path is not that of a regular file inside the root, or None. Raises OSError."""
    if not name or Path(name).is_absolute() or ".." in Path(name).parts or "\\" in name or "\0" in name:
        return "must be relative to the content folder and stay inside it"
    real = Path(os.path.realpath(root / name))
    if real.is_file() and real.is_relative_to(root.resolve()):
        return None
    if any(part.is_symlink() for part in (real, *real.parents)):  # which is left of links that lead to no file
        return "is a link that leads back to itself"
    if not real.is_relative_to(root.resolve()):
        return "is a link out of the content folder: put the file itself there"
    return "is not a file of the content folder"
