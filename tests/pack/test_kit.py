"""The kit of an exercise: it has what a learner needs, and nothing that is hidden, whatever the content is."""

import copy
import io
import json
import os
import re
import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import nbformat
import pytest

from grader.errors import NotFound
from grader.library import Library, load
from grader.numerics.version import INSTALLED
from grader.pack.kit import build_kit, list_texts
from grader.settings import Settings
from mjgrader.judges import JUDGES
from support.bare_environments import make_environment
from support.content import PASSED
from support.sites import ROOT, Site, open_site

API = "/api/v1"
CONTENTS = {"lesson": ROOT, "values": ROOT / "tests/exercises/values"}
EXERCISES = [
    (name, path.stem, one["id"])
    for name, folder in CONTENTS.items()
    for path in sorted((folder / "quizzes").glob("*.json"))
    for one in json.loads(path.read_text()).get("questions", [])
    if one["kind"] == "code"
]
PATHS = re.compile(r"/(?:home|work|tmp|root|usr)/|src/grader|reference_solutions|quizzes/starters|programs/")


@pytest.fixture(scope="module")
def libraries() -> dict[str, Library]:
    return {name: load(folder, passed=PASSED) for name, folder in CONTENTS.items()}


def change_secrets(question: dict[str, Any]) -> dict[str, Any]:
    """Returns the question with everything changed that no learner may know: numbers of hidden cases, their tolerances
    and models, hints, explanations, remarks and the sentences of mistakes. What a verdict shows stays."""
    changed = copy.deepcopy(question)
    changed["explain"] = "<p>Another explanation.</p>"
    check = changed["check"]
    check["x-remark"] = "another remark"
    for case in check["cases"]:
        case["hint"] = "another hint"
        if case.get("hidden"):
            case["id"] = f"{case['id']}-renamed"
            for part in ("set", "start", "tolerance"):
                if part in case:
                    case[part] = nudge(case[part])
            if "xml" in case:
                case["xml"] = [line.replace("mass='", "mass='1") for line in case["xml"]]
            case["x-why"] = "another reason"
    for mistake in check.get("mistakes", []):
        mistake["sentence"] = "Another sentence."
    return changed


def nudge(value: Any) -> Any:
    """Returns every number a little smaller; ranges stay ranges."""
    if isinstance(value, dict):
        return {name: nudge(part) for name, part in value.items()}
    if isinstance(value, list):
        return [nudge(part) for part in value]
    return value * 0.9995 if isinstance(value, float | int) and not isinstance(value, bool) else value


@pytest.mark.parametrize("name", CONTENTS)
def test_a_kit_does_not_depend_on_anything_hidden(name: str, libraries: dict[str, Library], tmp_path: Path) -> None:
    folder = tmp_path / "content"
    for part in ("quizzes", "models", "programs"):
        if (CONTENTS[name] / part).exists():
            shutil.copytree(CONTENTS[name] / part, folder / part)
    (folder / "models" / "of_the_teacher.xml").write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    for path in (folder / "programs").glob("*.py"):
        path.write_text(f"{path.read_text()}\nSECRET = 1\n")
    for path in (folder / "quizzes").glob("*.json"):
        quiz = json.loads(path.read_text())
        if "questions" not in quiz:
            continue
        quiz["questions"] = [change_secrets(one) if one["kind"] == "code" else one for one in quiz["questions"]]
        path.write_text(json.dumps(quiz))
    changed = load(folder, passed=PASSED)
    tried = 0
    for content, quiz_id, question in EXERCISES:
        if content == name:
            assert list_texts(changed, quiz_id, question, judged=True) == list_texts(
                libraries[name], quiz_id, question, judged=True
            )
            assert changed.digest(quiz_id) != libraries[name].digest(quiz_id)
            tried += 1
    assert tried


def list_leaves(value: Any) -> Iterator[str]:
    """Every text, and every number of three figures or more, as they stand in JSON."""
    if isinstance(value, dict):
        for part in value.values():
            yield from list_leaves(part)
    elif isinstance(value, list):
        for part in value:
            yield from list_leaves(part)
    elif isinstance(value, str):
        yield value
    elif (
        isinstance(value, float | int)
        and not isinstance(value, bool)
        and len(re.sub(r"e.*|[.-]|^0+|0+$", "", repr(value)).strip("0")) >= 3
    ):
        yield repr(value)


def is_number(text: str) -> bool:
    return re.fullmatch(r"-?[\d.]+(e-?\d+)?", text) is not None


