"""What the measured points say: the Pareto front, the cheapest setting for a tolerance, the order, the peers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from grader.bench.journal import Record
from grader.bench.settings_grid import INTEGRATORS
from grader.numerics.convergence import observed_order

TOLERANCES = tuple(10.0**-k for k in range(1, 11))

FLOOR = 30
"""Errors below this many times the reference's own error say nothing about the order."""

COARSE = 0.05
"""Errors above this [rad or m] are not yet in the asymptotic range."""


@dataclass(frozen=True)
class Point:
    """One setting of one method on one scene; cost in yardsticks with its band, error None where it failed."""

    method: str
    setting: float
    error: float | None
    cost: float
    low: float
    high: float


def points_of(records: Mapping[str, Record], kind: str, scene: str) -> list[Point]:
    """All points of a kind (`setting` or `peer`) on a scene."""
    found = []
    for key, record in records.items():
        parts = key.split("/")
        if parts[:2] == [kind, scene] and "ratio" in record:
            band = (record["ratio"], record["low"], record["high"])
            found.append(Point(parts[2], float(parts[3]), record["error"], *band))
    return found


def pareto(points: Sequence[Point]) -> list[Point]:
    """Those that no other point beats in both cost and error, cheapest first."""
    front: list[Point] = []
    for point in sorted((p for p in points if p.error is not None), key=lambda p: (p.cost, p.error)):
        if not front or point.error < front[-1].error:  # type: ignore[operator]
            front.append(point)
    return front


def cheapest(points: Sequence[Point], tolerance: float) -> Point | None:
    """The cheapest point whose error is within the tolerance."""
    good = [point for point in points if point.error is not None and point.error <= tolerance]
    return min(good, key=lambda point: point.cost, default=None)


def fitted_order(points: Sequence[Point], own_error: float) -> Record | None:
    """Order with its 95 % interval over the asymptotic range: errors that fall from COARSE down to FLOOR.

    The range ends where a smaller timestep no longer lowers the error. None for fewer than three points.
    """
    floor = FLOOR * max(own_error, 1e-15)
    usable = [p for p in sorted(points, key=lambda p: -p.setting) if p.error and floor < p.error < COARSE]
    falling = usable[:1] + [finer for coarser, finer in pairwise(usable) if finer.error < coarser.error]  # type: ignore[operator]
    if len(falling) < 3:
        return None
    fit = observed_order([p.setting for p in falling], [p.error for p in falling if p.error])
    return {"order": fit.order, "interval": [fit.low, fit.high], "points": len(falling)}


def against(mujoco: Point | None, peer: Point | None) -> Record | None:
    """How many times dearer the peer is, each at its cheapest setting within the tolerance."""
    if peer is None:
        return None
    if mujoco is None:
        return {"setting": peer.setting, "ratio": None}
    spread = [peer.low / mujoco.high, peer.high / mujoco.low]
    return {"setting": peer.setting, "ratio": peer.cost / mujoco.cost, "spread": spread}


def procedure(points: Sequence[Point]) -> Record | None:
    """The lesson's start beside RK4 at a quarter and at four times its step: errors, and costs in runs of the start."""
    found = {(point.method, point.setting): point for point in points}
    settings = {"start": ("implicitfast", 0.002), "quarter": ("RK4", 0.0005), "four_times": ("RK4", 0.008)}
    if not all(setting in found for setting in settings.values()):
        return None
    start = found[settings["start"]]
    return {
        name: {"error": found[setting].error, "cost": found[setting].cost / start.cost}
        for name, setting in settings.items()
    }


def scene_summary(records: Mapping[str, Record], scene: str) -> Record:
    """Everything the tables need about one scene."""
    truth = records[f"truth/{scene}"]
    points, peers = points_of(records, "setting", scene), points_of(records, "peer", scene)
    best = {tolerance: cheapest(points, tolerance) for tolerance in TOLERANCES}
    names = dict.fromkeys(point.method for point in peers)
    return {
        "reference": {"method": truth["method"], "own_error": truth["own_error"]},
        "pareto": [[p.method, p.setting, p.cost, p.error] for p in pareto(points)],
        "cheapest": {f"{tol:.0e}": point and as_record(point) for tol, point in best.items()},
        "orders": {
            name: fitted_order([p for p in points if p.method == name], truth["own_error"]) for name in INTEGRATORS
        },
        "peers": {
            name: {
                f"{tol:.0e}": against(best[tol], cheapest([p for p in peers if p.method == name], tol))
                for tol in TOLERANCES
            }
            for name in names
        },
        "procedure": procedure(points),
        "yardstick_s": min(r["yardstick_s"] for k, r in records.items() if k.startswith(f"setting/{scene}/")),
        "warned": sum(1 for point in points if point.error is None),
    }


def as_record(point: Point) -> Record:
    """For JSON."""
    return {
        "integrator": point.method,
        "timestep_s": point.setting,
        "cost": point.cost,
        "spread": [point.low, point.high],
        "error": point.error,
    }
