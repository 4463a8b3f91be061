"""A packed exercise, set up and run as Gradescope's harness would, with its paths below a temporary root."""

import base64
import csv
import hashlib
import io
import json
import os
import re
import shutil
import subprocess
import sysconfig
import zipfile
from collections.abc import Callable, Iterator
from importlib.metadata import distribution
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import jsonschema_rs
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from grader.errors import Conflict, NotFound, Unprocessable
from grader.library import load
from grader.pack import pack_gradescope
from grader.pack.gradescope import build_content, build_wheels
from grader.pack.wheel import list_constraints, write_wheel
from grader.questions.kinds.script import ScriptQuestion
from support.content import PASSED, load_content

ROOT = Path(__file__).parents[2]
SOLUTIONS = ROOT / "reference_solutions/1.3-exercises/servo-threshold"
SCHEMA = jsonschema_rs.validator_for(json.loads((ROOT / "tests/reports/gradescope.schema.json").read_text()))
EXERCISE = ("1.3-exercises", "servo-threshold")
FAKE_APT = '#!/bin/sh\necho "$@" >> "$CALLS"\n'
MASKED = """mount -t tmpfs -o ro tmpfs /proc/irq && exec unshare --user --map-user=1000 --map-group=1000 "$0" """
NO_NAMESPACES = ("unshare", "--user", "--map-root-user", "--mount", "sh", "-c", MASKED)
"""A part of /proc is covered up, as Docker does; so the kernel lets nobody mount another one."""

Result = dict[str, Any] | None
Grade = Callable[..., tuple[int, str, Result]]


def pack(out: Path, question: tuple[str, str] = EXERCISE, **options: Any) -> Path:
    return pack_gradescope(load_content(question[0]), *question, out, **options)


@pytest.fixture(scope="module")
def autograder() -> Iterator[Path]:
    """The /autograder of an image, which everybody can enter; pytest's own folders are closed to others."""
    with TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        yield set_up(Path(folder, "autograder"))


