"""Well-known models: what is skipped changes no bit, and the cost beside the steps is measured without the steps."""

from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco.rollout import rollout as roll_out

from grader.numerics.stepping import advance_exactly
from grader.studies.bench.physics import models
from grader.studies.bench.physics.models import (
    Model,
    are_bits_same,
    load_model_scene,
    measure_overhead,
    measure_recording,
    plan,
    run_scene,
)


def test_twenty_models_are_measured_six_of_them_where_gymnasium_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(plan(False)) == 20
    monkeypatch.setattr(models, "find_spec", lambda _name: None)
    assert plan(False) == [Model(f"{name} (course)") for name in models.COURSE] + [Model("cube"), Model("pile")]


@pytest.mark.parametrize(
    "name", ["inverted_double_pendulum (Gymnasium)", "hopper (Gymnasium)", "tumbling_box (course)"]
)
@pytest.mark.slow
def test_what_is_skipped_changes_no_bit(name: str) -> None:
    scene = load_model_scene(name)
    assert any(need.flag and not need.needed for need in scene.needs)
    assert are_bits_same(scene)


def test_the_cost_beside_the_steps_is_measured_without_them() -> None:
    """Afterwards the engine's own step is back, and runs are whole."""
    real, scene = mujoco.mj_step, load_model_scene("pendulum (course)")
    assert measure_overhead(scene, 0.01).yardstick_s > 0
    assert mujoco.mj_step is real
    with scene.borrow(keep=False, skip=True) as workspace:
        assert run_scene(scene, skip=True).time[-1] == pytest.approx(models.STEPS * workspace.option.timestep)


def test_every_step_is_recorded_by_both(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the same start, by the model's own options, without what our runs skip."""
    scene, recorded = load_model_scene("tumbling_box (course)"), list[np.ndarray]()

    def kept(*arguments: Any, **options: Any) -> None:
        roll_out(*arguments, **options)
        recorded.append(options["state"])

    monkeypatch.setattr(models, "roll_out", kept)
    assert measure_recording(scene, 0.01).ratio > 0
    ours = run_scene(scene, skip=True).states[-1]
    for states in recorded[-1]:
        assert states[-1].tobytes() == ours.tobytes()


def test_a_run_makes_as_many_calls_as_it_is_compared_with(monkeypatch: pytest.MonkeyPatch) -> None:
    real, chunks = mujoco.mj_step, list[int]()

    def counted(model: mujoco.MjModel, data: mujoco.MjData, steps: int) -> None:
        chunks.append(steps)
        real(model, data, steps)

    monkeypatch.setattr(mujoco, "mj_step", counted)
    with load_model_scene("pendulum (course)").borrow() as workspace:
        assert advance_exactly(workspace, models.STEPS) == models.STEPS
    assert (len(chunks), sum(chunks)) == (models.CALLS, models.STEPS)
