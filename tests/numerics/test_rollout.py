"""Rollouts: the states asked for, and never one from after a reset."""

import mujoco
import numpy as np
import pytest

from grader.numerics.integrators import INTEGRATORS, find_refusal
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.stepping import CHUNK, CHUNK_MAX, GROWTH, STEPS_MAX
from grader.numerics.workspace import BARE_AFTER
from grader.studies.advise.measures import measure_quantity
from numerics.measuring import energy
from numerics.models import ALL, LESSON, SENSORS

DOUBLE = Scene.from_xml(LESSON["double_pendulum"], key="release")
SERVO = Scene.from_xml(LESSON["pendulum_servo"].replace('kp="100"', 'kp="2000"')).at(qpos=[1.0])
WARNING = mujoco.mjtWarning


def stepped_singly(scene: Scene, timestep_s: float, integrator: int, steps: int) -> list[float]:
    """Times after every step of a plain loop that goes on through resets."""
    with scene.borrow(timestep_s=timestep_s, integrator=integrator) as workspace:
        times = []
        for _ in range(steps):
            mujoco.mj_step(workspace.model, workspace.data)
            times.append(workspace.data.time)
    return times


def test_states_of_every_step_and_the_end() -> None:
    run = simulate(DOUBLE, seconds=0.2, timestep_s=0.002)
    assert (run.time.shape, run.qpos.shape, run.qvel.shape, run.act.shape) == ((101,), (101, 2), (101, 2), (101, 0))
    assert run.time == pytest.approx(0.002 * np.arange(101), abs=1e-12)
    assert (run.steps, run.diverged_at_step, run.warning) == (100, None, None)
    thinned = simulate(DOUBLE, seconds=0.2, timestep_s=0.002, every=30)
    assert thinned.step.tolist() == [0, 30, 60, 90, 100]
    assert thinned.qpos.tobytes() == run.qpos[[0, 30, 60, 90, 100]].tobytes()


def test_states_at_requested_times() -> None:
    run = simulate(DOUBLE, seconds=1.0, timestep_s=0.002, at_s=[0.5, 0.1011, 1.0])
    assert run.step.tolist() == [51, 250, 500]
    with pytest.raises(ValueError, match="between 0"):
        simulate(DOUBLE, seconds=1.0, at_s=[1.5])


def test_chunks_are_bitwise_what_single_steps_are() -> None:
    for integrator in range(5):
        every_step = simulate(DOUBLE, steps=CHUNK * 3 + 7, integrator=integrator)
        chunked = simulate(DOUBLE, steps=CHUNK * 3 + 7, integrator=integrator, every=STEPS_MAX)
        assert chunked.qpos[-1].tobytes() == every_step.qpos[-1].tobytes()


@pytest.mark.parametrize("name", sorted(ALL))
@pytest.mark.slow
def test_a_run_is_bitwise_what_one_call_into_the_engine_is(name: str) -> None:
    """Over the model's first 600 steps, which are two chunks, or up to the first warning."""
    scene = Scene.from_xml(ALL[name])
    for integrator in (one.code for one in INTEGRATORS if find_refusal(scene.model, one) is None):
        run = simulate(scene, steps=600, timestep_s=0.001, integrator=integrator, every=STEPS_MAX)
        with scene.borrow(timestep_s=0.001, integrator=integrator) as workspace:
            mujoco.mj_step(workspace.model, workspace.data, run.steps)
            last = (run.qpos[-1], run.qvel[-1], run.act[-1])
            if run.diverged_at_step is None:
                assert last[0].tobytes() == workspace.data.qpos.tobytes()
                assert last[1].tobytes() == workspace.data.qvel.tobytes()
                assert last[2].tobytes() == workspace.data.act.tobytes()
                assert run.time[-1] == workspace.data.time


