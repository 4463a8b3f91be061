"""Latency and throughput of submissions: the real server, its jail and its database, over HTTP.

Wall time, unlike in the other benchmarks: a student waits in wall time. The server is a process of its own on a
database of its own, with rate limits lifted.
"""

import atexit
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from http.client import HTTPConnection
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.request import urlopen

import numpy as np
from matplotlib.figure import Figure

from grader.bench.answers import backends, beside_bare, free_port
from grader.bench.study import Measurement, Record, Records, Study
from grader.domain.run import Job, RunStatus
from grader.sandbox import cell, policy
from grader.sandbox.jail import Jail
from grader.settings import Settings

GRADER = Path(sys.executable).parent / "grader"
STUDENTS = 4
START_S = 120.0
GRADED_S = 60.0
UNLIMITED = {"GRADER_RATE_PER_S": "100000", "GRADER_RATE_BURST": "100000"}

SCRIPT = "def largest_stable_timestep(model, integrator):\n    return None\n"
"""Costs the jail a whole run and the grader a whole certificate, whatever the verdict."""

JUDGED = {
    "servo-threshold": "correct__the_lessons_script_and_a_bisection.py",
    "rk4-step": "correct__classical.py",
    "rk4-free-joint": "correct__quaternion_derivative.py",
}
"""Right answers; the last is judged by its convergence, which costs most."""

WORKER_COUNTS = (1, 2, 4)
NUMBERS = count()
"""Makes every script differ from all others."""

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


class Client:
    """One student with one connection."""

    def __init__(self, port: int, token: str, server: int) -> None:
        self.server = server  # its process id
        self.connection = HTTPConnection("127.0.0.1", port, timeout=GRADED_S)
        self.headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}

    def request(self, method: str, path: str, body: Any = None) -> tuple[int, Any]:
        """Status and JSON of a call under /api/v1."""
        self.connection.request(method, f"/api/v1{path}", json.dumps(body) if body else None, self.headers)
        answer = self.connection.getresponse()
        return answer.status, json.loads(answer.read())

    def answer(self) -> None:
        """Submit a typed number and check its verdict."""
        status, body = self.request("POST", "/submissions", {"quiz": "1.3-check", "question": "q2", "answer": "5 ms"})
        require(status == 201 and body["verdict"]["status"] == "correct", body)

    def hand_in(self, question: str, source: str) -> str:
        """Submit a script of the exercises; the id of the submission."""
        body = {"quiz": "1.3-exercises", "question": question, "answer": {"source": source}}
        status, submission = self.request("POST", "/submissions", body)
        require(status == 202, submission)
        return str(submission["id"])

    def heard(self, submission_id: str) -> dict[str, Any]:
        """Listen to a submission's events until its verdict is there. Raises TimeoutError after GRADED_S."""
        self.connection.request("GET", f"/api/v1/submissions/{submission_id}/events", None, self.headers)
        events = self.connection.getresponse().read().decode()  # the stream ends with the verdict
        data = [line.removeprefix("data: ") for line in events.splitlines() if line.startswith("data: ")]
        verdict: dict[str, Any] = json.loads(data[-1])["verdict"]
        require(verdict["status"] != "grader_fault", verdict)
        return verdict

    def graded(self, question: str, source: str) -> dict[str, Any]:
        """The verdict on a script of the exercises, once it is heard."""
        return self.heard(self.hand_in(question, source))


SUBMIT: dict[str, Callable[[Client], object]] = {
    "answers": Client.answer,
    "scripts": lambda client: client.graded("servo-threshold", SCRIPT),
}


def require(held: bool, body: Any) -> None:
    """Raise RuntimeError for an unexpected answer: its time would say nothing."""
    if not held:
        raise RuntimeError(f"the service answered {body}")


def wait_until_ready(process: "subprocess.Popen[bytes]", port: int) -> None:
    """Return once /readyz answers 200. Raises RuntimeError where the server ended or took too long."""
    end = time.perf_counter() + START_S
    while time.perf_counter() < end and process.poll() is None:
        with suppress(OSError), urlopen(f"http://127.0.0.1:{port}/readyz", timeout=5):
            return
        time.sleep(0.1)
    raise RuntimeError("the server did not become ready")


def token_of(folder: str, user: str) -> str:
    """A student's token."""
    arguments = [str(GRADER), "token", "create", "--user", user, "--role", "student", "--data", folder]
    return subprocess.check_output(arguments, text=True).strip()  # noqa: S603  our own command


@contextmanager
def served(students: int, **environment: str) -> Iterator[list[Client]]:
    """A client for each student of `grader serve`, on a free port with fresh data and these settings."""
    with TemporaryDirectory() as folder:
        port = free_port()
        arguments = [str(GRADER), "serve", "--port", str(port), "--data", folder]
        null, settings = subprocess.DEVNULL, os.environ | UNLIMITED | environment
        process = subprocess.Popen(arguments, env=settings, stdout=null, stderr=null)  # noqa: S603  our own command
        try:
            wait_until_ready(process, port)
            yield [Client(port, token_of(folder, f"student{number}"), process.pid) for number in range(students)]
        finally:
            process.terminate()
            process.wait(30)


