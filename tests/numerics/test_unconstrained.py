"""That no constraint acted in a run is a fact of the run: a repeat may skip what its scene may need, bit for bit."""

from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest

from grader.numerics.integrators import BY_NAME, RK4, find_refusal
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from numerics.models import ALL

FOREIGN = {
    path.stem: path.read_text()
    for path in sorted((Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets").glob("*.xml"))
}
STEPS = 60

FALLING = """<mujoco><option timestep="0.01" integrator="{integrator}"/><worldbody><geom type="plane" size="5 5 .1"/>
  <body pos="0 0 {height}"><joint type="slide" axis="0 0 1"/><geom size=".1" mass="1"/></body></worldbody></mujoco>"""


def falling(height: float, integrator: str = "Euler") -> Scene:
    return Scene.from_xml(FALLING.format(height=height, integrator=integrator))


def thrown(xml: str) -> Scene:
    scene = Scene.from_xml(xml)
    return scene.at(qvel=0.5 * np.random.default_rng(3).standard_normal(scene.model.nv))


@pytest.mark.parametrize("name", sorted(ALL | FOREIGN))
def test_a_repeat_is_bitwise_the_same_and_the_fact_is_that_of_every_evaluation(name: str) -> None:
    scene = thrown((ALL | FOREIGN)[name])
    for integrator in BY_NAME.values():
        if find_refusal(scene.model, integrator):
            continue
        whole = simulate(scene, steps=STEPS, integrator=integrator.code, skip=False)
        acted = False
        with scene.borrow(integrator=integrator.code, keep=False) as workspace:
            for _ in range(whole.steps):
                mujoco.mj_step(workspace.model, workspace.data)
                acted |= workspace.data.nefc > 0 or workspace.data.ncon > 0
        assert not (acted and whole.unconstrained)
        repeated = simulate(scene, steps=STEPS, integrator=integrator.code, repeat=True)
        assert repeated.states.tobytes() == whole.states.tobytes()


@pytest.mark.parametrize("integrator", BY_NAME)
def test_it_holds_up_to_the_impact_and_not_beyond(integrator: str) -> None:
    # Source: the sphere of 0.1 m at 1.1 m touches after sqrt(2 / 9.81) = 0.4515 s.
    scene = falling(1.1, integrator)
    assert simulate(scene, seconds=0.44).unconstrained
    assert not simulate(scene, seconds=0.48).unconstrained
    assert scene.unconstrained == {(0.01, BY_NAME[integrator].code): 44}


def test_the_stages_of_rk4_count() -> None:
    """A sphere that dips between two steps: no state of the run touches, a stage does."""
    scene = falling(0.1 + 0.0125).at(qvel=[-0.4])
    scene = scene.changed(lambda model: setattr(model.opt, "timestep", 0.08)).changed(
        lambda model: model.opt.gravity.__setitem__(2, 12.0)
    )
    run = simulate(scene, steps=1, integrator=RK4.code)
    with scene.borrow(integrator=RK4.code, keep=False) as workspace:
        mujoco.mj_forward(workspace.model, workspace.data)
        assert workspace.data.ncon == 0
        workspace.data.qpos[:], workspace.data.qvel[:] = run.qpos[-1], run.qvel[-1]
        mujoco.mj_forward(workspace.model, workspace.data)
        assert workspace.data.ncon == 0
    assert not run.unconstrained


def test_a_repeat_skips_no_longer_run_and_no_other_start_or_setting() -> None:
    scene = falling(1.1)
    simulate(scene, seconds=0.44)
    for other in (scene.at(qpos=[0.5]), scene.changed(lambda model: setattr(model.opt, "timestep", 0.01))):
        assert other.unconstrained == {}
    landed = simulate(scene, seconds=1.0, skip=False)
    assert simulate(scene, seconds=1.0, repeat=True).states.tobytes() == landed.states.tobytes()
    assert landed.qpos[-1, 0] > -1.05  # it lies on the floor, and did not fall through
    finer = simulate(scene, seconds=1.0, timestep_s=0.005, repeat=True)
    assert finer.qpos[-1, 0] > -1.05


def test_a_run_that_diverged_proves_nothing() -> None:
    run = simulate(falling(1.1).at(qvel=[1e11]), steps=STEPS)
    assert run.diverged_at_step is not None
    assert not run.unconstrained
