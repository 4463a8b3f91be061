"""The tables of the studies of errors, and what sentences say about them and about the other version."""

from collections.abc import Iterator
from itertools import chain

from grader.studies.bench.errors.impacts import PERCENT
from grader.studies.bench.published.claims import Results, claim, demand, span
from grader.studies.bench.published.other import OTHER, PINNED
from grader.studies.bench.published.tables import fitted, milliseconds, table
from grader.studies.bench.scenes import describe_scene

SHOWN_S = 0.002


@table("scene", "integrator", "position", "velocity", "energy [J]", "violation", "orders, in this order")
def quantities(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the errors of every quantity at SHOWN_S, and the orders that they show."""
    record = results["quantities"]
    place = record["timesteps_s"].index(SHOWN_S)
    for name, scene in record["scenes"].items():
        for kind, errors in scene["errors"].items():
            cells = []
            for quantity in ("position", "velocity", "energy", "violation"):
                error = errors[quantity][place] if quantity in errors else None
                cells.append("-" if quantity not in errors else "warned" if error is None else f"{error:.1e}")
            fits = scene["orders"][kind].values()
            yield describe_scene(name), kind, *cells, ", ".join(f"{fit['order']:.2f}" if fit else "-" for fit in fits)


@table("scene", "integrator", "errors", "1", "1/2", "1/4", "1/8", "1/16", "order")
def impacts(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields median and 95 % of the errors at each scene's timesteps, and the orders that they show."""
    record = results["impacts"]
    for name, scene in record["scenes"].items():
        yield describe_scene(name), "", "timestep", *map(milliseconds, record["timesteps_s"][name]), ""
        for kind, entry in scene["integrators"].items():
            for what, title in (("median", "median"), ("high", f"{PERCENT} %")):
                errors = ("warned" if error is None else f"{error:.1e}" for error in entry[what])
                yield describe_scene(name), kind, title, *errors, fitted(entry["orders"].get(what))


def orders_of(results: Results, what: str) -> list[float]:
    """Returns the orders of the medians or of the 95th percentiles, over all scenes and integrators."""
    scenes = results["impacts"]["scenes"].values()
    kinds = chain.from_iterable(scene["integrators"].values() for scene in scenes)
    return [kind["orders"][what]["order"] for kind in kinds if what in kind["orders"]]


@claim
def starts(results: Results) -> str:
    """How many starts each scene has."""
    counts = {scene["starts"] for scene in results["impacts"]["scenes"].values()}
    demand(counts == {200}, f"starts of the scenes: {counts}")
    return "200 starts of each scene"


@claim
def impact_orders(results: Results) -> str:
    """Returns the orders that medians and 95th percentiles show."""
    medians, highs = orders_of(results, "median"), orders_of(results, "high")
    demand(max(*medians, *highs) < 2, f"orders of the medians {medians}, of 95 % {highs}")
    return f"the medians show orders of {span(medians, '.1f')} and the 95 % bounds {span(highs, '.1f')}"


@claim
def impact_spread(results: Results) -> str:
    """How far the 95 % bound of RK4 lies above its median."""
    scenes = results["impacts"]["scenes"].values()
    runs = [scene["integrators"]["RK4"] for scene in scenes]
    factors = [high / middle for run in runs for high, middle in zip(run["high"], run["median"], strict=True) if high]
    demand(min(factors) > 1, f"95 % over median under RK4: {factors}")
    return f"{span(factors)} times its median"


@claim
def own_impacts(results: Results) -> str:
    """Returns the largest own error of a reference, and how close tiny timesteps come to it."""
    scenes = results["impacts"]["scenes"]
    own = max(scene["own_error"] for scene in scenes.values())
    smallest = min(
        error
        for scene in scenes.values()
        for integrator in scene["integrators"].values()
        for error in integrator["median"]
        if error
    )
    demand(10 * own < smallest, f"own error {own}, smallest median {smallest}")
    coarse, fine = (max(scene["tiny"][place] for scene in scenes.values()) for place in (0, 1))
    demand(fine < coarse, f"distances of RK4 to the reference at tiny timesteps: {coarse}, {fine}")
    steps = [f"{1e6 * h:.0f} us" for h in results["impacts"]["tiny_s"]]
    tiny = f"RK4 at {steps[0]} and at {steps[1]} comes within {coarse:.0e} and {fine:.0e} of it"
    return f"differs by {own:.0e} at most; {tiny}"


def ratios_to_position(results: Results, quantity: str, integrator: str = "RK4") -> dict[str, float]:
    """Returns the errors of a quantity at SHOWN_S over those of the positions, by scene."""
    record = results["quantities"]
    place = record["timesteps_s"].index(SHOWN_S)
    errors = {name: scene["errors"][integrator] for name, scene in record["scenes"].items()}
    return {
        name: own[quantity][place] / own["position"][place]
        for name, own in errors.items()
        if quantity in own and own["position"][place] is not None
    }


@claim
def velocities(results: Results) -> str:
    """How much larger the errors of velocities are under RK4."""
    ratios = ratios_to_position(results, "velocity")
    spinning = ratios.pop("spinning_body")
    demand(spinning < 1 < min(ratios.values()), f"error of velocities over that of positions: {ratios}, {spinning}")
    return (
        f"Under RK4 at 2 ms the velocities are off by {span([*ratios.values()], '.0f')} times the number of the "
        "positions, and by less on the spinning body alone"
    )


@claim
def violations(results: Results) -> str:
    """How far constraints are violated by the solution itself, and the errors of that under RK4."""
    record = results["quantities"]
    place = record["timesteps_s"].index(SHOWN_S)
    parts = []
    for name, scene in record["scenes"].items():
        if "violation" in scene["own_errors"]:
            error = scene["errors"]["RK4"]["violation"][place]
            demand(error < scene["largest_violation"], f"{name}: error {error}")
            parts.append(f"{scene['largest_violation']:.0e} ({describe_scene(name)}, RK4 at 2 ms off by {error:.0e})")
    return f"The exact solution violates soft constraints itself, by {', '.join(parts)}"


@claim
def plain_nstep(results: Results) -> str:
    """Returns the cost of plain mj_step with nstep in our runs."""
    ratios = [model["nstep"]["ratio"] for model in results["models"]["models"].values()]
    return f"One call of `mj_step(nstep)` takes {span(ratios, '.2f')} times the CPU time of our run"


@claim
def recording(results: Results) -> str:
    """Returns the cost of mujoco.rollout in our runs that keep every step."""
    ratios = [model["recording"]["ratio"] for model in results["models"]["models"].values()]
    demand(min(ratios) > 0.75, f"mujoco.rollout takes {min(ratios)} times the time of ours")
    return f"Where every step is kept, `mujoco.rollout` takes {span(ratios, '.2f')} times the CPU time of our run"


@claim
def newer(results: Results) -> str:
    """Returns what MuJoCo 4.0.0 changes."""
    record = results["versions"]
    ours, theirs = (record["versions"][version] for version in (PINNED, OTHER))
    same = [name for name, digests in ours["digests"].items() if digests == theirs["digests"][name]]
    place = record["timesteps_s"].index(SHOWN_S)
    gain = ours["spinning_body"]["errors"][place] / theirs["spinning_body"]["errors"][place]
    demand(bool(same) and gain > 10, f"the same: {same}; error of RK4 over that of {OTHER}: {gain}")
    return (
        f"MuJoCo {OTHER} runs {len(same)} of {len(ours['digests'])} scenes and models as {PINNED} does, to the last "
        f"bit, and its RK4 at 2 ms is {gain:.0e} times as precise on a free body"
    )
