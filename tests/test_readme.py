"""What the README says is so: its commands, files, settings and examples exist and run."""

import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from grader.domain.verdict import Status
from grader.library import load
from grader.pipeline import Pipeline
from grader.settings import Settings

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
GRADER = Path(sys.executable).parent / "grader"

FENCES = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)
SHELL = [line.partition("#")[0].strip() for kind, text in FENCES if kind == "sh" for line in text.splitlines()]
EXAMPLES = [json.loads(text) for kind, text in FENCES if kind == "json"]


def help_of(*command: str) -> str:
    done = subprocess.run([GRADER, *command, "--help"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return re.sub(r"\s+", " ", done.stdout)


COMMANDS = [
    words[words.index("grader") + 1 :] for line in SHELL if "grader" in (words := shlex.split(line.replace("...", "")))
]


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_exists_with_its_options(words: list[str]) -> None:
    name = words[:2] if words[0] in ("token", "pack", "roster") else words[:1]
    shown = help_of(*name)
    for option in (word for word in words if word.startswith("--")):
        assert option in shown


@pytest.mark.parametrize("target", sorted({w for line in SHELL for w in re.findall(r"^make ([\w-]+)", line)}))
def test_every_make_target_exists(target: str) -> None:
    done = subprocess.run(["make", "--dry-run", target], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("path", sorted(set(re.findall(r"\]\(([^):#]+)\)", README))))
def test_every_link_leads_somewhere(path: str) -> None:
    assert (ROOT / path).exists()


@pytest.mark.parametrize("room", sorted(set(re.findall(r"`([\w]+(?:/|\.py))`", README))))
def test_every_room_is_there(room: str) -> None:
    assert (ROOT / "src/grader" / room).exists() or (ROOT / room).exists()


def test_the_settings_are_these_and_no_others() -> None:
    rows = dict(re.findall(r"^\| `GRADER_(\w+)` \| (.*) \|$", README, re.MULTILINE))
    fields = {name.upper(): field.description for name, field in Settings.model_fields.items()}
    assert rows == fields


def test_the_example_of_a_question_loads_and_grades(tmp_path: Path) -> None:
    (tmp_path / "quizzes").mkdir()
    shutil.copytree(ROOT / "models", tmp_path / "models")
    (example,) = EXAMPLES
    (tmp_path / "quizzes" / "example.json").write_text(json.dumps(example), encoding="utf-8")
    verdict = Pipeline(load(tmp_path)).grade(example["id"], "q1", "2.006 s")
    assert verdict.status is Status.CORRECT


def test_the_dependencies_are_the_ones_that_are_explained() -> None:
    declared = re.findall(
        r'^  "([a-z-]+)[\[><=]', (ROOT / "pyproject.toml").read_text().partition("[project.scripts]")[0], re.M
    )
    table = README.partition("## Dependencies")[2].partition("##")[0]
    explained = {name.strip() for row in re.findall(r"^\| (.*?) \|", table, re.M) for name in row.split(",")}
    assert set(declared) <= explained
