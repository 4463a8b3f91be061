"""Stability to the limit: maps of the five integrators, their measured edges, and what lies beyond a warning."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cache, partial
from typing import Any

import matplotlib as mpl
import mujoco
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from grader.bench.collisions import CASES, collision_tasks, draw_cases, summarise_case
from grader.bench.grid import Classify, Grid, Plane, as_grid, as_rows, refined_map
from grader.bench.picture import new_figure
from grader.bench.scenes import load_scene
from grader.bench.study import Do, Key, Record, Records, Study, Task, of_kind
from grader.numerics.bisection import find_threshold
from grader.numerics.integrators import BY_NAME
from grader.numerics.linear import RADIUS_NOISE, equilibrium, spectral_limit, spectral_radius
from grader.numerics.scene import Scene
from grader.numerics.servo import Servo
from grader.numerics.trials import Criterion, Stability, try_timestep

SECONDS = 3.0
"""The lesson's horizon."""

PARTS = 4
"""The full grids take longest: an interruption loses a quarter of one."""

PENDULUM_INERTIA = 0.2501
PENDULUM_GRAVITY_STIFFNESS = 4.905
OMEGA = 100.0
"""Angular frequency of the oscillator [rad/s]; only h * omega matters."""

CLOSED_FORM: dict[str, Callable[[Servo], float]] = {
    "Euler": lambda servo: servo.euler_s,
    "RK4": lambda servo: servo.rk4_s,
    "implicit": lambda servo: servo.implicit_s,
    "implicitfast": lambda servo: servo.implicit_s,
    "discrete": lambda servo: servo.discrete_s,
}


class Class(IntEnum):
    """What a point of a map shows, the simulation beside the spectral radius."""

    STABLE = 0
    SLOW = 1
    WINDOW = 2
    UNSTABLE = 3
    FRAGILE = 4


MEANING = {
    Class.STABLE: "stable: no warning in 3 s, spectral radius at most 1",
    Class.SLOW: "no warning in 3 s, yet the spectral radius is above 1",
    Class.WINDOW: "warned, but not with BADQACC: the lesson's test says stable",
    Class.UNSTABLE: "BADQACC, spectral radius above 1",
    Class.FRAGILE: "warned although the spectral radius is at most 1",
}


@dataclass(frozen=True)
class Map(Key):
    """The refined map of a chart."""

    chart: str
    integrator: str


@dataclass(frozen=True)
class Full(Key):
    """Every PARTS-th row, from row `part` on, of the full grid of half the resolution."""

    chart: str
    integrator: str
    part: int


@dataclass(frozen=True)
class Edge(Key):
    """The largest stable timestep at one parameter."""

    chart: str
    integrator: str
    value: float


@dataclass(frozen=True, kw_only=True)
class Chart(Plane):
    """A map's plane; `servo` gives the closed forms at a parameter, and timesteps are drawn as `timestep_label`."""

    name: str
    servo: Callable[[float], Servo]
    timestep_scale: float = 1e3
    timestep_label: str = "h [ms]"

    def scene_at(self, value: float) -> Scene:
        """The scene with its servo set for this value of the parameter."""
        servo = self.servo(value)

        def set_gains(model: mujoco.MjModel) -> None:
            model.actuator("servo").gainprm[0] = servo.kp
            model.actuator("servo").biasprm[1:3] = -servo.kp, -servo.kv

        return load_scene(self.scene).changed(set_gains)

    def closed_form_s(self, integrator: str, value: float) -> float:
        """The largest stable timestep [s] by the closed form; inf where there is none."""
        return CLOSED_FORM[integrator](self.servo(value))


def pendulum(kp: float, kv: float) -> Servo:
    """The lesson's pendulum under a servo."""
    return Servo(PENDULUM_INERTIA, kp, kv, PENDULUM_GRAVITY_STIFFNESS)


