"""MuJoCo's RK4 bit for bit, and the one that keeps its order on rotations."""

from functools import partial
from math import inf

import mujoco
import numpy as np
import pytest

from grader.numerics.accuracy.convergence import fit_order
from grader.numerics.accuracy.reference import list_sample_times, solve_dop853
from grader.numerics.accuracy.runge_kutta import step_lie_rk4, step_mujoco_rk4
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from numerics.measuring import errors
from numerics.models import ALL, hinge

RK4 = int(mujoco.mjtIntegrator.mjINT_RK4)


@pytest.mark.parametrize("name", sorted(ALL))
def test_reproduces_mujocos_rk4_bit_for_bit(name: str) -> None:
    scene = Scene.from_xml(ALL[name])
    rng = np.random.default_rng(7)
    scene = scene.at(qvel=0.5 * rng.standard_normal(scene.model.nv), ctrl=rng.standard_normal(scene.model.nu))
    with (
        scene.borrow(timestep_s=0.002, integrator=RK4) as own,
        scene.borrow(timestep_s=0.002, integrator=RK4) as engine,
    ):
        for _ in range(200):
            step_mujoco_rk4(own.model, own.data)
            mujoco.mj_step(engine.model, engine.data)
        for part in ("qpos", "qvel", "act", "qacc_warmstart"):
            assert getattr(own.data, part).tobytes() == getattr(engine.data, part).tobytes(), part
        assert own.data.time == engine.data.time


def test_a_turn_of_more_than_pi_a_step_is_that_of_mujoco() -> None:
    """The rotation vector within a step is then no longer the shortest one of its rotation."""
    scene = Scene.from_xml(ALL["ball"], key="spin").at(qvel=[1700, 3, -2])
    with (
        scene.borrow(timestep_s=0.002, integrator=RK4) as own,
        scene.borrow(timestep_s=0.002, integrator=RK4) as engine,
    ):
        step_mujoco_rk4(own.model, own.data)
        mujoco.mj_step(engine.model, engine.data)
        assert own.data.qpos == pytest.approx(engine.data.qpos, abs=1e-12)


def test_a_state_that_is_not_finite_stays_so() -> None:
    for step in (step_mujoco_rk4, step_lie_rk4):
        with Scene.from_xml(ALL["ball"], key="spin").at(qvel=[inf, 0, 0]).borrow(keep=False) as workspace:
            step(workspace.model, workspace.data)
            assert not np.isfinite(workspace.data.qpos).all()


@pytest.mark.slow
def test_a_forward_of_ones_own_is_what_counts() -> None:
    """A force that exists only inside `forward` moves these steps and leaves mj_step alone."""
    scene = Scene.from_xml(ALL["double_pendulum"], key="release")

    def pushed(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.qfrc_applied[0] = 0.1 * np.sin(data.qpos[1])
        mujoco.mj_forward(model, data)
        data.qfrc_applied[0] = 0

    for step in (step_mujoco_rk4, step_lie_rk4):
        plain = simulate(scene, steps=500, timestep_s=0.002, integrator=RK4, stepper=step)
        moved = simulate(scene, steps=500, timestep_s=0.002, integrator=RK4, stepper=partial(step, forward=pushed))
        assert abs(moved.qpos[-1, 0] - plain.qpos[-1, 0]) > 1e-3


def test_time_stands_at_the_stages_while_forward_runs() -> None:
    scene = Scene.from_xml(ALL["double_pendulum"])
    for step in (step_mujoco_rk4, step_lie_rk4):
        times: list[float] = []

        def watched(model: mujoco.MjModel, data: mujoco.MjData, seen: list[float] = times) -> None:
            seen.append(data.time)
            mujoco.mj_forward(model, data)

        with scene.borrow(timestep_s=0.002, keep=False) as workspace:
            step(workspace.model, workspace.data, watched)
            assert times == [0.0, 0.001, 0.001, 0.002]
            assert workspace.data.time == 0.002


@pytest.mark.slow
def test_activations_converge_with_fourth_order() -> None:
    """The plain filter; MuJoCo's exact filter and its clamp are of first order inside RK4."""
    xml = ALL["pendulum"].replace(
        '<motor name="torque" joint="hinge" ctrlrange="-3 3"/>',
        '<general name="torque" joint="hinge" dyntype="filter" dynprm="0.1" gainprm="1"/>',
    )
    scene = Scene.from_xml(xml).at(ctrl=[1.5], qpos=[0.3])
    reference = solve_dop853(scene, list_sample_times(1.0, 0.02))
    for step in (step_mujoco_rk4, step_lie_rk4):
        timesteps_s = [0.01, 0.005, 0.004, 0.002]
        differences = errors(scene, reference, timesteps_s, integrator=RK4, stepper=step)
        assert fit_order(timesteps_s, [error.qpos for error in differences]).order == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize(
    ("xml", "words"),
    [
        (hinge(rest="<option><flag sleep='enable'/></option>"), "sleep"),
        (hinge(rest="<actuator><general joint='hinge' dyntype='user' actdim='1'/></actuator>"), "activation dynamics"),
    ],
)
def test_what_it_does_not_know_is_refused(xml: str, words: str) -> None:
    with Scene.from_xml(xml).borrow() as workspace:
        for step in (step_mujoco_rk4, step_lie_rk4):
            with pytest.raises(ValueError, match=words):
                step(workspace.model, workspace.data)
