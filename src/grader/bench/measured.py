"""All three benchmarks into a folder, and the tables and pictures of the pages made from them.

`python -m grader.bench.measured docs README.md docs/measured.md` measures (going on where it was stopped) and
rewrites; with `--tables-only` it renders the committed JSON again.
"""

import argparse
import shutil
from pathlib import Path

from grader.bench.run import run
from grader.bench.tables import BENCHMARKS, fill, load_results

PICTURES = (
    "precision.png",
    "precision_peers.png",
    "stability_stiffness.png",
    "stability_damping.png",
    "stability_oscillator.png",
    "stability_collisions.png",
    "skip.png",
)


def main() -> None:
    """Measure, copy what is committed, fill the pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("docs", type=Path, help="folder that holds measured/")
    parser.add_argument("pages", type=Path, nargs="+", help="pages with markers")
    parser.add_argument("--work", type=Path, default=Path(".data/bench"), help="folder of the runs")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--tables-only", action="store_true")
    given = parser.parse_args()
    kept = given.docs / "measured"
    if not given.tables_only:
        for name in BENCHMARKS:
            run(name, given.work, given.quick)
        kept.mkdir(parents=True, exist_ok=True)
        for name in (*(f"{benchmark}.json" for benchmark in BENCHMARKS), *PICTURES):
            shutil.copyfile(given.work / name, kept / name)
    results = load_results(kept)
    for page in given.pages:
        page.write_text(fill(page.read_text(encoding="utf-8"), results), encoding="utf-8")


if __name__ == "__main__":
    main()
