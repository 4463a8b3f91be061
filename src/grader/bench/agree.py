"""Do two runs of a study agree? What does not depend on time must be equal, ratios must lie within their spreads.

`python -m grader.bench.agree FIRST.json SECOND.json` prints the counts and every exception. It exits 1 where a result
is unequal, or more than a fifth of the ratios are apart: medians whose bands hold the middle 80 % of the pairs should
nearly always lie in bands that meet.
"""

import json
import sys
from pathlib import Path
from typing import Any

APART_MAX = 0.2
SETTING = ("integrator", "timestep_s", "setting")
"""Which setting is cheapest may change where two cost nearly the same; their spreads are then not compared."""

TIMED = {"ratio", "cost", "yardstick_s", "machine", "load_1min", "pareto"}
"""Keys whose values depend on time."""


class Agreement:
    """Compares two documents of one study; keeps the number of ratios and the paths of what disagrees."""

    def __init__(self, one: Any, other: Any) -> None:
        self.ratios = 0
        self.apart: list[str] = []
        self.unequal: list[str] = []
        self._compare(one, other, "$")

    @property
    def holds(self) -> bool:
        """Nothing is unequal, and few ratios are apart."""
        return not self.unequal and len(self.apart) <= APART_MAX * self.ratios

    def _compare(self, one: Any, other: Any, path: str) -> None:
        if path.endswith("/spread"):
            self.ratios += 1
            if one[0] > other[1] or other[0] > one[1]:
                self.apart.append(f"{path}: {one} and {other}")
        elif isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
            if all(one[key] == other[key] for key in SETTING if key in one):
                for key in one.keys() - TIMED:
                    self._compare(one[key], other[key], f"{path}/{key}")
        elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
            for number, (here, there) in enumerate(zip(one, other, strict=True)):
                self._compare(here, there, f"{path}[{number}]")
        elif one != other:
            self.unequal.append(f"{path}: {one} and {other}")


def main(paths: list[str]) -> int:
    """Compare two files."""
    found = Agreement(*(json.loads(Path(path).read_text(encoding="utf-8")) for path in paths))
    print(f"{found.ratios - len(found.apart)} of {found.ratios} ratios agree within their spreads")
    for word, lines in (("apart", found.apart), ("unequal", found.unequal)):
        for line in lines:
            print(f"{word}: {line}")
    return 0 if found.holds else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
