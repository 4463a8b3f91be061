"""Pictures of judged claims: the angle at both ends of each claim, the claims, the limits, and the stability line."""

from collections.abc import Sequence
from functools import lru_cache
from math import isfinite, pi, sqrt
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.exercises.kind import JudgedTrial, Trial
from grader.exercises.kinds.threshold.judging.judge import Bracket, Claim, NoLimit
from grader.exercises.kinds.threshold.limits import find_span
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.stability.equilibrium import find_equilibrium
from grader.numerics.stability.linear import EPS, compute_spectral_radius

POINTS_MAX = 200
LINE_POINTS = 25


def build_evidence(parameters: ThresholdParameters, visible: Sequence[JudgedTrial[Cell, Claim]]) -> dict[str, Any]:
    """Returns `angles`, `claims`, `limits` and `stability`, each a list with the trial's id as `case`. `claims` holds
    what the learner said; `limits` and `stability` are part of the solution."""
    return {
        "angles": [
            picture for trial in visible for picture in draw_angles(parameters, trial.trial, trial.judgement.outcome)
        ],
        "claims": [draw_claim(parameters, trial.trial, trial.judgement.outcome) for trial in visible],
        "limits": [draw_limits(parameters, trial.trial) for trial in visible],
        "stability": [draw_stability(parameters, trial.trial) for trial in visible],
    }


def draw_claim(parameters: ThresholdParameters, trial: Trial[Cell], claim: Claim) -> dict[str, Any]:
    """Returns the claimed bracket [ms] on the axis of the search [ms]; `claim_ms` is None where there is no bracket."""
    bracket = [claim.low, claim.high] if isinstance(claim, Bracket) else None
    is_drawn = bracket is not None and all(map(isfinite, bracket))
    return {
        "case": trial.id,
        "integrator": trial.problem.integrator.name,
        "search_ms": [1000 * value for value in parameters.search_s],
        "horizon_s": parameters.horizon_s,
        "claim_ms": [round_figures(1000 * value) for value in bracket] if bracket is not None and is_drawn else None,
        "said_none": isinstance(claim, NoLimit),
    }


def draw_limits(parameters: ThresholdParameters, trial: Trial[Cell]) -> dict[str, Any]:
    """Returns the linear limit and the limit within the horizon [ms], None where nothing of the search is unstable.
    `spring_ms` is the limit of the same scene without its damping: 2 over the largest frequency."""
    scene, code = trial.problem.scene, trial.problem.integrator.code
    span = find_span(scene, code, parameters.search_s, parameters.horizon_s)
    spring = find_undamped_limit(scene)
    return {
        "case": trial.id,
        "linear_ms": None if span is None else round_figures(1000 * span[0]),
        "within_ms": None if span is None else round_figures(1000 * span[1]),
        "spring_ms": None if spring is None else round_figures(1000 * spring),
    }


@lru_cache(maxsize=64)
def find_undamped_limit(scene: Scene) -> float | None:
    """Returns 2 / omega [s], omega the largest frequency of small motions at rest without velocity-dependent forces.
    The accelerations are differenced at zero velocity. None without an equilibrium or an oscillation. Source: explicit
    (semi-implicit) Euler on q'' = -omega^2 q is stable up to h = 2 / omega."""
    rest = find_equilibrium(scene)
    if rest is None:
        return None
    with rest.borrow() as workspace:
        model, data = workspace.model, workspace.data
        nv, origin = int(model.nv), data.qpos.copy()
        rates = np.empty((nv, nv))
        for column, nudge in enumerate(EPS * np.eye(nv)):
            pushed = []
            for way in (-1, 1):
                data.qpos[:] = origin
                data.qvel[:] = 0
                mujoco.mj_integratePos(model, data.qpos, way * nudge, 1.0)
                mujoco.mj_forward(model, data)
                pushed.append(data.qacc.copy())
            rates[:, column] = (pushed[1] - pushed[0]) / (2 * EPS)
    squared = float(np.max(-np.linalg.eigvals(rates).real, initial=0.0))
    return 2 / sqrt(squared) if isfinite(squared) and squared > (0.01 * pi) ** 2 else None


def round_figures(value: float) -> float:
    """Returns a number to seven figures."""
    return float(f"{value:.7g}")


def draw_angles(parameters: ThresholdParameters, trial: Trial[Cell], claim: Claim) -> list[dict[str, Any]]:
    """Returns the runs at both ends of a bracket, as far as they lie within the search."""
    shortest, longest = parameters.search_s
    if not isinstance(claim, Bracket):
        return []
    ends = zip(("lower end", "upper end"), (claim.low, claim.high), strict=True)
    return [draw_angle(parameters, trial, end, h) for end, h in ends if shortest <= h <= 2 * longest]


def draw_angle(parameters: ThresholdParameters, trial: Trial[Cell], end: str, timestep_s: float) -> dict[str, Any]:
    """Simulates at one end, and returns some points of the run."""
    scene, code = trial.problem.scene, trial.problem.integrator.code
    steps = round(parameters.horizon_s / timestep_s)
    rollout = simulate(scene, steps=steps, timestep_s=timestep_s, integrator=code)
    return {
        "case": trial.id,
        "end": end,
        "timestep_ms": 1000 * timestep_s,
        "diverged": rollout.diverged_at_step is not None,
        "time_s": thin(rollout.time),
        "angle": thin(rollout.qpos[:, 0]),
    }


def thin(values: NDArray[np.float64]) -> list[float]:
    """Returns at most POINTS_MAX of the values to seven figures; the first and the last are kept."""
    chosen = np.linspace(0, len(values) - 1, min(len(values), POINTS_MAX)).round().astype(int)
    return [round_figures(value) for value in values[chosen].tolist()]


def draw_stability(parameters: ThresholdParameters, trial: Trial[Cell]) -> dict[str, Any]:
    """Returns the spectral radius of one step at rest against the timestep; above 1 a small deviation grows."""
    line = np.linspace(*parameters.search_s, LINE_POINTS)
    return {
        "case": trial.id,
        "timestep_ms": [round_figures(1000 * h) for h in line],
        "radius": list(compute_radii(trial.problem.scene, trial.problem.integrator.code, tuple(line.tolist()))),
    }


@lru_cache(maxsize=64)
def compute_radii(scene: Scene, code: int, timesteps_s: tuple[float, ...]) -> tuple[float, ...]:
    """Returns the spectral radius at each timestep, to seven figures; none if the scene has no equilibrium."""
    rest = find_equilibrium(scene)
    if rest is None:
        return ()
    return tuple(round_figures(compute_spectral_radius(rest, timestep_s=h, integrator=code)) for h in timesteps_s)
