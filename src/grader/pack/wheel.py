"""Makes the wheel of a package again from where it is installed, editable or not, with no build tool and no network."""

import base64
import csv
import hashlib
import io
import re
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from grader.errors import NotFound

EPOCH = (1980, 1, 1, 0, 0, 0)
"""The earliest time that a zip file can hold: the same files give the same wheel."""

LEFT_OUT = ("__pycache__", "material")
"""Folders that are not packed: `material` is the content that the grader's own wheel brings along."""

REQUIREMENT = re.compile(r"([A-Za-z0-9][A-Za-z0-9._-]*)\s*(?:\[([^\]]*)\])?")
"""Name and extras of a requirement. Source: packaging.python.org, "Dependency specifiers"."""

PINNED = re.compile(r"^(Requires-Dist: *([A-Za-z0-9._-]+) *== *)([^;\s]+)", re.MULTILINE)
"""A requirement of one version alone: up to the version, the name, the version."""


class NeededDistribution(NamedTuple):
    """A distribution that is required, with these extras."""

    name: str
    extras: frozenset[str]


def write_wheel(package: Distribution, module: str, folder: Path) -> Path:
    """Writes the wheel of a distribution of pure Python with one top-level module into a folder. Raises NotFound."""
    name = f"{re.sub(r'[-_.]+', '_', package.name)}-{package.version}"
    path = folder / f"{name}-py3-none-any.whl"
    record = io.StringIO()
    rows = csv.writer(record, lineterminator="\n")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as wheel:
        for member, data in (*list_files(module), *write_notes(package, f"{name}.dist-info")):
            wheel.writestr(make_entry(member), data)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
            rows.writerow([member, f"sha256={digest}", len(data)])
        rows.writerow([f"{name}.dist-info/RECORD", "", ""])
        wheel.writestr(make_entry(f"{name}.dist-info/RECORD"), record.getvalue())
    return path


def make_entry(member: str, mode: int = 0o644) -> zipfile.ZipInfo:
    """Returns a member of a zip file, with the same time in each."""
    info = zipfile.ZipInfo(member, EPOCH)
    info.external_attr, info.compress_type = (0o100000 | mode) << 16, zipfile.ZIP_DEFLATED
    return info


def list_files(module: str) -> Iterator[tuple[str, bytes]]:
    """Path and content of every file of a top-level module. Raises NotFound."""
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise NotFound(f"The module {module!r} is not installed as a package with files.")
    place = Path(spec.origin)
    folder = place.parent if place.name == "__init__.py" else None
    for path in [place] if folder is None else sorted(folder.rglob("*")):
        if path.is_file() and not {*LEFT_OUT} & {*path.relative_to(place.parent).parts}:
            yield path.relative_to(place.parent if folder is None else folder.parent).as_posix(), path.read_bytes()


def write_notes(package: Distribution, folder: str) -> Iterator[tuple[str, bytes]]:
    """Says what installers read in a wheel. Source: packaging.python.org, "Binary distribution format"."""
    metadata = PINNED.sub(pin_installed, package.read_text("METADATA") or package.read_text("PKG-INFO") or "")
    points = package.read_text("entry_points.txt") or ""
    wheel = "Wheel-Version: 1.0\nGenerator: grader pack\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    for name, text in (("METADATA", metadata), ("WHEEL", wheel), ("entry_points.txt", points)):
        yield f"{folder}/{name}", text.encode()


def pin_installed(pinned: re.Match[str]) -> str:
    """Returns a pinned requirement with the version that is installed here, since that is what grades here. The grader
    may run with another MuJoCo than the one that it pins; `constraints` names the installed one."""
    try:
        return f"{pinned[1]}{distribution(pinned[2]).version}"
    except PackageNotFoundError:  # of an extra that is not installed
        return pinned[0]


def list_constraints(names: list[str]) -> str:
    """Versions of all that these distributions need and that is installed here, for pip's `--constraint`."""
    versions: dict[str, str] = {}
    seen: set[NeededDistribution] = set()
    waiting = [NeededDistribution(name, frozenset()) for name in names]
    while waiting:
        needed = waiting.pop()
        if needed in seen:
            continue
        seen.add(needed)
        with suppress(PackageNotFoundError):  # of another platform
            package = distribution(needed.name)
            versions[package.name] = package.version
            waiting += list_needs(package, needed.extras)
    return "".join(f"{name}=={versions[name]}\n" for name in sorted(versions) if name not in names)


def list_needs(package: Distribution, extras: frozenset[str]) -> Iterator[NeededDistribution]:
    """Says what a distribution with some of its extras requires, whatever the platform."""
    for text in package.requires or []:
        of_extra = re.search(r"""extra\s*==\s*["']([^"']+)""", text)
        match = REQUIREMENT.match(text)
        if match and (of_extra is None or of_extra[1] in extras):
            yield NeededDistribution(match[1], frozenset(filter(None, re.split(r"[\s,]+", match[2] or ""))))
