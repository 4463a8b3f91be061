"""docs/rest.md, word for word: its commands are run from top to bottom, and print what the page says."""

import json
import os
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from grader.settings import Settings
from support.sites import open_site

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "rest.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(sh|json|text)\n(.*?)```", PAGE, re.DOTALL)
ADDRESS = "http://127.0.0.1:8000"
MARK = "-- end of block --"


def fits(shown: Any, found: Any) -> bool:
    """Whether everything that is shown is found; "..." stands for any text."""
    if isinstance(shown, dict):
        return isinstance(found, dict) and all(name in found and fits(one, found[name]) for name, one in shown.items())
    if isinstance(shown, list) and isinstance(found, list):
        return all(any(fits(one, other) for other in found) for one in shown) if shown else not found
    return bool(shown == found or (shown == "..." and isinstance(found, str) and found))


def run(site: str, data: Path, folder: Path) -> list[str]:
    """What each block of commands prints."""
    commands = [text for kind, text in BLOCKS if kind == "sh"]
    assert commands[0] == f"export SITE={ADDRESS}\n"
    script = "set -euo pipefail\n" + "".join(f"{text}\necho; echo '{MARK}'\n" for text in commands)
    environment = {
        **os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "GRADER_DATA": str(data),
        "GRADER_CONTENT": str(ROOT),
    }  # fmt: skip
    done = subprocess.run(
        ["bash", "-c", script.replace(ADDRESS, site)], cwd=folder, env=environment, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.split(f"\n{MARK}\n")[:-1]


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, str, str]]:
    """Each block of commands with what it printed, and what the page says that it prints."""
    folder = tmp_path_factory.mktemp("rest")
    settings = Settings(content=ROOT, data=folder / "data", workers=0)
    with open_site(settings) as site:
        outputs = iter(run(site.origin, folder / "data", folder))
    blocks = [*BLOCKS, ("", "")]
    return [
        (text, next(outputs), shown if after != "sh" else "")
        for (kind, text), (after, shown) in pairwise(blocks)
        if kind == "sh"
    ]


@pytest.mark.slow
def test_every_command_runs_and_prints_what_the_page_says(printed: list[tuple[str, str, str]]) -> None:
    told = 0
    for command, output, shown in printed:
        if shown.startswith(("{", "[")):
            assert fits(json.loads(shown), json.loads(output)), (command, output)
            told += 1
        elif shown:
            assert output.strip() == shown.strip(), command
            told += 1
    assert told == len([kind for kind, _ in BLOCKS if kind != "sh"])


@pytest.mark.slow
def test_the_exports_hold_the_learner(printed: list[tuple[str, str, str]]) -> None:
    outputs = {command: output for command, output, _ in printed}
    [roster] = [output for command, output in outputs.items() if 'roster.csv" -H' in command]
    assert "Ada Lovelace,ada@school.example,student,school,s1815" in roster
    [heading] = [output for command, output in outputs.items() if "moodle.csv" in command]
    assert heading.strip().startswith("Username,Email address,ID number,")


@pytest.mark.slow
def test_a_row_of_the_feed_has_the_fields_that_other_programs_rely_on(printed: list[tuple[str, str, str]]) -> None:
    [page] = [output for command, output, _ in printed if "results?limit=100" in command]
    [row] = json.loads(page)["items"]
    fixed = {"submission_id": str, "user": str, "quiz": str, "question": str, "points": float, "max_points": float,
             "revision": int}  # fmt: skip
    assert {name: type(row[name]) for name in fixed} == fixed
    assert (row["user"], row["learner"]) == ("Ada Lovelace", {"namespace": "school", "id": "s1815"})


def test_the_page_is_not_fitted_by_anything() -> None:
    assert fits({"a": [{"b": "..."}]}, {"a": [{"c": 1}, {"b": "x"}], "d": 1})
    for shown, found in (({"a": 1}, {}), ({"a": 1}, {"a": 2}), ({"a": []}, {"a": [1]}), ({"a": "..."}, {"a": 1})):
        assert not fits(shown, found)
