"""docs/classroom.md: the workflow for GitHub Classroom and the recipe for notebooks, done on this machine."""

import base64
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import nbformat
import pytest
import yaml

from grader.pack import pack_gradescope
from support import command_line
from support.content import load_content

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
PAGE = (ROOT / "docs" / "classroom.md").read_text(encoding="utf-8")
SOLUTIONS = ROOT / "reference_solutions/1.3-exercises/servo-threshold"
WORKFLOW: dict[Any, Any] = yaml.safe_load((DEPLOY / "github-classroom.yml").read_text())
JOB: dict[str, Any] = WORKFLOW["jobs"]["run-autograding-tests"]
BIN = Path(sys.executable).parent


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}", "GRADER_CONTENT": str(ROOT), **more}


# -- GitHub Classroom --------------------------------------------------------------------------------------------------


def steps(key: str) -> list[dict[str, Any]]:
    return [step for step in JOB["steps"] if key in step]


def test_the_workflow_is_well_formed() -> None:
    assert WORKFLOW.keys() == {"name", True, "permissions", "jobs"}  # YAML reads `on` as true, as GitHub does not
    assert JOB.keys() == {"runs-on", "if", "timeout-minutes", "env", "steps"}
    allowed = {"name", "id", "if", "uses", "with", "env", "run"}
    for step in JOB["steps"]:
        assert step.keys() <= allowed and ("uses" in step) != ("run" in step)
    assert all(re.fullmatch(r"[\w-]+/[\w-]+@v\d+", step["uses"]) for step in steps("uses"))
    for step in steps("run"):
        subprocess.run(["bash", "-n", "-c", step["run"]], check=True)


def test_the_workflow_names_only_what_there_is() -> None:
    text = (DEPLOY / "github-classroom.yml").read_text()
    used = re.findall(r"\$\{\{ ([\w.-]+)", text)
    ids = {step["id"] for step in steps("id")}
    for name in used:
        context, _, rest = name.partition(".")
        assert context in {"github", "vars", "secrets", "steps"}
        assert context != "steps" or rest.partition(".")[0] in ids
    assert {name for name in used if name.startswith(("vars", "secrets"))} == {
        "vars.COURSE_EXERCISE", "secrets.COURSE_EXERCISE_TOKEN",
    }  # fmt: skip
    assert all(name.partition(".")[2] in PAGE for name in used if name.startswith(("vars", "secrets")))


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the workflow has checked out: the student's repository, with the packed exercise."""
    folder = tmp_path_factory.mktemp("workspace")
    pack_gradescope(load_content(), "1.3-exercises", "servo-threshold", folder / "exercise")
    return folder


def run_grade(workspace: Path) -> tuple[int, str]:
    """Runs the workflow's own step. Returns its exit code, and the result that the reporter gets."""
    [step] = [step for step in steps("run") if step.get("id") == "grade"]
    output = workspace / "output"
    output.write_text("")
    job = {name: value.replace("${{ github.workspace }}", str(workspace)) for name, value in JOB["env"].items()}
    done = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],
        cwd=workspace, env=environment(**job, GITHUB_OUTPUT=str(output)), capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, output.read_text().removeprefix("result=").strip()


@pytest.mark.jail
def test_the_step_grades_and_tells_classroom_parts_of_the_points(workspace: Path) -> None:
    for name, status, score in (("correct__spectral_radius", "pass", 3.0), ("partial__own_gains", "fail", 1.0)):
        shutil.copy(SOLUTIONS / f"{name}.py", workspace / "answer.py")
        code, result = run_grade(workspace)
        report = json.loads(base64.b64decode(result))
        assert (code, report["status"], report["max_score"]) == (0, status, 3.0)
        assert sum(test["score"] for test in report["tests"]) == score  # as the reporter counts
        assert ElementTree.parse(workspace / "report.xml").getroot().tag == "testsuites"
    assert "same answer for every model" in report["tests"][0]["message"]


def test_an_answer_that_is_not_there_fails_the_step_and_reports_nothing(workspace: Path) -> None:
    (workspace / "answer.py").unlink(missing_ok=True)
    assert run_grade(workspace) == (2, "")


# -- notebooks ---------------------------------------------------------------------------------------------------------


def cell(kind: str, source: str | list[str], grade_id: str | None = None) -> dict[str, Any]:
    marks = {"grade_id": grade_id, "grade": False, "solution": True, "locked": False, "schema_version": 3}
    metadata = {} if grade_id is None else {"nbgrader": marks}
    code: dict[str, Any] = {"execution_count": None, "outputs": []} if kind == "code" else {}
    return {"cell_type": kind, "metadata": metadata, "source": source, **code}


def notebook(path: Path, *cells: dict[str, Any]) -> Path:
    """Writes a notebook of format 4.5, the cells with ids, which fits the published schema."""
    numbered = [{**one, "id": f"cell-{number}"} for number, one in enumerate(cells)]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    document = {"cells": numbered, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}
    nbformat.validate(document)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(document))
    return path


@pytest.mark.jail
def test_the_function_cells_of_notebooks_are_graded(tmp_path: Path) -> None:
    right = ["%matplotlib inline\n", *(SOLUTIONS / "correct__spectral_radius.py").read_text().splitlines(keepends=True)]
    partial = (SOLUTIONS / "partial__own_gains.py").read_text()
    asked, elsewhere = cell("markdown", "# Find it"), cell("code", "raise SystemExit('this cell is not run')")
    notebook(tmp_path / "submitted/ada/ps1/servo.ipynb", asked, elsewhere, cell("code", right, "servo-threshold"))
    notebook(tmp_path / "submitted/bob/ps1/servo.ipynb", cell("code", partial, "servo-threshold"), elsewhere)
    notebook(tmp_path / "submitted/eve/ps1/servo.ipynb", asked, cell("code", right, "another"))
    (tmp_path / "submitted/zoe/ps1").mkdir(parents=True)
    (tmp_path / "submitted/zoe/ps1/servo.ipynb").write_text("{not JSON")
    [line] = re.findall(r"^grader (grade-notebook .*) > points\.jsonl$", PAGE, re.MULTILINE)
    words = shlex.split(line)
    paths = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.glob(words.pop()))
    command = [str(BIN / "grader"), *words, *paths]
    done = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False)
    reports = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 3
    assert [(Path(one["notebook"]).parts[1], one["points"], one["status"]) for one in reports] == [
        ("ada", 3.0, "correct"), ("bob", 1.0, "partial"), ("eve", None, None), ("zoe", None, None),
    ]  # fmt: skip
    assert reports[3]["message"].endswith("zoe/ps1/servo.ipynb is no notebook of format 4: save it again with Jupyter.")
    assert "same answer for every model" in reports[1]["message"]
    assert "0 code cells have the grade_id 'servo-threshold'" in reports[2]["message"]


# -- the page ----------------------------------------------------------------------------------------------------------


def test_the_commands_of_the_page_are_those_of_the_command_line() -> None:
    lines = [line.strip() for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL) for line in block.splitlines()]
    for line in (line for line in lines if line.startswith("grader ")):
        words = shlex.split(line.partition(">")[0])[1:]
        command = words[: 2 if words[0] == "pack" else 1]
        done = command_line.grader(*command, "--help")
        assert done.returncode == 0
        for option in (word for word in words if word.startswith("--")):
            assert option in done.stdout
    assert yaml.safe_load(re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)[0])["grade"]["artifacts"]["reports"]
    compile(re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[0], "docs/classroom.md", "exec")
