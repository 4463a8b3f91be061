"""Stability to the limit: maps of the five integrators, their measured edges, and what lies beyond a warning."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache, partial
from typing import Any

import mujoco
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from grader.numerics.integrators import BY_NAME
from grader.numerics.scene import Scene
from grader.numerics.stability.bisection import find_threshold
from grader.numerics.stability.equilibrium import find_equilibrium
from grader.numerics.stability.limit import find_spectral_limit
from grader.numerics.stability.linear import RADIUS_NOISE, compute_spectral_radius
from grader.numerics.stability.servo import Servo
from grader.numerics.stability.trials import Criterion, Stability, try_timestep
from grader.studies.bench.physics.collisions import CASES, Collision, draw_cases, summarise_case
from grader.studies.bench.physics.grid import Plane, refine_map, to_grid, to_rows
from grader.studies.bench.scenes import load_scene
from grader.studies.bench.study import Measurement, Record, Records, Study, select_kind

SECONDS = 3.0
"""The lesson's horizon."""

LEVELS = {True: 5, False: 8}
"""Times that a map's side is halved, by whether the run is quick."""

PENDULUM_INERTIA = 0.2501
PENDULUM_GRAVITY_STIFFNESS = 4.905
OMEGA = 100.0
"""Angular frequency of the oscillator [rad/s]; only h * omega matters."""


class Class(IntEnum):
    """What a point of a map shows, the simulation beside the spectral radius."""

    STABLE = 0
    SLOW = 1
    WINDOW = 2
    UNSTABLE = 3
    FRAGILE = 4


LOOK = {
    Class.STABLE: ("#e8f1e4", "stable: no warning in 3 s, spectral radius at most 1"),
    Class.SLOW: ("#ffcf56", "no warning in 3 s, yet the spectral radius is above 1"),
    Class.WINDOW: ("#7b3fa0", "warned, but not with BADQACC: the lesson's test says stable"),
    Class.UNSTABLE: ("#d9827a", "BADQACC, spectral radius above 1"),
    Class.FRAGILE: ("#3b78b5", "warned although the spectral radius is at most 1"),
}
"""Colour and meaning."""


@dataclass(frozen=True, kw_only=True)
class Chart(Plane):
    """A map's plane; `servo` gives the closed forms at a parameter, and timesteps are drawn as `timestep_label`."""

    name: str
    servo: Callable[[float], Servo]
    timestep_scale: float = 1e3
    timestep_label: str = "h [ms]"

    def scene_at(self, value: float) -> Scene:
        """Returns the scene with its servo set for this value of the parameter."""
        servo = self.servo(value)

        def set_gains(model: mujoco.MjModel) -> None:
            model.actuator("servo").gainprm[0] = servo.kp
            model.actuator("servo").biasprm[1:3] = -servo.kp, -servo.kv

        return load_scene(self.scene).changed(set_gains)

    def closed_form_s(self, integrator: str, value: float) -> float:
        """Returns the largest stable timestep [s] by the closed form; inf where there is none."""
        servo = self.servo(value)
        limits = {"Euler": servo.euler_s, "RK4": servo.rk4_s, "discrete": servo.discrete_s}
        return limits.get(integrator, servo.implicit_s)


CHARTS = {
    "stiffness": Chart(
        name="stiffness", scene="servo", parameter="kp [N m/rad]", span=(100, 40000), timestep_span_s=(0.001, 0.1),
        servo=lambda kp: Servo(PENDULUM_INERTIA, kp, 5, PENDULUM_GRAVITY_STIFFNESS),
    ),
    "damping": Chart(
        name="damping", scene="servo", parameter="kv [N m s/rad]", span=(0.5, 100), timestep_span_s=(0.001, 0.2),
        servo=lambda kv: Servo(PENDULUM_INERTIA, 100, kv, PENDULUM_GRAVITY_STIFFNESS),
    ),
    "oscillator": Chart(
        name="oscillator", scene="oscillator", parameter="damping ratio", span=(0.01, 10),
        timestep_span_s=(0.1 / OMEGA, 10 / OMEGA),
        servo=lambda zeta: Servo(1.0, OMEGA**2, 2 * zeta * OMEGA), timestep_scale=OMEGA, timestep_label="h * omega",
    ),
}  # fmt: skip


@lru_cache(maxsize=300)
def build_column(chart: str, value: float) -> tuple[Scene, Scene]:
    """The scene at one value of a chart's parameter, at its start and at rest. Caches scenes, expensive to compile."""
    scene = CHARTS[chart].scene_at(value)
    resting = find_equilibrium(scene)
    assert resting is not None, "a servo holds an equilibrium"
    return scene, resting