def set_up(root: Path) -> Path:
    """Unpacks the zip file, and sets it up without a network."""
    root.mkdir()
    with zipfile.ZipFile(pack(root.parent / f"{root.name}.zip")) as packed:
        packed.extractall(root / "source")
    tools = root.parent / f"{root.name}-tools"
    tools.mkdir()
    (tools / "apt-get").write_text(FAKE_APT)
    (tools / "apt-get").chmod(0o755)
    environment = {
        "PATH": f"{tools}:{os.environ['PATH']}", "CALLS": str(tools / "calls"), "AUTOGRADER_ROOT": str(root),
        "PIP_NO_INDEX": "1", "PIP_NO_DEPS": "1", "PIP_NO_COMPILE": "1", "HOME": str(root),
    }  # fmt: skip
    done = subprocess.run(
        ["bash", root / "source/setup.sh"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "bubblewrap" in (tools / "calls").read_text()
    [packages] = root.glob("grader/lib/python3*/site-packages")
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    shutil.copy(root / "source/run_autograder", root / "run_autograder")
    (root / "run_autograder").chmod(0o755)
    return root


@pytest.fixture
def grade(autograder: Path) -> Grade:
    """Grades files as the harness does. Returns exit code, output and results.json."""

    def grade_files(*before: str, allow_t2: bool = False, **files: bytes) -> tuple[int, str, Result]:
        for folder in ("submission", "results"):
            shutil.rmtree(autograder / folder, ignore_errors=True)
            (autograder / folder).mkdir()
        for name, text in files.items():
            (autograder / "submission" / (name if "." in name else f"{name}.py")).write_bytes(text)
        said = (autograder / "source/exercise.sh").read_text().splitlines()
        said[-1] = f"GRADER_ALLOW_T2={str(allow_t2).lower()}"
        (autograder / "source/exercise.sh").write_text("\n".join(said) + "\n")
        environment = {"PATH": os.environ["PATH"], "AUTOGRADER_ROOT": str(autograder)}
        command = [*before, str(autograder / "run_autograder")]
        done = subprocess.run(command, cwd=autograder, env=environment, capture_output=True, text=True, check=False)
        written = autograder / "results/results.json"
        assert not [path for path in (autograder / "results").iterdir() if path != written]
        return done.returncode, done.stdout, json.loads(written.read_text()) if written.exists() else None

    return grade_files


@pytest.mark.jail
def test_a_packed_exercise_grades_scripts_with_the_same_hidden_cases_each_time(grade: Grade) -> None:
    seeds = []
    for name, score in (("correct__spectral_radius", 3.0), ("partial__own_gains", 1.0), ("partial__own_gains", 1.0)):
        code, _, results = grade(answer=(SOLUTIONS / f"{name}.py").read_bytes())
        assert code == 0 and results is not None
        SCHEMA.validate(results)
        assert results["score"] == score
        seeds.append(results["extra_data"]["seed"])
    assert results is not None
    assert results["output"].startswith("The function gave the same answer for every model")
    assert seeds[0] != seeds[1] == seeds[2]


@pytest.mark.jail
def test_a_notebook_is_graded_by_its_code_cells(grade: Grade) -> None:
    lines = (SOLUTIONS / "correct__spectral_radius.py").read_text().splitlines(keepends=True)
    middle = next(number for number, line in enumerate(lines) if line.startswith("def "))
    sources = (["%matplotlib inline\n", *lines[:middle]], "!pip list", lines[middle:], "%%bash\nexit 1")
    cells: list[dict[str, Any]] = [
        {"cell_type": "code", "metadata": {}, "source": source, "outputs": []} for source in sources
    ]
    cells.insert(1, {"cell_type": "markdown", "metadata": {}, "source": "# My answer"})
    notebook = json.dumps({"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}).encode()
    code, output, results = grade(**{"answer.ipynb": notebook})
    assert code == 0 and results is not None, output
    assert results["score"] == 3.0
    for files in ({"answer.ipynb": b"{}"}, {"answer.ipynb": notebook, "other": b""}):
        code, output, results = grade(**files)
        assert code == 0 and results is not None, output
        assert results["score"] == 0
    assert results["output"].startswith("Hand in one file that ends in .py or .ipynb; this submission has 2.")


SPY = """
for path in {paths}:
    try:
        print("read", open(path, "rb").read())
    except OSError as error:
        print("refused", error.errno)
largest_stable_timestep = lambda model, integrator: None
"""


@pytest.mark.jail
def test_a_script_cannot_read_the_package(grade: Grade, autograder: Path) -> None:
    secrets = ("source/key", "source/content/quizzes/1.3-exercises.json", "source/exercise.sh")
    _, _, results = grade(spy=SPY.format(paths=[str(autograder / name) for name in secrets]).encode())
    assert results is not None
    [printed] = [test["output"] for test in results["tests"] if test["name"] == "Output of the script"]
    assert printed.count("refused") == len(secrets)
    assert "read" not in printed


def test_not_one_script_is_told_what_to_hand_in(grade: Grade, autograder: Path) -> None:
    for files in ({}, {"a": b"", "b": b""}):
        code, _, results = grade(**files)
        assert code == 0 and results is not None
        SCHEMA.validate(results)
        assert (results["score"], f"this submission has {len(files)}" in results["output"]) == (0, True)


def test_a_link_is_no_script(grade: Grade, autograder: Path) -> None:
    shutil.rmtree(autograder / "submission", ignore_errors=True)
    grade()
    (autograder / "submission/key.py").symlink_to(autograder / "source/key")
    environment = {"PATH": os.environ["PATH"], "AUTOGRADER_ROOT": str(autograder)}
    subprocess.run([autograder / "run_autograder"], env=environment, check=True)
    assert "this submission has 0" in (autograder / "results/results.json").read_text()


def test_a_script_that_cannot_be_read_gets_a_reason(grade: Grade) -> None:
    for files, why in (
        ({"answer": b"# \xe9\n"}, "UTF-8"),
        ({"answer.ipynb": b'{"cells": ['}, "is no notebook of format 4: save it again with Jupyter"),
        ({"answer": b"#" * 300_000}, "256 KB"),
    ):
        code, _, results = grade(**files)
        assert code == 0 and results is not None
        SCHEMA.validate(results)
        assert why in results["output"]
        assert results["score"] == 0


@pytest.mark.parametrize("damaged", ["key", "content/models/pendulum_servo.xml", "content/quizzes/1.3-exercises.json"])
def test_a_package_that_is_damaged_takes_no_points(damaged: str, grade: Grade, autograder: Path) -> None:
    path = autograder / "source" / damaged
    held = path.read_bytes()
    try:
        path.write_text("{") if path.suffix == ".json" else path.unlink()
        code, printed, results = grade(answer=(SOLUTIONS / "correct__spectral_radius.py").read_bytes())
    finally:
        path.write_bytes(held)
    assert (code, results) == (2, None)
    assert path.name in printed


@pytest.mark.jail
def test_a_container_without_namespaces_is_refused_or_gets_t2_where_that_was_allowed(grade: Grade) -> None:
    script = (SOLUTIONS / "correct__spectral_radius.py").read_bytes()
    code, printed, results = grade(*NO_NAMESPACES, answer=script)
    assert (code, results) == (3, None)
    assert "GRADER_ALLOW_T2=true" in printed
    code, _, results = grade(*NO_NAMESPACES, allow_t2=True, answer=script)
    assert code == 0 and results is not None
    assert results["score"] == 3.0


# -- the package -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_package_holds_what_grading_needs_and_nothing_more(tmp_path: Path) -> None:
    folder = pack(tmp_path / "packed")
    packed = load(folder / "content", passed=PASSED)
    assert {quiz.id: [q.id for q in quiz.questions] for quiz in packed.quizzes.values()} == {EXERCISE[0]: [EXERCISE[1]]}
    assert packed.models == load_content().models
    [question] = packed.quiz(EXERCISE[0]).questions
    whole = load_content().question(*EXERCISE)
    assert (question.points, getattr(question, "check", None)) == (whole.points, getattr(whole, "check", 1))
    assert question.explain is None and whole.explain is not None
    names = [path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()]
    assert not [name for name in names if "reference" in name or "starter" in name]
    with zipfile.ZipFile(next(folder.glob("wheels/*.whl"))) as wheel:
        assert not [name for name in wheel.namelist() if "material" in name or "__pycache__" in name]
    for name in ("setup.sh", "run_autograder", "exercise.sh", "constraints.txt"):
        assert "://" not in (folder / name).read_text()


@pytest.mark.slow
def test_the_page_says_that_the_model_of_the_author_is_packed() -> None:
    library = load_content()
    asked = library.question("4.1-exercises", "arm")
    assert isinstance(asked, ScriptQuestion)
    packed = {file.path: file.mode for file in build_content(library, "4.1-exercises", asked)}
    assert packed["content/quizzes/solutions/arm.xml"] == 0o600  # no script can read it
    assert not any("cart.xml" in path and "solutions" in path for path in packed)
    page = " ".join((ROOT / "docs/classroom.md").read_text(encoding="utf-8").split())
    assert "for an exercise of the kind `model` the author's model, its `reference`" in page


def test_what_is_secret_is_its_owners_alone_and_new_in_each_package(tmp_path: Path) -> None:
    one, other = pack(tmp_path / "one"), pack(tmp_path / "other")
    assert (one / "key").read_bytes() != (other / "key").read_bytes()
    for name in ("key", "content/quizzes/1.3-exercises.json"):
        assert (one / name).stat().st_mode & 0o777 == 0o600
    with zipfile.ZipFile(pack(tmp_path / "one.zip")) as packed:
        modes = {info.filename: info.external_attr >> 16 & 0o777 for info in packed.infolist()}
    assert {modes["setup.sh"], modes["run_autograder"]} == {0o755}
    assert modes["key"] == 0o600
    assert (tmp_path / "one.zip").stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("question", ["rk4-step", "rk4-free-joint"])
def test_every_exercise_of_the_lesson_can_be_packed(question: str, tmp_path: Path) -> None:
    folder = pack(tmp_path / "packed", ("1.3-exercises", question))
    assert load(folder / "content", passed=PASSED).question("1.3-exercises", question).id == question


def test_what_cannot_be_packed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Unprocessable, match="is no exercise"):
        pack(tmp_path / "a", ("1.3-check", "q1"))
    with pytest.raises(NotFound):
        pack(tmp_path / "a", ("1.3-exercises", "none"))
    with pytest.raises(Conflict, match="is there already"):
        pack(tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("script", ["setup.sh", "run_autograder"])
def test_the_scripts_are_bash(script: str) -> None:
    subprocess.run(["bash", "-n", ROOT / "src/grader/pack/scripts" / script], check=True)


# -- wheels ------------------------------------------------------------------------------------------------------------


def test_the_wheel_records_every_file_with_its_digest(tmp_path: Path) -> None:
    path = write_wheel(distribution("mujoco-grader"), "grader", tmp_path)
    with zipfile.ZipFile(path) as wheel:
        [name] = [one for one in wheel.namelist() if one.endswith("RECORD")]
        record = {row[0]: row[1:] for row in csv.reader(io.StringIO(wheel.read(name).decode()))}
        assert record.keys() == {*wheel.namelist()}
        for member, (digest, size) in record.items():
            if member != name:
                data = wheel.read(member)
                expected = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
                assert (digest, int(size)) == (f"sha256={expected}", len(data))
        shipped = {path.relative_to(ROOT / "src").as_posix() for path in (ROOT / "src/grader").rglob("*.py")}
        assert shipped <= {*wheel.namelist()}
    (tmp_path / "again").mkdir()
    again = write_wheel(distribution("mujoco-grader"), "grader", tmp_path / "again")
    assert again.read_bytes() == path.read_bytes()


def test_a_kind_of_another_package_comes_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notes = tmp_path / "grader_exact_text-1.0.dist-info"
    notes.mkdir()
    (notes / "METADATA").write_text("Metadata-Version: 2.1\nName: grader-exact-text\nVersion: 1.0\n")
    (notes / "entry_points.txt").write_text("[grader.exercise_kinds]\nexact-text = exact_text:ExactText\n")
    shutil.copy(ROOT / "tests/exercises/plugin/exact_text.py", tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    packed = {member.path: member.data for member in build_wheels("exact-text")}
    with zipfile.ZipFile(io.BytesIO(packed["wheels/grader_exact_text-1.0-py3-none-any.whl"])) as wheel:
        assert "exact_text.py" in wheel.namelist()
    assert len([name for name in packed if name.endswith(".whl")]) == 2
    assert len([member for member in build_wheels("threshold") if member.path.endswith(".whl")]) == 1


def test_the_wheel_pins_the_versions_that_are_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With another MuJoCo than the pinned one, as `make test MUJOCO=` has it, wheel and constraints still agree."""
    notes = tmp_path / "mujoco-4.5.6.dist-info"
    notes.mkdir()
    (notes / "METADATA").write_text("Metadata-Version: 2.1\nName: mujoco\nVersion: 4.5.6\n")
    monkeypatch.syspath_prepend(tmp_path)
    packed = {member.path: member.data.decode(errors="ignore") for member in build_wheels("threshold")}
    with zipfile.ZipFile(write_wheel(distribution("mujoco-grader"), "grader", tmp_path)) as wheel:
        [name] = [one for one in wheel.namelist() if one.endswith("/METADATA")]
        metadata = wheel.read(name).decode()
    assert "Requires-Dist: mujoco==4.5.6\n" in metadata
    required = [Requirement(line) for line in re.findall(r"^Requires-Dist: (.*)$", metadata, re.MULTILINE)]
    pairs = (line.split("==") for line in packed["constraints.txt"].splitlines())
    versions = {canonicalize_name(name): version for name, version in pairs}
    assert versions[canonicalize_name("mujoco")] == "4.5.6"
    for one in required:
        assert one.marker is not None or versions[canonicalize_name(one.name)] in one.specifier


def test_the_versions_are_those_that_are_installed_here_and_needed() -> None:
    lines = list_constraints(["mujoco-grader"]).splitlines()
    names = {line.partition("==")[0].lower().replace("_", "-") for line in lines}
    assert {"mujoco", "numpy", "psycopg-binary", "typer"} <= names
    assert not {"pytest", "mypy", "mujoco-grader"} & names
    assert f"mujoco=={distribution('mujoco').version}" in lines
