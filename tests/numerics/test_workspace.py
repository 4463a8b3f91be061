"""Workspaces that models of one layout share: a run in one is the run in a workspace of its own, bit for bit."""

import mujoco
import numpy as np
import pytest

from grader.numerics.integrators import INTEGRATORS, Integrator
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.workspace import Workspace, WorkspacePool, find_idle

ARM = """
<mujoco>
  <worldbody>
    <body><joint name="root" axis="0 1 0" damping="{damping}"/><geom size=".1" pos="0 0 {length}" mass="{mass}"/>
      <body pos="0 0 {length}"><joint axis="1 0 0"/><geom size=".1" pos="0 0 {length}"/>{left}</body>
      <body pos="0 .3 0"><joint axis="1 0 1"/><geom size=".1" pos="0 0 {length}"/>{right}</body>
    </body>
  </worldbody>
  <actuator><general joint="root" dyntype="filter" dynprm="{mass}"/></actuator>
</mujoco>
"""
HAND = '<body pos=".3 0 0"><joint axis="0 0 1"/><geom size=".1" pos=".1 0 0"/></body>'


def write_arm(*, left: bool = True, damping: float = 0.1, length: float = 0.5, mass: float = 1.0) -> str:
    hands = {"left": HAND, "right": ""} if left else {"left": "", "right": HAND}
    return ARM.format(damping=damping, length=length, mass=mass, **hands)


def save(model: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def compile_alone(xml: str) -> Scene:
    """The scene of a text with a workspace that no other model has used."""
    scene = Scene.from_xml(xml)
    pool = WorkspacePool(scene.model)
    pool._idle = {False: type(find_idle(scene.model))()}
    return Scene(scene.model, scene.start_vector, scene.start, scene.needs, pool)


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda one: one.name)
@pytest.mark.parametrize("left", [False, True])
def test_a_run_in_a_shared_workspace_is_the_same_bit_for_bit(integrator: Integrator, left: bool) -> None:
    """Also where the bodies of the model before hang together in another way, and its run diverged."""
    code = integrator.code
    texts = [write_arm(left=left), write_arm(left=not left, damping=3, length=0.2, mass=4)]
    scenes = Scene.from_xml(texts[0]), Scene.from_xml(texts[1]), compile_alone(texts[1])
    first, second, alone = (scene.at(qpos=[1, 0.5, -0.3, 0.2], qvel=[3, -2, 1, 2], ctrl=[0.5]) for scene in scenes)
    simulate(first, steps=200, timestep_s=0.2, integrator=code)  # diverges, and leaves its state
    with first.borrow() as workspace:
        pass
    with second.borrow() as shared:
        assert shared is workspace
        assert save(shared.model) == save(second.model)
    ours, theirs = (simulate(one, steps=300, timestep_s=0.002, integrator=code) for one in (second, alone))
    assert ours.states.tobytes() == theirs.states.tobytes()


def test_other_names_and_other_sizes_share_nothing() -> None:
    one = mujoco.MjModel.from_xml_string(write_arm())
    named = mujoco.MjModel.from_xml_string(write_arm().replace('"root"', '"base"'))
    larger = mujoco.MjModel.from_xml_string(write_arm().replace("</worldbody>", "<site/></worldbody>"))
    places = [find_idle(model) for model in (one, named, larger)]
    assert len({id(place) for place in places}) == 3


def test_a_workspace_takes_over_every_number_of_a_model() -> None:
    one, other = (mujoco.MjModel.from_xml_string(write_arm(mass=mass, damping=mass)) for mass in (1, 2))
    workspace = Workspace(one)
    workspace.load(other)
    assert save(workspace.model) == save(other) != save(one)
    assert workspace.model.joint("root").damping == other.joint("root").damping
