"""The wheel alone is enough: it brings the lesson along, and serves and grades in an empty folder."""

import os
import re
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from grader.settings import default_content
from support.content import load_content

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout, built from a copy of the files that are under version control or new."""
    folder = tmp_path_factory.mktemp("wheel")
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        check=True,
    )
    for name in listed.stdout.decode().split("\0"):
        if name and (ROOT / name).is_file():
            (folder / "source" / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / "source" / name).write_bytes((ROOT / name).read_bytes())
    build = [*(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"), "-w", str(folder)]
    subprocess.run([*build, str(folder / "source")], check=True)
    [built] = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path) -> Path:
    """The command `grader` of a virtual environment that has the wheel, and its dependencies from this one."""
    environment = wheel.parent / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True)
    [packages] = environment.glob("lib/python*/site-packages")
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    python = environment / "bin/python"
    pip = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        str(python),
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        "--no-compile",
    ]
    subprocess.run([*pip, "--ignore-installed", str(wheel)], check=True)
    return environment / "bin/grader"


@pytest.fixture
def outside(tmp_path: Path) -> dict[str, str]:
    """The environment of a process that knows nothing of this checkout."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH" and "GRADER" not in name}


def test_the_wheel_has_every_file_of_the_content(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    packed = {name.removeprefix("grader/material/") for name in names if name.startswith("grader/material/")}
    folders = ("quizzes", "lessons", "models", "reference_solutions")
    ours = {
        path.relative_to(ROOT).as_posix()
        for folder in folders
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert packed == ours != set()
    assert [name for name in names if name.startswith(("tests/", "quizzes/", "models/"))] == []


def test_a_checkout_uses_its_own_content() -> None:
    assert default_content() == ROOT
    assert not (ROOT / "src/grader/material").exists()


@pytest.mark.jail
def test_the_command_line_grades_in_an_empty_folder(installed: Path, outside: dict[str, str], tmp_path: Path) -> None:
    [packages] = installed.parents[1].glob("lib/python*/site-packages")
    solution = "reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py"
    for answer in (
        ("1.3-check", "q2", "5 ms"),
        ("1.3-exercises", "servo-threshold", packages / "grader/material" / solution),
    ):
        done = subprocess.run(
            [installed, "grade", *answer], cwd=tmp_path, env=outside, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def served(installed: Path, outside: dict[str, str], tmp_path: Path) -> Iterator[str]:
    """The address of the service, started in an empty folder."""
    command = [str(installed), "serve", "--port", "0", "--data", "data"]
    with subprocess.Popen(command, cwd=tmp_path, env=outside, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            match = re.match(r"Student page: +(\S+)/", process.stdout.readline())
            assert match, "the service does not start"
            yield match[1]
        finally:
            process.terminate()


@pytest.mark.jail
def test_the_service_serves_the_lesson_in_an_empty_folder(served: str, tmp_path: Path) -> None:
    page = httpx.get(served, timeout=60)
    assert page.status_code == 200
    for quiz in load_content().quizzes.values():
        assert quiz.title in page.text
    assert (tmp_path / "data/grader.db").stat().st_mode & 0o777 == 0o600
