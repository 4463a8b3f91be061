"""Skipping: what is called proven changes no bit; a whole run writes its files and is not repeated."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from grader.errors import Unprocessable
from grader.numerics.version import INSTALLED
from grader.studies.bench import run
from grader.studies.bench.physics import skip as skipping
from grader.studies.bench.physics.skip import SCENES, Run, find_largest_difference, is_proven
from grader.studies.bench.scenes import load_scene
from grader.studies.bench.timing import LEAST, MOST, measure_pairs


@pytest.mark.parametrize("name", SCENES)
def test_all_proven_flags_together_change_no_bit(name: str) -> None:
    scene = load_scene(name)
    bits = 0
    for need in scene.needs:
        bits |= need.flag if is_proven(need) else 0
    assert bits
    assert find_largest_difference(scene, bits) == 0


def test_islands_are_kept_for_a_reason() -> None:
    scene = load_scene("two_bodies")
    islands = next(need for need in scene.needs if need.part == "islands")
    assert not is_proven(islands)
    assert 0 < find_largest_difference(scene, islands.flag) < 1e-6


def test_chunks_are_steps() -> None:
    scene = load_scene("cube")
    one, many = Run(scene, chunk=1), Run(scene, chunk=50)
    one()
    many()
    assert one.data.qpos.tobytes() == many.data.qpos.tobytes()


def test_a_ratio_is_a_ratio() -> None:
    def turns(count: int) -> int:
        return sum(index * index for index in range(count))

    ratio = measure_pairs(lambda: turns(30_000), lambda: turns(10_000), budget_s=0.2)
    assert 2 < ratio.ratio < 4.5
    assert ratio.interval[0] <= ratio.ratio <= ratio.interval[1]
    assert ratio.ratio == np.median(ratio.pairs)
    assert LEAST <= len(ratio.pairs) <= MOST


@pytest.fixture
def one_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(skipping, "SCENES", ("servo",))
    monkeypatch.setattr(skipping, "REPEATED", ("swimmer", "reacher"))


@pytest.mark.slow
@pytest.mark.usefixtures("one_scene")
def test_a_run_writes_what_it_promises_and_is_not_repeated(tmp_path: Path) -> None:
    run("skip", tmp_path, quick=True)
    lines = (tmp_path / "skip.jsonl").read_text()
    summary = json.loads((tmp_path / "skip.json").read_text())
    assert summary["machine"]["processor"]
    assert summary["versions"]["mujoco"] == INSTALLED
    assert summary["broken_proofs"] == []
    flags = sum(1 for need in load_scene("servo").needs if need.flag)
    assert summary["measurements"] == len(lines.strip().splitlines()) == flags + 1 + len(skipping.REPEATED)
    assert {name: (one["may_act"], one["bitwise"]) for name, one in summary["repeats"].items()} == {
        "swimmer": (True, True),
        "reacher": (True, True),
    }
    assert all(repeat["steps"] > 0 for repeat in summary["repeats"].values())
    assert (tmp_path / "skip.csv").read_text().count("servo") > flags
    for picture in ("skip.svg", "skip.png"):
        assert (tmp_path / picture).stat().st_size > 10_000
    run("skip", tmp_path, quick=True)
    assert (tmp_path / "skip.jsonl").read_text() == lines
    assert json.loads((tmp_path / "skip.json").read_text())["scenes"] == summary["scenes"]


WITHOUT_MATPLOTLIB = """
import sys
from grader.commands.main import main
sys.modules["matplotlib"] = None
sys.argv = ["grader", "bench", "skip"]
main()
"""


def test_without_matplotlib_the_command_says_how_to_get_it() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT_MATPLOTLIB], capture_output=True, text=True, check=False)
    hint = "the pictures need matplotlib: run make install, or pip install 'mujoco-grader[bench]'\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", hint)


def test_an_unknown_benchmark_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Unprocessable, match="no benchmark"):
        run("speed", tmp_path, quick=True)
