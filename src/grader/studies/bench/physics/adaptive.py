"""Adaptive solvers at the same error: SciPy's LSODA, DOP853 and Radau over mj_forward, beside the five integrators.
Costs are counted in evaluations of the forward dynamics, which do not depend on the machine or its load, and timed in
turns with MuJoCo's defaults. One scene is stiff and rich in contacts."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from typing import Any

import mujoco
import numpy as np
from matplotlib.figure import Figure

from grader.numerics.accuracy.convergence import fit_order, measure_position_distance
from grader.numerics.accuracy.reference import Method, build_rate
from grader.numerics.integrators import BY_NAME, EULER
from grader.numerics.rollout import simulate
from grader.numerics.stepping import STEPS_MAX
from grader.studies.bench.physics.peers import Array, make_adaptive, make_exact
from grader.studies.bench.scenes import describe_scene, load_scene
from grader.studies.bench.study import COLOURS, Measurement, Record, Records, Study, select_kind
from grader.studies.bench.timing import measure_pairs

SCENES = {"double_pendulum": 1.024, "stiff_servo": 1.024, "joint_limits": 1.024, "pile": 0.128}
"""Each scene and its simulated time [s]; timesteps and samples divide it."""

SAMPLES = 8
TIMESTEPS_S = tuple(0.016 / 2**k for k in range(8))
METHODS: tuple[Method, ...] = ("LSODA", "DOP853", "Radau")
TOLERANCES = (1e-3, 1e-5, 1e-7)
BEST: tuple[tuple[Method, float], ...] = (("DOP853", 1e-12), ("LSODA", 1e-11))
"""The reference, and the solver of another family that its own error is measured against."""

ERRORS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
YARDSTICK_S = 0.002
BUDGET_S = {True: 0.01, False: 0.02}
"""CPU time of a comparison [s], by whether the run is quick."""

FALLING = (1e-8, 0.02)
"""Errors that an order is fitted through [rad or m]: above the references' noise, below what is still coarse."""


def list_times(name: str) -> Array:
    """Returns the instants at which runs are compared [s], start included, (SAMPLES + 1,)."""
    return np.linspace(0, SCENES[name], SAMPLES + 1)


class Adaptive:
    """Called, it solves a scene at a relative tolerance, absolute a tenth of it; counts `evaluations` of mj_forward.
    Counted are those of numerical Jacobians too, which SciPy leaves out."""

    def __init__(self, name: str, method: Method, tolerance: float) -> None:
        self.name, self.tolerance = name, tolerance
        self.evaluations = 0
        with make_exact(load_scene(name)).borrow(integrator=EULER.code, keep=False, skip=True) as workspace:
            self.model, self.data = workspace.model, workspace.data
        rate = build_rate(workspace)

        def counted(time_s: float, state: Array) -> Array:
            self.evaluations += 1
            return rate(time_s, state)

        start = np.concatenate([self.data.qpos, self.data.qvel, self.data.act])
        self.run = make_adaptive(counted, start, int(self.model.nq), method)

    def __call__(self) -> Array:
        """The positions at the times of `list_times`, (SAMPLES + 1, nq). Raises RuntimeError where SciPy gives up."""
        self.evaluations = 0
        mujoco.mj_resetData(self.model, self.data)  # the warm start of the last run
        return self.run(self.tolerance, list_times(self.name))


def make_run(name: str, integrator: str, timestep_s: float) -> Callable[[], object]:
    """Returns a run of MuJoCo that keeps its end alone."""
    scene, code = load_scene(name), BY_NAME[integrator].code
    steps = round(SCENES[name] / timestep_s)
    return lambda: simulate(scene, steps=steps, timestep_s=timestep_s, integrator=code, every=STEPS_MAX)


@dataclass(frozen=True)
class Truth(Measurement):
    """The reference solution of a scene."""

    timed = False
    scene: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Solve by both of BEST; the own error is their distance. Counts how often the active constraints change."""
        best, other = (Adaptive(self.scene, *setting)() for setting in BEST)
        scene = load_scene(self.scene)
        with scene.borrow(timestep_s=TIMESTEPS_S[-1], keep=False) as workspace:
            rows = []
            for _ in range(round(SCENES[self.scene] / TIMESTEPS_S[-1])):
                mujoco.mj_step(workspace.model, workspace.data)
                rows.append(int(workspace.data.nefc))
        changes = int(np.count_nonzero(np.diff(rows)))
        own = measure_position_distance(scene, best, other)
        return {"qpos": best.tolist(), "own_error": own, "most_constraints": max(rows), "changes": changes}


@dataclass(frozen=True)
class Fixed(Measurement):
    """One of MuJoCo's integrators at a timestep [s]."""

    scene: str
    method: str
    setting: float

    def measure(self, quick: bool, done: Records) -> Record:
        """Error, evaluations and CPU time."""
        scene, integrator = load_scene(self.scene), BY_NAME[self.method]
        steps = round(SCENES[self.scene] / self.setting)
        times = list_times(self.scene).tolist()
        run = simulate(make_exact(scene), steps=steps, timestep_s=self.setting, integrator=integrator.code, at_s=times)
        truth = np.array(done[Truth(self.scene)]["qpos"])
        error = measure_position_distance(scene, truth, run.qpos) if run.diverged_at_step is None else None
        yardstick = make_run(self.scene, EULER.name, YARDSTICK_S)
        timed = measure_pairs(make_run(self.scene, self.method, self.setting), yardstick, BUDGET_S[quick])
        return {"error": error, "evaluations": steps * integrator.evaluations} | asdict(timed)