@dataclass(frozen=True)
class OnChart(Measurement):
    """Measurements of one integrator on one chart."""

    timed = False
    chart: str
    integrator: str

    def classify(self, timestep_s: float, value: float) -> Class:
        """Simulate for 3 s and take the spectral radius."""
        scene, resting = build_column(self.chart, value)
        code = BY_NAME[self.integrator].code
        grows = compute_spectral_radius(resting, timestep_s=timestep_s, integrator=code) > 1 + RADIUS_NOISE
        trial = try_timestep(scene, timestep_s, SECONDS, integrator=code)
        if trial.stability is not Stability.UNSTABLE:
            return Class.SLOW if grows else Class.STABLE
        if not grows:
            return Class.FRAGILE
        lesson = try_timestep(scene, timestep_s, SECONDS, integrator=code, criterion=Criterion.BADQACC)
        return Class.UNSTABLE if lesson.stability is Stability.UNSTABLE else Class.WINDOW


@dataclass(frozen=True)
class Map(OnChart):
    """The refined map of 2^LEVELS + 1 points a side."""

    def measure(self, quick: bool, done: Records) -> Record:
        """Classify points where the class changes."""
        timesteps_s, values = CHARTS[self.chart].ticks(2 ** LEVELS[quick] + 1)
        coarse = 2 if quick else 3
        classes, evaluated = refine_map(
            LEVELS[quick], coarse, lambda row, column: self.classify(timesteps_s[row], values[column])
        )
        return {"classes": to_rows(classes), "evaluated": to_rows(evaluated)}

    def rows(self, record: Record) -> list[Record]:
        """Returns one row an evaluated point."""
        classes = to_grid(record["classes"])
        timesteps_s, values = CHARTS[self.chart].ticks(len(classes))
        return [
            {"parameter": values[j], "timestep_s": timesteps_s[i], "class": Class(classes[i, j]).name.lower()}
            for i, j in np.argwhere(to_grid(record["evaluated"]))
        ]


@dataclass(frozen=True)
class Full(OnChart):
    """The full grid of every second row and column of the map, to hold the map against."""

    def measure(self, quick: bool, done: Records) -> Record:
        """Classify every point."""
        timesteps_s, values = CHARTS[self.chart].ticks(2 ** (LEVELS[quick] - 1) + 1)
        return {"classes": to_rows([[self.classify(h, value) for value in values] for h in timesteps_s])}


@dataclass(frozen=True)
class Edge(OnChart):
    """The largest stable timestep at one value of the parameter."""

    value: float

    def measure(self, quick: bool, done: Records) -> Record:
        """Measures three ways: simulated, by spectral radius, by closed form [s]."""
        chart, code = CHARTS[self.chart], BY_NAME[self.integrator].code
        scene, (low_s, high_s) = chart.scene_at(self.value), chart.timestep_span_s
        closed_s = chart.closed_form_s(self.integrator, self.value)
        if np.isfinite(closed_s):
            low_s, high_s = closed_s / 2, closed_s * 2
        threshold = find_threshold(scene, low_s=low_s, high_s=high_s, integrator=code, horizon_s=SECONDS)
        return {
            "parameter": self.value,
            "closed_s": closed_s if np.isfinite(closed_s) else None,
            "spectral_s": find_spectral_limit(scene, low_s=low_s, high_s=high_s, integrator=code),
            "simulated_s": None if threshold.bracket_s is None else sum(threshold.bracket_s) / 2,
        }


def plan(quick: bool) -> Sequence[Measurement]:
    """Refined maps, full grids to hold them against, edges, collisions."""
    pairs = [(chart, kind) for chart in CHARTS for kind in BY_NAME]
    edges = 5 if quick else 13
    return [
        *(Map(*pair) for pair in pairs),
        *(Full(*pair) for pair in pairs),
        *(Edge(*pair, value) for pair in pairs for value in CHARTS[pair[0]].ticks(edges)[1]),
        *(Collision(case, kind) for case in CASES for kind in BY_NAME),
    ]


def list_edges(records: Records, chart: str, integrator: str) -> list[Record]:
    """Returns the edges of one chart under one integrator."""
    edges = select_kind(records, Edge).items()
    return [record for key, record in edges if (key.chart, key.integrator) == (chart, integrator)]


