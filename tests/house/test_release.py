"""What `make release` builds and writes: reproducible, without anything of this machine, with notes."""

import io
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest

from release.building import ROOT, ReleaseError, build
from release.checking import check_files, check_metadata, read_choice, read_members
from release.notes import read_changes, write_notes

VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Path]]:
    """The sdist and the wheel of the commit; `build` makes each twice, and compares."""
    yield build(".", tmp_path_factory.mktemp("dist"))


@pytest.mark.slow
@pytest.mark.process
def test_a_release_is_built_alike_twice_and_passes_its_checks(built: list[Path]) -> None:
    assert [path.suffix for path in built] == [".gz", ".whl"]
    for path in built:
        committed = path.name.split("-")[1].removesuffix(".tar.gz")
        check_metadata(path, committed)
        check_files(path)
    names = {name for name, _ in read_members(built[1])}
    assert {"grader/material/quizzes/1.3-check.json", "grader/web/static/page.js", "grader/py.typed"} <= names
    assert {f"grader/labs/kinds/simlab/lab.{ending}" for ending in ("html", "js")} <= names
    assert {name.split("/")[0].split("-")[0] for name in names} == {"grader", "mujoco_grader"}


def test_the_version_is_in_one_place() -> None:
    assert version("mujoco-grader") == VERSION
    assert read_changes(VERSION)
    named = [path for path in (ROOT / "src").rglob("*.py") if f'"{VERSION}"' in path.read_text()]
    assert named == []


def wheel_with(folder: Path, name: str, text: str) -> Path:
    path = folder / f"mujoco_grader-{VERSION}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as wheel:
        wheel.writestr(name, text)
    return path


@pytest.mark.parametrize("name", ["grader/tests/test_one.py", "tests/one.py", "grader/__pycache__/a.txt", "a.pyc"])
def test_a_file_of_the_checkout_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ReleaseError, match=f"{name} belongs to the checkout"):
        check_files(wheel_with(tmp_path, name, ""))


def test_a_folder_of_this_machine_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReleaseError, match=r"grader/one.py names .*, a folder of this machine"):
        check_files(wheel_with(tmp_path, "grader/one.py", f"PATH = '{ROOT}/src'"))


METADATA = f"Metadata-Version: 2.4\nName: mujoco-grader\nVersion: {VERSION}\n"
WHOLE = f"{METADATA}Summary: one\nRequires-Python: >=3.11\nDescription-Content-Type: text/markdown\n\n# One\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (WHOLE.replace(VERSION, "0.0.9"), "version: 0.0.9 is not"),
        (WHOLE.replace("Summary: one\n", ""), "summary"),
        (WHOLE.replace("text/markdown", "text/plain"), "description_content_type"),
        (METADATA.replace("Version: 1", "Version: one"), "version"),
        (WHOLE.replace("Name: mujoco-grader", "Name: other"), "must be named for it"),
    ],
)
def test_metadata_that_an_index_would_refuse_is_named(text: str, said: str, tmp_path: Path) -> None:
    check_metadata(wheel_with(tmp_path, "mujoco_grader.dist-info/METADATA", WHOLE), VERSION)
    with pytest.raises(ReleaseError, match=said):
        check_metadata(wheel_with(tmp_path, "mujoco_grader.dist-info/METADATA", text), VERSION)


def test_an_sdist_is_read_as_a_wheel_is(tmp_path: Path) -> None:
    path = tmp_path / f"mujoco_grader-{VERSION}.tar.gz"
    with tarfile.open(path, "w:gz") as files:
        member = tarfile.TarInfo(f"mujoco_grader-{VERSION}/PKG-INFO")
        member.size = len(WHOLE)
        files.addfile(member, io.BytesIO(WHOLE.encode()))
    check_metadata(path, VERSION)
    check_files(path)


def test_the_notes_have_the_changes_the_checks_and_every_file(tmp_path: Path) -> None:
    file = wheel_with(tmp_path, "grader/one.py", "")
    write_notes(VERSION, [file], ["looked at"], tmp_path)
    notes = (tmp_path / "NOTES.md").read_text()
    assert notes.startswith(f"# {VERSION}\n")
    assert all(text in notes for text in (read_changes(VERSION), "- looked at", file.name))
    assert (tmp_path / "SHA256SUMS").read_text() in notes
    with pytest.raises(ReleaseError, match=r"has no section `## 9.9.9 - YYYY-MM-DD`"):
        read_changes("9.9.9")


def test_the_choice_that_a_release_grades_is_one_of_the_lesson() -> None:
    question, answer = read_choice()
    assert question
    assert answer >= 0
