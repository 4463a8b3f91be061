"""Stability to the limit: maps of the five integrators, their measured edges, and what lies beyond a warning."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from grader.bench.charts import CHARTS, Chart
from grader.bench.journal import Record, Task
from grader.bench.refine import refined_map
from grader.bench.settings_grid import INTEGRATORS
from grader.numerics.linear import RADIUS_NOISE, equilibrium, spectral_radius
from grader.numerics.scene import Scene
from grader.numerics.search import find_threshold, spectral_limit
from grader.numerics.threshold import Criterion, Outcome, try_timestep

SECONDS = 3.0
"""The lesson's horizon."""


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

    def classify(self, timestep_s: float, integrator: int) -> Class:
        """Simulate for 3 s and take the spectral radius."""
        grows = spectral_radius(self.resting, timestep_s=timestep_s, integrator=integrator) > 1 + RADIUS_NOISE
        trial = try_timestep(self.scene, timestep_s, SECONDS, integrator=integrator)
        if trial.outcome is not Outcome.UNSTABLE:
            return Class.SLOW if grows else Class.STABLE
        if not grows:
            return Class.FRAGILE
        lesson = try_timestep(self.scene, timestep_s, SECONDS, integrator=integrator, criterion=Criterion.BADQACC)
        return Class.UNSTABLE if lesson.outcome is Outcome.UNSTABLE else Class.WINDOW


def classifier(chart: Chart, integrator: str, size: int) -> "Classifier":
    """Classes by (row, column) = (timestep, parameter) of a size x size grid."""
    return Classifier(chart, INTEGRATORS[integrator], size)


class Classifier:
    """Remembers the scenes of the columns, which are dear to build, and nothing else."""

    def __init__(self, chart: Chart, integrator: int, size: int) -> None:
        self.chart, self.integrator = chart, integrator
        self.parameters, self.timesteps_s = chart.parameters(size), chart.timesteps_s(size)
        self.columns: dict[int, Column] = {}

    def __call__(self, row: int, column: int) -> int:
        """The class at a point of the grid."""
        if column not in self.columns:
            self.columns[column] = Column.of(self.chart, float(self.parameters[column]))
        return int(self.columns[column].classify(float(self.timesteps_s[row]), self.integrator))


def as_rows(grid: "np.ndarray[tuple[int, int], np.dtype[np.generic]]") -> list[str]:
    """A grid of digits as one string a row: compact in JSON, readable in a pager."""
    return ["".join(str(int(cell)) for cell in row) for row in grid]


PARTS = 4
"""The full grids take longest: what is interrupted costs a quarter of one."""


def map_task(chart: Chart, integrator: str, levels: int) -> Task:
    """The refined map."""

    def measure() -> Record:
        refined = refined_map(
            levels, coarse=3 if levels > 5 else 2, classify=classifier(chart, integrator, 2**levels + 1)
        )
        return {
            "classes": as_rows(refined.classes),
            "evaluated": as_rows(refined.evaluated),
            "evaluations": int(refined.evaluated.sum()),
            "share": refined.share,
        }

    return Task(f"map/{chart.name}/{integrator}", measure)


def full_task(chart: Chart, integrator: str, levels: int, part: int) -> Task:
    """One part (every PARTS-th row) of the full grid of half the resolution, whose points the refined map has too."""

    def measure() -> Record:
        size = 2 ** (levels - 1) + 1
        classify = classifier(chart, integrator, size)
        rows = [[classify(row, column) for column in range(size)] for row in range(part, size, PARTS)]
        return {"classes": as_rows(np.array(rows))}

    return Task(f"full/{chart.name}/{integrator}/{part}", measure)


def edge_task(chart: Chart, integrator: str, value: float) -> Task:
    """The largest stable timestep at one parameter, three ways: simulated, by spectral radius, by closed form [s]."""

    def measure() -> Record:
        column = Column.of(chart, value)
        low_s, high_s = chart.timestep_span_s
        closed_s = chart.closed_form_s(integrator, value)
        if np.isfinite(closed_s):
            low_s, high_s = closed_s / 2, closed_s * 2
        code = INTEGRATORS[integrator]
        radius_s = spectral_limit(column.scene, low_s=low_s, high_s=high_s, integrator=code)
        found = find_threshold(column.scene, low_s=low_s, high_s=high_s, integrator=code, horizon_s=SECONDS)
        return {
            "parameter": value,
            "closed_s": closed_s if np.isfinite(closed_s) else None,
            "spectral_s": radius_s,
            "simulated_s": None if found.bracket_s is None else sum(found.bracket_s) / 2,
        }

    return Task(f"edge/{chart.name}/{integrator}/{value:g}", measure)


def stability_tasks(quick: bool) -> list[Task]:
    """Refined maps, full grids to hold them against, and edges."""
    levels, edges = (5, 5) if quick else (8, 13)
    pairs = [(chart, integrator) for chart in CHARTS.values() for integrator in INTEGRATORS]
    tasks = [map_task(chart, integrator, levels) for chart, integrator in pairs]
    tasks += [full_task(chart, integrator, levels, part) for chart, integrator in pairs for part in range(PARTS)]
    tasks += [
        edge_task(chart, integrator, float(value)) for chart, integrator in pairs for value in chart.parameters(edges)
    ]
    return tasks
