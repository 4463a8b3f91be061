"""MuJoCo's RK4 bit for bit, and the one that keeps its order on rotations."""

import mujoco
import numpy as np
import pytest

from grader.numerics.rk4 import mujoco_rk4_step
from grader.numerics.scene import Scene
from numerics.models import ALL

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
            mujoco_rk4_step(own.model, own.data)
            mujoco.mj_step(engine.model, engine.data)
        for part in ("qpos", "qvel", "act", "qacc_warmstart"):
            assert getattr(own.data, part).tobytes() == getattr(engine.data, part).tobytes(), part
        assert own.data.time == engine.data.time