CHARTS = {
    "stiffness": Chart(
        name="stiffness",
        scene="servo",
        parameter="kp [N m/rad]",
        span=(100, 40000),
        timestep_span_s=(0.001, 0.1),
        servo=lambda kp: pendulum(kp, 5),
    ),
    "damping": Chart(
        name="damping",
        scene="servo",
        parameter="kv [N m s/rad]",
        span=(0.5, 100),
        timestep_span_s=(0.001, 0.2),
        servo=lambda kv: pendulum(100, kv),
    ),
    "oscillator": Chart(
        name="oscillator",
        scene="oscillator",
        parameter="damping ratio",
        span=(0.01, 10),
        timestep_span_s=(0.1 / OMEGA, 10 / OMEGA),
        servo=lambda zeta: Servo(1.0, OMEGA**2, 2 * zeta * OMEGA),
        timestep_scale=OMEGA,
        timestep_label="h * omega",
    ),
}


@dataclass
class Column:
    """One parameter of a chart: its scene, at the start and at rest."""

    scene: Scene
    resting: Scene

    @staticmethod
    def of(chart: Chart, value: float) -> "Column":
        """The column of a chart at this value of its parameter."""
        scene = chart.scene_at(value)
        resting = equilibrium(scene)
        assert resting is not None, "a servo holds an equilibrium"
        return Column(scene, resting)

    def classify(self, timestep_s: float, integrator: str) -> Class:
        """Simulate for 3 s and take the spectral radius."""
        code = BY_NAME[integrator].code
        grows = spectral_radius(self.resting, timestep_s=timestep_s, integrator=code) > 1 + RADIUS_NOISE
        trial = try_timestep(self.scene, timestep_s, SECONDS, integrator=code)
        if trial.stability is not Stability.UNSTABLE:
            return Class.SLOW if grows else Class.STABLE
        if not grows:
            return Class.FRAGILE
        lesson = try_timestep(self.scene, timestep_s, SECONDS, integrator=code, criterion=Criterion.BADQACC)
        return Class.UNSTABLE if lesson.stability is Stability.UNSTABLE else Class.WINDOW


def classifier(chart: Chart, integrator: str, size: int) -> Classify:
    """Classes by (row, column) = (timestep, parameter) of a size x size grid. Caches scenes, expensive to compile."""
    parameters, timesteps_s = chart.parameters(size), chart.timesteps_s(size)

    @cache
    def column_at(column: int) -> Column:
        return Column.of(chart, float(parameters[column]))

    return lambda row, column: int(column_at(column).classify(float(timesteps_s[row]), integrator))


def map_out(chart: Chart, integrator: str, levels: int) -> Record:
    """The refined map of 2^levels + 1 points a side."""
    classify = classifier(chart, integrator, 2**levels + 1)
    refined = refined_map(levels, coarse=3 if levels > 5 else 2, classify=classify)
    return {
        "classes": as_rows(refined.classes),
        "evaluated": as_rows(refined.evaluated),
        "evaluations": int(refined.evaluated.sum()),
        "share": refined.share,
    }


def fill_in(chart: Chart, integrator: str, levels: int, part: int) -> Record:
    """One part of the full grid of half the resolution, whose points the refined map has too."""
    size = 2 ** (levels - 1) + 1
    classify = classifier(chart, integrator, size)
    grid = [[classify(row, column) for column in range(size)] for row in range(part, size, PARTS)]
    return {"classes": as_rows(np.array(grid))}


def find_edge(chart: Chart, integrator: str, value: float) -> Record:
    """The largest stable timestep at one parameter, three ways: simulated, by spectral radius, by closed form [s]."""
    scene, code = chart.scene_at(value), BY_NAME[integrator].code
    low_s, high_s = chart.timestep_span_s
    closed_s = chart.closed_form_s(integrator, value)
    if np.isfinite(closed_s):
        low_s, high_s = closed_s / 2, closed_s * 2
    found = find_threshold(scene, low_s=low_s, high_s=high_s, integrator=code, horizon_s=SECONDS)
    return {
        "parameter": value,
        "closed_s": closed_s if np.isfinite(closed_s) else None,
        "spectral_s": spectral_limit(scene, low_s=low_s, high_s=high_s, integrator=code),
        "simulated_s": None if found.bracket_s is None else sum(found.bracket_s) / 2,
    }


