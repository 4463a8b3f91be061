"""Run time against error: five integrators and ten timesteps on seven scenes, and what a user would pick instead."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

import mujoco
import numpy as np

from grader.bench.by_hand import Array
from grader.bench.journal import Record, Task
from grader.bench.peers import Peer, peers_of
from grader.bench.scenes import load_scene
from grader.bench.settings_grid import END_TIMES_S, HORIZON_S, INTEGRATORS, SAMPLE_TIMES_S, TIMESTEPS_S, YARDSTICK
from grader.bench.timing import paired
from grader.bench.truth import error_of, truth_task
from grader.bench.wheel_timer import timer_is_known
from grader.numerics.rollout import simulate
from grader.numerics.scene import FULL_STATE, Scene
from grader.numerics.stepping import advance_coarsely

SCENES = (
    "double_pendulum",
    "servo",
    "stiff_servo",
    "spinning_body",
    "eccentric_body",
    "joint_limits",
    "cube",
)


class Stepping:
    """Called, it runs the scene once over the horizon as cheaply as MuJoCo can: proven flags off, chunks in C."""

    def __init__(self, scene: Scene, integrator: str, timestep_s: float) -> None:
        self.start = scene.start_vector
        self.steps = round(HORIZON_S / timestep_s)
        code = INTEGRATORS[integrator]
        with scene.borrow(timestep_s=timestep_s, integrator=code, skip=True, keep=False) as workspace:
            self.workspace = workspace

    def __call__(self) -> int:
        """The number of whole steps that were done."""
        model, data = self.workspace.model, self.workspace.data
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, self.start, FULL_STATE)
        return advance_coarsely(self.workspace, self.steps)


@dataclass(frozen=True)
class Subject:
    """One scene with its reference, qpos at SAMPLE_TIMES_S, and the CPU time that a measurement may take [s]."""

    name: str
    scene: Scene
    truth: Array
    budget_s: float

    def setting_task(self, integrator: str, timestep_s: float) -> Task:
        """Error and CPU time of one setting of MuJoCo; no error where it warned: the rest is of a reset state."""

        def measure() -> Record:
            work = Stepping(self.scene, integrator, timestep_s)
            timed = asdict(paired(work, Stepping(self.scene, *YARDSTICK), self.budget_s))
            return {"error": None, "steps": work.steps} | self.error(integrator, timestep_s) | timed

        return Task(f"setting/{self.name}/{integrator}/{timestep_s:g}", measure)

    def error(self, integrator: str, timestep_s: float) -> Record:
        """The error, or the warning and the step before it."""
        code = INTEGRATORS[integrator]
        run = simulate(
            self.scene, seconds=HORIZON_S, timestep_s=timestep_s, integrator=code, at_s=SAMPLE_TIMES_S.tolist()
        )
        if run.warning is not None:
            return {"warning": run.warning.name, "diverged_at_step": run.diverged_at_step}
        return {"error": error_of(self.scene, run.qpos, self.truth)}

    def peer_task(self, peer: Peer, setting: float) -> Task:
        """Error and CPU time of a peer, against the same reference and the same yardstick."""

        def measure() -> Record:
            try:
                error = error_of(self.scene, peer.run(setting, SAMPLE_TIMES_S), self.truth)
            except ArithmeticError as failure:
                return {"error": None, "why": str(failure)}
            yardstick = Stepping(self.scene, *YARDSTICK)
            return {"error": error} | asdict(
                paired(lambda: peer.run(setting, END_TIMES_S), yardstick, self.budget_s, least=3)
            )

        return Task(f"peer/{self.name}/{peer.name}/{setting:g}", measure)

    def tasks(self, choose: slice) -> list[Task]:
        """The chosen settings of MuJoCo and of the peers."""
        found = [self.setting_task(kind, h) for kind in INTEGRATORS for h in TIMESTEPS_S[choose]]
        for peer in peers_of(self.name, self.scene):
            found += [self.peer_task(peer, setting) for setting in peer.settings[choose]]
        return found


ALL, FEW = slice(None), slice(0, 7, 2)
"""Every setting; or four, without the finest, which take longest."""


def measure_precision(quick: bool, do: Callable[[list[Task]], dict[str, Record]]) -> Mapping[str, Record]:
    """References first, then every setting against them."""
    truths = do([truth_task(name) for name in SCENES])
    tasks = []
    for name in SCENES:
        truth = np.array(truths[f"truth/{name}"]["qpos"])
        tasks += Subject(name, load_scene(name), truth, 0.02 if quick else 0.3).tasks(FEW if quick else ALL)
    return truths | do(tasks) | {"timer": {"profiling_timer": timer_is_known()}}