def summarise(records: Records) -> Record:
    """Maps, windows and cases; and the totals that a reader quotes."""
    maps = {chart: {kind: summarise_map(records, chart, kind) for kind in BY_NAME} for chart in CHARTS}
    every = [curve for chart in maps.values() for curve in chart.values()]
    return {
        "maps": maps,
        "windows": {chart: {kind: summarise_windows(records, chart, kind) for kind in BY_NAME} for chart in CHARTS},
        "cases": {case: summarise_case(records, case) for case in CASES},
        "totals": {
            "grid_points": sum(curve["points"] for curve in every),
            "evaluated": sum(curve["evaluated"] for curve in every),
            "compared": sum(curve["full_points"] for curve in every),
            "disagreeing": sum(curve["disagreeing"] for curve in every),
            "largest_spectral_to_closed": max(curve["edges"]["spectral_to_closed"] or 0 for curve in every),
        },
    }


def summarise_map(records: Records, chart: str, integrator: str) -> Record:
    """What the refined map cost, how it compares with the full grid, how much of it is what, and its edge."""
    record = records[Map(chart, integrator)]
    refined, full = to_grid(record["classes"]), to_grid(records[Full(chart, integrator)]["classes"])
    evaluated = int(to_grid(record["evaluated"]).sum())
    return {
        "points": refined.size,
        "evaluated": evaluated,
        "saving": refined.size / evaluated,
        "full_points": full.size,
        "disagreeing": int((refined[::2, ::2] != full).sum()),
        "shares": {kind.name.lower(): float((full == kind).mean()) for kind in Class},
        "edges": summarise_edges(list_edges(records, chart, integrator)),
    }


def summarise_edges(edges: list[Record]) -> Record:
    """Returns the largest relative distances between closed form, spectral radius and simulation along the edge."""
    closed = [edge for edge in edges if edge["closed_s"] is not None]
    spectral = [e["spectral_s"] / e["closed_s"] - 1 for e in closed if e["spectral_s"] is not None]
    simulated = [e["simulated_s"] / e["closed_s"] - 1 for e in closed if e["simulated_s"] is not None]
    return {
        "spectral_to_closed": max(map(abs, spectral), default=None),
        "simulated_to_closed": [min(simulated), max(simulated)] if simulated else None,
    }


def summarise_windows(records: Records, chart: str, integrator: str) -> list[Record]:
    """Per kind of deceptive point, its share of the points beyond the limit, and the timesteps it spans [s]."""
    grid = to_grid(records[Full(chart, integrator)]["classes"])
    timesteps_s = CHARTS[chart].ticks(len(grid))[0]
    beyond = int(np.isin(grid, [Class.SLOW, Class.WINDOW, Class.UNSTABLE]).sum())
    windows = []
    for kind in (Class.SLOW, Class.WINDOW, Class.FRAGILE):
        lines = np.flatnonzero((grid == kind).any(axis=1))
        if len(lines):
            share = float((grid == kind).sum() / beyond) if beyond else None
            span = [timesteps_s[lines[0]], timesteps_s[lines[-1]]]
            windows.append({"kind": kind.name.lower(), "share_of_unstable": share, "timesteps_s": span})
    return windows


def draw_chart(chart: str, records: Records, _summary: Record) -> Figure:
    """Draws five integrators side by side: classes, the closed form in black, simulated edges as circles."""
    figure = Figure(figsize=(15, 4.3))
    panels = figure.subplots(1, len(BY_NAME), sharey=True)
    for axes, integrator in zip(panels, BY_NAME, strict=True):
        draw_map(axes, chart, integrator, records)
        axes.set_title(integrator)
    panels[0].set_ylabel(CHARTS[chart].timestep_label)
    handles: list[Any] = [Patch(color=colour, label=text) for colour, text in LOOK.values()]
    handles += panels[0].get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return figure


def draw_map(axes: Any, name: str, integrator: str, records: Records) -> None:
    """The classes as coloured cells, the closed form as a line, the edges found by simulation and radius as marks."""
    chart, grid = CHARTS[name], to_grid(records[Map(name, integrator)]["classes"])
    scale, values = chart.timestep_scale, chart.ticks(200)[1]
    chart.draw(axes, grid, [colour for colour, _ in LOOK.values()], scale)
    closed = [chart.closed_form_s(integrator, value) * scale for value in values]
    axes.plot(values, closed, color="black", lw=1.2, label="closed form")
    edges = list_edges(records, name, integrator)
    for method, marker, label in (("simulated", "o", "simulated limit, 3 s"), ("spectral", "+", "spectral radius = 1")):
        known = [(edge["parameter"], edge[f"{method}_s"] * scale) for edge in edges if edge[f"{method}_s"] is not None]
        if known:
            axes.plot(*zip(*known, strict=True), marker, color="black", ms=5, mfc="none", mew=0.8, label=label)


CHARTS_DRAWN = {f"stability_{name}": partial(draw_chart, name) for name in CHARTS}
STUDY = Study("stability", plan, summarise, CHARTS_DRAWN | {"stability_collisions": draw_cases})
