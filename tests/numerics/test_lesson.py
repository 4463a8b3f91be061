"""The lesson's own numbers."""

import hashlib

import mujoco
import pytest

from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.stability.trials import Stability, try_timestep
from numerics.measuring import energy
from numerics.models import LESSON

EULER, RK4, IMPLICIT, IMPLICITFAST, DISCRETE = range(5)
DOUBLE = Scene.from_xml(LESSON["double_pendulum"], key="release")


def servo(kp: float, kv: float, q0: float = 1.0) -> Scene:
    def gains(model: mujoco.MjModel) -> None:
        model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 1:3] = kp, (-kp, -kv)

    return Scene.from_xml(LESSON["pendulum_servo"]).changed(gains).at(qpos=[q0])


def energy_error_percent(integrator: int, seconds: float = 20.0, scene: Scene = DOUBLE) -> float:
    rollout = simulate(scene, seconds=seconds, timestep_s=0.002, integrator=integrator, every=1_000_000)
    first, last = energy(scene, rollout)
    return float(100 * (last - first) / abs(first))


TABLE_20_S = {EULER: -10.0488, RK4: 0.0, IMPLICIT: 21.6355, IMPLICITFAST: -10.0488, DISCRETE: -10.0488}
TABLE_5_S = {
    EULER: -0.346052950709,
    RK4: -0.000015700236,
    IMPLICIT: -3.876230264479,
    IMPLICITFAST: -0.346052950709,
    DISCRETE: -0.346052950709,
}
ARITHMETIC = "dacc9e91e6b909bb57e815e39a34b96ced140b858c1c2ec2876efc73871d4223"
"""SHA-256 of the state that Euler reaches in 2 s where sine and cosine round as on the machine of the table."""


def arithmetic() -> str:
    run = simulate(DOUBLE, seconds=2, timestep_s=0.002, integrator=EULER, every=1_000_000)
    return hashlib.sha256(run.qpos[-1].tobytes() + run.qvel[-1].tobytes()).hexdigest()


@pytest.mark.parametrize("integrator", range(5))
def test_energy_table(integrator: int) -> None:
    """To 0.01 % of the initial energy where arithmetic is that of the table: the system is chaotic.

    Elsewhere the printed figure must lie among those of starts that differ by a few 1e-15 rad.
    """
    if arithmetic() == ARITHMETIC:
        assert energy_error_percent(integrator) == pytest.approx(TABLE_20_S[integrator], abs=0.01)
    else:
        assert in_ensemble(integrator)


@pytest.mark.parametrize("integrator", range(5))
def test_energy_while_it_is_still_predictable(integrator: int) -> None:
    assert energy_error_percent(integrator, seconds=5.0) == pytest.approx(TABLE_5_S[integrator], abs=1e-6)


@pytest.mark.parametrize("integrator", [EULER, IMPLICIT])
@pytest.mark.slow
def test_the_printed_energy_is_one_of_its_ensemble(integrator: int) -> None:
    assert in_ensemble(integrator)


def in_ensemble(integrator: int) -> bool:
    """Whether the printed figure lies within what 25 starts give that differ by up to 1.2e-14 rad."""
    starts = [DOUBLE.at(qpos=[2.0 + k * 1e-15, 0.5]) for k in range(-12, 13)]
    figures = [energy_error_percent(integrator, scene=start) for start in starts]
    return min(figures) - 0.01 <= TABLE_20_S[integrator] <= max(figures) + 0.01


def test_the_methods_without_damping_are_one_method_bit_for_bit() -> None:
    euler, implicitfast, discrete = (
        simulate(DOUBLE, seconds=20, timestep_s=0.002, integrator=i) for i in (EULER, IMPLICITFAST, DISCRETE)
    )
    assert euler.qpos.tobytes() == implicitfast.qpos.tobytes() == discrete.qpos.tobytes()
    assert euler.qvel.tobytes() == implicitfast.qvel.tobytes() == discrete.qvel.tobytes()


@pytest.mark.parametrize("integrator", range(5))
def test_the_same_build_reruns_bit_for_bit(integrator: int) -> None:
    one, other = (simulate(DOUBLE, seconds=20, timestep_s=0.002, integrator=integrator) for _ in range(2))
    assert one.qpos.tobytes() == other.qpos.tobytes()


def test_rk4_conserves_energy() -> None:
    assert abs(energy_error_percent(RK4)) < 0.01


UNSTABLE_CELLS = {(100, 60, EULER, h) for h in (0.01, 0.02)} | {
    (20000, 5, integrator, h) for integrator in (EULER, IMPLICITFAST) for h in (0.01, 0.02)
}


@pytest.mark.parametrize("integrator", [EULER, IMPLICITFAST, DISCRETE])
@pytest.mark.parametrize("timestep_s", [0.002, 0.01, 0.02])
@pytest.mark.parametrize(("kp", "kv"), [(100, 60), (20000, 5)])
def test_the_18_cells_of_the_servo_table(kp: float, kv: float, timestep_s: float, integrator: int) -> None:
    unstable = (kp, kv, integrator, timestep_s) in UNSTABLE_CELLS
    trial = try_timestep(servo(kp, kv), timestep_s, 3.0, integrator=integrator)
    assert trial.stability is (Stability.UNSTABLE if unstable else Stability.STABLE)
