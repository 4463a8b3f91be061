"""What the maps, the edges and the collisions say in numbers."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from grader.bench.charts import CHARTS, Chart
from grader.bench.collisions import CASES
from grader.bench.journal import Record
from grader.bench.settings_grid import INTEGRATORS
from grader.bench.stability import PARTS, Class

Grid = NDArray[np.int8]


def as_grid(rows: list[str]) -> Grid:
    """Rows of digits back to an array."""
    return np.array([[int(digit) for digit in row] for row in rows], dtype=np.int8)


def full_grid(records: Mapping[str, Record], chart: str, integrator: str) -> Grid:
    """The parts of a full grid put together."""
    parts = [as_grid(records[f"full/{chart}/{integrator}/{part}"]["classes"]) for part in range(PARTS)]
    grid = np.empty((sum(len(part) for part in parts), parts[0].shape[1]), dtype=np.int8)
    for number, part in enumerate(parts):
        grid[number::PARTS] = part
    return grid


def map_summary(records: Mapping[str, Record], chart: Chart, integrator: str) -> Record:
    """What the refined map cost, whether the full grid agrees, how much of it is what, and where the windows lie."""
    record = records[f"map/{chart.name}/{integrator}"]
    refined, full = as_grid(record["classes"]), full_grid(records, chart.name, integrator)
    common = refined[::2, ::2]
    return {
        "points": refined.size,
        "evaluated": record["evaluations"],
        "saving": refined.size / record["evaluations"],
        "full_points": full.size,
        "disagreeing": int((common != full).sum()),
        "shares": {kind.name.lower(): float((full == kind).mean()) for kind in Class},
        "edges": edge_summary(records, chart, integrator),
    }


def edge_summary(records: Mapping[str, Record], chart: Chart, integrator: str) -> Record:
    """The largest relative distances between closed form, spectral radius and simulation along the edge."""
    edges = [record for key, record in records.items() if key.startswith(f"edge/{chart.name}/{integrator}/")]
    with_limit = [edge for edge in edges if edge["closed_s"] is not None]
    spectral = [e["spectral_s"] / e["closed_s"] - 1 for e in with_limit if e["spectral_s"] is not None]
    simulated = [e["simulated_s"] / e["closed_s"] - 1 for e in with_limit if e["simulated_s"] is not None]
    return {
        "columns": len(edges),
        "with_closed_form": len(with_limit),
        "spectral_found": len(spectral),
        "simulated_found": len(simulated),
        "spectral_to_closed": max(map(abs, spectral), default=None),
        "simulated_to_closed": [min(simulated), max(simulated)] if simulated else None,
        "limit_without_closed_form": sum(
            1 for e in edges if e["closed_s"] is None and (e["spectral_s"] or e["simulated_s"])
        ),
    }


def windows_of(records: Mapping[str, Record], chart: Chart, integrator: str) -> list[Record]:
    """Per kind of deceptive point, its share of the points beyond the limit, and the timesteps it spans [s]."""
    grid = full_grid(records, chart.name, integrator)
    timesteps_s = chart.timesteps_s(len(grid))
    beyond = int(np.isin(grid, [Class.SLOW, Class.WINDOW, Class.UNSTABLE]).sum())
    found = []
    for kind in (Class.SLOW, Class.WINDOW, Class.FRAGILE):
        rows = np.flatnonzero((grid == kind).any(axis=1))
        if len(rows):
            share = float((grid == kind).sum() / beyond) if beyond else None
            span = [float(timesteps_s[rows[0]]), float(timesteps_s[rows[-1]])]
            found.append({"kind": kind.name.lower(), "share_of_unstable": share, "timesteps_s": span})
    return found


def case_summary(records: Mapping[str, Record], case: str) -> Record:
    """Shares of the outcomes under each integrator, and what the first warned run went through."""
    found = {}
    for integrator in INTEGRATORS:
        record = records[f"case/{case}/{integrator}"]
        grid = as_grid(record["outcomes"])
        shares = {name: float((grid == number).mean()) for number, name in enumerate(record["names"])}
        found[integrator] = {"shares": shares, "reset": record["reset"]}
    return found


def summarise(records: Mapping[str, Record]) -> Record:
    """Maps, windows and cases; and the totals that a reader quotes."""
    maps = {c.name: {i: map_summary(records, c, i) for i in INTEGRATORS} for c in CHARTS.values()}
    every = [one for chart in maps.values() for one in chart.values()]
    distances = [one["edges"]["spectral_to_closed"] for one in every if one["edges"]["spectral_to_closed"] is not None]
    return {
        "maps": maps,
        "windows": {c.name: {i: windows_of(records, c, i) for i in INTEGRATORS} for c in CHARTS.values()},
        "cases": {case: case_summary(records, case) for case in CASES},
        "totals": {
            "grid_points": sum(one["points"] for one in every),
            "evaluated": sum(one["evaluated"] for one in every),
            "compared": sum(one["full_points"] for one in every),
            "disagreeing": sum(one["disagreeing"] for one in every),
            "largest_spectral_to_closed": max(distances),
        },
    }
