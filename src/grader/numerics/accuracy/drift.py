"""How far the energy drifts along a run, and what a step of it costs."""

import time
from dataclasses import dataclass

import mujoco
import numpy as np

from grader.numerics.integrators import Integrator
from grader.numerics.scene import Scene, Vector
from grader.numerics.stepping import MujocoWarning, derive_copy, take_warnings


@dataclass(frozen=True)
class Drift:
    """A run under one integrator: `time_s` (n,), `energy_j` (n,), and what a step cost [us]. The cost is measured on
    this machine. After a reset by MuJoCo the run goes on; `warnings` tell of it."""

    integrator: str
    time_s: Vector
    energy_j: Vector
    warnings: tuple[MujocoWarning, ...]
    steps: int
    cost_us: float

    @property
    def energy_error(self) -> Vector:
        """How far the energy is from the start's (n,), in % of its absolute value; NaN where the start has none."""
        start = float(self.energy_j[0])
        return (self.energy_j - start) * (100.0 / abs(start) if start else float("nan"))


def measure_drift(scene: Scene, integrator: Integrator, timestep_s: float, steps: int, samples: int) -> Drift:
    """Step from the scene's start and read the energy at about `samples` times. It is derived for the state of that
    time: mj_step leaves in `data.energy` that of the state before, or of RK4's last stage. Raises ValueError for less
    than one step or sample."""
    if steps < 1 or samples < 1:
        raise ValueError(f"a drift needs steps and samples, not {steps} and {samples}")
    every = max(1, steps // samples)
    done, costs, warnings = [0], list[float](), list[MujocoWarning]()
    with scene.borrow(timestep_s=timestep_s, integrator=integrator.code, keep=False) as workspace:
        model, data = workspace.model, workspace.data
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        mujoco.mj_forward(model, data)
        shown = mujoco.MjData(model)
        energies = [float(data.energy.sum())]
        while done[-1] < steps:
            count = min(every, steps - done[-1])
            began = time.perf_counter()
            mujoco.mj_step(model, data, nstep=count)
            costs.append((time.perf_counter() - began) / count)
            warnings += take_warnings(workspace.counts, done[-1] * timestep_s)
            done.append(done[-1] + count)
            derive_copy(model, data, shown)
            energies.append(float(shown.energy.sum()))
    cost_us = 1e6 * float(np.median(costs))
    times = np.array(done) * timestep_s
    return Drift(integrator.name, times, np.array(energies), tuple(warnings), steps, cost_us)
