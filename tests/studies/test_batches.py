"""The parts of the study of MJX that need no MJX; its results are data, rendered by the tests of the page."""

import numpy as np
import pytest

from grader.errors import Unprocessable
from grader.studies.bench.physics import batches
from grader.studies.bench.physics.skip import STEPS, TIMESTEP_S
from grader.studies.bench.scenes import load_scene


def test_both_sides_of_a_timed_pair_take_the_same_steps() -> None:
    """The model that MJX is given is the scene's, whose timestep is that of the yardstick."""
    assert batches.STEPS == STEPS
    for name in batches.SCENES:
        assert load_scene(name).model.opt.timestep == TIMESTEP_S


def test_every_timestep_divides_the_sampling_interval() -> None:
    steps = np.array([batches.SAMPLE_S / h for h in batches.TIMESTEPS_S])
    assert steps == pytest.approx(np.round(steps), abs=1e-9)


def test_a_summary_keeps_errors_and_ratios_by_scene_precision_and_size() -> None:
    timed = {"ratio": 2.0, "interval": [1.9, 2.1], "pairs": [2.0]}
    summary = batches.summarise({
        batches.Precision("spinning_body", 32): {"errors": [1e-5], "mujoco": [1e-6]},
        batches.Batch("spinning_body", 32, 128): timed,
    })  # fmt: skip
    assert summary["scenes"]["spinning_body"]["32"] == {
        "errors": [1e-5],
        "mujoco": [1e-6],
        "batches": {"128": {"ratio": 2.0, "interval": [1.9, 2.1]}},
    }


def test_without_mjx_the_study_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batches, "find_spec", lambda _module: None)
    with pytest.raises(Unprocessable, match=r"requirements-mjx\.lock"):
        batches.load_mjx(32)
