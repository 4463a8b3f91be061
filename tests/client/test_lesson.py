"""The client as learners use it: its wheel alone in an environment, in a terminal and a notebook, at a real server."""

import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from grader.pack.kit import list_texts
from grader.settings import Settings
from support.bare_environments import list_needed, make_environment
from support.content import load_content
from support.sites import ROOT, Site, open_site
from support.tokens import issue_token

pytestmark = [pytest.mark.jail, pytest.mark.process, pytest.mark.slow]

API = "/api/v1"
SOLUTION = ROOT / "reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py"
WHEEL_BYTES_MAX = 64 * 1024


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    arguments: list[str | Path] = [
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--wheel-dir",
        folder,
    ]
    pip(*arguments, ROOT / "client")
    (built,) = folder.glob("*.whl")
    return built


def pip(*arguments: str | Path) -> None:
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with the wheel, and with what it requires."""
    made = make_environment(tmp_path_factory.mktemp("learner") / "env", "mujoco", "numpy", "httpx")
    pip("--python", made, "install", "--quiet", "--no-deps", "--no-index", wheel)
    return made


@pytest.fixture(scope="module")
def lesson(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_site(Settings(data=tmp_path_factory.mktemp("lesson"), workers=1)) as site:
        yield site


def test_the_wheel_is_small_pure_and_names_its_needs(wheel: Path) -> None:
    assert wheel.name.endswith("-py3-none-any.whl")
    assert wheel.stat().st_size < WHEEL_BYTES_MAX
    with zipfile.ZipFile(wheel) as packed:
        names = packed.namelist()
        metadata = packed.read(next(name for name in names if name.endswith("METADATA"))).decode()
        assert {name.partition("/")[0] for name in names} == {"mjgrader", "mujoco_grader_client-1.0.0.dist-info"}
        assert "from grader" not in "".join(packed.read(name).decode() for name in names if name.endswith(".py"))
    needs = [line.removeprefix("Requires-Dist: ") for line in metadata.splitlines() if line.startswith("Requires-Dist")]
    assert needs == ["mujoco>=3.14", "numpy>=2", "httpx>=0.27"]
    assert "Requires-Python: >=3.10" in metadata


def test_what_it_needs_does_not_bring_the_server_along() -> None:
    needed = list_needed("mujoco", "numpy", "httpx")
    assert not needed & {"scipy", "pydantic", "fastapi", "sqlalchemy", "IPython", "ipython"}


class Terminal:
    """`mjgrade` in the learner's environment and folder."""

    def __init__(self, python: Path, folder: Path, token: str) -> None:
        self.folder, self.command = folder, python.with_name("mjgrade")
        kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        self.environment = {**kept, "MJGRADER_CONFIG": str(folder / "config"), "MJGRADER_TOKEN": token}

    def run(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [self.command, *arguments],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )


def test_a_terminal_checks_hands_in_and_shows_the_verdict(lesson: Site, python: Path, tmp_path: Path) -> None:
    token = issue_token(lesson.settings, "terry", "student", None)
    terminal = Terminal(python, tmp_path, token)
    assert terminal.run().stdout.startswith("usage: mjgrade")
    unsigned = terminal.run("status")
    assert (unsigned.returncode, unsigned.stderr.partition(" http")[0]) == (2, "Sign in first: mjgrade sign-in")
    signed_in = terminal.run("sign-in", lesson.origin, "--token")
    assert signed_in.returncode == 0, signed_in.stderr
    assert token not in signed_in.stdout + signed_in.stderr
    assert (
        "There is no exercise 'nonsense'. The course has: servo-threshold" in terminal.run("start", "nonsense").stderr
    )
    started = terminal.run("start", "servo-threshold")
    script = Path(started.stdout.strip())
    assert (tmp_path / script).read_text() == (ROOT / "quizzes/starters/servo_threshold.py").read_text()

    starter = terminal.run("check", script)
    assert starter.returncode == 1, starter.stderr
    assert starter.stdout.count("wrong  kp = 2000") == 3
    (tmp_path / script).write_text("def largest_stable_timestep(model, integrator)\n    return None\n")
    broken = terminal.run("submit", script)
    assert broken.returncode == 2
    assert "SyntaxError in line 1" in broken.stderr
    assert "no attempt is used" in broken.stderr
    (tmp_path / script).write_text(SOLUTION.read_text())
    assert "right  kp = 2000, kv = 5, Euler: Certified" in terminal.run("check", script).stdout
    again = terminal.run("start", "servo-threshold")
    assert (again.returncode, again.stderr) == (0, "Your servo_threshold.py was there, and was kept.\n")
    assert (tmp_path / script).read_text() == SOLUTION.read_text()
    done = terminal.run("submit", script)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("correct: 3 of 3 points")
    assert "Attempt 1 at servo-threshold." in done.stdout
    assert terminal.run("status", script).stdout == terminal.run("result").stdout == done.stdout
    assert "3 of 3" in terminal.run("progress").stdout
    stepping = tmp_path / terminal.run("start", "rk4-step").stdout.strip()
    stepping.write_text("import mujoco\ndef rk4_step(model, data):\n    mujoco.mj_step(model, data)\n")
    forbidden = terminal.run("check", stepping)
    assert forbidden.returncode == 2
    assert "let MuJoCo take the step (mj_step), which this exercise does not allow" in forbidden.stderr
    mistyped = Terminal(python, tmp_path, "grt_0123456789abcdef_nonsense-nonsense").run(
        "sign-in", lesson.origin, "--token"
    )
    assert (mistyped.returncode, "copy it again" in mistyped.stderr) == (2, True)


