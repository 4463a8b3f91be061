"""Latency and throughput of submissions: the real server, its jail and its database, over HTTP. Wall time, unlike in
the other benchmarks: a student waits in wall time."""

import atexit
import subprocess
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache

import numpy as np
from matplotlib.figure import Figure

from grader.domain.run import Job, RunStatus
from grader.sandbox import policy
from grader.sandbox.jail import Jail
from grader.sandbox.locks import cell
from grader.settings import Settings
from grader.studies.bench.service.answers import compare_with_bare, list_backends
from grader.studies.bench.service.submitting import JUDGED, SCRIPT, Client, read_right_answer, serve_clients
from grader.studies.bench.service.workers import SCRIPTS, Workers
from grader.studies.bench.study import Measurement, Record, Records, Study

STUDENTS = 4
SHOWN = {"service": "the service", "each": "bare, a commit each", "gathered": "bare, gathered"}
"""The servers as the picture names them."""

WORKERS = 2
BURST = 200
PAUSE_S = 0.05
"""Between idle runs of the jail [s]: long enough for a spare to be made again."""

HELLO = "import mujoco, numpy as np\n\nprint('hello')\n\n\ndef answer():\n    return np.arange(3.0)\n"
DRIVER = """
import time

began = time.perf_counter()

def run(student, inputs, submit):
    submit("answer", student.answer())
    submit("own_s", [time.perf_counter() - began])
"""


SUBMIT: dict[str, Callable[[Client], object]] = {
    "answers": Client.answer,
    "scripts": lambda client: client.graded("servo-threshold", SCRIPT),
}


def open_clients() -> list[Client]:
    """Returns the clients of one server, each with a new connection: a server closes those that are idle. A request on
    such a connection raises BrokenPipeError, which click takes for a closed stdout: it exits silently."""
    for client in start_clients():
        client.connection.close()  # and the next request opens one
    return start_clients()


@cache
def start_clients() -> list[Client]:
    """Returns the clients of a server that is started when something is left to measure, and stopped at exit."""
    stack = ExitStack()
    atexit.register(stack.close)
    return stack.enter_context(serve_clients(STUDENTS))


def compute_percentiles(times_s: Sequence[float]) -> Record:
    """Median and 95th percentile."""
    middle, late = np.percentile(times_s, [50, 95])
    return {"median_s": float(middle), "p95_s": float(late)}


@dataclass(frozen=True)
class Load(Measurement):
    """`answers` (typed numbers) or `scripts`, submitted by so many students at once."""

    load: str
    students: int

    def measure(self, quick: bool, done: Records) -> Record:
        """Wall times from request to verdict [s]; each student submits one after the other."""
        submit = SUBMIT[self.load]
        each = {"answers": (200, 25), "scripts": (15, 3)}[self.load][quick]

        def time_all(client: Client) -> list[float]:
            stamps = [time.perf_counter()]
            for _ in range(each):
                submit(client)
                stamps.append(time.perf_counter())
            return np.diff(stamps).tolist()

        busy = open_clients()[: self.students]
        submit(busy[0])
        with ThreadPoolExecutor(self.students) as pool:
            begin = time.perf_counter()
            times = [value for several in pool.map(time_all, busy) for value in several]
            per_second = len(times) / (time.perf_counter() - begin)
        return {"submissions": len(times), "per_second": per_second} | compute_percentiles(times)


@dataclass(frozen=True)
class Beside(Measurement):
    """The answers of a class beside two bare routes, by so many students at once."""

    backend: str
    students: int

    def measure(self, quick: bool, done: Records) -> Record:
        """Rates, wall times [s] and the CPU times of an answer [s] of each server, and the ratios to the service's."""
        return compare_with_bare(self.backend, self.students, *((2, 0.25) if quick else (7, 5.0)))

    def rows(self, record: Record) -> list[Record]:
        """Returns one row a server; ratios stand beside the bare route that they are to."""
        return [
            {**server, **record["ratios"].get(server["server"], {}), **record["effort"]} for server in record["servers"]
        ]


@dataclass(frozen=True)
class Judging(Measurement):
    """Our own simulating for one exercise, without the script's run."""

    exercise: str

    def measure(self, quick: bool, done: Records) -> Record:
        """CPU time [s]; every submission draws its cases anew."""
        source, count = read_right_answer(self.exercise), 3 if quick else 15
        verdicts = [open_clients()[0].graded(self.exercise, f"{source}\n# {number}\n") for number in range(count)]
        times = [verdict["timing_ms"]["judge_cpu"] / 1000 for verdict in verdicts]
        return {"submissions": count} | compute_percentiles(times)


