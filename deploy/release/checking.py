"""Checks what was built: its metadata, its files, and that it grades where nothing else is installed."""

import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

from packaging.metadata import Metadata
from packaging.utils import canonicalize_name

from release.building import ROOT, ReleaseError

FOREIGN = re.compile(r"(^|/)(tests?|__pycache__|\.git|\.venv[^/]*|\.data)(/|$)|\.py[cod]$")
"""What belongs to a checkout, and not into a release."""


def read_members(path: Path) -> Iterator[tuple[str, bytes]]:
    """Yields the files of a wheel or an sdist, with what is in them."""
    if path.suffix == ".whl":
        with zipfile.ZipFile(path) as wheel:
            yield from ((name, wheel.read(name)) for name in wheel.namelist())
        return
    with tarfile.open(path) as files:
        for member in files.getmembers():
            if data := files.extractfile(member):
                yield member.name, data.read()


def check_files(path: Path) -> None:
    """Raises ReleaseError for a file of the checkout alone, and for text that names a folder of this machine."""
    here = [str(folder).encode() for folder in {ROOT, Path(sys.prefix), Path(tempfile.gettempdir(), "tmp")}]
    for name, data in read_members(path):
        inside = name if path.suffix == ".whl" else name.partition("/")[2]
        if FOREIGN.search(inside):
            raise ReleaseError(f"{path.name}: {name} belongs to the checkout: leave it out in MANIFEST.in")
        for folder in here:
            if folder in data:
                raise ReleaseError(f"{path.name}: {name} names {folder.decode()}, a folder of this machine")


def read_metadata(path: Path) -> Metadata:
    """Returns the metadata of a wheel or an sdist. Raises ReleaseError where the standard is not met."""
    wanted = re.compile(r"[^/]+\.dist-info/METADATA" if path.suffix == ".whl" else r"[^/]+/PKG-INFO")
    found = [data for name, data in read_members(path) if wanted.fullmatch(name)]
    if len(found) != 1:
        raise ReleaseError(f"{path.name}: has {len(found)} files of metadata, there must be one")
    try:
        return Metadata.from_email(found[0], validate=True)
    except ExceptionGroup as errors:
        raise ReleaseError(f"{path.name}: {'; '.join(map(str, errors.exceptions))}") from errors


def check_metadata(path: Path, version: str) -> None:
    """Raises ReleaseError unless the metadata is what an index takes, and of this version."""
    metadata = read_metadata(path)
    if str(metadata.version) != version:
        raise ReleaseError(f"{path.name}: version: {metadata.version} is not {version}: see its pyproject.toml")
    name = canonicalize_name(metadata.name).replace("-", "_")
    if not path.name.startswith(f"{name}-{version}"):
        raise ReleaseError(f"{path.name}: is the file of {name} {version}, and must be named for it")
    lacking = [key for key in ("summary", "description", "requires_python") if not getattr(metadata, key)]
    if lacking or metadata.description_content_type != "text/markdown":
        raise ReleaseError(f"{path.name}: {', '.join(lacking) or 'description_content_type'}: see [project]")


def bare_environment(folder: Path) -> Path:
    """Makes a virtual environment without anything but pip, and returns its Python."""
    run([sys.executable, "-m", "venv", str(folder)])
    return folder / "bin" / "python"


def run(command: list[str], folder: Path | None = None) -> str:
    """Runs a command without settings of this checkout, and returns its output. Raises ReleaseError."""
    mine = ("GRADER_", "PYTHON", "VIRTUAL_ENV")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(mine)}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        raise ReleaseError(f"{' '.join(command)}: exits with {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def check_grader(wheel: Path) -> str:
    """Installs the wheel as docs/deploy.md says, and grades a choice and a script. Returns what was done.

    Raises ReleaseError.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        python = bare_environment(folder / "bare")
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        run([*pip, "--require-hashes", "-r", str(ROOT / "requirements-all.lock")])
        run([*pip, "--no-deps", "--no-index", str(wheel)])
        run([str(python), "-m", "pip", "check"])
        run([str(python), "-c", "import authlib.integrations.httpx_client, httpx2, joserfc"])
        grader = [str(python.with_name("grader")), "grade"]
        choice, answer = read_choice()
        script = ROOT / "reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py"
        for question in (["1.3-check", choice, str(answer)], ["1.3-exercises", "servo-threshold", str(script)]):
            verdict = json.loads(run([*grader, *question, "--json"], folder))
            if verdict["status"] != "correct":
                raise ReleaseError(f"{wheel.name}: graded {question}: {verdict}")
    return "installed by hash in a bare environment; graded a choice and a script"


def read_choice() -> tuple[str, int]:
    """Returns the id of a question with options of the lesson, and its right answer."""
    quiz = json.loads((ROOT / "quizzes/1.3-check.json").read_text())
    for position, question in enumerate(quiz["questions"], start=1):
        if question["kind"] == "mcq":
            return question.get("id", f"q{position}"), question["answer"]
    raise ReleaseError("quizzes/1.3-check.json: has no question of the kind mcq")


def check_client(wheel: Path) -> str:
    """Installs the client with the versions of requirements-dev.lock, and calls it. Raises ReleaseError."""
    pins = re.findall(r"^[\w.-]+==[\w.]+", (ROOT / "requirements-dev.lock").read_text(), re.MULTILINE)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "pins.txt").write_text("\n".join(pins))
        python = bare_environment(folder / "bare")
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        run([*pip, "--constraint", str(folder / "pins.txt"), str(wheel)])
        run([str(python), "-m", "pip", "check"])
        run([str(python.with_name("mjgrade")), "--help"], folder)
        run([str(python), "-c", "import mjgrader"], folder)
    return "installed in a bare environment; imported"