def stability_tasks(quick: bool) -> list[Task]:
    """Refined maps, full grids to hold them against, and edges."""
    levels, edges = (5, 5) if quick else (8, 13)
    pairs = [(chart, kind) for chart in CHARTS.values() for kind in BY_NAME]
    tasks = [Task(Map(chart.name, kind), partial(map_out, chart, kind, levels)) for chart, kind in pairs]
    for chart, kind in pairs:
        tasks += [Task(Full(chart.name, kind, p), partial(fill_in, chart, kind, levels, p)) for p in range(PARTS)]
    for chart, kind in pairs:
        values = chart.parameters(edges).tolist()
        tasks += [Task(Edge(chart.name, kind, value), partial(find_edge, chart, kind, value)) for value in values]
    return tasks


def measure(quick: bool, do: Do) -> Records:
    """Maps, full grids, edges, collisions."""
    return do(stability_tasks(quick) + collision_tasks(quick))


def full_grid(records: Records, chart: str, integrator: str) -> Grid:
    """The parts of a full grid put together."""
    parts = [as_grid(records[Full(chart, integrator, part)]["classes"]) for part in range(PARTS)]
    grid = np.empty((sum(len(part) for part in parts), parts[0].shape[1]), dtype=np.int8)
    for number, part in enumerate(parts):
        grid[number::PARTS] = part
    return grid


def edges_of(records: Records, chart: str, integrator: str) -> list[Record]:
    """The edges of one chart under one integrator."""
    edges = of_kind(records, Edge).items()
    return [record for key, record in edges if (key.chart, key.integrator) == (chart, integrator)]


def summarise(records: Records) -> Record:
    """Maps, windows and cases; and the totals that a reader quotes."""
    maps = {chart: {kind: summarise_map(records, chart, kind) for kind in BY_NAME} for chart in CHARTS}
    every = [one for chart in maps.values() for one in chart.values()]
    return {
        "maps": maps,
        "windows": {chart: {kind: summarise_windows(records, chart, kind) for kind in BY_NAME} for chart in CHARTS},
        "cases": {case: summarise_case(records, case) for case in CASES},
        "totals": {
            "grid_points": sum(one["points"] for one in every),
            "evaluated": sum(one["evaluated"] for one in every),
            "compared": sum(one["full_points"] for one in every),
            "disagreeing": sum(one["disagreeing"] for one in every),
            "largest_spectral_to_closed": max(one["edges"]["spectral_to_closed"] or 0 for one in every),
        },
    }


def summarise_map(records: Records, chart: str, integrator: str) -> Record:
    """What the refined map cost, how it compares with the full grid, how much of it is what, and its edge."""
    record = records[Map(chart, integrator)]
    refined, full = as_grid(record["classes"]), full_grid(records, chart, integrator)
    return {
        "points": refined.size,
        "evaluated": record["evaluations"],
        "saving": refined.size / record["evaluations"],
        "full_points": full.size,
        "disagreeing": int((refined[::2, ::2] != full).sum()),
        "shares": {kind.name.lower(): float((full == kind).mean()) for kind in Class},
        "edges": summarise_edges(edges_of(records, chart, integrator)),
    }


def summarise_edges(edges: list[Record]) -> Record:
    """The largest relative distances between closed form, spectral radius and simulation along the edge."""
    closed = [edge for edge in edges if edge["closed_s"] is not None]
    spectral = [e["spectral_s"] / e["closed_s"] - 1 for e in closed if e["spectral_s"] is not None]
    simulated = [e["simulated_s"] / e["closed_s"] - 1 for e in closed if e["simulated_s"] is not None]
    return {
        "spectral_to_closed": max(map(abs, spectral), default=None),
        "simulated_to_closed": [min(simulated), max(simulated)] if simulated else None,
    }


