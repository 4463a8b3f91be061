"""One way to run every study: measure what is missing, keep it in a journal, summarise, tabulate, draw."""

import ast
import csv
import hashlib
import json
import os
import platform
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib.metadata import distributions
from multiprocessing import get_context
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import matplotlib as mpl
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from grader.numerics.process import prepare
from grader.studies.bench import ROOMS, STUDIES

PACKAGES = ("mujoco", "numpy", "scipy", "pin", "drake")
ROOM = Path(__file__).parent
UNRELATED = {"__init__", "floors", "lines", "loops"}
"""Modules of this package that take no part in a study's measurements."""

NOT_MEASURING = ("draw", "summarise", "rows")
"""How the names of functions begin that only evaluate records."""

COLOURS = {
    "Euler": "#4477aa", "RK4": "#ee6677", "implicit": "#228833", "implicitfast": "#ccbb44", "discrete": "#aa3377",
}  # fmt: skip
"""Of the integrators. Source: Paul Tol's bright scheme, which colour-blind readers can tell apart."""

LOOK: Any = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.constrained_layout.use": True,
    "figure.dpi": 110,
    "savefig.facecolor": "white",
    "svg.hashsalt": "grader",
}
"""Matplotlib's settings for every picture; the salt makes the same bytes every time."""

Record = dict[str, Any]


@dataclass(frozen=True)
class Measurement(ABC):
    """Something to measure. A study derives a class for each kind; the fields tell measurements of a kind apart. What
    is not `timed` reads nothing from `done`; it is measured first, on all cores side by side."""

    timed: ClassVar[bool] = True

    @abstractmethod
    def measure(self, quick: bool, done: "Records") -> Record:
        """Measure, with a small part of the effort where `quick`; `done` holds the measurements listed before."""

    def __str__(self) -> str:
        """Returns the kind and the fields, for a progress bar."""
        return " ".join(map(str, self.row().values()))

    def row(self) -> Record:
        """Returns the kind and the fields, for JSON and CSV."""
        return {"kind": type(self).__name__.lower(), **asdict(self)}

    def rows(self, record: Record) -> list[Record]:
        """Returns the lines of the CSV: by default one of the record's numbers and words, where it has any."""
        row = {name: value for name, value in record.items() if isinstance(value, str | int | float)}
        return [row] if row else []


Records = Mapping[Measurement, Record]
KindT = TypeVar("KindT", bound=Measurement)


def select_kind(records: Records, kind: type[KindT]) -> dict[KindT, Record]:
    """Returns the records of the measurements of one class."""
    return {key: record for key, record in records.items() if isinstance(key, kind)}


@dataclass(frozen=True)
class Study:
    """`plan(quick)` lists what to measure, in order; the other functions only evaluate records. `draw` makes the
    figures, by file name. Functions that only evaluate begin with a word of NOT_MEASURING, so that changing them does
    not discard what was measured."""

    name: str
    plan: Callable[[bool], Sequence[Measurement]]
    summarise: Callable[[Records], Record]
    draw: Mapping[str, Callable[[Records, Record], Figure]]

    def run(self, out: Path, quick: bool) -> None:
        """Run the study; interrupted and started again with the same `out`, it resumes. Writes `<name>.jsonl` (each
        measurement as it is finished), `<name>.json` (machine, versions, summary), `<name>.csv` and each picture as SVG
        and PNG."""
        prepare()
        console = Console(stderr=True)
        out.mkdir(parents=True, exist_ok=True)
        context = compute_digest(read_versions(), compute_code_digest(self.name), quick)
        journal = Journal(out / f"{self.name}.jsonl", context)
        summary: Record = {"benchmark": self.name, "quick": quick}
        summary |= {"machine": describe_machine(), "versions": read_versions()}
        try:
            records = carry_out(self.name, self.plan(quick), journal, console, quick)
        except KeyboardInterrupt:
            console.print(f"{self.name}: stopped; {journal.path} keeps what is finished, the same command resumes")
            raise
        summary |= {"measurements": len(records)} | self.summarise(records)
        written = [out / f"{self.name}.json", out / f"{self.name}.csv"]
        # Times are known to no more than four significant digits, and the file stays small.
        rounded = json.loads(json.dumps(summary), parse_float=lambda digits: float(f"{float(digits):.4g}"))
        written[0].write_text(json.dumps(rounded, indent=1) + "\n", encoding="utf-8")
        rows = [key.row() | row for key, record in records.items() for row in key.rows(record)]
        with written[1].open("w", encoding="utf-8", newline="") as lines:
            writer = csv.DictWriter(lines, list(dict.fromkeys(column for row in rows for column in row)))
            writer.writeheader()
            writer.writerows(rows)
        with mpl.rc_context(LOOK):
            for name, draw in self.draw.items():
                figure = draw(records, summary)
                written += [out / f"{name}.svg", out / f"{name}.png"]
                figure.savefig(written[-2], metadata={"Date": None})
                figure.savefig(written[-1], dpi=130)
        for path in written:
            console.print(f"{self.name}: wrote {path}")


