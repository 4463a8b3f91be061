"""What is skipped must not change one bit of the trajectory, under any integrator."""

import mujoco
import numpy as np
import pytest

from grader.numerics.integrators import BY_CODE, find_refusal
from grader.numerics.needs import prove_needs
from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import Scene
from numerics.models import ALL, CUBE, EXPLICIT_PAIR, LESSON, SENSORS, hinge

INTEGRATORS = range(5)


pytestmark = pytest.mark.usefixtures("bare_at_once")


def thrown(xml: str) -> Scene:
    """The scene in motion: a fixed random velocity and control."""
    scene = Scene.from_xml(xml)
    rng = np.random.default_rng(11)
    return scene.at(qvel=0.7 * rng.standard_normal(scene.model.nv), ctrl=rng.standard_normal(scene.model.nu))


def same_bits(one: Rollout, other: Rollout) -> bool:
    parts = ("time", "qpos", "qvel", "act")
    return all(getattr(one, part).tobytes() == getattr(other, part).tobytes() for part in parts)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("name", sorted(ALL))
def test_skipping_changes_no_bit(name: str, integrator: int) -> None:
    scene = thrown(ALL[name])
    if find_refusal(scene.model, BY_CODE[integrator]):
        for skip in (True, False):
            with pytest.raises(mujoco.FatalError, match="flex edge stiffness and damping"):
                simulate(scene, steps=300, integrator=integrator, skip=skip)
        return
    skipped = simulate(scene, steps=300, integrator=integrator)
    whole = simulate(scene, steps=300, integrator=integrator, skip=False)
    assert same_bits(skipped, whole)
    assert len(whole.time) > 50
    assert np.ptp(whole.qpos, axis=0).max() > 1e-3


@pytest.mark.parametrize("name", sorted(LESSON))
def test_the_lessons_models_need_no_constraints(name: str) -> None:
    needs = {need.part: need for need in Scene.from_xml(LESSON[name]).needs}
    assert not needs["constraints"].needed
    assert not needs["contacts"].needed
    assert needs["gravity"].needed
    assert all(need.reason for need in needs.values())


@pytest.mark.parametrize(
    ("xml", "part"),
    [
        (CUBE, "contacts"),
        (EXPLICIT_PAIR, "contacts"),
        (ALL["mocap_alone"], "contacts"),
        (ALL["equality"], "equality constraints"),
        (ALL["inactive_weld"], "equality constraints"),
        (ALL["joint_limit"], "limits"),
        (ALL["tendon_limit"], "limits"),
        (ALL["tendon_limit"], "friction loss"),
        (ALL["friction_loss"], "friction loss"),
        (ALL["spring"], "springs"),
        (ALL["damper"], "dampers"),
        (ALL["activations"], "actuation"),
        (ALL["flex"], "contacts"),
        (ALL["two_free_bodies"], "islands"),
        (ALL["stiff_chain"], "islands"),
        (SENSORS, "sensors"),
    ],
)
def test_what_is_needed_is_said_to_be(xml: str, part: str) -> None:
    assert next(need for need in Scene.from_xml(xml).needs if need.part == part).needed


@pytest.mark.parametrize(
    ("xml", "part"),
    [
        (ALL["excluded_pair"], "contacts"),
        (ALL["parent_and_child"], "contacts"),
        (ALL["gravity_off"], "gravity"),
        (hinge(), "islands"),
        (hinge(), "actuation"),
        (hinge(), "sensors"),
        (hinge(), "springs"),
        (hinge(), "dampers"),
    ],
)
def test_what_is_not_needed_is_proved(xml: str, part: str) -> None:
    assert not next(need for need in Scene.from_xml(xml).needs if need.part == part).needed


def test_a_changed_contype_is_proved_anew() -> None:
    ghost = CUBE.replace('mass="1"', 'mass="1" contype="0" conaffinity="0"')
    scene = Scene.from_xml(ghost)

    def solid(model: mujoco.MjModel) -> None:
        for bits in (model.geom_contype, model.geom_conaffinity, model.body_contype, model.body_conaffinity):
            bits[:] = 1

    changed = scene.changed(solid)
    assert scene.flags & ~changed.flags != 0
    for integrator in INTEGRATORS:
        skipped = simulate(changed, steps=300, integrator=integrator)
        whole = simulate(changed, steps=300, integrator=integrator, skip=False)
        assert same_bits(skipped, whole)
        assert whole.qpos[-1, 2] > 0.05  # it lies on the floor: the contact is there
    assert simulate(scene, steps=300).qpos[-1, 2] < 0  # and without one it fell through


def test_sleep_and_plugins_prove_nothing() -> None:
    xml = hinge(rest="<option><flag sleep='enable'/></option>")
    (need,) = prove_needs(mujoco.MjModel.from_xml_string(xml))
    assert need.part == "everything"
    assert need.needed


def test_never_a_flag_that_changes_trajectories() -> None:
    bit = mujoco.mjtDisableBit
    never = bit.mjDSBL_AUTORESET | bit.mjDSBL_WARMSTART | bit.mjDSBL_FILTERPARENT
    assert not any(Scene.from_xml(xml).flags & int(never) for xml in ALL.values())
