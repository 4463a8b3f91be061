"""Steps recorded in one call of C are bitwise what chunks of steps leave, up to the step that warns."""

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.numerics import rollout
from grader.numerics.integrators import INTEGRATORS, find_refusal
from grader.numerics.recording import SPARSE, count_completed
from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import FULL_STATE, Scene
from numerics.models import ALL, DELAY, LESSON

SERVO = Scene.from_xml(LESSON["pendulum_servo"]).at(qpos=[1.0])
PLAIN = [integrator.code for integrator in INTEGRATORS]
Simulate = Callable[..., Rollout]


@pytest.fixture(scope="module")
def simulate_in_chunks() -> Simulate:
    """Returns `simulate` as it is where few states are kept."""

    def in_chunks(scene: Scene, **options: object) -> Rollout:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(rollout, "SPARSE", 0)
            return simulate(scene, **options)  # type: ignore[arg-type]

    return in_chunks


def same(one: Rollout, other: Rollout) -> bool:
    """Whether all fields are equal, the states bit for bit."""
    return one[2:] == other[2:] and all(
        a.tobytes() == b.tobytes() and a.shape == b.shape for a, b in zip(one[:2], other[:2], strict=True)
    )


def write_start(scene: Scene, write: Callable[[mujoco.MjModel, mujoco.MjData], object]) -> Scene:
    """Returns the scene with a start that `write` has changed, in any part of the integration state."""
    with scene.borrow(keep=False) as workspace:
        write(workspace.model, workspace.data)
        vector = np.empty_like(scene.start_vector)
        mujoco.mj_getState(workspace.model, workspace.data, vector, FULL_STATE)
    return replace(scene, start_vector=vector)


def disturb(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Write every input that MuJoCo keeps, and a velocity."""
    rng = np.random.default_rng(7)
    data.qvel[:] = 0.7 * rng.standard_normal(model.nv)
    data.ctrl[:] = rng.standard_normal(model.nu)
    data.qfrc_applied[:] = 0.3 * rng.standard_normal(model.nv)
    data.xfrc_applied[1:] = 0.1 * rng.standard_normal((model.nbody - 1, 6))
    data.mocap_pos[:] += 0.05
    data.mocap_quat[:] = [0.8, 0.6, 0, 0]
    data.eq_active[:] = 1 - data.eq_active
    data.qacc_warmstart[:] = rng.standard_normal(model.nv)
    data.time = 0.75


@pytest.mark.parametrize("skip", [True, False])
@pytest.mark.parametrize("disturbed", [True, False])
@pytest.mark.parametrize("name", sorted(ALL))
def test_every_step_is_bitwise_the_same(
    name: str, disturbed: bool, skip: bool, simulate_in_chunks: Simulate
) -> None:  # fmt: skip
    """With contacts, limits, equalities, activations and applied forces, under all integrators."""
    scene = Scene.from_xml(ALL[name])
    scene = write_start(scene, disturb) if disturbed else scene
    for integrator in (one.code for one in INTEGRATORS if find_refusal(scene.model, one) is None):
        options = {"steps": 300, "integrator": integrator, "skip": skip}
        recorded, chunks = simulate(scene, **options), simulate_in_chunks(scene, **options)  # type: ignore[arg-type]
        assert same(recorded, chunks)
        assert len(recorded.time) > 50


@pytest.mark.parametrize("every", range(1, SPARSE + 2))
def test_what_is_kept_does_not_change_it(every: int, simulate_in_chunks: Simulate) -> None:
    scene = Scene.from_xml(ALL["cube"])
    for options in ({"every": every}, {"at_s": np.arange(3, 150 * every, every) * 0.002}):
        recorded, chunks = (run(scene, steps=150 * every, **options) for run in (simulate, simulate_in_chunks))
        assert same(recorded, chunks)
        assert recorded.states.flags.c_contiguous
        assert not recorded.states.flags.writeable


@given(
    timestep_s=st.floats(0.015, 0.4),
    integrator=st.sampled_from(PLAIN),
    time_s=st.sampled_from([0.0, -0.05, 0.02, 1.0, 1e6]),
    qpos=st.sampled_from([0.0, 1e-9, 1.0, 1e4, 1e9, np.nan]),
    every=st.integers(1, SPARSE),
    skip=st.booleans(),
)
def test_a_run_ends_at_the_step_that_warns(
    timestep_s: float, integrator: int, time_s: float, qpos: float, every: int, skip: bool, simulate_in_chunks: Simulate
) -> None:
    """A stiff servo diverges at long timesteps. Its clock starts before, at and after the time to which a reset sets
    it."""
    scene = SERVO.at(qpos=[qpos], time_s=time_s)
    options = {"steps": 200, "timestep_s": timestep_s, "integrator": integrator, "every": every, "skip": skip}
    recorded, chunks = simulate(scene, **options), simulate_in_chunks(scene, **options)  # type: ignore[arg-type]
    assert same(recorded, chunks)


@pytest.mark.parametrize("integrator", PLAIN)
@pytest.mark.parametrize("timestep_s", [0.0205, 0.03, 0.05, 0.3])
def test_a_warning_without_a_reset_ends_the_run_at_the_same_step(
    timestep_s: float, integrator: int, simulate_in_chunks: Simulate
) -> None:
    def stay(model: mujoco.MjModel) -> None:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)

    scene = SERVO.changed(stay)
    options = {"steps": 1500, "timestep_s": timestep_s, "integrator": integrator}
    assert same(simulate(scene, **options), simulate_in_chunks(scene, **options))  # type: ignore[arg-type]


def test_a_delay_keeps_its_history(simulate_in_chunks: Simulate) -> None:
    scene = Scene.from_xml(DELAY).at(qvel=[1.0], ctrl=[0.5])
    assert same(simulate(scene, steps=200), simulate_in_chunks(scene, steps=200))


def test_a_model_that_sleeps_is_stepped_in_chunks(simulate_in_chunks: Simulate) -> None:
    """What sleeps is no part of the state that is recorded."""
    scene = Scene.from_xml(ALL["cube"].replace("<mujoco>", '<mujoco><option><flag sleep="enable"/></option>'))
    assert scene.inputs is None
    assert same(simulate(scene, steps=500), simulate_in_chunks(scene, steps=500))


STEP = 0.25
"""A timestep whose multiples are exact."""


@pytest.mark.parametrize(
    ("times", "warned", "done"),
    [
        ([0, 1, 2, 3], False, 3),
        ([0, 1, 2, 1, 1], True, 2),  # reset at step 3
        ([0, 1, 2, 3, 3], True, 2),  # step 3 warned without a reset
        ([0, 1, 2, 3], True, 2),  # the last step warned
        ([0, 1, 1, 1], True, None),  # step 1 or 2 was reset
        ([-4, -3, 1, 1], True, None),  # a reset that looks like an advance
        ([1, 1, 1], True, None),  # step 1 was reset to the time at which it began
        ([0, 1, 1, 2], False, None),  # the clock stood still
        ([np.nan, np.nan, np.nan], False, None),
        ([2**60, 2**60, 2**60], True, None),  # a timestep is less than the rounding of the clock
    ],
)
def test_the_times_tell_the_step_that_warned_or_nothing(times: list[float], warned: bool, done: int | None) -> None:
    assert count_completed(STEP * np.array(times), warned, STEP) == done