@pytest.mark.slow
def test_the_step_that_warns_is_found_in_every_chunk() -> None:
    """The smaller the start, the later the linear growth beyond the limit reaches a warning."""
    first_steps = []
    for exponent in np.linspace(-290, 0, 40):
        scene = SERVO.at(qpos=[10.0**exponent])
        times = np.array(stepped_singly(scene, 0.0215, 0, 2500))
        first = int(np.argmax(np.diff(times) < 0)) + 1
        run = simulate(scene, steps=2500, timestep_s=0.0215, integrator=0, every=STEPS_MAX)
        assert (run.diverged_at_step, run.step.tolist()) == (first, [0])
        first_steps.append(first)
    assert min(first_steps) < CHUNK < GROWTH * CHUNK < CHUNK + CHUNK_MAX < max(first_steps)


def test_results_are_read_only() -> None:
    run = simulate(DOUBLE, steps=3)
    with pytest.raises(ValueError, match="read-only"):
        run.qpos[0, 0] = 1.0


@pytest.mark.parametrize("every", [1, 7, STEPS_MAX])
@pytest.mark.parametrize("timestep_s", [0.0205, 0.022, 0.05, 0.3])
@pytest.mark.parametrize("integrator", [0, 1, 3])
def test_divergence_ends_the_run_at_its_step(integrator: int, timestep_s: float, every: int) -> None:
    times = stepped_singly(SERVO, timestep_s, integrator, 2000)
    resets = [step for step in range(1, 2000) if times[step] < times[step - 1] + 0.5 * timestep_s]
    run = simulate(SERVO, steps=2000, timestep_s=timestep_s, integrator=integrator, every=every)
    if not resets:
        assert run.diverged_at_step is None
        return
    assert run.diverged_at_step == resets[0] == run.steps
    assert run.warning in (WARNING.mjWARN_BADQACC, WARNING.mjWARN_BADQVEL, WARNING.mjWARN_BADQPOS)
    assert run.step[-1] <= run.diverged_at_step
    assert np.all(np.diff(run.time) > 0)
    assert every > 1 or run.step[-1] == run.diverged_at_step


@pytest.mark.parametrize(
    ("parts", "warning"),
    [
        ({"qpos": [np.nan]}, WARNING.mjWARN_BADQPOS),
        ({"qpos": [1e12]}, WARNING.mjWARN_BADQPOS),
        ({"qvel": [np.inf]}, WARNING.mjWARN_BADQVEL),
        ({"ctrl": [np.nan]}, WARNING.mjWARN_BADCTRL),
        ({"qpos": [1e9]}, WARNING.mjWARN_BADQACC),
    ],
)
def test_a_bad_start_is_a_divergence_at_step_0(parts: dict[str, list[float]], warning: mujoco.mjtWarning) -> None:
    run = simulate(SERVO.at(**parts), seconds=1)  # type: ignore[arg-type]
    assert (run.diverged_at_step, run.warning, run.steps) == (0, warning, 0)


