"""Latency and throughput in figures and a picture."""

from contextlib import ExitStack
from functools import cache
from pathlib import Path

import matplotlib as mpl

from grader.bench.journal import Record
from grader.bench.report.style import RC, figure, save
from grader.bench.run import Benchmark, Do, Records
from grader.bench.service import STUDENTS, Client, server, service_tasks


def measure(quick: bool, do: Do) -> Records:
    """All loads, on one server that is started only if something is left to measure."""
    with ExitStack() as stack:

        @cache
        def clients() -> list[Client]:
            return stack.enter_context(server(STUDENTS))

        return do(service_tasks(quick, clients))


def summarise(records: Records) -> Record:
    """The records are the summary."""
    return {"loads": dict(records)}


def rows(records: Records) -> list[Record]:
    """One row a load."""
    return [{"load": key.split("/")[0]} | record for key, record in records.items()]


def draw(records: Records, _summary: Record, out: Path) -> list[Path]:
    """Median and 95th percentile of each load."""
    with mpl.rc_context(RC):
        made = figure(7, 3)
        axes = made.subplots()
        for place, (key, record) in enumerate(records.items()):
            name, students = key.split("/")
            axes.barh(place, 1e3 * record["p95_s"], color="#bbccee", height=0.6)
            axes.barh(place, 1e3 * record["median_s"], color="#335599", height=0.6)
            speed = f", {students} at once: {record['per_second']:.0f} a second" if "per_second" in record else ""
            text = f" {name}{speed}"
            axes.text(1e3 * record["p95_s"], place, text, va="center", fontsize=8)
        axes.set_yticks([])
        axes.set_xlim(0, 2.2e3 * max(record["p95_s"] for record in records.values()))
        axes.set_xlabel(
            "ms until the verdict is back (judging: CPU time of ours alone): median (dark) and 95th percentile (light)"
        )
        return save(made, out, "service")


SERVICE = Benchmark(measure, summarise, rows, draw)
