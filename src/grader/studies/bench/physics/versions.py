"""MuJoCo 3.14.0 beside 4.0.0: the error of RK4 at equal timesteps, on a free body and on hinges, and digests of the
runs of all scenes and models of the studies, which are equal where the runs are to the last bit. Each version measures
itself: `python -m grader.studies.bench.physics.versions docs/measured/versions.json` writes the row of the MuJoCo that
runs it, and leaves the others."""

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from grader.numerics.accuracy.convergence import fit_order, measure_distance
from grader.numerics.accuracy.reference import list_sample_times, solve_dop853
from grader.numerics.integrators import BY_NAME, RK4, Integrator
from grader.numerics.rollout import simulate
from grader.numerics.version import INSTALLED
from grader.studies.bench.physics.models import COURSE, find_gymnasium_models, load_model_scene
from grader.studies.bench.scenes import find_scene, load_scene

SCENES = ("spinning_body", "double_pendulum")
TIMESTEPS_S = (0.004, 0.002, 0.001, 0.0005)
HORIZON_S = 1.024
SAMPLE_S = 0.032
"""Errors are evaluated at its multiples; every timestep divides it."""

BITS_S, BITS_STEPS = (0.016, 0.004, 0.001), 300
"""Timesteps [s] and steps of the runs whose bits are compared."""


def measure_errors(name: str) -> dict[str, Any]:
    """Measures the largest error of all positions (rotations in rad) at each timestep, and the order that they show."""
    scene, times = load_scene(name), np.asarray(list_sample_times(HORIZON_S, SAMPLE_S))
    reference = solve_dop853(scene, times)
    runs = (
        simulate(scene, seconds=HORIZON_S, timestep_s=h, integrator=RK4.code, at_s=times.tolist()) for h in TIMESTEPS_S
    )
    errors = [measure_distance(scene, run, reference).qpos for run in runs]
    return {"errors": [float(f"{error:.4g}") for error in errors], "order": fit_order(TIMESTEPS_S, errors).order}


def compute_digest(name: str, integrator: Integrator) -> str:
    """Returns a digest of all states of a scene or model at each timestep of BITS_S; `refused` where MuJoCo refuses the
    integrator."""
    scene = load_scene(name) if find_scene(name).exists() else load_model_scene(name)
    digest = hashlib.sha256()
    for timestep_s in BITS_S:
        try:
            run = simulate(scene, steps=BITS_STEPS, timestep_s=timestep_s, integrator=integrator.code)
        except mujoco.FatalError:
            return "refused"
        digest.update(run.states.tobytes())
    return digest.hexdigest()[:12]


def list_names() -> list[str]:
    """Returns the names of all scenes of the studies and of the models on which skipping is measured."""
    scenes = sorted(path.stem for path in find_scene("cube").parent.glob("*.xml"))
    return [*scenes, *find_gymnasium_models(), *(f"{name} (course)" for name in COURSE)]


def main(path: Path) -> None:
    """Write the row of the installed version into a file of results."""
    kept: dict[str, Any] = json.loads(path.read_text())["versions"] if path.exists() else {}
    kept[INSTALLED] = {name: measure_errors(name) for name in SCENES}
    kept[INSTALLED]["digests"] = {
        name: {kind: compute_digest(name, integrator) for kind, integrator in BY_NAME.items()} for name in list_names()
    }
    path.write_text(json.dumps({"timesteps_s": TIMESTEPS_S, "versions": kept}, indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
