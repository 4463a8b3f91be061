"""docs/architecture.md names every room in the order of the floors, and only files and functions that exist."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src/grader"
PAGE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
MAP = PAGE.partition("## The map")[2].partition("\n## ")[0]
ROWS = re.findall(r"^\| (`.*?) \| (.*) \|$", MAP, re.MULTILINE)
ROOMS = {tuple(re.findall(r"`(\w+)(?:/|\.py)`", names)): job for names, job in ROWS}
INNER = {(room, name) for (room, *_), job in ROOMS.items() for name in re.findall(r"`(\w+)/`", job)}
PACKAGES = [path.parent.relative_to(SOURCE).parts for path in SOURCE.glob("*/**/__init__.py")]
HISTORY = ("store", "engine", "migrations", "versions")
FILES = sorted(set(re.findall(r"`([\w/]+\.(?:py|js))`", PAGE)))
NAMED = [
    (file, name)
    for file, names in re.findall(r"`([\w/]+\.py)`: ((?:`[A-Za-z_.]+`(?:, (?=`\w+`))?)+)", PAGE)
    for name in re.findall(r"`([A-Za-z_.]+)`", names)
]
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]


def test_the_rooms_are_those_of_import_linter_floor_by_floor() -> None:
    names = [name for row in ROOMS for name in row]
    [layers] = [contract["layers"] for contract in CONTRACTS if contract.get("containers") == ["grader"]]
    for floor in layers:
        rooms = set(floor.split(" | "))
        assert set(names[: len(rooms)]) == rooms
        del names[: len(rooms)]
    assert not names


def test_every_package_stands_in_the_row_of_its_room_and_no_other_name_does() -> None:
    there = {(room, name) for room, *inner in PACKAGES for name in inner if (room, *inner) != HISTORY}
    assert there == INNER


@pytest.mark.parametrize("file", FILES)
def test_every_file_is_there(file: str) -> None:
    assert any((folder / file).is_file() for folder in (SOURCE, SOURCE / "web", SOURCE / "web/static", ROOT))


@pytest.mark.parametrize(("file", "name"), NAMED)
def test_every_function_is_in_its_file(file: str, name: str) -> None:
    text = (SOURCE / file).read_text(encoding="utf-8")
    for part in name.split("."):
        assert re.search(rf"^ *(?:def|class) {part}\b", text, re.MULTILINE)


def test_tests_lie_in_the_folder_of_their_room() -> None:
    folders = {path.parent.relative_to(ROOT / "tests").parts[0] for path in (ROOT / "tests").glob("*/**/test_*.py")}
    assert folders - {"docs", "house", "client"} <= {name for row in ROOMS for name in row}
