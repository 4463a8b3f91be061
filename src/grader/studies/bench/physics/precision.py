"""Run time against error: five integrators and ten timesteps on seven scenes, and what a user would pick instead."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import chain, pairwise
from typing import Any

import mujoco
import numpy as np
from matplotlib.figure import Figure

from grader.numerics.accuracy.convergence import fit_order, measure_position_distance
from grader.numerics.accuracy.reference import solve_dop853
from grader.numerics.integrators import BY_NAME
from grader.numerics.rollout import simulate
from grader.numerics.scene import FULL_STATE, Scene
from grader.numerics.stepping import advance_coarsely
from grader.studies.bench.physics.peers import (
    EQUATIONS,
    Array,
    find_peers,
    make_by_hand,
    make_exact,
    make_over_mj_forward,
)
from grader.studies.bench.scenes import describe_scene, load_scene
from grader.studies.bench.study import COLOURS, Measurement, Record, Records, Study, select_kind
from grader.studies.bench.timing import compute_median_interval, is_timer_known, measure_pairs

SCENES = ("double_pendulum", "servo", "stiff_servo", "spinning_body", "eccentric_body", "joint_limits", "cube")
PEER_SCENES = ("double_pendulum", "spinning_body", "joint_limits")
"""The scenes whose peers are drawn."""

TIMESTEPS_S = tuple(0.016 / 2**k for k in range(10))
"""16 ms down to 31 us by halves, with the default 2 ms among them."""

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
"""Relative tolerances of the adaptive peers."""

SAMPLES, SAMPLE_EVERY_S = 64, 0.016
HORIZON_S = SAMPLES * SAMPLE_EVERY_S
"""1.024 s: every timestep divides the sampling interval, so that all runs are compared at the same instants."""

SAMPLE_TIMES_S: Array = SAMPLE_EVERY_S * np.arange(SAMPLES + 1, dtype=np.float64)
"""Start included; shape (SAMPLES + 1,)."""

END_TIMES_S: Array = SAMPLE_TIMES_S[[0, -1]]
"""Start and end alone: timed runs record nothing in between."""

YARDSTICK = ("Euler", 0.002)
"""MuJoCo's defaults: every CPU time is quoted in runs of this setting on the same scene."""

BUDGET_S = {True: 0.02, False: 0.3}
"""CPU time of a comparison [s], by whether the run is quick."""

ERRORS = tuple(10.0**-k for k in range(1, 11))
"""The position errors [rad or m] that the cheapest setting is sought for."""

NOISE_FACTOR = 30
"""Errors below this many times the reference's own error say nothing about the order."""

COARSE = 0.05
"""Errors above this [rad or m] are not yet in the asymptotic range."""

PROCEDURE = {"start": ("implicitfast", 0.002), "quarter": ("RK4", 0.0005), "four_times": ("RK4", 0.008)}
"""The lesson's start, and RK4 at a quarter and at four times its timestep [s]."""


class Stepping:
    """Called, it runs a scene over the horizon as fast as we can: proven flags off, chunks of steps in C."""

    def __init__(self, scene: Scene, integrator: str, timestep_s: float) -> None:
        self.start = scene.start_vector
        self.steps = round(HORIZON_S / timestep_s)
        code = BY_NAME[integrator].code
        with scene.borrow(timestep_s=timestep_s, integrator=code, skip=True, keep=False) as workspace:
            self.workspace = workspace

    def __call__(self) -> int:
        """Return the number of steps without a warning."""
        model, data = self.workspace.model, self.workspace.data
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, self.start, FULL_STATE)
        return advance_coarsely(self.workspace, self.steps)


def smooth(name: str, scene: Scene) -> tuple[Array, list[Array], str]:
    """DOP853 over mj_forward, beside itself at ten times the tolerance and beside the equations by hand."""
    best = np.asarray(solve_dop853(scene, SAMPLE_TIMES_S).qpos)
    others = [np.asarray(solve_dop853(scene, SAMPLE_TIMES_S, rtol=3e-13, atol=1e-14).qpos)]
    method = "DOP853 at rtol 3e-14 over mj_forward; own error: distance to rtol 3e-13"
    if name in EQUATIONS:
        others.append(make_by_hand(name, scene, "DOP853")(3e-14, SAMPLE_TIMES_S))
        method += " and to the equations by hand"
    return best, others, method


