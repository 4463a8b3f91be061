"""The reference of every scene, and how wrong it may itself be."""

import mujoco
import numpy as np

from grader.bench.by_hand import EQUATIONS, Array
from grader.bench.journal import Record, Task
from grader.bench.peers import by_hand, over_mj_forward
from grader.bench.scenes import load_scene
from grader.bench.settings_grid import SAMPLE_TIMES_S
from grader.numerics.reference import dop853
from grader.numerics.scene import Scene


def error_of(scene: Scene, qpos: Array, truth: Array) -> float:
    """Sup norm over the samples of the position error in tangent space: rad and m, rotations as rotation vectors."""
    difference = np.empty(scene.model.nv)
    worst = 0.0
    for here, there in zip(qpos, truth, strict=True):
        mujoco.mj_differentiatePos(scene.model, difference, 1.0, there, here)
        worst = max(worst, float(np.abs(difference).max()))
    return worst


def truth_task(name: str) -> Task:
    """The reference solution and its own error: the largest distance to solutions found another way."""

    def measure() -> Record:
        scene = load_scene(name)
        constrained = any(need.part == "constraints" and need.needed for need in scene.needs)
        best, others, method = through_impacts(scene) if constrained else smooth(name, scene)
        own_error = max(error_of(scene, other, best) for other in others)
        return {"qpos": best.tolist(), "own_error": own_error, "method": method}

    return Task(f"truth/{name}", measure)


def smooth(name: str, scene: Scene) -> tuple[Array, list[Array], str]:
    """DOP853 over mj_forward, beside itself at ten times the tolerance and beside the equations by hand."""
    best = np.asarray(dop853(scene, SAMPLE_TIMES_S).qpos)
    others = [np.asarray(dop853(scene, SAMPLE_TIMES_S, rtol=3e-13, atol=1e-14).qpos)]
    method = "DOP853 at rtol 3e-14 over mj_forward; own error: distance to rtol 3e-13"
    if name in EQUATIONS:
        others.append(by_hand(name, scene, "DOP853")(3e-14, SAMPLE_TIMES_S))
        method += " and to the equations by hand"
    return best, others, method


def through_impacts(scene: Scene) -> tuple[Array, list[Array], str]:
    """Error control finds every impact by itself: two solvers of different families must tell the same story.

    The constraint solver is made exact first, so that its own tolerance is no part of the reference.
    """

    def exactly(model: mujoco.MjModel) -> None:
        model.opt.tolerance, model.opt.iterations = 0.0, 200

    exact = scene.changed(exactly)
    best = over_mj_forward(exact, "DOP853")(1e-13, SAMPLE_TIMES_S)
    other = over_mj_forward(exact, "LSODA")(1e-12, SAMPLE_TIMES_S)
    return best, [other], "DOP853 at 1e-13 over mj_forward; own error: distance to LSODA at 1e-12"
