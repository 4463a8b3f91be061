"""The page on MuJoCo 4.0.0 says what was measured, and the installed version measures it again."""

import json
from pathlib import Path
from typing import Any

import pytest

from grader.numerics.integrators import BY_NAME
from grader.numerics.version import INSTALLED
from grader.studies.bench.physics.versions import HORIZON_S, SCENES, TIMESTEPS_S, main, measure_errors
from grader.studies.bench.scenes import describe_scene

ROOT = Path(__file__).parents[2]
RESULTS = json.loads((ROOT / "docs/measured/versions.json").read_text())
PAGE = (ROOT / "docs/mujoco-4.md").read_text(encoding="utf-8")
VERSIONS: dict[str, Any] = RESULTS["versions"]
OLD, NEW = "3.14.0", "4.0.0"


def row(scene: str, version: str) -> str:
    row_values = VERSIONS[version][scene]
    errors = " | ".join(f"{error:.1e}" for error in row_values["errors"])
    return f"| {describe_scene(scene)} | {version} | {errors} | {row_values['order']:.2f} |"


def test_the_table_is_that_of_the_results() -> None:
    assert tuple(RESULTS["timesteps_s"]) == TIMESTEPS_S
    head = f"| scene | MuJoCo | {' | '.join(f'{1000 * h:g} ms' for h in TIMESTEPS_S)} | order |"
    rows = "\n".join(row(scene, version) for scene in SCENES for version in (OLD, NEW))
    assert f"within {HORIZON_S} s, at equal timesteps:\n\n{head}\n|---|---|---|---|---|---|---|\n{rows}\n" in PAGE


def test_the_sentence_is_that_of_the_results() -> None:
    free = {version: VERSIONS[version]["spinning_body"] for version in (OLD, NEW)}
    orders = [round(free[version]["order"]) for version in (NEW, OLD)]
    at = TIMESTEPS_S.index(0.002)
    ratio = free[OLD]["errors"][at] / free[NEW]["errors"][at]
    assert f"On the free body RK4 has order {orders[0]} in place of {orders[1]}" in PAGE
    assert f"at 2 ms an error {ratio:.0e} times smaller" in PAGE
    assert "on hinges nothing changes" in PAGE
    assert VERSIONS[OLD]["double_pendulum"] == VERSIONS[NEW]["double_pendulum"]


@pytest.mark.parametrize("scene", SCENES)
def test_the_installed_version_measures_the_same(scene: str) -> None:
    """The error at the smallest timestep comes within ten times of that of the reference."""
    measured, kept = measure_errors(scene), VERSIONS[INSTALLED][scene]
    assert measured["errors"][:-1] == pytest.approx(kept["errors"][:-1], rel=0.01)
    assert measured["order"] == pytest.approx(kept["order"], abs=0.02)


def test_a_version_writes_its_own_row_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grader.studies.bench.physics.versions.measure_errors", lambda name: name)
    monkeypatch.setattr("grader.studies.bench.physics.versions.INSTALLED", "5.0.0")
    monkeypatch.setattr("grader.studies.bench.physics.versions.list_names", lambda: ["servo"])
    monkeypatch.setattr("grader.studies.bench.physics.versions.compute_digest", lambda name, kind: name + kind.name)
    path = tmp_path / "versions.json"
    path.write_text(json.dumps(RESULTS))
    main(path)
    versions = json.loads(path.read_text())["versions"]
    digests = {"servo": {kind: f"servo{kind}" for kind in BY_NAME}}
    assert versions == {**VERSIONS, "5.0.0": {scene: scene for scene in SCENES} | {"digests": digests}}