def through_impacts(scene: Scene) -> tuple[Array, list[Array], str]:
    """Returns two solvers of different families, whose error control finds every impact. The constraint solver is made
    exact first, so that its own tolerance is no part of the reference."""
    exact = make_exact(scene)
    best = make_over_mj_forward(exact, "DOP853")(1e-13, SAMPLE_TIMES_S)
    other = make_over_mj_forward(exact, "LSODA")(1e-12, SAMPLE_TIMES_S)
    return best, [other], "DOP853 at 1e-13 over mj_forward; own error: distance to LSODA at 1e-12"


@dataclass(frozen=True)
class Truth(Measurement):
    """The reference solution of a scene."""

    timed = False
    scene: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Solve, and take the largest distance to a solution found another way for the reference's own error."""
        scene = load_scene(self.scene)
        constrained = any(need.part == "constraints" and need.needed for need in scene.needs)
        best, others, method = through_impacts(scene) if constrained else smooth(self.scene, scene)
        return {
            "qpos": best.tolist(),
            "own_error": max(measure_position_distance(scene, best, other) for other in others),
            "method": method,
        }


@dataclass(frozen=True)
class Setting(Measurement):
    """MuJoCo's integrator `method` at the timestep `setting` [s]."""

    scene: str
    method: str
    setting: float

    def measure(self, quick: bool, done: Records) -> Record:
        """Error and CPU time of one setting of MuJoCo."""
        scene = load_scene(self.scene)
        work = Stepping(scene, self.method, self.setting)
        timed = asdict(measure_pairs(work, Stepping(scene, *YARDSTICK), BUDGET_S[quick]))
        error = self.error(np.array(done[Truth(self.scene)]["qpos"]), scene)
        return {"error": None, "steps": work.steps} | error | timed

    def error(self, truth: Array, scene: Scene) -> Record:
        """Returns the error; or the warning and the step before it, since MuJoCo resets the state then."""
        code, times = BY_NAME[self.method].code, SAMPLE_TIMES_S.tolist()
        run = simulate(scene, seconds=HORIZON_S, timestep_s=self.setting, integrator=code, at_s=times)
        if run.warning is not None:
            return {"warning": run.warning.name, "diverged_at_step": run.diverged_at_step}
        return {"error": measure_position_distance(scene, truth, run.qpos)}


@dataclass(frozen=True)
class PeerSetting(Measurement):
    """The peer `method` at a timestep [s] or a tolerance."""

    scene: str
    method: str
    setting: float

    def measure(self, quick: bool, done: Records) -> Record:
        """Error and CPU time of a peer, against the same reference and the same yardstick."""
        scene = load_scene(self.scene)
        run = find_peers(self.scene)[self.method].run
        try:
            positions = run(self.setting, SAMPLE_TIMES_S)
        except RuntimeError as failure:
            return {"error": None, "why": str(failure)}
        error = measure_position_distance(scene, np.array(done[Truth(self.scene)]["qpos"]), positions)
        yardstick = Stepping(scene, *YARDSTICK)
        timed = measure_pairs(lambda: run(self.setting, END_TIMES_S), yardstick, BUDGET_S[quick])
        return {"error": error} | asdict(timed)


def plan(quick: bool) -> Sequence[Measurement]:
    """References first, then every setting against them."""
    measurements: list[Measurement] = [Truth(name) for name in SCENES]
    chosen = slice(0, 7, 2) if quick else slice(None)  # four settings, without the finest, which take longest
    for name in SCENES:
        measurements += [Setting(name, kind, h) for kind in BY_NAME for h in TIMESTEPS_S[chosen]]
        for method, peer in find_peers(name).items():
            settings = TIMESTEPS_S if peer.setting == "timestep" else TOLERANCES
            measurements += [PeerSetting(name, method, setting) for setting in settings[chosen]]
    return measurements


@dataclass(frozen=True)
class Point:
    """One setting of one method on one scene; cost in yardsticks and the pairs it is the median of, error None where it
    failed."""

    method: str
    setting: float
    error: float | None
    cost: float
    pairs: tuple[float, ...]

    def over(self, other: "Point") -> Record:
        """Its cost over that of another point, with the 95 % interval."""
        return {"ratio": self.cost / other.cost, "interval": compute_median_interval(self.pairs, other.pairs)}


