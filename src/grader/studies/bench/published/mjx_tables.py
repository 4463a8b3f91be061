"""The table of MJX, and what sentences say about it."""

from collections.abc import Iterator

from grader.studies.bench.physics import batches
from grader.studies.bench.published.claims import Results, claim, demand, span
from grader.studies.bench.published.tables import milliseconds, table, times
from grader.studies.bench.scenes import describe_scene


@table(
    "scene",
    "MJX",
    *(f"error at {milliseconds(h)}" for h in batches.TIMESTEPS_S),
    *(f"batch of {n}" for n in batches.SIZES),
)
def mjx(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields MJX's errors in both precisions beside MuJoCo's, and its CPU time over MuJoCo's by size of the batch."""
    for name, scene in results["batches"]["scenes"].items():
        yield (
            describe_scene(name),
            "MuJoCo in C",
            *(f"{error:.1e}" for error in scene["64"]["mujoco"]),
            *("" for _ in batches.SIZES),
        )
        for bits, entry in scene.items():
            costs = (times(cost, ".2g") if (cost := entry["batches"].get(str(n))) else "-" for n in batches.SIZES)
            yield describe_scene(name), f"float{bits}", *(f"{error:.1e}" for error in entry["errors"]), *costs


@claim
def mjx_packages(results: Results) -> str:
    """Returns the packages of MJX that were measured."""
    return ", ".join(map(" ".join, results["batches"]["packages"].items()))


@claim
def single_precision(results: Results) -> str:
    """Returns the error that single precision leaves at every timestep, and how far double precision is MuJoCo's."""
    scenes = results["batches"]["scenes"].values()
    finest = [(scene["32"]["errors"][-1], scene["64"]["errors"][-1], scene["64"]["mujoco"][-1]) for scene in scenes]
    demand(all(single > ours for single, _, ours in finest), f"errors at the smallest timestep: {finest}")
    apart = max(
        abs(b / a - 1) for scene in scenes for a, b in zip(scene["64"]["mujoco"], scene["64"]["errors"], strict=True)
    )
    demand(apart < 0.01, f"errors of float64 over those of MuJoCo differ by {apart}")
    return (
        "MJX in float64 has MuJoCo's errors within 1 %; in float32 rounding leaves "
        f"{span([single for single, _, _ in finest], '.0e')} at 0.5 ms"
    )


@claim
def batch_costs(results: Results) -> str:
    """Returns what a step costs alone and in the largest batch."""
    kinds = [scene["batches"] for scene in results["batches"]["scenes"][batches.TIMED].values()]
    alone, together = (
        [kind[str(size)]["ratio"] for kind in kinds if str(size) in kind]
        for size in (batches.SIZES[0], batches.SIZES[-1])
    )
    demand(min(alone) > max(together), f"alone {alone}, together {together}")
    return (
        f"a step of MJX on the {describe_scene(batches.TIMED)} costs {span(alone)} times the CPU time of MuJoCo's in C "
        f"alone, and {span(together)} times in a batch of {batches.SIZES[-1]}"
    )
