"""One scene under all five integrators from one state: how far the energy drifts, and what a step costs."""

import time
from dataclasses import dataclass
from math import isfinite
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.domain.lab import IntegratorsLab
from grader.errors import LabRefused
from grader.labs.record import Warned, noted, number_or_none
from grader.numerics.integrators import INTEGRATORS, Integrator
from grader.numerics.scene import Scene
from grader.numerics.workspace import Workspace

SAMPLES = 400
STEPS_MAX = 200_000
TIMESTEP_MIN_S, TIMESTEP_MAX_S = 1e-4, 0.1
SECONDS_MAX = 60.0


@dataclass(frozen=True)
class IntegratorRun:
    """One integrator: `time_s` (n,), `energy_error` (n,) in % of the start's |energy| [J], what a step cost [us].

    The cost is measured on this machine and decides nothing. Warnings as in a lab: the run goes on after a reset.
    """

    integrator: str
    time_s: NDArray[np.float64]
    energy_error: NDArray[np.float64]
    warnings: tuple[Warned, ...]
    steps: int
    cost_us: float

    def to_json(self) -> dict[str, Any]:
        """Plain JSON; an error that is not finite is null."""
        errors = [number_or_none(error) for error in self.energy_error]
        return {
            "name": self.integrator,
            "times": self.time_s.round(6).tolist(),
            "energy_error_percent": errors,
            "final_error_percent": errors[-1],
            "cost_us_per_step": round(self.cost_us, 3),
            "steps": self.steps,
            "warnings": [warning.to_json() for warning in self.warnings],
        }


@dataclass(frozen=True)
class IntegratorsRun:
    """The five runs, from one state, with one timestep [s]; `keys` are the keyframes that the model offers."""

    model: str
    key: str | None
    keys: tuple[str, ...]
    timestep_s: float
    seconds: float
    energy_j: float
    runs: tuple[IntegratorRun, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {
            "model": self.model,
            "key": self.key,
            "keys": list(self.keys),
            "timestep": self.timestep_s,
            "seconds": self.seconds,
            "energy": self.energy_j,
            "integrators": [run.to_json() for run in self.runs],
        }


def run_integrators(
    lab: IntegratorsLab,
    xml: str,
    *,
    model: str | None = None,
    key: int | str | None = None,
    timestep: float | None = None,
    seconds: float | None = None,
) -> IntegratorsRun:
    """Run the scene `xml` (of `model`, the lab's own where not named) under all five integrators.

    Energy is read as the lesson reads it: `data.energy` after each step. `key` is a keyframe's name or index, "" for
    none (qpos0). Raises LabRefused for a model, timestep [s] or length [s] that the lab does not offer, KeyError for
    an unknown keyframe, ValueError where the model does not compile.
    """
    timestep = lab.timestep if timestep is None else timestep
    model, seconds = model or lab.model, lab.seconds if seconds is None else seconds
    check_setting(lab, model, timestep, seconds)
    scene = Scene.from_xml(xml)
    keys = scene.names_of(mujoco.mjtObj.mjOBJ_KEY)
    key = lab.key if key is None and model == lab.model else key
    index = None if key is None or key == "" else scene.id_of(mujoco.mjtObj.mjOBJ_KEY, key)
    scene = scene if index is None else scene.at(key=index)
    steps = round(seconds / timestep)
    with scene.borrow(keep=False) as workspace:
        energy = _energy_at_start(workspace)
    runs = tuple(_run_one(scene, one, timestep, steps, energy) for one in INTEGRATORS)
    return IntegratorsRun(model, None if index is None else keys[index], keys, timestep, seconds, energy, runs)


def check_setting(lab: IntegratorsLab, model: str, timestep: float, seconds: float) -> None:
    """Raises LabRefused for a model, timestep [s] or length [s] that the lab does not offer."""
    if model != lab.model and model not in lab.models:
        raise LabRefused(f"model must be one of: {', '.join(dict.fromkeys((lab.model, *lab.models)))}.")
    if not (isfinite(timestep) and TIMESTEP_MIN_S <= timestep <= TIMESTEP_MAX_S):
        raise LabRefused(f"timestep must be a number from {TIMESTEP_MIN_S:g} to {TIMESTEP_MAX_S:g} s.")
    if not (isfinite(seconds) and 0 < seconds <= SECONDS_MAX) or seconds / timestep > STEPS_MAX:
        raise LabRefused(f"The run must last at most {SECONDS_MAX:g} s and {STEPS_MAX} steps.")
    if round(seconds / timestep) < 1:
        raise LabRefused("The run must last one timestep or longer.")


def _energy_at_start(workspace: Workspace) -> float:
    workspace.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    mujoco.mj_forward(workspace.model, workspace.data)
    return float(workspace.data.energy.sum())


def _run_one(scene: Scene, integrator: Integrator, timestep: float, steps: int, energy: float) -> IntegratorRun:
    every = max(1, steps // SAMPLES)
    times, errors, warnings, costs = [0.0], [0.0], list[Warned](), list[float]()
    scale = 100.0 / abs(energy) if energy else float("nan")
    with scene.borrow(timestep_s=timestep, integrator=integrator.code, keep=False) as workspace:
        _energy_at_start(workspace)
        done = 0
        while done < steps:
            count = min(every, steps - done)
            began = time.perf_counter()
            mujoco.mj_step(workspace.model, workspace.data, nstep=count)
            costs.append((time.perf_counter() - began) / count)
            warnings += noted(workspace.counts, done * timestep)
            done += count
            times.append(done * timestep)
            errors.append(scale * (float(workspace.data.energy.sum()) - energy))
    cost_us = 1e6 * float(np.median(costs))
    return IntegratorRun(integrator.name, np.array(times), np.array(errors), tuple(warnings), steps, cost_us)
