"""A second machine's results beside the committed ones: `python -m grader.studies.bench.published.compare docs DIR`.

DIR holds what `grader bench NAME --out DIR` wrote there. Prints for each study how far the ratios of times lie apart,
and how far all other numbers; at the end the sentences of DOCS/measured.md that those results deny, and exits 1 if any.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import typer

from grader.studies.bench.published.claims import Results
from grader.studies.bench.published.measured import STUDIES, fill, load_results

CIRCUMSTANCES = {"machine", "versions", "quick", "measurements", "interval", "yardstick_s", "fixed_us", "reset_us"}
"""Keys whose numbers are of the machine or belong to a ratio; the fronts also hold costs, and the service has rates."""

NAMING = ("part", "backend", "students", "server", "script", "workers")
"""Keys that say what a row of a list is, wherever it stands: a machine without PostgreSQL has fewer rows."""


def list_ratios(results: Any, path: str = "") -> Iterator[tuple[str, Results]]:
    """Yields each measured ratio with its interval, and where it stands."""
    for name, entry in results.items() if isinstance(results, dict) else ():
        if isinstance(entry, dict) and entry.get("ratio") is not None:
            yield f"{path}{name}", entry
        yield from list_ratios(entry, f"{path}{name}, ")
    for number, entry in enumerate(results if isinstance(results, list) else ()):
        if isinstance(entry, dict) and "ratio" in entry:
            label = ", ".join(str(entry[name]) for name in NAMING if name in entry)
            yield f"{path}{label or number}", entry


def list_others(results: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Yields every other number: errors, orders, shares, counts."""
    for name, entry in results.items() if isinstance(results, dict) else ():
        if name not in CIRCUMSTANCES | {"ratio", "pareto", "loads"}:
            yield from list_others(entry, f"{path}{name}, ")
    for number, entry in enumerate(results if isinstance(results, list) else ()):
        yield from list_others(entry, f"{path}{number}, ")
    if isinstance(results, int | float) and not isinstance(results, bool):
        yield path.removesuffix(", "), float(results)


def compare(ours: Results, theirs: Results) -> Iterator[str]:
    """Lines on one study: the machines, the ratios, the other numbers."""
    machines = " beside ".join(
        "{processor} with {cores} cores".format(**record["machine"]) for record in (ours, theirs)
    )
    yield f"{theirs['benchmark']}: {machines}"
    first, second = dict(list_ratios(ours)), dict(list_ratios(theirs))
    if common := [name for name in first if name in second]:
        apart = {name: second[name]["ratio"] / first[name]["ratio"] for name in common}
        known = [name for name in common if "interval" in first[name] and "interval" in second[name]]
        overlapping = sum(do_overlap(first[name]["interval"], second[name]["interval"]) for name in known)
        low, middle, high = np.percentile(list(apart.values()), (10, 50, 90))
        furthest = max(apart, key=lambda name: abs(np.log(apart[name])))
        yield (
            f"  {len(common)} ratios: theirs over ours {middle:.2f} at the median, {low:.2f} to {high:.2f} in the "
            f"middle 80 %; {overlapping} of {len(known)} intervals overlap; "
            f"furthest apart {apart[furthest]:.2f}: {furthest}"
        )
    numbers, those = dict(list_others(ours)), dict(list_others(theirs))
    differences = {
        name: abs(those[name] - value) / max(abs(value), abs(those[name]))
        for name, value in numbers.items()
        if name in those and value != those[name]
    }
    far = max(differences, key=lambda name: differences[name], default="")
    yield f"  {len(numbers.keys() & those)} other numbers: {len(differences)} differ" + (
        f", furthest {numbers[far]:.4g} beside {those[far]:.4g}: {far}" if far else ""
    )


def do_overlap(one: list[float], other: list[float]) -> bool:
    """Whether two intervals have a point in common."""
    return one[0] <= other[1] and other[0] <= one[1]


def main(docs: Path, folder: Path) -> None:
    """Compare the results in FOLDER with those in DOCS/measured."""
    ours = load_results(docs / "measured")
    theirs = {
        name: json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        for name in STUDIES
        if (folder / f"{name}.json").exists()
    }
    if not theirs:
        sys.exit(f"there are no results in {folder}: run grader bench NAME --out {folder}")
    for name, entry in theirs.items():
        print("\n".join(compare(ours[name], entry)))
    _, denied = fill((docs / "measured.md").read_text(encoding="utf-8"), ours | theirs)
    if denied:
        sys.exit("\n".join(denied))


if __name__ == "__main__":
    typer.run(main)