def list_points(records: Records, kind: type[Setting] | type[PeerSetting], scene: str) -> dict[str, list[Point]]:
    """Returns all points of a scene that could be timed, by method."""
    by_method: dict[str, list[Point]] = {}
    for key, record in select_kind(records, kind).items():
        if key.scene == scene and "ratio" in record:
            point = Point(key.method, key.setting, record["error"], record["ratio"], tuple(record["pairs"]))
            by_method.setdefault(key.method, []).append(point)
    return by_method


def find_front(points: Sequence[Point]) -> list[Point]:
    """Returns the points that no other point beats in both cost and error, cheapest first."""
    front: list[Point] = []
    for point in sorted((p for p in points if p.error is not None), key=lambda p: (p.cost, p.error)):
        if not front or point.error < front[-1].error:  # type: ignore[operator]
            front.append(point)
    return front


def find_cheapest(points: Sequence[Point], error: float) -> Point | None:
    """Returns the cheapest point within this error."""
    good = [point for point in points if point.error is not None and point.error <= error]
    return min(good, key=lambda point: point.cost, default=None)


def fit_asymptotic_order(points: Sequence[Point], own_error: float) -> Record | None:
    """Order with its 95 % interval over the asymptotic range; None for fewer than three points. The range begins below
    COARSE and ends at NOISE_FACTOR times `own_error`, or where a smaller timestep no longer lowers the error."""
    floor = NOISE_FACTOR * max(own_error, 1e-15)
    usable = [p for p in sorted(points, key=lambda p: -p.setting) if p.error and floor < p.error < COARSE]
    falling = usable[:1] + [finer for coarser, finer in pairwise(usable) if finer.error < coarser.error]  # type: ignore[operator]
    if len(falling) < 3:
        return None
    fit = fit_order([p.setting for p in falling], [p.error for p in falling if p.error])
    return {"order": fit.order, "interval": [fit.low, fit.high], "points": len(falling)}


def compare_with_peer(mujoco: Point | None, peer: Point | None) -> Record | None:
    """Returns the peer's cost over MuJoCo's, each at its cheapest setting within the same error."""
    if peer is None:
        return None
    if mujoco is None:
        return {"setting": peer.setting, "ratio": None}
    return {"setting": peer.setting} | peer.over(mujoco)


def summarise_procedure(points: Sequence[Point]) -> Record | None:
    """Errors of the settings of PROCEDURE, and their costs in runs of the start."""
    by_setting = {(point.method, point.setting): point for point in points}
    if not all(setting in by_setting for setting in PROCEDURE.values()):
        return None
    start = by_setting[PROCEDURE["start"]]
    chosen = {name: by_setting[setting] for name, setting in PROCEDURE.items()}
    return {
        name: {"error": point.error} | ({"ratio": 1.0} if point is start else point.over(start))
        for name, point in chosen.items()
    }


def summarise(records: Records) -> Record:
    """Per scene: reference, front, cheapest settings, orders, peers."""
    return {
        "horizon_s": HORIZON_S,
        "profiling_timer": is_timer_known(),
        "scenes": {name: summarise_scene(records, name) for name in SCENES},
    }


def summarise_scene(records: Records, scene: str) -> Record:
    """Everything the tables need about one scene."""
    truth = records[Truth(scene)]
    by_method, by_peer = list_points(records, Setting, scene), list_points(records, PeerSetting, scene)
    points = [*chain(*by_method.values())]
    best = {error: find_cheapest(points, error) for error in ERRORS}
    return {
        "reference": {"method": truth["method"], "own_error": truth["own_error"]},
        "pareto": [[p.method, p.setting, p.cost, p.error] for p in find_front(points)],
        "cheapest": {f"{error:.0e}": point and summarise_point(point) for error, point in best.items()},
        "errors": {name: [point.error for point in own] for name, own in by_method.items()},
        "costs": {name: [point.cost for point in own] for name, own in by_method.items()},
        "orders": {name: fit_asymptotic_order(own, truth["own_error"]) for name, own in by_method.items()},
        "peers": {
            name: {f"{error:.0e}": compare_with_peer(best[error], find_cheapest(own, error)) for error in ERRORS}
            for name, own in by_peer.items()
        },
        "procedure": summarise_procedure(points),
        "yardstick_s": min(r["yardstick_s"] for key, r in select_kind(records, Setting).items() if key.scene == scene),
        "warned": sum(1 for point in points if point.error is None),
    }


