"""Scenes: built once, shared by threads, changed only as copies."""

import threading
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
import pytest

from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import Scene
from numerics.models import ALL, LESSON

DOUBLE = LESSON["double_pendulum"]


def test_one_text_is_compiled_once() -> None:
    assert Scene.from_xml(DOUBLE) is Scene.from_xml(DOUBLE)
    assert Scene.from_xml(DOUBLE, key="release").model is Scene.from_xml(DOUBLE).model
    assert len(Scene.from_xml(DOUBLE).digest) == 64


def test_the_start_is_qpos0_a_keyframe_or_what_is_given() -> None:
    scene = Scene.from_xml(DOUBLE)
    assert scene.start.qpos.tolist() == [0, 0]
    release = scene.at(key="release")
    assert release.start.qpos.tolist() == [2.0, 0.5]
    assert scene.at(key=0).start.qpos.tolist() == [2.0, 0.5]
    moving = release.at(qvel=[1, 2], time_s=3.0)
    assert (moving.start.qpos.tolist(), moving.start.qvel.tolist(), moving.start.time_s) == ([2.0, 0.5], [1, 2], 3.0)
    assert scene.start.qpos.tolist() == [0, 0]


def test_what_is_not_there_is_named() -> None:
    scene = Scene.from_xml(DOUBLE)
    with pytest.raises(KeyError, match="release"):
        scene.at(key="nothing")
    with pytest.raises(KeyError, match="elbow, shoulder"):
        scene.find_qpos("hinge")
    with pytest.raises(ValueError, match="qpos has 2 entries"):
        scene.at(qpos=[1.0])
    with pytest.raises(ValueError, match="XML"):
        Scene.from_xml("<mujoco><nonsense/></mujoco>")


def test_coordinates_by_name() -> None:
    scene = Scene.from_xml(DOUBLE)
    assert (scene.find_qpos("shoulder"), scene.find_qpos("elbow")) == (slice(0, 1), slice(1, 2))
    free = Scene.from_xml(ALL["free_body"])
    assert free.find_qpos("root") == slice(0, 7)


@pytest.mark.parametrize("timestep_s", [0.0, -0.001, float("nan"), float("inf")])
def test_a_timestep_that_means_nothing_is_refused(timestep_s: float) -> None:
    with pytest.raises(ValueError, match="timestep"):
        simulate(Scene.from_xml(DOUBLE), steps=1, timestep_s=timestep_s)


@pytest.mark.parametrize("integrator", [-1, 5, 99])
def test_an_unknown_integrator_is_refused(integrator: int) -> None:
    with pytest.raises(ValueError, match="integrator"):
        simulate(Scene.from_xml(DOUBLE), steps=1, integrator=integrator)


def test_a_given_model_is_copied() -> None:
    model = mujoco.MjModel.from_xml_string(DOUBLE)
    scene = Scene.from_model(model).at(qpos=[2.0, 0.5])
    before = simulate(scene, steps=100)
    model.opt.gravity[2] = 0
    model.body_mass[:] *= 3
    assert simulate(scene, steps=100).qpos.tobytes() == before.qpos.tobytes()


def test_a_change_leaves_the_original_alone() -> None:
    scene = Scene.from_xml(DOUBLE, key="release")
    before = simulate(scene, steps=100)

    def weightless(model: mujoco.MjModel) -> None:
        model.opt.gravity[:] = 0

    changed = scene.changed(weightless)
    assert np.all(simulate(changed, steps=100).qpos == [2.0, 0.5])
    assert simulate(scene, steps=100).qpos.tobytes() == before.qpos.tobytes()
    assert not next(need for need in changed.needs if need.part == "gravity").needed


def test_a_controller_that_writes_its_model_spoils_no_later_run() -> None:
    scene = Scene.from_xml(DOUBLE, key="release")
    before = simulate(scene, steps=100)

    def meddle(model: mujoco.MjModel, _data: mujoco.MjData) -> None:
        model.body_mass[:] *= 1.01
        model.opt.timestep = 0.01

    assert simulate(scene, steps=100, controller=meddle).qpos[-1, 0] != before.qpos[-1, 0]
    assert simulate(scene, steps=100).qpos.tobytes() == before.qpos.tobytes()


def test_threads_and_nested_runs_share_a_scene_but_no_data() -> None:
    scene = Scene.from_xml(DOUBLE, key="release")
    settings = [(0.001 * (1 + i % 3), i % 5) for i in range(20)]

    def run(setting: tuple[float, int]) -> Rollout:
        return simulate(scene, steps=1000, timestep_s=setting[0], integrator=setting[1])

    alone = [run(setting).qpos.tobytes() for setting in settings]
    with ThreadPoolExecutor(4) as pool:
        together = [rollout.qpos.tobytes() for rollout in pool.map(run, settings)]
    assert together == alone

    inner: list[bytes] = []

    def nested(_model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if data.time == 0:
            inner.append(run(settings[0]).qpos.tobytes())

    outer = simulate(scene, steps=1000, timestep_s=settings[1][0], integrator=settings[1][1], controller=nested)
    assert (inner, outer.qpos.tobytes()) == ([alone[0]], alone[1])


def test_a_workspace_is_never_in_two_hands() -> None:
    scene = Scene.from_xml(DOUBLE, key="release")
    held: set[int] = set()
    clashes: list[int] = []
    lock = threading.Lock()

    def hold(_: int) -> None:
        with scene.borrow() as workspace:
            address = id(workspace.data)
            with lock:
                if address in held:
                    clashes.append(address)
                held.add(address)
            mujoco.mj_step(workspace.model, workspace.data, nstep=500)
            with lock:
                held.remove(address)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(hold, range(200)))
    assert clashes == []
    with scene.borrow() as first, scene.borrow() as second:
        assert first.data is not second.data
        assert first.model is not second.model is not scene.model


def test_one_thread_reuses_its_workspace() -> None:
    scene = Scene.from_xml(DOUBLE).changed(lambda model: None)
    with scene.borrow() as first:
        pass
    with scene.borrow() as second:
        assert second is first
