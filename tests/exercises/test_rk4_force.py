"""The force that only mj_forward adds, against its formula."""

import threading
from typing import Any

import mujoco
import numpy as np
import pytest

from grader.exercises.kinds.rk4.judging import driver
from grader.exercises.kinds.rk4.judging.driver import add_force

LINK = (
    '<body pos="0 0 -.3"><joint axis="0 1 0"/><inertial pos="0 0 -.1" mass="1" diaginertia="1e-2 1e-2 1e-2"/>{}</body>'
)


def compile_chain(links: int, *, free: bool = False) -> mujoco.MjModel:
    inner = ""
    for _ in range(links):
        inner = LINK.format(inner)
    if free:
        inner = inner.replace('<joint axis="0 1 0"/>', "<freejoint/>", 1)
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{inner}</worldbody></mujoco>")


def draw_spec(model: mujoco.MjModel, rate: float) -> dict[str, Any]:
    rng = np.random.default_rng(model.nv)
    sizes = {"amplitude": model.nv, "position": (model.nv, model.nq), "velocity": (model.nv, model.nv)}
    return {name: rng.normal(size=size).tolist() for name, size in {**sizes, "phase": model.nv}.items()} | {
        "rate": rate
    }


def draw_data(model: mujoco.MjModel, seed: int) -> mujoco.MjData:
    rng, data = np.random.default_rng(seed), mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = rng.normal(size=model.nq), rng.normal(size=model.nv)
    data.time, data.qfrc_applied[:] = rng.uniform(), rng.normal(size=model.nv)
    return data


def compute_force(spec: dict[str, Any], data: mujoco.MjData) -> "np.ndarray[Any, np.dtype[np.float64]]":
    angle = np.array(spec["position"]) @ data.qpos + np.array(spec["velocity"]) @ data.qvel
    force: np.ndarray[Any, np.dtype[np.float64]] = np.array(spec["amplitude"]) * np.sin(
        angle + spec["rate"] * data.time + np.array(spec["phase"])
    )
    return force


@pytest.mark.parametrize("rate", [0.0, 5.0])
@pytest.mark.parametrize(("links", "free"), [(1, False), (2, False), (3, False), (4, False), (1, True), (2, True)])
def test_the_force_is_that_of_the_formula_and_leaves_nothing_behind(links: int, free: bool, rate: float) -> None:
    model, seen = compile_chain(links, free=free), list[Any]()
    spec = draw_spec(model, rate)
    forced = add_force(lambda _, data: seen.append(data.qfrc_applied.copy()), spec)
    both = [draw_data(model, seed) for seed in (1, 2)]
    for data in (*both, *both):
        own = data.qfrc_applied.copy()
        forced(model, data)
        assert np.allclose(seen.pop(), own + compute_force(spec, data), rtol=0, atol=1e-14)
        assert np.array_equal(data.qfrc_applied, own)
        data.qvel[:] += 0.1


def test_a_force_of_few_joints_is_that_of_many(monkeypatch: pytest.MonkeyPatch) -> None:
    model, seen = compile_chain(driver.FEW), list[Any]()
    spec, data = draw_spec(model, 5.0), draw_data(model, 1)
    for few in (driver.FEW, 0):
        monkeypatch.setattr(driver, "FEW", few)
        add_force(lambda _, data: seen.append(data.qfrc_applied.copy()), spec)(model, data)
    assert np.allclose(seen[0], seen[1], rtol=0, atol=1e-14)


def test_a_model_of_another_size_moves_without_the_force() -> None:
    model, other, seen = compile_chain(2), compile_chain(3), list[Any]()
    forced = add_force(lambda _, data: seen.append(data.qfrc_applied.copy()), draw_spec(model, 0.0))
    data = draw_data(other, 1)
    forced(other, data)
    assert np.array_equal(seen[0], data.qfrc_applied)


@pytest.mark.parametrize("links", [2, 5])
def test_threads_with_data_of_their_own_do_not_mix_their_forces(links: int) -> None:
    model, wrong = compile_chain(links), list[int]()
    spec = draw_spec(model, 5.0)
    here = threading.local()
    forced = add_force(lambda _, data: setattr(here, "seen", data.qfrc_applied.copy()), spec)

    def work(seed: int) -> None:
        data = draw_data(model, seed)
        own = data.qfrc_applied.copy()
        for _ in range(2000):
            data.qvel[:] += 0.01
            forced(model, data)
            if not np.allclose(here.seen, own + compute_force(spec, data), rtol=0, atol=1e-13):
                wrong.append(seed)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