def clients() -> list[Client]:
    """The clients of one server, each with a new connection: a server closes those that are idle.

    A request on such a connection raises BrokenPipeError, which click takes for a closed stdout: it exits silently.
    """
    for client in started():
        client.connection.close()  # and the next request opens one
    return started()


@cache
def started() -> list[Client]:
    """The clients of a server that is started when something is left to measure, and stopped at exit."""
    stack = ExitStack()
    atexit.register(stack.close)
    return stack.enter_context(served(STUDENTS))


def percentiles(times_s: Sequence[float]) -> Record:
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

        busy = clients()[: self.students]
        submit(busy[0])
        with ThreadPoolExecutor(self.students) as pool:
            begin = time.perf_counter()
            times = [one for several in pool.map(time_all, busy) for one in several]
            per_second = len(times) / (time.perf_counter() - begin)
        return {"submissions": len(times), "per_second": per_second} | percentiles(times)


@dataclass(frozen=True)
class Beside(Measurement):
    """Choice answers beside a bare route with one durable insert, by so many students at once."""

    backend: str
    students: int

    def measure(self, quick: bool, done: Records) -> Record:
        """Rates, their ratio, wall times [s] and the servers' CPU times for one answer [s]."""
        return beside_bare(self.backend, self.students, *((1, 1.0) if quick else (5, 5.0)))


@dataclass(frozen=True)
class Workers(Measurement):
    """A queue of scripts, worked off by one, two and four grading processes.

    Nothing is handed in or asked for meanwhile. `cores` is how many cores the service keeps busy, its server, grading
    processes and jails together: where one process of grading keeps more than one core busy, two of them gain less than
    twice on two cores. It prepares the verdict while the script runs, and the next cell while the verdict is stored.
    """

    def measure(self, quick: bool, done: Records) -> Record:
        """Rates by the number of processes [1/s], their ratios to one, busy cores: medians of bursts in turn."""
        each, rounds = (24, 1) if quick else (60, 5)
        with ExitStack() as stack:
            busy = {n: stack.enter_context(served(1, GRADER_WORKERS=str(n)))[0] for n in WORKER_COUNTS}
            for client in busy.values():
                worked_off(client, 8)
            bursts = [{n: worked_off(client, each) for n, client in busy.items()} for _ in range(rounds)]
        runs = []
        for n in WORKER_COUNTS:
            rates, costs = zip(*(burst[n] for burst in bursts), strict=True)
            runs.append(
                {
                    "workers": n,
                    "per_second": float(np.median(rates)),
                    "ratio": float(np.median([burst[n][0] / burst[1][0] for burst in bursts])),
                    "cores": float(np.median(np.multiply(rates, costs))),
                    "cpu_s": float(np.median(costs)),
                }
            )
        return {"machine_cores": os.cpu_count() or 1, "runs": runs}

    def rows(self, record: Record) -> list[Record]:
        """One row a number of processes."""
        return [{"machine_cores": record["machine_cores"], **run} for run in record["runs"]]


def worked_off(client: Client, scripts: int) -> tuple[float, float]:
    """The rate at which queued scripts are graded [1/s], and the CPU time of one in all processes of the service [s].

    The grading processes are held until all are handed in; at most 100 scripts.
    """
    client.connection.close()  # and a new one: a server closes those that are idle
    sources = (f"{SCRIPT}# {next(NUMBERS)}\n" for _ in range(scripts))  # each draws other cases
    with held(client.server):
        ids = [client.hand_in("servo-threshold", source) for source in sources]
        began, before_s = time.perf_counter(), family_cpu_s(client.server)
    for one in ids[-max(WORKER_COUNTS) :]:  # one of them is the last
        client.heard(one)
    ended, after_s = time.perf_counter(), family_cpu_s(client.server)
    return scripts / (ended - began), (after_s - before_s) / scripts


@contextmanager
def held(server: int) -> Iterator[None]:
    """Stops the grading processes of a server for the block."""
    pids = [pid for pid, stat in processes().items() if int(stat[1]) == server and is_grading(pid)]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


def is_grading(pid: int) -> bool:
    """Whether this is a grading process."""
    with suppress(OSError):  # it has ended
        return "grading_process" in Path(f"/proc/{pid}/cmdline").read_text()
    return False


def family_cpu_s(pid: int) -> float:
    """The CPU time of a process and its descendants [s], with those that have ended and were waited for."""
    stats, family = processes(), {pid}
    while more := {child for child, stat in stats.items() if int(stat[1]) in family} - family:
        family |= more
    return sum(sum(map(int, stats[one][11:15])) for one in family & stats.keys()) / os.sysconf("SC_CLK_TCK")