@pytest.mark.parametrize(("content", "quiz", "question"), EXERCISES)
def test_no_secret_of_the_content_is_in_a_kit(
    content: str, quiz: str, question: str, libraries: dict[str, Library]
) -> None:
    library = libraries[content]
    texts = list_texts(library, quiz, question, judged=True)
    whole = "\n".join(texts.values())
    raw = next(
        one for one in json.loads(library.sources[quiz][library.file(quiz)])["questions"] if one["id"] == question
    )
    hidden = [case for case in raw["check"]["cases"] if case.get("hidden")]
    assert hidden
    visible = [case for case in raw["check"]["cases"] if not case.get("hidden")]
    starter = library.starter(library.question(quiz, question)) or ""
    shown = "\n".join(
        [*list_leaves([visible, raw["q"], raw["check"].get("numbers")]), starter, *library.models.values()]
    )
    secrets = set(list_leaves([hidden, raw["check"].get("mistakes", []), raw.get("explain", "")]))
    secrets |= {line.strip() for text in library.texts.values() for line in text.splitlines()}
    folder = CONTENTS[content] / "reference_solutions" / quiz / question
    for path in sorted(folder.glob("correct__*.*")):
        secrets |= {line.strip() for line in path.read_text(encoding="utf-8", errors="ignore").splitlines()}
    secrets = {one for one in secrets if (one not in shown if is_number(one) else len(one) > 20 and one not in shown)}
    assert len(secrets) >= 10
    for secret in secrets:
        assert not re.search(rf"(?<![\w.]){re.escape(secret)}(?![\w.])", whole), secret
    assert not PATHS.search(whole)


@pytest.mark.parametrize(("content", "quiz", "question"), EXERCISES)
def test_a_kit_has_all_that_is_promised_in_the_same_bytes(
    content: str, quiz: str, question: str, libraries: dict[str, Library]
) -> None:
    built = build_kit(libraries[content], quiz, question, judged=True)
    build_kit.__globals__["_build"].cache_clear()
    assert build_kit(libraries[content], quiz, question, judged=True) == built
    with zipfile.ZipFile(io.BytesIO(built)) as kit:
        assert kit.testzip() is None
        assert {name.partition("/")[0] for name in kit.namelist()} == {question}
        names = {name.removeprefix(f"{question}/") for name in kit.namelist()}
        exercise = json.loads(kit.read(f"{question}/exercise.json"))
        is_script = exercise["takes"] == "python"
        script = f"{question.replace('-', '_')}{'.xml' if exercise['takes'] == 'mjcf' else '.py'}"  # where one begins
        notebooks = {f"{question}.ipynb"} if is_script else set[str]()
        assert {"README.md", script, "exercise.json", "mjcourse.py"} | notebooks <= names
        readme = kit.read(f"{question}/README.md").decode()
        assert len(readme.splitlines()) <= 12
        assert f"`{script}`" in readme
        words = " ".join(readme.split())
        assert "with another major version" in words
        judged_here = exercise["kind"] in JUDGES and any(trial["problem"] for trial in exercise["trials"])
        assert ("judges the visible cases here" in words) == judged_here
        assert ("sees that the script can be imported, judges nothing" in words) == (is_script and not judged_here)
        assert ("The server judges, all cases." in words) != judged_here
        assert f"`pip install mujoco=={INSTALLED}{' numpy' if is_script else ''}`" in readme
        asked = libraries[content].question(quiz, question)
        visible = [case for case in asked.check.parameters["cases"] if not case.get("hidden")]  # type: ignore[attr-defined]
        titles = [trial["title"] for trial in exercise["trials"]]
        assert all(any(title.startswith(case["title"]) for title in titles) for case in visible)
        assert exercise["how"]
        points = sum(trial["points"] for trial in exercise["trials"]) + exercise["hidden_points"]
        assert points == pytest.approx(asked.points)
        if not is_script:
            return
        notebook: Any = nbformat.reads(  # type: ignore[no-untyped-call]
            kit.read(f"{question}/{question}.ipynb").decode(), as_version=4
        )
        nbformat.validate(notebook)
        assert notebook.cells[0].source.startswith(f"# {exercise['title']}")
        checks = (
            "Judges the visible cases here"
            if judged_here
            else "Sees that the script can be imported; the server judges"
        )
        assert notebook.cells[3].source.startswith(f"# {checks}. No attempt is used.")
        assert notebook.cells[2].source == kit.read(f"{question}/{script}").decode()


def test_a_starter_writes_the_file_that_the_kit_asks_for(libraries: dict[str, Library]) -> None:
    asked = [one for one in EXERCISES if libraries[one[0]].question(*one[1:]).model_dump().get("takes") == "npz"]
    assert len(asked) == 3
    for content, quiz, question in asked:
        texts = list_texts(libraries[content], quiz, question, judged=True)
        file = f"{question.replace('-', '_')}.npz"
        assert f"You hand in `{file}`" in texts["README.md"]
        assert re.findall(r"[\w.]+\.npz", texts[file.replace(".npz", ".py")]) == [file, file]


