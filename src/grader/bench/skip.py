"""What skipping saves: per scene and flag, proven or not and why, time saved, and whether the bits stay the same."""

import copy
from collections.abc import Callable
from dataclasses import asdict

import mujoco
import numpy as np

from grader.bench.by_hand import Array
from grader.bench.journal import Record, Task
from grader.bench.scenes import load_scene, scene_text
from grader.bench.settings_grid import INTEGRATORS
from grader.bench.timing import paired
from grader.bench.wheel_timer import profiling_timer
from grader.numerics.needs import Need
from grader.numerics.scene import FULL_STATE, Scene
from grader.numerics.visuals import without_visuals

SCENES = (
    "double_pendulum",
    "drawn_pendulum",
    "servo",
    "spinning_body",
    "eccentric_body",
    "sensed_arm",
    "joint_limits",
    "cube",
    "two_bodies",
)

TIMESTEP_S = 0.002
STEPS = 500
CHUNK = 50
"""Steps per call into C; divides STEPS."""


class Run:
    """Called, it runs a scene for STEPS steps at 2 ms from its start, with these disable bits set.

    `bare` is a model that moves alike, to be stepped in place of the scene's own.
    """

    def __init__(
        self,
        scene: Scene,
        integrator: str = "Euler",
        bits: int = 0,
        chunk: int = CHUNK,
        bare: mujoco.MjModel | None = None,
    ) -> None:
        self.start, self.chunk = scene.start_vector, chunk
        self.model = copy.copy(bare or scene.model)
        self.model.opt.timestep, self.model.opt.integrator = TIMESTEP_S, INTEGRATORS[integrator]
        self.model.opt.disableflags |= bits
        self.data = mujoco.MjData(self.model)

    def reset(self) -> None:
        """Back to the start."""
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, self.start, FULL_STATE)

    def __call__(self) -> None:
        """All steps, in chunks."""
        self.reset()
        model, data, chunk = self.model, self.data, self.chunk
        if chunk == 1:
            for _ in range(STEPS):
                mujoco.mj_step(model, data)
        else:
            for _ in range(STEPS // chunk):
                mujoco.mj_step(model, data, nstep=chunk)

    def trajectory(self) -> Array:
        """qpos and qvel after every step, shape (STEPS, nq + nv)."""
        self.reset()
        rows = np.empty((STEPS, self.model.nq + self.model.nv))
        for row in rows:
            mujoco.mj_step(self.model, self.data)
            row[:] = np.concatenate([self.data.qpos, self.data.qvel])
        return rows


def with_timer(work: Callable[[], object]) -> Callable[[], None]:
    """The same with the wheel's profiling timer on."""

    def timed() -> None:
        with profiling_timer():
            work()

    return timed


def largest_difference(scene: Scene, bits: int, bare: mujoco.MjModel | None = None) -> dict[str, float]:
    """Per integrator, the largest difference of any state over the run; 0 only if bitwise equal."""
    found = {}
    for integrator in INTEGRATORS:
        whole, less = Run(scene, integrator).trajectory(), Run(scene, integrator, bits, bare=bare).trajectory()
        same = whole.tobytes() == less.tobytes()
        found[integrator] = 0.0 if same else max(float(np.abs(whole - less).max()), 5e-324)
    return found


def flag_task(name: str, need: Need, budget_s: float) -> Task:
    """One part of the engine on one scene: the proof, the bits, and the time without it."""

    def measure() -> Record:
        scene = load_scene(name)
        differences = largest_difference(scene, need.flag)
        timed = paired(Run(scene), Run(scene, bits=need.flag), budget_s)
        return {
            "part": need.part,
            "proven": is_proven(need),
            "reason": need.reason,
            "bitwise": all(difference == 0 for difference in differences.values()),
            "largest_difference": max(differences.values()),
            **asdict(timed),
        }

    return Task(f"flag/{name}/{need.part}", measure)


def is_proven(need: Need) -> bool:
    """Proven not to change the motion. Sensors never do; they are skipped only where nobody reads them."""
    return not need.needed or (need.part == "sensors" and "read" in need.reason)


def ladder_task(name: str, budget_s: float) -> Task:
    """Cumulative: from a Python loop as the wheel comes, by timer off, chunks in C, each proven flag, no visuals."""

    def measure() -> Record:
        scene = load_scene(name)
        first = with_timer(Run(scene, chunk=1))
        rungs: list[tuple[str, Callable[[], object]]] = [
            ("timer off", Run(scene, chunk=1)),
            ("steps in C", Run(scene)),
        ]
        bits = 0
        for need in scene.needs:
            if need.flag and is_proven(need):
                bits |= need.flag
                rungs.append((need.part, Run(scene, bits=bits)))
        bare = without_visuals(scene_text(name), scene.model, scene.needs)
        if bare is not None:
            rungs.append(("visuals", Run(scene, bits=bits, bare=bare)))
        timed = [{"rung": rung} | asdict(paired(first, work, budget_s)) for rung, work in rungs]
        differences = largest_difference(scene, bits, bare)
        return {"rungs": timed, "bitwise": all(d == 0 for d in differences.values()), "bits": bits}

    return Task(f"ladder/{name}", measure)


def skip_tasks(quick: bool) -> list[Task]:
    """Every part with a flag on every scene, and the cumulative ladder of each scene."""
    budget_s = 0.05 if quick else 0.5
    tasks = []
    for name in SCENES:
        tasks += [flag_task(name, need, budget_s) for need in load_scene(name).needs if need.flag]
        tasks.append(ladder_task(name, budget_s))
    return tasks
