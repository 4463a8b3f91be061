"""What runs on the learner's machine: each script in a process of its own, with the server's refusals."""

import importlib
import json
import os
import shutil
from pathlib import Path
from typing import Any

import httpx
import pytest

from grader.library import Library, load
from grader.pack.kit import build_kit
from mjgrader import worker
from mjgrader.accounts import Account
from mjgrader.checking import check_source, list_remarks
from mjgrader.errors import NotRunning, Sentence
from mjgrader.kits import FIELDS, Kit, find_kit, read_kit, unpack_kit
from mjgrader.session import Session
from support.content import PASSED, load_content
from support.sites import ROOT

VALUES = ROOT / "tests/exercises/values"


@pytest.fixture(scope="module")
def library() -> Library:
    return load_content()


@pytest.fixture
def job(library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A job of the worker that only imports its script."""
    monkeypatch.syspath_prepend(tmp_path)
    kit = unpack_kit(build_kit(library, "1.3-exercises", "servo-threshold", judged=True), tmp_path / "kit")
    trials = [{**trial, "index": index, "problem": None} for index, trial in enumerate(kit.exercise["trials"])]
    shared = {"without_integrators": False, "reveal": "size", "folder": str(kit.folder), "file": kit.script}
    return {**shared, "kind": "of_a_plugin", "trials": trials[:1]}


def test_a_kind_that_the_client_does_not_know_is_left_to_the_server(job: dict[str, Any]) -> None:
    entry = job["trials"][0]["entries"][0]
    run = worker.run_job(
        {**job, "source": f"from mjcourse import model_path\ndef {entry}(*arguments):\n    return 1\n"}
    )
    assert run["status"] == "returned"
    (finding,) = worker.judge_job(job, run)
    assert (finding["passed"], finding["raised"]) == (None, False)
    assert finding["message"] == "Your script can be imported; the server judges this case."


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("x = 1\ny = unknown\n", "NameError in line 2: name 'unknown' is not defined"),
        ("x = 1\n", "TypeError: the script defines no function largest_stable_timestep"),
        ("import sys\nsys.exit(3)\n", "SystemExit in line 2: 3"),
        ("x = (\n", "SyntaxError in line 1"),
    ],
)
def test_a_script_that_does_not_run_is_told_with_its_line(job: dict[str, Any], source: str, why: str) -> None:
    run = worker.run_job({**job, "source": source})
    assert run["status"] == "crashed"
    assert run["why"].startswith(why)


@pytest.mark.parametrize(
    "line",
    [
        "from mine import size",
        "import mine",
        "from mine import *",
        "size = __import__('importlib').import_module('mine')",
    ],
)
def test_a_file_of_the_learner_is_refused_as_the_server_does_not_have_it(
    line: str, job: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path(job["folder"], "mine.py").write_text("size = 1\n")
    monkeypatch.setattr("builtins.__import__", __import__)  # both are put back after the test
    monkeypatch.setattr("importlib.import_module", importlib.import_module)
    run = worker.run_job({**job, "source": f"import math\n{line}\n"})
    assert run["status"] == "crashed"
    assert run["why"] == (
        "ModuleNotFoundError in line 2: mine is a file of yours: paste it into a cell, or into the script"
    )


def test_what_the_server_does_not_have_is_refused_and_can_be_done_without(
    job: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("builtins.__import__", __import__)
    monkeypatch.setattr("importlib.import_module", importlib.import_module)
    run = worker.run_job({**job, "source": "import pytest\n"})
    assert "the server does not have pytest: a script can import NumPy, SciPy, MuJoCo and" in run["why"]
    entry = job["trials"][0]["entries"][0]
    source = (
        f"try:\n    import pytest\nexcept ImportError:\n    pytest = None\nfrom scipy import linalg\n{entry} = print\n"
    )
    assert worker.run_job({**job, "source": source})["status"] == "returned"
    assert worker.run_job({**job, "source": f"{source}def plot():\n    import pytest\n"})["status"] == "returned"


HALF = """\
import numpy as np
def largest_stable_timestep(model, integrator):
    if integrator == 0:
        return {0}
    raise ValueError("no idea")
"""


@pytest.fixture
def kit(library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kit:
    monkeypatch.setenv("MJGRADER_CONFIG", str(tmp_path / "config"))
    return unpack_kit(build_kit(library, "1.3-exercises", "servo-threshold", judged=True), tmp_path / "kit")


def test_what_is_missing_in_one_case_holds_an_answer_back_and_another_error_does_not(kit: Kit) -> None:
    handed_in: list[str] = []

    def answer(request: httpx.Request) -> httpx.Response:
        handed_in.append(request.content.decode())
        return httpx.Response(202, json={"id": "s", "status": "queued", "quiz": "q", "question": "e"})

    session = Session(lambda text: None, httpx.MockTransport(answer), Account("https://grader.example.edu", "t"))
    missing = HALF.format("unknown")
    with pytest.raises(NotRunning) as raised:
        session.submit(missing, kit, wait=False)
    text = str(raised.value)
    assert "NameError: name 'unknown' is not defined, in line 4 of your script. It works only in your kernel" in text
    assert "Nothing was handed in, and no attempt is used; with anyway=True it is." in text
    assert not handed_in
    session.submit(missing, kit, anyway=True, wait=False)
    session.submit(HALF.format("0.01"), kit, wait=False)
    assert len(handed_in) == 2


@pytest.mark.parametrize(("installed", "is_old"), [("3.3.0", True), ("3.13.9", True), ("3.14.0", False)])
def test_a_mujoco_that_is_too_old_is_told_before_anything_runs(
    installed: str, is_old: bool, kit: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mujoco.__version__", installed)
    started: list[str] = []

    def start(*asked: object) -> str:
        started.append(str(asked[0]))
        raise NotRunning("The worker was started.")

    monkeypatch.setattr("mjgrader.checking.start_worker", start)
    with pytest.raises(NotRunning) as raised:
        check_source("x = 1\n", kit)
    wanted = kit.exercise["mujoco"]
    assert (
        f"Your MuJoCo {installed} is too old to check with: `pip install mujoco=={wanted}`" in str(raised.value)
    ) == (is_old)
    assert started == ([] if is_old else ["run"])


@pytest.mark.parametrize(("installed", "differs"), [
    ("4.0.0", "verdicts may differ, not only the last digits: what is wrong here may be right there"),
    ("3.15.1", "the last digits may differ"),
])  # fmt: skip
def test_a_remark_says_what_another_mujoco_changes(
    installed: str, differs: str, kit: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mujoco.__version__", installed)
    exercise = {**kit.exercise, "mujoco": "3.14.0"}
    [_, remark] = list_remarks(exercise)
    assert remark == (
        f"The server has MuJoCo 3.14.0, you have {installed}: {differs}. `pip install mujoco==3.14.0` makes them the "
        "same."
    )
    monkeypatch.setattr("mujoco.__version__", "3.14.0")
    assert len(list_remarks(exercise)) == 1


READERS = {
    "open": "open('exercise.json')",
    "beside": "open(__file__.replace('servo_threshold.py', 'exercise.json'))",
    "xml": "mujoco.MjModel.from_xml_path('models/pendulum_servo.xml')",
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("place", ["import", "call"])
def test_a_script_runs_in_an_empty_folder_as_on_the_server(
    reader: str, place: str, kit: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(kit.folder)
    assert Path("models/pendulum_servo.xml").exists()
    monkeypatch.setenv("PYTHONPATH", os.path.relpath(ROOT / "src"))
    lines = ["import mujoco", "from mjcourse import model_path"]
    function = ["def largest_stable_timestep(model, integrator):", f"    {READERS[reader]}", "    return 0.01"]
    if place == "import":
        function = [READERS[reader], *function[:1], *function[2:]]
    says = r"No such file or directory|Error opening file.*A script runs in an empty folder, as on the server: mjcourse"
    if place == "import":
        with pytest.raises(NotRunning, match=says):
            check_source("\n".join([*lines, *function]), kit, str(kit.script))
    else:
        check = check_source("\n".join([*lines, *function]), kit, str(kit.script))
        assert all("A script runs in an empty folder" in finding["message"] for finding in check.findings)


def test_a_script_finds_the_models_and_an_empty_folder(
    kit: Kit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("random.py").write_text("raise ValueError")
    Path("own.py").write_text("")
    source = """\
import os
import mujoco
from mjcourse import model_path
mujoco.MjModel.from_xml_path(str(model_path("pendulum_servo")))
print(os.listdir(), __file__)
def largest_stable_timestep(model, integrator):
    return 0.01
"""
    assert check_source(source, kit, "servo-threshold/servo_threshold.py").output == "[] servo_threshold.py"
    with pytest.raises(NotRunning, match="own is a file of yours"):
        check_source(f"import own\n{source}", kit)


def test_a_traceback_names_the_cells_and_shows_their_lines_once(kit: Kit) -> None:
    shown = check_source(HALF.format("np.zeros(1 / 0)"), kit).output
    assert shown.count("your cells") == shown.count("Traceback") == 2  # one for each of the two errors
    assert 'File "your cells", line 4, in largest_stable_timestep\n    return np.zeros(1 / 0)' in shown
    assert str(kit.folder) not in shown
    with pytest.raises(NotRunning) as raised:
        check_source("import numpy as np\n\nx = unknown\n", kit)
    text = str(raised.value)
    assert text.startswith('File "your cells", line 3, in <module>\n    x = unknown\n')
    assert "worker" not in text
    assert "handed in" not in text
    with pytest.raises(NotRunning, match=r'^File "your cells", line 1\n    def f\(\n'):
        check_source("def f(\n", kit)


@pytest.mark.parametrize(("reveal", "solution", "passed"), [
    ("value", "correct__as_the_author", [True, True]),
    ("value", "partial__cosine", [False, True]),
    (None, "correct__as_the_author", [None, None]),
    (None, "partial__cosine", [None, None]),
])  # fmt: skip
def test_values_are_compared_here_only_where_the_author_reveals_them(
    reveal: str | None, solution: str, passed: list[bool | None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    content = tmp_path / "content"
    shutil.copytree(VALUES, content, ignore=shutil.ignore_patterns("reference_solutions"))
    path = content / "quizzes" / "motion.json"
    quiz = json.loads(path.read_text())
    quiz["questions"] = [{**quiz["questions"][0], **({"reveal": reveal} if reveal else {})}]
    path.write_text(json.dumps(quiz))
    kit = unpack_kit(
        build_kit(load(content, passed=PASSED), "motion", "rotor-acceleration", judged=True), tmp_path / "kit"
    )
    source = (VALUES / f"reference_solutions/motion/rotor-acceleration/{solution}.py").read_text()
    trials = [{**trial, "index": index, "hidden": False} for index, trial in enumerate(kit.exercise["trials"])]
    names = ("kind", "without_integrators", "reveal")
    asked = {"trials": trials, "source": source, "folder": str(kit.folder), "file": kit.script}
    asked |= {name: kit.exercise[name] for name in names}
    run = worker.run_job(asked)
    assert run["status"] == "returned", run["why"]
    assert [finding["passed"] for finding in worker.judge_job(asked, run)] == passed


def test_a_kit_is_found_by_its_name_or_its_function_and_a_script_stays(library: Library, tmp_path: Path) -> None:
    for name in ("servo-threshold", "rk4-step", "rk4-free-joint"):
        unpack_kit(build_kit(library, "1.3-exercises", name, judged=True), tmp_path / name)
    assert find_kit(tmp_path, "rk4-step").name == "rk4-step"
    assert find_kit(tmp_path, None, "largest_stable_timestep").name == "servo-threshold"
    with pytest.raises(Sentence, match=r"rk4-free-joint, rk4-step.*question="):
        find_kit(tmp_path, None, "rk4_step")
    with pytest.raises(Sentence, match=r'g\.start\("other"\)'):
        find_kit(tmp_path, "other")
    script = tmp_path / "rk4-step" / "rk4_step.py"
    script.write_text("mine")
    (tmp_path / "rk4-step" / "mjcourse.py").write_text("damaged")
    unpack_kit(build_kit(library, "1.3-exercises", "rk4-step", judged=True), tmp_path / "rk4-step")
    assert script.read_text() == "mine"
    assert "model_path" in (tmp_path / "rk4-step" / "mjcourse.py").read_text()


@pytest.mark.parametrize(("found", "cure"), [(2, "pip install --upgrade"), (0, "get the kit again"), (None, "again")])
def test_a_kit_of_another_version_is_told(found: int | None, cure: str, tmp_path: Path) -> None:
    (tmp_path / "exercise.json").write_text(f'{{"format": {"null" if found is None else found}}}')
    with pytest.raises(Sentence, match=cure):
        read_kit(tmp_path)


@pytest.mark.parametrize("name", sorted(FIELDS))
def test_a_kit_that_lacks_a_field_is_damaged(name: str, kit: Kit) -> None:
    assert read_kit(kit.folder) == kit
    damage(kit, {key: value for key, value in kit.exercise.items() if key != name})


@pytest.mark.parametrize("broken", [{"trials": None}, {"trials": ["x"]}, {"trials": [{"id": 1}]}, {"limits": {}}])
def test_a_kit_whose_fields_lack_something_is_damaged(broken: dict[str, Any], kit: Kit) -> None:
    damage(kit, {**kit.exercise, **broken})


def damage(kit: Kit, exercise: dict[str, Any]) -> None:
    """Writes another exercise.json, and sees that it is called damaged."""
    path = kit.folder / "exercise.json"
    path.write_text(json.dumps(exercise))
    with pytest.raises(Sentence) as raised:
        read_kit(kit.folder)
    assert str(raised.value) == f"{path} is damaged: delete it, and get the kit again with g.start()."


@pytest.mark.parametrize("name", ["/etc/x", "../x", "a/../../x", "a/C:x", "a\\x", "x"])
def test_a_kit_writes_nothing_outside_of_its_folder(name: str, tmp_path: Path) -> None:
    import io
    import zipfile

    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as kit:
        kit.writestr("a/exercise.json", '{"format": 1}')
        kit.writestr(name, "x")
    with pytest.raises(Sentence, match="odd name"):
        unpack_kit(packed.getvalue(), tmp_path / "kit")
    assert not list(tmp_path.rglob("*"))


def test_what_is_no_kit_is_told(tmp_path: Path) -> None:
    with pytest.raises(Sentence, match="sent no kit"):
        unpack_kit(b"<html>", tmp_path)