def test_the_notebook_signs_in_at_the_server_that_made_the_kit(libraries: dict[str, Library]) -> None:
    of = (libraries["lesson"], "1.3-exercises", "servo-threshold")

    def read_last_cell(origin: str) -> str:
        notebook = list_texts(*of, judged=True, origin=origin)["servo-threshold.ipynb"]
        return str(json.loads(notebook)["cells"][-1]["source"])

    known, unknown = read_last_cell("https://course.example.org"), read_last_cell("")
    assert 'g.sign_in("https://course.example.org")' in known and "write the address" not in known
    assert 'g.sign_in("https://grader.example.edu")' in unknown and "write the address" in unknown


def test_only_an_exercise_has_a_kit(libraries: dict[str, Library]) -> None:
    with pytest.raises(NotFound, match="only exercises have a kit"):
        build_kit(libraries["lesson"], "1.3-check", "q1", judged=True)


@pytest.mark.process
@pytest.mark.slow
def test_every_starter_runs_with_mujoco_and_numpy_alone(libraries: dict[str, Library], tmp_path: Path) -> None:
    python = make_environment(tmp_path / "bare", "mujoco", "numpy")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    missing = subprocess.run(
        [python, "-c", "import scipy"], capture_output=True, text=True, env=environment, check=False
    )
    assert "ModuleNotFoundError" in missing.stderr
    for content, quiz, question in EXERCISES:
        folder = tmp_path / question
        with zipfile.ZipFile(io.BytesIO(build_kit(libraries[content], quiz, question, judged=True))) as kit:
            kit.extractall(tmp_path)
        script = f"{question.replace('-', '_')}.py"
        if not (folder / script).exists():
            continue
        done = subprocess.run(
            [python, script], cwd=folder, capture_output=True, text=True, env=environment, check=False
        )
        assert (done.returncode, done.stderr) == (0, ""), done.stderr


@pytest.fixture(scope="module")
def lesson(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_site(Settings(data=tmp_path_factory.mktemp("kits"), workers=0)) as site:
        yield site


KIT = "/quizzes/1.3-exercises/questions/servo-threshold/kit"


def test_the_route_sends_a_kit_with_an_etag(lesson: Site, libraries: dict[str, Library]) -> None:
    ann = lesson.client("ann")
    first = ann.get(API + KIT)
    assert (first.status_code, first.headers["content-type"]) == (200, "application/zip")
    assert first.headers["content-disposition"] == 'attachment; filename="servo-threshold.zip"'
    assert first.content == build_kit(
        libraries["lesson"], "1.3-exercises", "servo-threshold", judged=True, origin=lesson.origin
    )
    with zipfile.ZipFile(io.BytesIO(first.content)) as kit:
        readme = kit.read("servo-threshold/README.md").decode()
    assert (
        f"Its page: {lesson.origin}/quizzes/1.3-exercises/servo-threshold. `mjgrade sign-in {lesson.origin}`" in readme
    )
    again = lesson.client("bob").get(API + KIT, headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    for path in (KIT.replace("servo-threshold", "servo-explain"), KIT.replace("servo-threshold", "none")):
        assert ann.get(API + path).status_code == 404
    assert httpx.get(lesson.origin + API + KIT).status_code == 401


def test_the_page_links_the_kit(lesson: Site) -> None:
    page = httpx.get(f"{lesson.origin}/quizzes/1.3-exercises/servo-threshold")
    (address,) = re.findall(r'href="([^"]*)" download>download the kit<', page.text)
    assert httpx.get(lesson.origin + address).content == lesson.client("ann").get(API + KIT).content
    assert "(it needs the kit)" in page.text  # the starter imports mjcourse


def test_a_kit_is_not_sent_before_its_quiz_opens(tmp_path: Path) -> None:
    folder = tmp_path / "content"
    shutil.copytree(Settings().content, folder)
    path = folder / "quizzes" / "1.3-exercises.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "policy": {"opens": "2199-01-01T00:00:00Z"}}))
    with open_site(Settings(content=folder, data=tmp_path / "data", workers=0)) as site:
        refused = site.client("ann").get(API + KIT)
        assert (refused.status_code, refused.json()["detail"][:14]) == (409, "This quiz open")
        assert site.client("tina", "instructor").get(API + KIT).status_code == 200
        assert httpx.get(f"{site.origin}/quizzes/1.3-exercises/servo-threshold/kit.zip").status_code == 409
