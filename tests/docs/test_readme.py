"""What the README says is so: its commands run, its pages exist; and the lists of settings and of dependencies."""

import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.service.accounts import in_database
from grader.settings import Settings
from support.sites import Site, open_site, write_content

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DEPENDENCIES = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
TEACHING = (ROOT / "docs" / "teaching.md").read_text(encoding="utf-8")
STEPS = README.partition("## First steps for a teacher")[2].partition("##")[0]
SHELL = "".join(re.findall(r"```sh\n(.*?)```", README, re.DOTALL)).splitlines()


def test_the_readme_is_a_front_door() -> None:
    assert len(README.split()) <= 900
    assert len(re.findall(r"!\[", README)) == 1


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


@pytest.mark.slow
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


def test_every_page_that_is_named_is_there(site: Site) -> None:
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "tom", Role.INSTRUCTOR))
    teacher = browser(site, code)
    for path in sorted(set(re.findall(r"`(/instructor[\w/]*)`", README + TEACHING))):
        assert teacher.get(path).status_code == 200, path


@pytest.mark.process
@pytest.mark.parametrize("line", [line for line in SHELL if "grader grade" in line])
def test_the_command_of_the_readme_grades(line: str) -> None:
    words = shlex.split(line, comments=True)
    assert words[0] == ".venv/bin/grader"
    command = [sys.executable, "-c", "from grader.commands.main import main; main()", *words[1:]]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "correct" in done.stdout


def test_the_dependencies_are_the_ones_that_are_explained() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    required = [
        *project["dependencies"],
        *(one for extra in project["optional-dependencies"].values() for one in extra),
    ]
    declared = {re.split(r"[\[><=]", one)[0] for one in required}
    explained = re.findall(r"^\| (.*?) \|", DEPENDENCIES, re.MULTILINE)[1:]
    assert {name.strip() for row in explained for name in row.partition(" (")[0].split(",")} == declared
