"""One scene under all five integrators from one state: how far the energy drifts, and what a step costs."""

from dataclasses import dataclass
from math import isfinite
from typing import Any

import mujoco

from grader.domain.lab import SECONDS_MAX
from grader.errors import LabRefused
from grader.labs.kinds.integrators.lab import IntegratorsLab
from grader.labs.record import to_number_or_none, warnings_to_json
from grader.numerics.accuracy.drift import Drift, measure_drift
from grader.numerics.integrators import INTEGRATORS
from grader.numerics.scene import Scene

SAMPLES = 400
STEPS_MAX = 200_000
TIMESTEP_MIN_S, TIMESTEP_MAX_S = 1e-4, 0.1


@dataclass(frozen=True)
class IntegratorsRun:
    """The five runs, from one state with one energy [J]; `keys` are the keyframes that the model offers. The timestep
    and the length are in s. What a step cost decides nothing."""

    model: str
    key: str | None
    keys: tuple[str, ...]
    timestep: float
    seconds: float
    runs: tuple[Drift, ...]

    @property
    def energy(self) -> float:
        """The energy at the start [J]."""
        return float(self.runs[0].energy_j[0])

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        setting = {name: getattr(self, name) for name in ("model", "key", "timestep", "seconds", "energy")}
        return setting | {"keys": list(self.keys), "integrators": list(map(_drift_to_json, self.runs))}


def _drift_to_json(run: Drift) -> dict[str, Any]:
    """Plain JSON; an error that is not finite is null."""
    errors = [to_number_or_none(error) for error in run.energy_error]
    return {
        "name": run.integrator,
        "times": run.time_s.round(6).tolist(),
        "energy_error_percent": errors,
        "final_error_percent": errors[-1],
        "cost_us_per_step": round(run.cost_us, 3),
        "steps": run.steps,
        "warnings": warnings_to_json(run.warnings),
    }


def run_integrators(
    lab: IntegratorsLab, xml: str, *, model: str | None = None, key: int | str | None = None,
    timestep: float | None = None, seconds: float | None = None,
) -> IntegratorsRun:  # fmt: skip
    """Run the scene `xml` (of `model`, the lab's own where not named) under all five integrators.

    The energy is that of the state at each time. `key` is a keyframe's name or index, "" for none (qpos0);
    not given, it is the lab's own, or the first of another model, which may rest without one. Raises LabRefused for a
    model, timestep [s] or length [s] that the lab does not offer, KeyError for an unknown keyframe, ValueError where
    the model does not compile.
    """
    timestep = lab.timestep if timestep is None else timestep
    model, seconds = model or lab.model, lab.seconds if seconds is None else seconds
    check_setting(lab, model, timestep, seconds)
    scene = Scene.from_xml(xml)
    keys = scene.list_names(mujoco.mjtObj.mjOBJ_KEY)
    if key is None:
        key = lab.key if model == lab.model else 0 if keys else None
    index = None if key is None or key == "" else scene.find_id(mujoco.mjtObj.mjOBJ_KEY, key)
    scene = scene if index is None else scene.at(key=index)
    steps = round(seconds / timestep)
    runs = tuple(measure_drift(scene, integrator, timestep, steps, SAMPLES) for integrator in INTEGRATORS)
    return IntegratorsRun(model, None if index is None else keys[index], keys, timestep, seconds, runs)


def check_setting(lab: IntegratorsLab, model: str, timestep: float, seconds: float) -> None:
    """Raises LabRefused for a model, timestep [s] or length [s] that the lab does not offer."""
    if model not in lab.offered:
        raise LabRefused(f"model must be one of: {', '.join(lab.offered)}.")
    if not (isfinite(timestep) and TIMESTEP_MIN_S <= timestep <= TIMESTEP_MAX_S):
        raise LabRefused(f"timestep must be a number from {TIMESTEP_MIN_S:g} to {TIMESTEP_MAX_S:g} s.")
    if not (isfinite(seconds) and 0 < seconds <= SECONDS_MAX) or seconds / timestep > STEPS_MAX:
        raise LabRefused(f"The run must last at most {SECONDS_MAX:g} s and {STEPS_MAX} steps.")
    if round(seconds / timestep) < 1:
        raise LabRefused("The run must last one timestep or longer.")
