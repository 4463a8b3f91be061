"""What the README says is so: its commands, files, pages and examples exist and run; and the list of settings."""

import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from grader.accounts import in_database
from grader.courses.sign_in import create_sign_in_code
from grader.domain.verdict import Status
from grader.identity import Role
from grader.library import load
from grader.pipeline import Pipeline
from grader.settings import Settings
from sites import Site, open_site, write_content

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
SETTINGS = (ROOT / "docs" / "settings.md").read_text(encoding="utf-8")
MAP = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").partition("## The map")[2].partition("##")[0]
STEPS = README.partition("## First steps")[2].partition("##")[0]
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


@pytest.mark.parametrize("room", sorted(set(re.findall(r"`([\w]+(?:/|\.py))`", MAP))))
def test_every_room_is_there(room: str) -> None:
    assert (ROOT / "src/grader" / room).exists() or (ROOT / room).exists()


def test_the_settings_are_these_and_no_others() -> None:
    rows = dict(re.findall(r"^\| `GRADER_(\w+)` \| (.*) \|$", SETTINGS, re.MULTILINE))
    fields = {name.upper(): field.description for name, field in Settings.model_fields.items()}
    assert rows == fields


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("steps")
    with open_site(Settings(content=write_content(folder / "content"), data=folder / "data", workers=0)) as site:
        yield site


def browser(site: Site, code: str) -> httpx.Client:
    """A browser without scripts that has used a sign-in link."""
    client = site.anonymous({"Origin": site.origin, "Sec-Fetch-Site": "same-origin"})
    client.follow_redirects = True
    assert "Sign in</button>" in client.get(f"/signin?code={code}").text
    assert client.post("/signin", data={"code": code}).is_success
    return client


def test_the_first_steps_lead_from_a_class_to_its_gradebook(site: Site) -> None:
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "tina", Role.INSTRUCTOR))
    shown = site.anonymous().get(f"/signin?code={code}").text
    teacher = browser(site, code)
    made = teacher.post("/instructor/people/invitations", data={"names": "Ada\nBob", "role": "student"}).text
    for link in re.findall(r"signin\?code=([\w-]+)", made):
        form = {"answer": "Because."}
        assert browser(site, link).post("/quizzes/small/q4", data=form).is_success
    shown += teacher.get("/instructor/review").text
    shown += (opened := teacher.post("/instructor/review/next?which=reviews")).text
    assert "Because." in opened.text
    shown += "".join(teacher.get(path).raise_for_status().text for path in re.findall(r"`(/instructor[\w/]*)`", STEPS))
    buttons = {" ".join(text.split()) for text in re.findall(r">([^<>]+)</(?:a|button)>", shown + made)}
    assert set(re.findall(r"\*\*([^*]+)\*\*", STEPS)) <= buttons
    book = teacher.get("/instructor/gradebook?quiz=small").text
    assert ("Ada" in book, "Bob" in book) == (True, True)


def test_every_page_of_the_readme_is_there(site: Site) -> None:
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "tom", Role.INSTRUCTOR))
    teacher = browser(site, code)
    for path in sorted(set(re.findall(r"`(/instructor[\w/]*)`", README))):
        assert teacher.get(path).status_code == 200, path


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