def test_time_that_does_not_go_on_ends_the_run() -> None:
    run = simulate(SERVO.at(time_s=float("nan")), seconds=1)
    assert (run.diverged_at_step, run.warning) == (0, None)

    def rewind(_model: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.time = min(data.time, 0.1)

    assert simulate(DOUBLE, seconds=1, controller=rewind).diverged_at_step is None

    def backwards(model: mujoco.MjModel, _data: mujoco.MjData) -> None:
        model.opt.timestep = -0.001

    assert simulate(DOUBLE, seconds=1, controller=backwards).diverged_at_step == 0


def test_a_warning_without_a_reset_ends_the_run_too() -> None:
    def spoil(_model: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.ctrl[0] = np.nan if data.time > 0.0995 else 0.0

    run = simulate(SERVO, steps=1000, timestep_s=0.001, controller=spoil)
    assert (run.diverged_at_step, run.warning) == (100, WARNING.mjWARN_BADCTRL)
    assert run.step[-1] == 100


def test_an_engine_error_is_raised_and_leaves_the_scene_usable() -> None:
    scene = Scene.from_xml(ALL["two_free_bodies"].replace("<mujoco>", '<mujoco><size memory="20K"/>'))
    before = simulate(scene, steps=5).qpos.tobytes()
    with pytest.raises(mujoco.FatalError):
        simulate(scene, seconds=3)
    assert simulate(scene, steps=5).qpos.tobytes() == before


def test_a_controller_acts_before_every_step() -> None:
    seen: list[float] = []

    def push(_model: mujoco.MjModel, data: mujoco.MjData) -> None:
        seen.append(data.time)
        data.ctrl[0] = 1.0

    pendulum = Scene.from_xml(LESSON["pendulum"])
    run = simulate(pendulum, steps=50, controller=push)
    assert len(seen) == 50
    assert run.qpos.tobytes() == simulate(pendulum.at(ctrl=[1.0]), steps=50).qpos.tobytes()


@pytest.mark.parametrize(
    "length",
    [
        {},
        {"seconds": 1.0, "steps": 3},
        {"seconds": -1.0},
        {"seconds": float("nan")},
        {"seconds": float("inf")},
        {"seconds": 1e9},
        {"steps": -1},
        {"steps": STEPS_MAX + 1},
        {"steps": 5, "every": 0},
    ],
)
def test_lengths_that_mean_nothing_are_refused(length: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"give|cannot|between|every"):
        simulate(DOUBLE, **length)  # type: ignore[arg-type]


def test_energy_is_the_engines() -> None:
    run = simulate(DOUBLE, seconds=1, every=50)

    def enabled(model: mujoco.MjModel) -> None:
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)

    by_engine = measure_quantity(DOUBLE.changed(enabled), run, lambda _model, data: float(data.energy.sum()))
    assert energy(DOUBLE, run).tolist() == by_engine.tolist()


def test_energy_is_computed_for_a_quantity() -> None:
    run = simulate(DOUBLE, seconds=1, every=50)
    assert measure_quantity(DOUBLE, run, lambda _model, data: float(data.energy.sum())) == pytest.approx(
        energy(DOUBLE, run)
    )


def test_what_a_quantity_writes_is_its_own() -> None:
    run = simulate(DOUBLE, steps=100)

    def spoil(model: mujoco.MjModel, _data: mujoco.MjData) -> float:
        model.body_mass[1] = 50
        return 0.0

    measure_quantity(DOUBLE, run, spoil)
    for skip in (True, False):
        assert simulate(DOUBLE, steps=100, skip=skip).qpos.tobytes() == run.qpos.tobytes()


def test_a_stepper_may_read_anything() -> None:
    scene, seen = Scene.from_xml(SENSORS).at(qpos=[1.0]), []

    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mujoco.mj_step(model, data)
        seen.append((data.sensordata.tobytes(), data.site("tip").xpos.tobytes()))

    simulate(scene, steps=BARE_AFTER, every=STEPS_MAX)
    for skip in (True, False):
        simulate(scene, steps=20, stepper=step, skip=skip)
    assert seen[:20] == seen[20:]


def test_a_stepper_that_writes_its_model_is_refused() -> None:
    before = simulate(DOUBLE, steps=100).qpos.tobytes()

    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        model.opt.gravity[2] = -1.0
        mujoco.mj_step(model, data)

    with pytest.raises(ValueError, match="may not write its model"):
        simulate(DOUBLE, steps=3, stepper=step)
    for skip in (True, False):
        assert simulate(DOUBLE, steps=100, skip=skip).qpos.tobytes() == before


@pytest.mark.parametrize("every", [1, 13, STEPS_MAX])
def test_a_buffer_that_fills_up_ends_the_run_however_it_is_kept(every: int) -> None:
    """MuJoCo warns, and a few steps later it runs out of memory altogether."""
    box = "<geom type='box' size='.1 .1 .1'/>"
    boxes = "".join(
        f"<body pos='{0.05 * (i % 3)} {0.05 * (i % 2)} {0.1 + 0.25 * i}'><freejoint/>{box}</body>" for i in range(6)
    )
    pile = f"""<mujoco><size memory="70K"/><option solver="PGS" jacobian="sparse"/>
    <worldbody><geom type="plane" size="5 5 0.1"/>{boxes}</worldbody></mujoco>"""
    run = simulate(Scene.from_xml(pile), steps=300, every=every)
    assert (run.diverged_at_step, run.warning) == (91, WARNING.mjWARN_CNSTRFULL)
