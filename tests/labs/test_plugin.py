"""A kind of lab of another package: it passes every test that our own kinds pass, and is refused when broken."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from grader.errors import GraderError
from grader.labs.registry import GROUP, load_lab_kind

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
GRADER = Path(sys.executable).parent / "grader"

BROKEN = {
    "NoFiles": ("put a template with its parts at", "put an ES module that draws it at"),
    "NoParts": (
        "define the macro skeleton(base, lab)",
        "define the macro still(lab)",
        "an element with data-message",
        "export a function `open(box, page)`",
        "import 'https://example.org/draw.js' in",
    ),
    "NoNames": ("declare `kind: Literal[...]` in Unnamed",),
    "NoAddress": ("rename '../Lab'",),
    "NoLab": ("set `lab` to a model that derives from grader.labs.Lab",),
    "NoSettings": ("set `settings` to a model that derives from grader.labs.LabSettings",),
    "NoKind": ("derive it from grader.labs.LabKind",),
    "Raises": ("ZeroDivisionError",),
    "Missing": ("AttributeError",),
}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the plug-in, as pip installs it, without a network."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("target")
    shutil.copytree(HERE / "plugin", source, dirs_exist_ok=True)
    options = ["--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--disable-pip-version-check"]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, "--target", target, source], check=True)
    yield target


def environment(*folders: Path) -> dict[str, str]:
    path = os.pathsep.join([*map(str, folders), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path}


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.browser
def test_a_kind_of_another_package_passes_every_test_of_ours_and_its_own(installed: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:randomly"]
    tests = [str(HERE / "test_every_kind.py"), str(HERE / "plugin/checks.py")]
    ran = subprocess.run(
        [*command, *tests, "-k", "sweep or test_every_kind_has_an_example"],
        capture_output=True, text=True, check=False, env=environment(installed), cwd=ROOT,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "test_the_example_passes_the_check[sweep] PASSED" in ran.stdout
    assert "test_it_is_drawn_in_a_browser_and_nothing_complains[sweep-360] PASSED" in ran.stdout
    assert "checks.py::test_sweep_" in ran.stdout


@pytest.mark.process
def test_two_packages_that_claim_one_name_are_refused(installed: Path, tmp_path: Path) -> None:
    notes = tmp_path / "another_package-1.0.dist-info"
    notes.mkdir()
    (notes / "METADATA").write_text("Metadata-Version: 2.1\nName: another-package\nVersion: 1.0\n")
    (notes / "entry_points.txt").write_text(f"[{GROUP}]\nagain = sweep:Sweep\n")
    (tmp_path / "quizzes").mkdir()
    (tmp_path / "quizzes/q.json").write_text('{"id": "q", "title": "Q", "labs": [{"kind": "x", "id": "x"}]}')
    checked = subprocess.run(
        [GRADER, "check", tmp_path], capture_output=True, text=True, check=False, env=environment(installed, tmp_path)
    )
    assert checked.returncode != 0
    assert "two installed kinds of lab are called 'sweep'" in checked.stdout + checked.stderr


@pytest.mark.parametrize("name", BROKEN)
def test_a_kind_that_is_not_whole_is_refused_before_it_serves(name: str) -> None:
    module = "labs.broken.bare" if name == "NoFiles" else "labs.broken.kinds.broken"
    with pytest.raises(GraderError) as raised:
        load_lab_kind(EntryPoint(name.lower(), f"{module}:{name}", GROUP))
    assert f"the lab kind {name.lower()!r} ({module}:{name})" in str(raised.value)
    for lack in BROKEN[name]:
        assert lack in str(raised.value)
