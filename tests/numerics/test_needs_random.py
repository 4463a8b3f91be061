"""Random small scenes: what is skipped never changes a bit, under any integrator."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene

pytestmark = pytest.mark.usefixtures("bare_at_once")


@dataclass(frozen=True)
class Limb:
    """One body: how it hangs, what touches it, and where its parent is (counted back in the list)."""

    joint: str
    parent: int
    collides: bool
    limited: bool
    stiffness: float
    damping: float
    friction_loss: float
    gravity_compensation: float
    actuator: str


limbs = st.builds(
    Limb,
    joint=st.sampled_from(["hinge", "slide", "ball", "free"]),
    parent=st.integers(0, 3),
    collides=st.booleans(),
    limited=st.booleans(),
    stiffness=st.sampled_from([0.0, 0.0, 2.0]),
    damping=st.sampled_from([0.0, 0.0, 0.3]),
    friction_loss=st.sampled_from([0.0, 0.0, 0.05]),
    gravity_compensation=st.sampled_from([0.0, 0.0, 0.8]),
    actuator=st.sampled_from(["", "", "motor", "position"]),
)


def mjcf(tree: list[Limb], floor: bool, gravity: float, medium: float, extra: str) -> str:
    """The MJCF of a tree of limbs; free joints hang from the world."""
    children: dict[int, list[int]] = {}
    for index, limb in enumerate(tree):
        parent = index - 1 - limb.parent
        children.setdefault(-1 if limb.joint == "free" else max(parent, -1), []).append(index)
    bodies = "".join(body(tree, children, index) for index in children.get(-1, []))
    actuators = "".join(
        f'<{limb.actuator} joint="j{index}"/>'
        for index, limb in enumerate(tree)
        if limb.actuator and limb.joint in ("hinge", "slide")
    )
    ground = '<geom name="ground" type="plane" size="2 2 0.1"/>' if floor else ""
    return f"""<mujoco><compiler angle="radian"/><option gravity="0 0 {gravity}" density="{medium}"/>
    <worldbody>{ground}{bodies}</worldbody><actuator>{actuators}</actuator>{extra}</mujoco>"""


def body(tree: list[Limb], children: dict[int, list[int]], index: int) -> str:
    limb = tree[index]
    at = f"{0.25 * index} {0.05 * index} {0.6 if limb.joint == 'free' else 0.15}"
    inner = "".join(body(tree, children, child) for child in children.get(index, []))
    bits = "" if limb.collides else 'contype="0" conaffinity="0"'
    return f"""<body name="b{index}" pos="{at}" gravcomp="{limb.gravity_compensation}">{joint(limb, index)}
    <geom type="capsule" fromto="0 0 0 0.2 0 -0.1" size="0.04" mass="0.5" {bits}/>{inner}</body>"""


def joint(limb: Limb, index: int) -> str:
    if limb.joint == "free":
        return f'<freejoint name="j{index}"/>'
    spans = {"hinge": "-0.4 0.5", "slide": "-0.1 0.1", "ball": "0 0.6"}
    limit = f'limited="true" range="{spans[limb.joint]}"' if limb.limited else ""
    return f"""<joint name="j{index}" type="{limb.joint}" axis="0 1 0.3" {limit} stiffness="{limb.stiffness}"
    damping="{limb.damping}" frictionloss="{limb.friction_loss}"/>"""


EXTRAS = [
    "",
    '<visual/><worldbody><light pos="0 0 3"/><camera pos="0 -2 1"/></worldbody>',
    '<sensor><framepos objtype="body" objname="b0"/><subtreecom body="b0"/></sensor>',
    "<contact/>",
]


@settings(max_examples=40)
@given(
    tree=st.lists(limbs, min_size=1, max_size=4),
    floor=st.booleans(),
    gravity=st.sampled_from([0.0, -9.81]),
    medium=st.sampled_from([0.0, 0.0, 1.2]),
    extra=st.sampled_from(EXTRAS),
    seed=st.integers(0, 1000),
)
def test_skipping_changes_no_bit_on_random_scenes(
    tree: list[Limb], floor: bool, gravity: float, medium: float, extra: str, seed: int
) -> None:
    scene = Scene.from_xml(mjcf(tree, floor, gravity, medium, extra))
    rng = np.random.default_rng(seed)
    scene = scene.at(qvel=rng.standard_normal(scene.model.nv), ctrl=rng.standard_normal(scene.model.nu))
    for integrator in range(5):
        skipped = simulate(scene, steps=120, integrator=integrator)
        whole = simulate(scene, steps=120, integrator=integrator, skip=False)
        assert skipped.qpos.tobytes() == whole.qpos.tobytes()
        assert skipped.qvel.tobytes() == whole.qvel.tobytes()
        assert skipped.diverged_at_step == whole.diverged_at_step
