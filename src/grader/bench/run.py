"""One benchmark from start to pictures: measure what is missing, summarise, write JSON, CSV and pictures."""

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from grader.bench.journal import Journal, Record, Task, carry_out, context_of
from grader.bench.machine import code_digest, machine, versions
from grader.errors import Unprocessable
from grader.numerics.process import prepare

Records = Mapping[str, Record]
Do = Callable[[Sequence[Task]], dict[str, Record]]


@dataclass(frozen=True)
class Benchmark:
    """What a benchmark consists of; every function is pure but `measure`, which hands its tasks to `Do`."""

    measure: Callable[[bool, Do], Records]
    summarise: Callable[[Records], Record]
    rows: Callable[[Records], list[Record]]
    draw: Callable[[Records, Record, Path], list[Path]]


def benchmark_of(name: str) -> Benchmark:
    """By name; what one benchmark imports (matplotlib, SciPy) the others need not have."""
    if name == "precision":
        from grader.bench.report.precision import PRECISION

        return PRECISION
    if name == "stability":
        from grader.bench.report.stability import STABILITY

        return STABILITY
    if name == "skip":
        from grader.bench.report.skip import SKIP

        return SKIP
    if name == "service":
        from grader.bench.report.service import SERVICE

        return SERVICE
    raise Unprocessable(f"there is no benchmark {name!r}; there are precision, stability, skip and service")


def run(name: str, out: Path, quick: bool) -> None:
    """Run a benchmark; interrupted and started again with the same `out`, it goes on where it was.

    Writes `<name>.jsonl` (every measurement as it is finished), `<name>.json` (machine, versions, results),
    `<name>.csv` (one row a measurement) and pictures. Raises Unprocessable for an unknown name.
    """
    benchmark = benchmark_of(name)
    prepare()
    console = Console(stderr=True)
    out.mkdir(parents=True, exist_ok=True)
    journal = Journal(out / f"{name}.jsonl", context_of(versions(), code_digest(), quick))
    before = machine()
    try:
        records = benchmark.measure(quick, lambda tasks: carry_out(name, tasks, journal, console))
    except KeyboardInterrupt:
        console.print(
            f"{name}: stopped; what is finished is in {journal.path}, and the same command goes on from there"
        )
        raise
    summary: Record = {"benchmark": name, "quick": quick, "machine": before, "versions": versions()}
    summary |= {"measurements": len(records)} | benchmark.summarise(records)
    written = [out / f"{name}.json", out / f"{name}.csv"]
    written[0].write_text(json.dumps(rounded(summary), indent=1) + "\n", encoding="utf-8")
    write_csv(written[1], benchmark.rows(records))
    for path in written + benchmark.draw(records, summary, out):
        console.print(f"{name}: wrote {path}")


def rounded(value: Any) -> Any:
    """Four significant digits: more than any time is good for, and small enough to commit."""
    if isinstance(value, float):
        return float(f"{value:.4g}")
    if isinstance(value, dict):
        return {key: rounded(inner) for key, inner in value.items()}
    return [rounded(inner) for inner in value] if isinstance(value, list | tuple) else value


def write_csv(path: Path, rows: list[Record]) -> None:
    """Rows with the union of their columns, in order of first appearance."""
    columns = list(dict.fromkeys(column for row in rows for column in row))
    with path.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, columns)
        writer.writeheader()
        writer.writerows(rows)
