"""Builds wheels and sdists, twice, of what is committed: the same commit gives the same bytes."""

import gzip
import io
import os
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]

BACKEND = "from setuptools import build_meta as b; import sys; b.build_{kind}(sys.argv[1])"


class ReleaseError(Exception):
    """Something is not as a release must be: what, where, and what cures it."""


def git(*arguments: str) -> bytes:
    """Runs git in the checkout. Raises CalledProcessError."""
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True).stdout  # noqa: S603, S607


def export_commit(folder: Path) -> None:
    """Writes the files of the commit that is checked out into a folder, with their modes."""
    with tarfile.open(fileobj=io.BytesIO(git("archive", "--format=tar", "HEAD"))) as files:
        files.extractall(folder, filter="data")


def commit_time() -> int:
    """Returns when the commit was made [s since 1970]: the time of every file in a wheel."""
    return int(git("log", "-1", "--format=%ct"))


def list_uncommitted() -> list[str]:
    """Returns the files that differ from the commit, and so would be missing from the release."""
    return git("status", "--porcelain").decode().splitlines()


def build(project: str, out: Path) -> list[Path]:
    """Builds the sdist and the wheel of a project of the checkout (`.` or `client`) into a folder, and returns them.

    Both are built twice, the wheel the second time from the sdist. Raises ReleaseError where the bytes differ.
    """
    with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
        export_commit(Path(first))
        sources = build_one(Path(first, project), "sdist", out)
        wheel = build_one(Path(first, project), "wheel", out)
        export_commit(Path(second))
        again = build_one(Path(second, project), "sdist", Path(second, "again"))
        if again.read_bytes() != sources.read_bytes():
            raise ReleaseError(f"{sources.name}: built twice, it differs: find what reads the clock or the folder")
        with tarfile.open(again) as files:
            files.extractall(second, filter="data")
        unpacked = Path(second, sources.name.removesuffix(".tar.gz"))
        if build_one(unpacked, "wheel", Path(second, "again")).read_bytes() != wheel.read_bytes():
            raise ReleaseError(f"{wheel.name}: built again from {sources.name}, it differs: see MANIFEST.in")
    return [sources, wheel]


def build_one(source: Path, kind: str, out: Path) -> Path:
    """Builds the `sdist` or `wheel` of a folder into another, and returns it. Raises ReleaseError."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as made:
        command = [sys.executable, "-c", BACKEND.format(kind=kind), made]
        environment = {**os.environ, "SOURCE_DATE_EPOCH": str(commit_time()), "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run(command, cwd=source, env=environment, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode:
            raise ReleaseError(f"the {kind} of {source} cannot be built:\n{done.stdout}{done.stderr}")
        [path] = Path(made).iterdir()
        data = pack_evenly(path) if kind == "sdist" else path.read_bytes()
        target = out / path.name
        target.write_bytes(data)
    return target


def pack_evenly(sdist: Path) -> bytes:
    """Returns an sdist with its files sorted, all of the commit's time and of no user."""
    packed = io.BytesIO()
    with (
        tarfile.open(sdist) as old,
        gzip.GzipFile(fileobj=packed, mode="wb", filename="", mtime=commit_time()) as whole,
        tarfile.open(fileobj=whole, mode="w", format=tarfile.PAX_FORMAT) as new,
    ):
        for member in sorted(old.getmembers(), key=lambda getmember: getmember.name):
            member.mtime, member.uid, member.gid, member.uname, member.gname = commit_time(), 0, 0, "", ""
            member.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
            member.pax_headers = {}
            new.addfile(member, old.extractfile(member))
    return packed.getvalue()
