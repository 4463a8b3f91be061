"""The interactive page of the study: docs/measured.html, which holds its data and needs no network."""

import json
from pathlib import Path
from typing import Any

from grader.studies.bench.errors.quantities import QUANTITIES
from grader.studies.bench.published.claims import Results
from grader.studies.bench.scenes import describe_scene
from grader.studies.bench.study import COLOURS

TEMPLATE = Path(__file__).with_name("interactive.html")


def collect_points(results: Results) -> list[dict[str, Any]]:
    """Returns every setting of MuJoCo as scene, integrator, timestep [ms], its CPU time in runs of the defaults (None
    where that was not measured), and its error and order by quantity."""
    precision, record = results["precision"]["scenes"], results["quantities"]
    points: list[dict[str, Any]] = []
    for name, scene in record["scenes"].items():
        for kind, errors in scene["errors"].items():
            costs = precision.get(name, {}).get("costs", {}).get(kind, [None] * len(record["timesteps_s"]))
            orders = {quantity: fit and fit["order"] for quantity, fit in scene["orders"][kind].items()}
            for place, timestep_s in enumerate(record["timesteps_s"]):
                values = {quantity: own[place] for quantity, own in errors.items()}
                settings = {"scene": describe_scene(name), "integrator": kind, "ms": 1e3 * timestep_s}
                points.append(settings | {"cost": costs[place], "errors": values, "orders": orders})
    return points


def render_page(results: Results) -> str:
    """Returns the page with its data. `<` is escaped, so that no text of the data ends the script."""
    data = {
        "points": collect_points(results),
        "units": QUANTITIES,
        "colours": COLOURS,
        "version": results["quantities"]["versions"]["mujoco"],
        "horizon_s": results["quantities"]["horizon_s"],
    }
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    return TEMPLATE.read_text(encoding="utf-8").replace("/*DATA*/null", text)
