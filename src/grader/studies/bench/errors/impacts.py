"""Contact by distribution: the errors of many starts, whose impacts fall at other phases of a step. Every run and its
reference have the same contact parameters, so that the error is the integrator's alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import mujoco
import numpy as np
from matplotlib.figure import Figure

from grader.numerics.accuracy.convergence import fit_order, measure_position_distance
from grader.numerics.accuracy.reference import Method, build_rate, solve
from grader.numerics.integrators import BY_NAME, EULER, RK4
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.studies.bench.physics.peers import Array, make_exact
from grader.studies.bench.scenes import describe_scene, load_scene
from grader.studies.bench.study import COLOURS, Measurement, Record, Records, Study, select_kind

HORIZONS_S = {"joint_limits": 1.024, "cube": 0.512, "pile": 0.064}
"""Each scene and its simulated time [s]; timesteps and samples divide it."""

SPREAD = {"joint_limits": (0.1, 0.5), "cube": (0.02, 0.1), "pile": (0.001, 0.05)}
"""How far starts lie from the scene's own, in positions [m, rad] and velocities [m/s, rad/s]: uniform, either way. An
impact is moved by more than the largest timestep."""

STARTS = 200
TOGETHER = 10
"""Starts of one measurement."""

TIMESTEPS_S = {
    name: tuple(largest_s / 2**k for k in range(5))
    for name, largest_s in {"joint_limits": 0.008, "cube": 0.008, "pile": 0.002}.items()
}
"""Each scene's timesteps [s], by halves. MuJoCo lengthens a time constant that is below two steps; none is. Source:
MuJoCo's documentation of solref and of the flag refsafe."""

SAMPLE_S = 0.016
TINY_S = (6.25e-5, 1.5625e-5)
"""Timesteps of RK4 [s] whose distance to the reference bounds its error from another side: it falls with them."""

RTOL = 1e-9
BEST: Method = "LSODA"
OTHER: Method = "DOP853"
"""The reference, and the solver of another family that its own error is measured against, at the same tolerance."""

FOLLOWED = 5
"""Starts of each scene that are followed at the timesteps of TINY_S."""

PERCENT = 95


def list_times(name: str) -> Array:
    """Returns the instants at which runs are compared [s], start included."""
    return np.arange(0, HORIZONS_S[name] + SAMPLE_S / 2, SAMPLE_S)


def draw_start(name: str, number: int) -> Scene:
    """Returns the scene at a start of its own for each number; the same number gives the same start."""
    scene, (far, fast) = make_exact(load_scene(name)), SPREAD[name]
    generator = np.random.default_rng(number)
    qpos = np.array(scene.start.qpos)
    mujoco.mj_integratePos(scene.model, qpos, generator.uniform(-far, far, scene.model.nv), 1.0)
    return scene.at(qpos=qpos, qvel=scene.start.qvel + generator.uniform(-fast, fast, scene.model.nv))


def solve_positions(scene: Scene, times: Array, method: Method) -> Array:
    """Returns the positions by an adaptive solver, which finds the impacts by controlling its error, (times, nq).
    Raises RuntimeError where it gives up."""
    with scene.borrow(integrator=EULER.code, keep=False, skip=True) as workspace:
        data, nq = workspace.data, int(workspace.model.nq)
        start = np.concatenate([data.qpos, data.qvel, data.act])
        values = solve(build_rate(workspace), start, times[1:], rtol=RTOL, atol=RTOL / 10, method=method)
    return np.vstack([start[:nq], values[:, :nq]])


def measure_error(scene: Scene, truth: Array, integrator: str, timestep_s: float, times: Array) -> float | None:
    """Returns the largest position error [m, rad] of a run, None where MuJoCo warned."""
    code = BY_NAME[integrator].code
    run = simulate(scene, seconds=float(times[-1]), timestep_s=timestep_s, integrator=code, at_s=times.tolist())
    return None if run.diverged_at_step is not None else measure_position_distance(scene, truth, run.qpos)


@dataclass(frozen=True)
class Starts(Measurement):
    """TOGETHER starts of a scene, from a number on."""

    timed = False
    scene: str
    first: int

    def measure(self, quick: bool, done: Records) -> Record:
        """Measures each start under every integrator at every timestep, and the own errors of the first references."""
        times, timesteps_s = list_times(self.scene), TIMESTEPS_S[self.scene]
        errors: Record = {kind: [[] for _ in timesteps_s] for kind in BY_NAME}
        own_errors: list[float] = []
        for number in range(self.first, self.first + (2 if quick else TOGETHER)):
            scene = draw_start(self.scene, number)
            truth = solve_positions(scene, times, BEST)
            if number == self.first:
                own_errors.append(measure_position_distance(scene, truth, solve_positions(scene, times, OTHER)))
            for kind, by_timestep in errors.items():
                for own, timestep_s in zip(by_timestep, timesteps_s, strict=True):
                    own.append(measure_error(scene, truth, kind, timestep_s, times))
        return {"errors": errors, "own_errors": own_errors}