@dataclass(frozen=True)
class Journal:
    """Finished measurements on disk, one JSON line each. Only lines of the same context (versions, code, scenes) are
    read; the others stay in the file."""

    path: Path
    context: str

    def read(self) -> dict[str, Record]:
        """Returns the records by their measurements' rows as JSON; a line that was cut short is left out."""
        records = {}
        for line in self.path.read_text(encoding="utf-8").splitlines() if self.path.exists() else ():
            with suppress(ValueError):
                entry = json.loads(line)
                if entry["context"] == self.context:
                    records[json.dumps(entry["key"])] = entry["record"]
        return records

    def add(self, key: Measurement, record: Record) -> Record:
        """Append a record, on a line of its own whatever stands before it; return it as `read` would."""
        line = json.dumps({"context": self.context, "key": key.row(), "record": record})
        with self.path.open("a", encoding="utf-8") as lines:
            lines.write(f"\n{line}")
        return dict(json.loads(line)["record"])


def carry_out(
    title: str, plan: Sequence[Measurement], journal: Journal, console: Console, quick: bool = False
) -> dict[Measurement, Record]:
    """Measure what the journal does not hold yet, with a progress bar; return all records. What is timed is measured
    alone and in order, after the others. Raises ValueError where two measurements are equal."""
    if len(set(plan)) != len(plan):
        raise ValueError(f"{title}: two measurements are the same")
    kept = journal.read()
    done = {key: kept[row] for key in plan if (row := json.dumps(key.row())) in kept}
    if done:
        console.print(f"{title}: {len(done)} of {len(plan)} measurements are already in {journal.path}")
    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(TextColumn("{task.description}"), *columns, console=console) as progress:
        bar = progress.add_task(title, total=len(plan), completed=len(done))
        for key, record in measure_in_parallel([key for key in plan if not key.timed and key not in done], quick):
            progress.update(bar, description=f"{title}: {key}")
            done[key] = journal.add(key, record)
            progress.advance(bar)
        for key in plan:
            if key not in done:
                progress.update(bar, description=f"{title}: {key}")
                done[key] = journal.add(key, key.measure(quick, done))
                progress.advance(bar)
    return {key: done[key] for key in plan}


def measure_in_parallel(keys: Sequence[Measurement], quick: bool) -> Iterator[tuple[Measurement, Record]]:
    """Measure on all cores; yield each record as it is finished."""
    with ProcessPoolExecutor(mp_context=get_context("spawn"), initializer=prepare) as pool:
        try:
            futures = {pool.submit(key.measure, quick, {}): key for key in keys}
            yield from ((futures[future], future.result()) for future in as_completed(futures))
        finally:
            pool.shutdown(cancel_futures=True)


def read_versions() -> dict[str, str]:
    """Versions of Python and of each package; `not installed` where an optional one is missing."""
    return {"python": platform.python_version()} | {name: read_version(name) for name in PACKAGES}


def read_version(package: str) -> str:
    """Returns the version of a package, or `not installed`."""
    return next(
        (distribution.version for distribution in distributions() if distribution.name == package), "not installed"
    )


def describe_machine() -> dict[str, str | int | float]:
    """Processor, cores, system and load now: what a reader needs to judge a time."""
    cpus = Path("/proc/cpuinfo")
    lines = cpus.read_text(encoding="utf-8").splitlines() if cpus.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": names[0] if names else platform.machine(),
        "cores": os.cpu_count() or 1,
        "architecture": platform.machine(),
        "system": f"{platform.system()} {platform.release()}",
        "load_1min": round(os.getloadavg()[0], 2),
    }


def compute_digest(*parts: object) -> str:
    """Returns a short digest of the representation of the parts."""
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def compute_code_digest(study: str) -> str:
    """Returns a digest of what a study measures with: numerics, scenes, its own module and those that studies share.
    Comments, docstrings and the functions of NOT_MEASURING are left out."""
    others = UNRELATED.union(STUDIES) - {study}
    rooms = {"errors": ("errors", "physics")}.get(ROOMS[study], (ROOMS[study],))
    paths = (*ROOM.glob("*.py"), *(path for room in rooms for path in ROOM.glob(f"{room}/*.py")))
    own = [path for path in paths if path.stem not in others]
    modules = [*own, *ROOM.parents[1].glob("numerics/**/*.py")]
    texts = [extract_measuring_part(path.read_text(encoding="utf-8")) for path in sorted(modules)]
    return compute_digest(texts, [path.read_bytes() for path in sorted(ROOM.glob("scenes/*.xml"))])


def extract_measuring_part(source: str) -> str:
    """Returns the syntax tree of a module without docstrings and without the functions of NOT_MEASURING."""

    def is_left_out(part: ast.stmt) -> bool:
        if isinstance(part, ast.FunctionDef):
            return part.name.startswith(NOT_MEASURING)
        return isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant)

    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [part for part in node.body if not is_left_out(part)]
    return ast.dump(tree)
