"""MuJoCo 3.14.0 beside 4.0.0: the error of RK4 at equal timesteps, on a free body and on hinges. Each version measures
itself: `python -m grader.studies.bench.physics.versions docs/measured/versions.json` writes the row of the MuJoCo that
runs it, and leaves the others."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from grader.numerics.accuracy.convergence import fit_order, measure_distance
from grader.numerics.accuracy.reference import list_sample_times, solve_dop853
from grader.numerics.integrators import RK4
from grader.numerics.rollout import simulate
from grader.numerics.version import INSTALLED
from grader.studies.bench.scenes import load_scene

SCENES = ("spinning_body", "double_pendulum")
TIMESTEPS_S = (0.004, 0.002, 0.001, 0.0005)
HORIZON_S = 1.024
SAMPLE_S = 0.032
"""Errors are evaluated at its multiples; every timestep divides it."""


def measure_errors(name: str) -> dict[str, Any]:
    """Measures the largest error of all positions (rotations in rad) at each timestep, and the order that they show."""
    scene, times = load_scene(name), np.asarray(list_sample_times(HORIZON_S, SAMPLE_S))
    reference = solve_dop853(scene, times)
    runs = (
        simulate(scene, seconds=HORIZON_S, timestep_s=h, integrator=RK4.code, at_s=times.tolist()) for h in TIMESTEPS_S
    )
    errors = [measure_distance(scene, run, reference).qpos for run in runs]
    return {"errors": [float(f"{error:.4g}") for error in errors], "order": fit_order(TIMESTEPS_S, errors).order}


def main(path: Path) -> None:
    """Write the row of the installed version into a file of results."""
    kept: dict[str, Any] = json.loads(path.read_text())["versions"] if path.exists() else {}
    kept[INSTALLED] = {name: measure_errors(name) for name in SCENES}
    path.write_text(json.dumps({"timesteps_s": TIMESTEPS_S, "versions": kept}, indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
