"""Asks for advice on many models, and holds each choice against a reference that advise did not use.

`python -m grader.studies.advise.survey OUT.json MODEL.xml ...` writes a row for each model as it goes, and continues
where it stopped. The starts are those of `grader advise MODEL --seconds 1 --perturb 1`. With `--again EARLIER.json` a
choice that is the same as in that survey, for the same time, keeps the check it had: an independent reference takes
longer than the advice, and depends on the choice alone.
"""

import json
import os
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import scipy.integrate  # noqa: F401  here, so that the first model's cost does not hold its import
import typer

from grader.errors import Unprocessable
from grader.numerics.accuracy.reference import Adaptive, find_obstacle, solve_adaptively
from grader.numerics.integrators import EULER
from grader.numerics.scene import Scene, Vector
from grader.studies.advise.meter import Meter, States, extrapolate, interpolate
from grader.studies.advise.report import TOLERANCE, Advice, RunStart, advise, build_scene

SECONDS = 1.0
START = RunStart(perturb=1.0)
PACKAGES = {
    "gymnasium": "Gymnasium",
    "dm_control": "dm_control",
    "gymnasium_robotics": "Gymnasium-Robotics",
    "mjx": "MJX",
}
"""Folders by which a model's origin is known."""

PLAIN_FOLDERS = ("assets", "envs", "mujoco", "suite", "test_data")
"""Folders that do not tell one model from another of the same name."""

RTOLS = ((1e-8, 1e-10), (1e-6, 1e-7))
"""Tolerances of the adaptive methods of the independent reference, whose distance is its uncertainty; the second pair
is for where the first gets stuck."""

EULER_S, EULER_LARGE_S, LARGE = 1e-5, 4e-5, 12
"""Timestep [s] of Euler's runs where the adaptive methods get stuck, and of models with more degrees of freedom than
LARGE; half of it is run too."""


CHECK = ("independent", "independent_doubt", "independent_error")
"""Keys of a row that the independent reference fills."""


def survey(
    path: Path, earlier: dict[str, Any], *, seconds: float = SECONDS, tolerance: float = TOLERANCE
) -> dict[str, Any]:
    """Returns the advice on one model, what it cost, and the error of the choice by the independent reference, or by
    that of an `earlier` row with the same choice."""
    began = time.process_time()
    try:
        advice = advise(path, tol=tolerance, seconds=seconds, start=START, budget_s=120.0)
    except Unprocessable as error:
        return {"verdict": "refused", "why": str(error), "cpu_s": time.process_time() - began}
    selection, cpu_s = advice.selection, time.process_time() - began
    row: dict[str, Any] = {
        "verdict": name_verdict(advice),
        "why": selection.reason,
        "until_s": selection.until_s,
        "doubt": selection.reference_error if np.isfinite(selection.reference_error) else None,
        "reference": selection.reference,
        "settings": len(selection.candidates),
        "cpu_s": cpu_s,
    }
    if selection.best is None:
        return row
    best = selection.best
    choice = {"integrator": best.integrator.name, "timestep_s": best.timestep_s, "error": best.error}
    row["choice"] = choice
    if name_check(row) == name_check(earlier):
        return row | {key: earlier[key] for key in CHECK}
    return row | check_choice(path, advice, selection.until_s or seconds)


def name_check(row: dict[str, Any]) -> tuple[Any, ...]:
    """Returns what the check of a row depends on: the setting, the time, and which methods are independent."""
    choice = row.get("choice", {})
    return choice.get("integrator"), choice.get("timestep_s"), row.get("until_s"), row.get("reference") == "DOP853"


def name_verdict(advice: Advice) -> str:
    """Returns `choice`, `choice until`, `none passes` or `cannot tell`."""
    selection = advice.selection
    if selection.best is None:
        return "cannot tell" if selection.reason.startswith("cannot tell:") else "none passes"
    return "choice" if selection.until_s is None else "choice until"


def check_choice(path: Path, advice: Advice, seconds: float) -> dict[str, Any]:
    """Returns the error of the choice by another method than advise's reference, and that method's own uncertainty."""
    best = advice.selection.best
    assert best is not None
    scene = build_scene(path, START)
    meter = Meter(scene, seconds, None)
    times = meter.times_of(best.timestep_s)
    method: Adaptive = "LSODA" if advice.selection.reference == "DOP853" else "DOP853"
    pair: tuple[States, States] | None = None
    if find_obstacle(scene, constraints=False) is None:
        pair = next(filter(None, (solve_pair(scene, times, method, rtols) for rtols in RTOLS)), None)
    coarse, fine = run_euler(meter, times) if pair is None else pair
    chosen = meter.run(best.setting, times).rollout
    return {
        "independent": "Euler, extrapolated" if pair is None else method,
        "independent_doubt": float(meter.distances(coarse, fine, times)[-1]),
        "independent_error": float(meter.distances(chosen, fine, times)[-1]),
    }


def solve_pair(
    scene: Scene, times: Vector, method: Adaptive, rtols: tuple[float, float]
) -> tuple[States, States] | None:  # fmt: skip
    """Returns the solutions at both tolerances; None where one gets stuck."""
    solutions = list[States]()
    for rtol in rtols:
        solutions += solve_adaptively(scene, times, method, rtol=rtol)
        if len(solutions[-1].time) < len(times):
            return None
    return solutions[0], solutions[1]


def run_euler(meter: Meter, times: Vector) -> tuple[States, States]:
    """Returns Euler's run, and its first-order extrapolation with the one at half the timestep."""
    whole_s = EULER_LARGE_S if meter.scene.model.nv > LARGE else EULER_S
    runs = [meter.reference_run((EULER, h), times) for h in (whole_s, whole_s / 2)]
    coarse, fine = (interpolate(meter.scene, run, times + meter.scene.start.time_s) for run in runs)
    return coarse, extrapolate(meter.scene, coarse, fine)


def name_model(path: Path) -> str:
    """Returns the name with the folder, if that says anything, and the package: `hand/reach (Gymnasium-Robotics)`."""
    at = next((i for i, part in enumerate(path.parts) if part in PACKAGES), -2)
    folder = [part for part in path.parts[at + 1 : -1] if part not in PLAIN_FOLDERS][-1:]
    return f"{'/'.join([*folder, path.stem])} ({PACKAGES.get(path.parts[at], path.parts[at])})"


def main(out: Path, models: list[Path], again: Path | None = None) -> None:
    """Survey the models, and write OUT as JSON."""
    earlier = {} if again is None else json.loads(again.read_text(encoding="utf-8"))["models"]
    kept = json.loads(out.read_text(encoding="utf-8"))["models"] if out.is_file() else {}
    for path in models:
        name = name_model(path)
        if name in kept:
            continue
        model = mujoco.MjModel.from_xml_path(str(path))
        kept[name] = {"degrees": int(model.nv), **survey(path, earlier.get(name, {}))}
        about = {"seconds": SECONDS, "tolerance": TOLERANCE, "mujoco": mujoco.__version__, "cores": os.cpu_count()}
        out.write_text(json.dumps({**about, "models": kept}, indent=1) + "\n", encoding="utf-8")
        print(f"{name}: {kept[name]['verdict']}, {kept[name]['cpu_s']:.2f} s", flush=True)


if __name__ == "__main__":
    typer.run(main)