@dataclass(frozen=True)
class Tiny(Measurement):
    """One start followed by RK4 at the timesteps of TINY_S: a second way to the reference."""

    timed = False
    scene: str
    number: int

    def measure(self, quick: bool, done: Records) -> Record:
        """Measures the distance of both runs to the reference [m, rad]."""
        scene, times = draw_start(self.scene, self.number), list_times(self.scene)
        truth = solve_positions(scene, times, BEST)
        return {"distances": [measure_error(scene, truth, RK4.name, h, times) for h in TINY_S]}


def plan(quick: bool) -> Sequence[Measurement]:
    """Returns every start of every scene, and those that are followed at tiny timesteps."""
    measurements: list[Measurement] = []
    for name in HORIZONS_S:
        measurements += [Starts(name, first) for first in range(0, TOGETHER if quick else STARTS, TOGETHER)]
        measurements += [Tiny(name, number) for number in range(1 if quick else FOLLOWED)]
    return measurements


def summarise(records: Records) -> Record:
    """Per scene: the own error of the references, and median and 95 % of the errors with the orders that they show."""
    return {
        "horizons_s": HORIZONS_S,
        "timesteps_s": TIMESTEPS_S,
        "tiny_s": TINY_S,
        "scenes": {name: summarise_scene(records, name) for name in HORIZONS_S},
    }


def summarise_scene(records: Records, scene: str) -> Record:
    """Everything that the table and the sentences need about one scene."""
    own = [record for key, record in select_kind(records, Starts).items() if key.scene == scene]
    tiny = np.array([r["distances"] for key, r in select_kind(records, Tiny).items() if key.scene == scene])
    return {
        "starts": sum(len(record["errors"][RK4.name][0]) for record in own),
        "own_error": max(error for record in own for error in record["own_errors"]),
        "tiny": [float(distance) for distance in np.median(tiny, axis=0)],
        "integrators": {
            kind: summarise_errors(
                [[*chain(*runs)] for runs in zip(*(record["errors"][kind] for record in own), strict=True)],
                TIMESTEPS_S[scene],
            )
            for kind in BY_NAME
        },
    }


def summarise_errors(errors: Sequence[Sequence[float | None]], timesteps_s: Sequence[float]) -> Record:
    """Returns `median` and `high`, the 95th percentile, of the errors at each timestep, their orders, and how many runs
    warned; a run that warned counts as larger than any error."""
    sizes = [np.array([np.inf if error is None else error for error in own]) for own in errors]
    summary: Record = {"warned": sum(int(np.isinf(own).sum()) for own in sizes), "orders": {}}
    for name, percent in (("median", 50), ("high", PERCENT)):
        values = [float(np.percentile(own, percent, method="higher")) for own in sizes]
        summary[name] = [value if np.isfinite(value) else None for value in values]
        if np.all(np.isfinite(values)):
            fit = fit_order(timesteps_s, values)
            summary["orders"][name] = {"order": fit.order, "interval": [fit.low, fit.high]}
    return summary


def draw(_records: Records, summary: Record) -> Figure:
    """Draws the medians over the timesteps, each with a band up to the 95th percentile."""
    figure = Figure(figsize=(13, 4.4))
    for axes, (name, scene) in zip(figure.subplots(1, len(HORIZONS_S)), summary["scenes"].items(), strict=True):
        steps = [1e3 * h for h in TIMESTEPS_S[name]]
        for kind, curve in scene["integrators"].items():
            median, high = (np.array(curve[what], dtype=float) for what in ("median", "high"))
            axes.plot(steps, median, "o-", color=COLOURS[kind], ms=3.5, lw=1.2, label=kind)
            axes.fill_between(steps, median, high, color=COLOURS[kind], alpha=0.12, lw=0)
        axes.axhline(scene["own_error"], color="#bbbbbb", lw=3, label="own error of the reference")
        axes.set(xscale="log", yscale="log", xlabel="timestep [ms]", title=describe_scene(name))
    figure.axes[0].set_ylabel("position error [rad, m]: median to 95 %")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, frameon=False)
    return figure


STUDY = Study("impacts", plan, summarise, {"impacts": draw})