def summarise_windows(records: Records, chart: str, integrator: str) -> list[Record]:
    """Per kind of deceptive point, its share of the points beyond the limit, and the timesteps it spans [s]."""
    grid = full_grid(records, chart, integrator)
    timesteps_s = CHARTS[chart].timesteps_s(len(grid))
    beyond = int(np.isin(grid, [Class.SLOW, Class.WINDOW, Class.UNSTABLE]).sum())
    found = []
    for kind in (Class.SLOW, Class.WINDOW, Class.FRAGILE):
        lines = np.flatnonzero((grid == kind).any(axis=1))
        if len(lines):
            share = float((grid == kind).sum() / beyond) if beyond else None
            span = [float(timesteps_s[lines[0]]), float(timesteps_s[lines[-1]])]
            found.append({"kind": kind.name.lower(), "share_of_unstable": share, "timesteps_s": span})
    return found


def rows(key: Key, record: Record) -> list[Record]:
    """One row an edge, and one row an evaluated point of a map."""
    if isinstance(key, Edge):
        return [record]
    if not isinstance(key, Map):
        return []
    chart, classes, evaluated = CHARTS[key.chart], as_grid(record["classes"]), as_grid(record["evaluated"])
    parameters, timesteps_s = chart.parameters(len(classes)).tolist(), chart.timesteps_s(len(classes)).tolist()
    return [
        {
            "parameter": parameters[column],
            "timestep_s": timesteps_s[row],
            "class": Class(classes[row, column]).name.lower(),
        }
        for row, column in np.argwhere(evaluated)
    ]


CLASS_COLOURS = {
    Class.STABLE: "#e8f1e4",
    Class.SLOW: "#ffcf56",
    Class.WINDOW: "#7b3fa0",
    Class.UNSTABLE: "#d9827a",
    Class.FRAGILE: "#3b78b5",
}


def draw(records: Records, _summary: Record) -> dict[str, Figure]:
    """One picture a chart, and one of the collisions."""
    charts = {f"stability_{chart.name}": draw_chart(chart, records) for chart in CHARTS.values()}
    return charts | {"stability_collisions": draw_cases(records)}


def draw_chart(chart: Chart, records: Records) -> Figure:
    """Five integrators side by side: classes, the closed form in black, simulated edges as circles."""
    figure = new_figure(15, 4.3)
    panels = figure.subplots(1, len(BY_NAME), sharey=True)
    for axes, integrator in zip(panels, BY_NAME, strict=True):
        draw_map(axes, chart, integrator, records)
        axes.set_title(integrator)
    panels[0].set_ylabel(chart.timestep_label)
    line = partial(mpl.lines.Line2D, [], [], color="black")
    handles: list[Any] = [Patch(color=CLASS_COLOURS[kind], label=text) for kind, text in MEANING.items()]
    handles += [
        line(label="closed form"),
        line(marker="o", mfc="none", ls="", label="simulated limit, 3 s"),
        line(marker="+", ls="", label="spectral radius = 1"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return figure


def draw_map(axes: Any, chart: Chart, integrator: str, records: Records) -> None:
    """The classes as coloured cells, the closed form as a line, the edges found by simulation and radius as marks."""
    grid, scale = as_grid(records[Map(chart.name, integrator)]["classes"]), chart.timestep_scale
    chart.draw(axes, grid, CLASS_COLOURS.values(), scale)
    values = chart.parameters(200).tolist()
    axes.plot(values, [chart.closed_form_s(integrator, value) * scale for value in values], color="black", lw=1.2)
    edges = edges_of(records, chart.name, integrator)
    for name, marker in (("simulated_s", "o"), ("spectral_s", "+")):
        known = [(edge["parameter"], edge[name] * scale) for edge in edges if edge[name] is not None]
        if known:
            axes.plot(*zip(*known, strict=True), marker, color="black", ms=5, mfc="none", mew=0.8)


STUDY = Study("stability", measure, summarise, rows, draw)
