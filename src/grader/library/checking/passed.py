"""The checks of content that have passed, kept on disk by a digest of all that they depend on: what has not changed is
not simulated again. A check that failed is not kept, and runs each time."""

import hashlib
import json
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import structlog

from grader import labs, questions
from grader.domain.plugins import find_points
from grader.errors import NotFound

if TYPE_CHECKING:
    from grader.exercises import TextOf

log = structlog.get_logger()

VERSIONS = ("mujoco", "numpy", "scipy", "pydantic", "latex2mathml")
"""The packages whose numbers or sentences a result holds."""

AGE_S = 30 * 86400
"""How long the results of other versions of the code stay [s]."""

Result = TypeVar("Result")


@dataclass(frozen=True)
class PassedChecks:
    """The checks that have passed, in a folder of the user of this process; without a folder nothing is kept. Threads
    and processes may share it."""

    folder: Path | None = None
    place: Path | None = field(init=False, default=None)
    """Where the results of this version of the code are."""

    def __post_init__(self) -> None:
        if self.folder is not None:
            object.__setattr__(self, "place", open_place(self.folder))

    def run(
        self, check: str, inputs: Iterable[str], compute: "Callable[[TextOf], Result]",
        *, text_of: "TextOf", write: Callable[[Result], Any], read: Callable[[Any], Result],
    ) -> Result:  # fmt: skip
        """Returns what a check gave when it passed, or computes it. Raises what `compute` does.

        `check` and `inputs` name all that the result depends on, but for files: `compute` gets a `text_of` that notes
        which it reads, and a result counts while they are the same. `write` makes JSON of a result, or None of one that
        did not pass; `read` makes a result of this JSON.
        """
        if self.place is None:
            return compute(text_of)
        name = digest_texts([check, *inputs])
        earlier = self.recall(name)
        if earlier is not None and all(
            digest_file(text_of, path) == digest for path, digest in earlier["files"].items()
        ):
            return read(earlier["result"])
        files: dict[str, str] = {}

        def note(path: str) -> str:
            files[path] = digest_file(text_of, path)
            return text_of(path)

        result = compute(note)
        if (written := write(result)) is not None:
            self.keep(name, {"files": files, "result": written})
        return result

    def recall(self, name: str) -> Any | None:
        """Returns what was kept by this name; None if there is nothing that can be read."""
        try:
            return None if self.place is None else json.loads((self.place / f"{name}.json").read_bytes())
        except (OSError, ValueError):
            return None

    def keep(self, name: str, result: Any) -> None:
        """Writes a file as a whole or not at all; a full disk loses nothing but time."""
        if self.place is None:
            return
        try:
            with tempfile.NamedTemporaryFile("w", dir=self.place, delete=False) as file:
                json.dump(result, file)
            Path(file.name).replace(self.place / f"{name}.json")
        except OSError as error:
            log.info("a passed check is not kept", why=str(error))


NOTHING_PASSED = PassedChecks()
"""Every check runs."""


def open_place(folder: Path) -> Path | None:
    """Returns the folder for this version of the code, made if need be, or None if it cannot be used or is another
    user's. Removes those of versions that have not been used for long."""
    place = folder / digest_code()
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        if place.stat().st_uid != os.geteuid():
            raise PermissionError(f"{place} belongs to another user")
        os.utime(place)
        for other in folder.iterdir():
            if time.time() - other.stat().st_mtime > AGE_S:
                shutil.rmtree(other, ignore_errors=True)
    except OSError as error:
        log.info("passed checks are not kept", folder=str(folder), why=str(error))
        return None
    return place


def digest_texts(texts: Iterable[str]) -> str:
    """Returns the sha256 of texts in this order, each preceded by its length."""
    digest = hashlib.sha256()
    for text in texts:
        encoded = text.encode()
        digest.update(f"{len(encoded)}:".encode() + encoded)
    return digest.hexdigest()


def digest_file(text_of: "TextOf", path: str) -> str:
    """Returns the digest of a file's text, or why it cannot be read."""
    try:
        return digest_texts([text_of(path)])
    except NotFound as error:
        return str(error)


@cache
def digest_code() -> str:
    """Returns the digest of the code that checks content: this package, those of installed kinds, and the versions of
    what they compute with, on this kind of machine."""
    versions = [*(f"{name} {version(name)}" for name in VERSIONS), *(str(point) for point in list_points())]
    code = [hashlib.sha256(file.read_bytes()).hexdigest() for file in list_code()]
    return digest_texts([*versions, platform.python_version(), platform.machine(), *code])


def list_code() -> Iterator[Path]:
    """Yields the source files of this package, and of every package that has a kind of question, exercise or lab."""
    for name in sorted({__name__.partition(".")[0], *(point.module.partition(".")[0] for point in list_points())}):
        spec = find_spec(name)
        if spec is not None and spec.submodule_search_locations is not None:
            for folder in spec.submodule_search_locations:
                yield from list_modules(folder)
        elif spec is not None and spec.origin is not None:
            yield Path(spec.origin)


def list_modules(root: str) -> Iterator[Path]:
    """Yields the source files below a folder, in order; `Path.rglob` takes three times as long."""
    for folder, folders, names in os.walk(root):
        folders.sort()
        yield from (Path(folder, name) for name in sorted(names) if name.endswith(".py"))


def list_points() -> list[EntryPoint]:
    """Returns what installed packages offer as kinds of question, exercise and lab, in order of the names."""
    from grader import exercises

    groups = (questions.GROUP, exercises.GROUP, labs.GROUP)
    return sorted(point for group in groups for point in find_points(group))