def processes() -> dict[int, list[str]]:
    """The fields after the name in /proc/PID/stat of every process: 1 is its parent, 11 to 14 are CPU times [ticks]."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has ended
            found[int(stat.parent.name)] = stat.read_text().rpartition(")")[2].split()
    return found


@dataclass(frozen=True)
class Judging(Measurement):
    """Our own simulating for one exercise, without the script's run."""

    exercise: str

    def measure(self, quick: bool, done: Records) -> Record:
        """CPU time [s]; every submission draws its cases anew."""
        folder = Settings().content / "reference_solutions" / "1.3-exercises" / self.exercise
        source, count = (folder / JUDGED[self.exercise]).read_text(encoding="utf-8"), 3 if quick else 15
        verdicts = [clients()[0].graded(self.exercise, f"{source}\n# {number}\n") for number in range(count)]
        return {"submissions": count} | percentiles([verdict["timing_ms"]["judge_cpu"] / 1000 for verdict in verdicts])


@dataclass(frozen=True)
class Overhead(Measurement):
    """What the jail costs above the script's own time, idle and in bursts.

    Idle runs take turns with a new interpreter and a single-use bubblewrap cell, so that load on the machine meets all
    three alike.
    """

    def measure(self, quick: bool, done: Records) -> Record:
        """Wall times by what was run [s], and the median rate of the bursts [jobs/s]."""
        models, (rounds, bursts) = Settings().content / "models", (10, 1) if quick else (40, 3)
        runtime = cell.discover()
        importing = f"import sys; sys.path += {list(map(str, runtime.packages))!r}; import mujoco, numpy"
        commands = {
            "new interpreter": [str(runtime.executable), *cell.ISOLATED, "-c", importing],
            "single-use bubblewrap": [*cell.bubblewrap(runtime, models, cell.INSIDE, control=0)[:-2], importing],
        }
        times: dict[str, list[float]] = {name: [] for name in ("jail, idle", "jail, in a burst", *commands)}
        rates = []
        with Jail(models, WORKERS) as jail, ThreadPoolExecutor(WORKERS) as pool:
            overhead_s(jail)
            for _ in range(rounds):
                time.sleep(PAUSE_S)
                times["jail, idle"].append(overhead_s(jail))
                for name, command in commands.items():
                    start = time.perf_counter()
                    subprocess.run(command, env=policy.ENVIRONMENT, check=True, capture_output=True)  # noqa: S603
                    times[name].append(time.perf_counter() - start)
            for _ in range(bursts):
                start = time.perf_counter()
                times["jail, in a burst"] += pool.map(overhead_s, [jail] * BURST)
                rates.append(BURST / (time.perf_counter() - start))
        runs = [{"run": name} | percentiles(one) for name, one in times.items()]
        return {"per_second": float(np.median(rates)), "runs": runs}

    def rows(self, record: Record) -> list[Record]:
        """One row a kind of run."""
        return [run | {"per_second": record["per_second"]} for run in record["runs"]]


def overhead_s(jail: Jail) -> float:
    """The wall time of one job above the script's own [s]."""
    start = time.perf_counter()
    report = jail.run(Job(HELLO, DRIVER, {}))
    total_s = time.perf_counter() - start
    assert report.status is RunStatus.RETURNED, report.reason
    return total_s - float(report.results["own_s"][0])


def plan(_quick: bool) -> Sequence[Measurement]:
    """Answers and scripts, by one student and by four at once; what the jail and judging cost alone; more workers."""
    loads = [Load(load, students) for students in (1, STUDENTS) for load in ("answers", "scripts")]
    beside = [Beside(backend, students) for backend in backends() for students in (10, 50)]
    return [Overhead(), *beside, *loads, Workers(), *map(Judging, JUDGED)]


def summarise(records: Records) -> Record:
    """The records, as rows."""
    return {"loads": [key.row() | row for key, record in records.items() for row in key.rows(record)]}


def draw(records: Records, _summary: Record) -> Figure:
    """Median and 95th percentile of each load that has them."""
    figure = Figure(figsize=(7, 4))
    axes = figure.subplots()
    bars = [(label_of(key, row), row) for key, record in records.items() for row in key.rows(record) if "p95_s" in row]
    for place, (label, row) in enumerate(bars):
        axes.barh(place, 1e3 * row["p95_s"], color="#bbccee", height=0.6)
        axes.barh(place, 1e3 * row["median_s"], color="#335599", height=0.6)
        axes.text(1e3 * row["p95_s"], place, f" {label}", va="center", fontsize=8)
    axes.set_yticks([])
    axes.set_xlim(0, 2.2e3 * max(row["p95_s"] for _, row in bars))
    axes.set_xlabel("ms until the verdict is back: median (dark) and 95th percentile (light)")
    return figure


def label_of(key: Measurement, row: Record) -> str:
    """What a bar shows."""
    if isinstance(key, Load):
        return f"{key.load}, {key.students} at once: {row['per_second']:.0f} a second"
    if isinstance(key, Beside):
        return f"choices on {key.backend}, {key.students} at once: {row['ratio']:.2f} of a bare route"
    return f"judging {key.exercise}, our own CPU time" if isinstance(key, Judging) else str(row["run"])


STUDY = Study("service", plan, summarise, {"service": draw})
