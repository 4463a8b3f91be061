"""Maps of stability with their closed forms drawn over, and what collisions end in."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch

from grader.bench.charts import CHARTS, Chart
from grader.bench.collisions import CASES, Case, collision_tasks
from grader.bench.journal import Record
from grader.bench.report.stability_analysis import as_grid, summarise
from grader.bench.report.style import RC, figure, save
from grader.bench.run import Benchmark, Do, Records
from grader.bench.settings_grid import INTEGRATORS
from grader.bench.stability import MEANING, Class, stability_tasks

CLASS_COLOURS = {
    Class.STABLE: "#e8f1e4",
    Class.SLOW: "#ffcf56",
    Class.WINDOW: "#7b3fa0",
    Class.UNSTABLE: "#d9827a",
    Class.FRAGILE: "#3b78b5",
}

FINE, PUSHED, LOST, WARNED = "#e8f1e4", "#ffcf56", "#d9827a", "#7b3fa0"

OUTCOME_COLOURS = {
    "stopped": FINE,
    "settled": FINE,
    "pushed through": PUSHED,
    "launched": PUSHED,
    "kicked": PUSHED,
    "tunnelled": LOST,
    "sunk": LOST,
    "warned": WARNED,
}


def measure(quick: bool, do: Do) -> Records:
    """Maps, full grids, edges, collisions."""
    return do(stability_tasks(quick) + collision_tasks(quick))


def rows(records: Records) -> list[Record]:
    """One row an edge, and one row an evaluated point of a map."""
    found: list[Record] = []
    for key, record in records.items():
        kind, chart, integrator, *_ = key.split("/")
        if kind == "edge":
            found.append({"kind": kind, "chart": chart, "integrator": integrator} | record)
        if kind == "map":
            found += map_rows(CHARTS[chart], integrator, record)
    return found


def map_rows(chart: Chart, integrator: str, record: Record) -> list[Record]:
    """The evaluated points of one map."""
    classes, evaluated = as_grid(record["classes"]), as_grid(record["evaluated"])
    size = len(classes)
    parameters, timesteps_s = chart.parameters(size), chart.timesteps_s(size)
    return [
        {
            "kind": "map",
            "chart": chart.name,
            "integrator": integrator,
            "parameter": float(parameters[column]),
            "timestep_s": float(timesteps_s[row]),
            "class": Class(classes[row, column]).name.lower(),
        }
        for row, column in np.argwhere(evaluated)
    ]


def draw(records: Records, _summary: Record, out: Path) -> list[Path]:
    """One picture a chart, and one of the collisions."""
    with mpl.rc_context(RC):
        made = [path for chart in CHARTS.values() for path in draw_chart(chart, records, out)]
        return made + draw_cases(records, out)


def draw_chart(chart: Chart, records: Records, out: Path) -> list[Path]:
    """Five integrators side by side: classes, the closed form in black, simulated edges as circles."""
    made = figure(15, 4.3)
    panels = made.subplots(1, len(INTEGRATORS), sharey=True)
    for axes, integrator in zip(panels, INTEGRATORS, strict=True):
        draw_map(axes, chart, records[f"map/{chart.name}/{integrator}"])
        draw_limit(axes, chart, integrator)
        edges = [r for key, r in records.items() if key.startswith(f"edge/{chart.name}/{integrator}/")]
        for name, style in (("simulated_s", "o"), ("spectral_s", "+")):
            known = [(e["parameter"], e[name] * chart.timestep_scale) for e in edges if e[name] is not None]
            if known:
                axes.plot(*zip(*known, strict=True), style, color="black", ms=5, mfc="none", mew=0.8)
        axes.set_title(integrator)
        axes.set_xlabel(f"{chart.parameter} {f'[{chart.unit}]' if chart.unit else ''}")
    panels[0].set_ylabel(chart.timestep_label)
    handles: list[Any] = [Patch(color=CLASS_COLOURS[kind], label=text) for kind, text in MEANING.items()]
    handles += [
        mpl.lines.Line2D([], [], color="black", label="closed form"),
        mpl.lines.Line2D([], [], color="black", marker="o", mfc="none", ls="", label="simulated limit, 3 s"),
        mpl.lines.Line2D([], [], color="black", marker="+", ls="", label="spectral radius = 1"),
    ]
    made.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return save(made, out, f"stability_{chart.name}")


def edges_of(values: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    """Cell borders around logarithmically spaced values, one more than there are values."""
    ratio = np.sqrt(values[1] / values[0])
    return np.append(values / ratio, values[-1] * ratio)


def draw_map(axes: Any, chart: Chart, record: Record) -> None:
    """The classes as coloured cells."""
    grid = as_grid(record["classes"])
    x, y = edges_of(chart.parameters(len(grid))), edges_of(chart.timesteps_s(len(grid))) * chart.timestep_scale
    colours = ListedColormap([CLASS_COLOURS[kind] for kind in Class])
    axes.pcolormesh(x, y, grid, cmap=colours, norm=BoundaryNorm(range(len(Class) + 1), len(Class)), rasterized=True)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    axes.grid(visible=False)


def draw_limit(axes: Any, chart: Chart, integrator: str) -> None:
    """The closed form over the map."""
    values = chart.parameters(200)
    limits = np.array([chart.closed_form_s(integrator, float(value)) for value in values]) * chart.timestep_scale
    axes.plot(values, limits, color="black", lw=1.2)


def draw_cases(records: Records, out: Path) -> list[Path]:
    """Three cases by five integrators."""
    made = figure(15, 9)
    panels = made.subplots(len(CASES), len(INTEGRATORS))
    for line, (name, case) in zip(panels, CASES.items(), strict=True):
        for axes, integrator in zip(line, INTEGRATORS, strict=True):
            draw_case(axes, case, records[f"case/{name}/{integrator}"])
            axes.set_title(f"{case.scene.replace('_', ' ')}: {integrator}")
        line[0].set_ylabel("h [ms]")
        handles = [Patch(color=OUTCOME_COLOURS[name], label=name) for name in case.outcomes]
        line[-1].legend(handles=handles, loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    return save(made, out, "stability_collisions")


def draw_case(axes: Any, case: Case, record: Record) -> None:
    """The outcomes as coloured cells."""
    grid = as_grid(record["outcomes"])
    x = edges_of(np.geomspace(*case.span, len(grid)))
    y = edges_of(np.geomspace(*case.timestep_span_s, len(grid))) * 1e3
    count = len(case.outcomes)
    colours = ListedColormap([OUTCOME_COLOURS[name] for name in case.outcomes])
    axes.pcolormesh(x, y, grid, cmap=colours, norm=BoundaryNorm(range(count + 1), count), rasterized=True)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(f"{case.parameter} [{case.unit}]")
    axes.grid(visible=False)


STABILITY = Benchmark(measure, summarise, rows, draw)