@dataclass(frozen=True)
class Overhead(Measurement):
    """What a script that does nothing takes in the jail, without its own time, idle and in bursts. Idle runs take turns
    with a new interpreter and a single-use bubblewrap cell, so that load on the machine meets all three alike."""

    def measure(self, quick: bool, done: Records) -> Record:
        """Wall times by what was run [s], and the median rate of the bursts [jobs/s]."""
        models, (rounds, bursts) = Settings().content / "models", (10, 1) if quick else (40, 3)
        runtime = cell.find_runtime()
        importing = f"import sys; sys.path += {list(map(str, runtime.packages))!r}; import mujoco, numpy"
        single_use = cell.build_cell_command(runtime, models, cell.INSIDE, control=0)[:-2]
        commands = {
            "new interpreter": [str(runtime.executable), *cell.ISOLATED, "-c", importing],
            "single-use bubblewrap": [*single_use, importing],
        }
        times: dict[str, list[float]] = {name: [] for name in ("jail, idle", "jail, in a burst", *commands)}
        rates = []
        with Jail(models, WORKERS) as jail, ThreadPoolExecutor(WORKERS) as pool:
            measure_overhead_s(jail)
            for _ in range(rounds):
                time.sleep(PAUSE_S)
                times["jail, idle"].append(measure_overhead_s(jail))
                for name, command in commands.items():
                    start = time.perf_counter()
                    subprocess.run(command, env=policy.ENVIRONMENT, check=True, capture_output=True)  # noqa: S603
                    times[name].append(time.perf_counter() - start)
            for _ in range(bursts):
                start = time.perf_counter()
                times["jail, in a burst"] += pool.map(measure_overhead_s, [jail] * BURST)
                rates.append(BURST / (time.perf_counter() - start))
        runs = [{"run": name} | compute_percentiles(durations) for name, durations in times.items()]
        return {"per_second": float(np.median(rates)), "runs": runs}

    def rows(self, record: Record) -> list[Record]:
        """Returns one row a kind of run."""
        return [run | {"per_second": record["per_second"]} for run in record["runs"]]


def measure_overhead_s(jail: Jail) -> float:
    """Measures the wall time of one job above the script's own [s]."""
    start = time.perf_counter()
    report = jail.run(Job(HELLO, DRIVER, {}))
    total_s = time.perf_counter() - start
    assert report.status is RunStatus.RETURNED, report.reason
    return total_s - float(report.results["own_s"][0])


def plan(_quick: bool) -> Sequence[Measurement]:
    """Answers and scripts, by one student and by four at once; what the jail and judging cost alone; more workers."""
    loads = [Load(load, students) for students in (1, STUDENTS) for load in ("answers", "scripts")]
    beside = [Beside(backend, students) for backend in list_backends() for students in (10, 50)]
    return [Overhead(), *beside, *loads, *map(Workers, SCRIPTS), *map(Judging, JUDGED)]


def summarise(records: Records) -> Record:
    """Returns the records, as rows."""
    return {"loads": [key.row() | row for key, record in records.items() for row in key.rows(record)]}


def draw(records: Records, _summary: Record) -> Figure:
    """Median and 95th percentile of each load that has them."""
    figure = Figure(figsize=(7, 6))
    axes = figure.subplots()
    bars = [
        (describe_bar(key, row), row) for key, record in records.items() for row in key.rows(record) if "p95_s" in row
    ]
    for place, (label, row) in enumerate(bars):
        axes.barh(place, 1e3 * row["p95_s"], color="#bbccee", height=0.6)
        axes.barh(place, 1e3 * row["median_s"], color="#335599", height=0.6)
        axes.text(1e3 * row["p95_s"], place, f" {label}", va="center", fontsize=8)
    axes.set_yticks([])
    axes.set_xlim(0, 2.2e3 * max(row["p95_s"] for _, row in bars))
    axes.set_xlabel("ms until the verdict is back: median (dark) and 95th percentile (light)")
    return figure


def describe_bar(key: Measurement, row: Record) -> str:
    """What a bar shows."""
    if isinstance(key, Load):
        return f"{key.load}, {key.students} at once: {row['per_second']:.0f} a second"
    if isinstance(key, Beside):
        return f"{SHOWN[row['server']]} on {key.backend}, {key.students} at once: {row['per_second']:.0f} a second"
    return f"judging {key.exercise}, our own CPU time" if isinstance(key, Judging) else str(row["run"])


STUDY = Study("service", plan, summarise, {"service": draw})