KERNEL_ONLY = """\
exec("found_by_hand = 0.02")
def largest_stable_timestep(model, integrator):
    return found_by_hand
"""


def make_notebook(origin: str) -> Any:
    """Start, wrong, check, kernel alone, right, submit; then the notebook of a kit without its other files."""
    solution = SOLUTION.read_text()
    imports, _, rest = solution.partition("\ndef ")
    cells = [
        f"import os\nimport mjgrader as g\ng.sign_in({origin!r}, token=os.environ['TOKEN'], remember=False)",
        "g.start('servo-threshold')",
        (ROOT / "quizzes/starters/servo_threshold.py").read_text().replace('__name__ == "__main__"', "False"),
        "g.check(largest_stable_timestep)",
        KERNEL_ONLY,
        "g.submit(largest_stable_timestep)",
        imports,
        f"def {rest}",
        "g.submit(largest_stable_timestep)",
        "g.progress()",
        f"%%check servo-threshold\n{solution}",
        "g.check(undefined_name)",
        "exec('def largest_stable_timestep(model, integrator): return 1.0')\ng.submit(largest_stable_timestep)",
        "with open('mine.py', 'w') as file:\n    file.write('def largest_stable_timestep(*two): return 1.0')",
        "from mine import largest_stable_timestep",
        "g.submit(largest_stable_timestep)",
        "import sys\nos.makedirs('alone')\nos.chdir('alone')\nsys.path.insert(0, '')\nsys.modules.pop('mjcourse')",
    ]
    alone: Any = nbformat.reads(  # type: ignore[no-untyped-call]
        list_texts(load_content(), "1.3-exercises", "rk4-step", judged=True)["rk4-step.ipynb"], as_version=4
    )
    cells += [cell.source for cell in alone.cells if cell.cell_type == "code"]
    notebook: Any = nbformat.v4.new_notebook()  # type: ignore[no-untyped-call]
    notebook.cells = [nbformat.v4.new_code_cell(cell) for cell in cells]  # type: ignore[no-untyped-call]
    return notebook


def read_html(cell: Any) -> str:
    return "".join(output.data.get("text/html", "") for output in cell.outputs if "data" in output)


def read_error(cell: Any) -> str:
    return "".join(f"{output.ename}: {output.evalue}" for output in cell.outputs if output.output_type == "error")


def test_a_notebook_goes_from_the_starter_to_the_verdict(
    lesson: Site, python: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lib").mkdir()
    (package,) = python.parents[1].glob("lib/python*/site-packages/mjgrader")
    (tmp_path / "lib" / "mjgrader").symlink_to(package)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "lib"))
    monkeypatch.setenv("TOKEN", issue_token(lesson.settings, "nora", "student", None))
    monkeypatch.setenv("MJGRADER_CONFIG", str(tmp_path / "config"))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    notebook = make_notebook(lesson.origin)
    NotebookClient(
        notebook, timeout=300, allow_errors=True, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    ).execute()
    cells = notebook.cells
    signed_in, started, _, wrong, _, kernel_only, _, _, right, progress, magic, undefined, other, _, _, mine, *alone = (
        cells
    )
    whole = json.dumps(notebook)
    assert os.environ["TOKEN"] not in whole

    assert [read_error(cell) for cell in cells if cell not in (kernel_only, undefined, other, mine)] == [""] * 17
    assert (tmp_path / "servo-threshold" / "mjcourse.py").exists()
    assert "The kit of The largest stable timestep" in json.dumps(started.outputs)
    assert "Signed in" in json.dumps(signed_in.outputs)
    assert read_html(wrong).count(">wrong<") == 3
    assert "The server decides" in read_html(wrong)
    assert read_error(kernel_only).startswith("NotRunning: ")
    assert "name 'found_by_hand' is not defined" in read_error(kernel_only)
    assert "only in your kernel" in read_error(kernel_only)
    assert "no attempt is used" in read_error(kernel_only)

    verdict = read_html(right)
    assert "correct: 3 of 3 points" in verdict
    assert verdict.count(">right<") == 21
    assert "<svg" in verdict
    assert "Attempt 1 at servo-threshold." in verdict
    assert "found_by_hand" not in verdict
    assert "<td>3 of 3</td>" in read_html(progress)
    assert read_html(magic).count(">right<") == 3
    assert "NameError" in read_error(undefined)
    assert "in your kernel is not the one in your cells" in read_error(other)
    assert "ModuleNotFoundError in line 1: mine is a file of yours: paste it into a cell" in read_error(mine)
    _, _, script, checked, _ = alone
    assert (tmp_path / "alone" / "models" / "double_pendulum.xml").exists()
    assert "difference from MuJoCo's RK4" in json.dumps(script.outputs)
    assert read_html(checked).count(">wrong<") == 2
    taken = lesson.client("nora").get(f"{API}/submissions").json()["items"]
    assert [one["attempt"] for one in taken] == [1]
