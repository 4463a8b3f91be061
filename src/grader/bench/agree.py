"""Do two runs of a benchmark agree? Results that do not depend on time must be equal, ratios within their spreads.

`python -m grader.bench.agree FIRST.json SECOND.json` prints the counts and every exception; exits 1 where more
ratios disagree than a band of 80 % leaves to chance, or a result that must be equal is not.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SHARE_MIN = 0.8
"""Two medians whose bands hold the middle 80 % of the pairs should nearly always lie in bands that meet."""

TIMED = {"ratio", "cost", "spread", "yardstick_s", "machine", "load_1min", "pareto"}
"""Keys whose values depend on time."""


@dataclass(frozen=True)
class Agreement:
    """Counts, and the paths of what disagrees."""

    ratios: int
    apart: tuple[str, ...]
    unequal: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Nothing unequal, and at least SHARE_MIN of the ratios within their spreads."""
        return not self.unequal and len(self.apart) <= (1 - SHARE_MIN) * self.ratios


def compare(first: Any, second: Any) -> Agreement:
    """Two documents of the same benchmark."""
    ratios, apart, unequal = 0, [], []
    for path, one, other in walk(first, second, "$"):
        if path.endswith("/spread"):
            ratios += 1
            if one[0] > other[1] or other[0] > one[1]:
                apart.append(f"{path}: {one} and {other}")
        else:
            unequal.append(f"{path}: {one} and {other}")
    return Agreement(ratios, tuple(apart), tuple(unequal))


def walk(one: Any, other: Any, path: str) -> Iterator[tuple[str, Any, Any]]:
    """Every pair of spreads, and every pair of values outside TIMED that differ."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        if same_setting(one, other):
            for key, value in one.items():
                if key == "spread":
                    yield f"{path}/{key}", value, other[key]
                elif key not in TIMED:
                    yield from walk(value, other[key], f"{path}/{key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, (here, there) in enumerate(zip(one, other, strict=True)):
            yield from walk(here, there, f"{path}[{number}]")
    elif one != other:
        yield path, one, other


def same_setting(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Which setting is cheapest may change where two cost nearly the same; their spreads are then no pair."""
    return all(one[key] == other[key] for key in ("integrator", "timestep_s", "setting") if key in one)


def main(arguments: list[str]) -> int:
    """Compare two files."""
    first, second = (json.loads(Path(path).read_text(encoding="utf-8")) for path in arguments)
    found = compare(first, second)
    print(f"{found.ratios - len(found.apart)} of {found.ratios} ratios agree within their spreads")
    for line in found.apart:
        print(f"apart: {line}")
    for line in found.unequal:
        print(f"unequal: {line}")
    return 0 if found.holds else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