def summarise_point(point: Point) -> Record:
    """Returns one setting of MuJoCo for JSON."""
    return {
        "integrator": point.method,
        "timestep_s": point.setting,
        "ratio": point.cost,
        "interval": compute_median_interval(point.pairs),
        "error": point.error,
    }


MARKERS = dict(zip(COLOURS, "os^vD", strict=True))


def draw_settings(records: Records, summary: Record) -> Figure:
    """Error against CPU time, one panel a scene, the Pareto front in grey; the last panel explains the others."""
    figure = Figure(figsize=(14, 7.4))
    *panels, last = figure.subplots(2, 4).flat
    for axes, name in zip(panels, SCENES, strict=True):
        by_method = list_points(records, Setting, name)
        for kind, own in by_method.items():
            draw_line(axes, own, color=COLOURS[kind], marker=MARKERS[kind], ms=4, label=kind)
        front = find_front([*chain(*by_method.values())])
        draw_line(axes, front, color="black", lw=4, alpha=0.15, zorder=1, label="Pareto front")
        draw_axes(axes, summary["scenes"][name], describe_scene(name))
    last.axis("off")
    last.legend(*panels[0].get_legend_handles_labels(), loc="upper left", frameon=False)
    text = (
        f"{HORIZON_S:g} s simulated, timesteps 16 ms to 31 us by halves\n"
        f"MuJoCo {summary['versions']['mujoco']}, {summary['machine']['processor']}\n"
        "A setting that warned has no point."
    )
    last.text(0.02, 0.02, text, transform=last.transAxes, fontsize=8)
    return figure


def draw_line(axes: Any, points: Sequence[Point], **look: Any) -> None:
    """One method's settings with an error, in the order of cost."""
    ordered = sorted((p for p in points if p.error), key=lambda p: p.cost)
    axes.plot([p.cost for p in ordered], [p.error for p in ordered], **{"lw": 1} | look)


def draw_axes(axes: Any, scene: Record, title: str) -> None:
    """Logarithmic axes, and the level below which the reference itself is not known."""
    axes.set(xscale="log", yscale="log", ylim=(1e-15, 20), title=title, ylabel="sup-norm error [rad, m]")
    axes.set_xlabel(f"CPU time / ({1e3 * scene['yardstick_s']:.2f} ms: Euler at 2 ms)")
    level = scene["reference"]["own_error"]
    axes.axhspan(1e-17, level, facecolor="none", edgecolor="#bbbbbb", hatch="//", label="own error of the reference")


PEER_COLOURS = {
    "Python loop": "#999999",
    "mj_step(nstep)": "#aa3377",
    "SciPy": "#0077bb",
    "Pinocchio": "#cc3311",
    "Drake": "#009988",
}


def draw_peers(records: Records, summary: Record) -> Figure:
    """MuJoCo's Pareto front beside what a user would pick instead."""
    figure = Figure(figsize=(14, 5))
    for axes, name in zip(figure.subplots(1, 3), PEER_SCENES, strict=True):
        front = find_front([*chain(*list_points(records, Setting, name).values())])
        draw_line(axes, front, color="black", marker="o", ms=4, label="MuJoCo in C, its best settings")
        for method, own in list_points(records, PeerSetting, name).items():
            colour = next(colour for family, colour in PEER_COLOURS.items() if method.startswith(family))
            dash = ":" if "LSODA" in method or "Euler" in method else "-"
            marker = "x" if "mj_forward" in method else "."
            draw_line(axes, own, ls=dash, color=colour, marker=marker, ms=5, label=method)
        draw_axes(axes, summary["scenes"][name], describe_scene(name))
    handles = figure.axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    return figure


STUDY = Study("precision", plan, summarise, {"precision": draw_settings, "precision_peers": draw_peers})