@dataclass(frozen=True)
class Solved(Measurement):
    """An adaptive solver at a tolerance."""

    scene: str
    method: Method
    setting: float

    def measure(self, quick: bool, done: Records) -> Record:
        """Error, evaluations and CPU time; or why the solver gave up."""
        work = Adaptive(self.scene, self.method, self.setting)
        try:
            positions = work()
        except RuntimeError as failure:
            return {"error": None, "why": str(failure)}
        error = measure_position_distance(load_scene(self.scene), np.array(done[Truth(self.scene)]["qpos"]), positions)
        counted = {"error": error, "evaluations": work.evaluations}
        yardstick = make_run(self.scene, EULER.name, YARDSTICK_S)
        return counted | asdict(measure_pairs(work, yardstick, BUDGET_S[quick]))


def plan(quick: bool) -> Sequence[Measurement]:
    """References first, then every setting against them."""
    measurements: list[Measurement] = [Truth(name) for name in SCENES]
    for name in SCENES:
        measurements += [Fixed(name, kind, h) for kind in BY_NAME for h in TIMESTEPS_S[:: 3 if quick else 1]]
        measurements += [Solved(name, method, t) for method in METHODS for t in TOLERANCES[: 2 if quick else None]]
    return measurements


def list_settings(records: Records, scene: str, kind: type[Fixed] | type[Solved]) -> dict[str, list[Record]]:
    """Returns the records of a scene that have an error, each with its setting, by method."""
    settings: dict[str, list[Record]] = {}
    for key, record in select_kind(records, kind).items():
        if key.scene == scene and record["error"] is not None:
            settings.setdefault(key.method, []).append({"method": key.method, "setting": key.setting} | record)
    return settings


def summarise(records: Records) -> Record:
    """Per scene: the reference, the fewest evaluations within each error, and the orders of the five integrators."""
    return {"horizons_s": SCENES, "scenes": {name: summarise_scene(records, name) for name in SCENES}}


def summarise_scene(records: Records, scene: str) -> Record:
    """Everything the tables need about one scene."""
    truth, fixed = records[Truth(scene)], list_settings(records, scene, Fixed)
    cheapest = {f"{error:.0e}": summarise_fewest(chain(*fixed.values()), error) for error in ERRORS}
    return {
        "reference": {name: truth[name] for name in ("own_error", "most_constraints", "changes")},
        "mujoco": cheapest,
        "adaptive": {
            method: {f"{error:.0e}": summarise_fewest(own, error) for error in ERRORS}
            for method, own in list_settings(records, scene, Solved).items()
        },
        "errors": {
            method: {f"{1e3 * run['setting']:.4g} ms": run["error"] for run in own} for method, own in fixed.items()
        },
        "orders": {method: summarise_order(own) for method, own in fixed.items()},
    }


def summarise_fewest(settings: Any, error: float) -> Record | None:
    """The setting within an error that takes the fewest evaluations; its cost is in runs of MuJoCo's defaults."""
    good = [setting for setting in settings if setting["error"] <= error]
    if not good:
        return None
    best = min(good, key=lambda record: int(record["evaluations"]))
    return {name: best[name] for name in ("method", "setting", "evaluations", "ratio", "interval")}


def summarise_order(settings: list[Record]) -> Record | None:
    """Returns the order through the errors of FALLING, with its 95 % interval; None for fewer than three."""
    used = [setting for setting in settings if FALLING[0] < setting["error"] < FALLING[1]]
    if len(used) < 3:
        return None
    fit = fit_order([run["setting"] for run in used], [run["error"] for run in used])
    return {"order": fit.order, "interval": [fit.low, fit.high], "points": len(used)}


ALL_COLOURS = COLOURS | {"LSODA": "#000000", "DOP853": "#666666", "Radau": "#bb8800"}


def draw(records: Records, _summary: Record) -> Figure:
    """Error against evaluations on every scene."""
    figure = Figure(figsize=(14, 4.4))
    for axes, name in zip(figure.subplots(1, len(SCENES)), SCENES, strict=True):
        for kind, look in ((Fixed, "o-"), (Solved, "x--")):
            for method, own in list_settings(records, name, kind).items():
                counts, errors = [run["evaluations"] for run in own], [run["error"] for run in own]
                axes.plot(counts, errors, look, color=ALL_COLOURS[method], ms=3.5, lw=1, label=method)
        axes.axhline(records[Truth(name)]["own_error"], color="#bbbbbb", lw=3, label="own error of the reference")
        axes.set(xscale="log", yscale="log", xlabel="evaluations of the forward dynamics", title=describe_scene(name))
    figure.axes[0].set_ylabel("largest position error [rad, m]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=9, frameon=False)
    return figure


STUDY = Study("adaptive", plan, summarise, {"adaptive": draw})
