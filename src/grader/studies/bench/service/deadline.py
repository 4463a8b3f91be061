"""What learners wait for before a deadline: the cost of scripts measured on the real server, the queue simulated.

`Capacity` measures the CPU time of a script in the whole service, `Footprint` what processes hold in memory.
`summarise` simulates a class with these numbers on machines of several sizes, with a grading process for each core.
`Rehearsal` is the check: scripts that come at random on the real server, and the same arrivals simulated.
"""

import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

import numpy as np
from matplotlib.figure import Figure

from grader.studies.bench.service.queueing import Arrival, count_processes, simulate_queue
from grader.studies.bench.service.submitting import SCRIPT, Client, serve_clients
from grader.studies.bench.service.workers import NUMBERS, SCRIPTS, list_family, measure_queue
from grader.studies.bench.study import Measurement, Record, Records, Study, select_kind

KINDS = ("reference", "long")
"""Scripts of `workers.SCRIPTS`: a right answer, and one that computes for seconds."""

CORES = os.cpu_count() or 1
MACHINES = (2, 4, 16)
"""Numbers of cores for which the class is simulated."""

LEARNERS, EACH = 5000, 4
"""The class, and the scripts that a learner hands in."""

RUSH_S, RUSH_SHARE, DAY_S = 600.0, 0.25, 86_400.0
"""The last minutes [s], the share of the scripts that come in them, and the time over which the others are spread [s]:
both evenly."""

BUSY = 0.92
"""The share of the cores that the service keeps busy with as many grading processes. Source: the table of workers in
docs/measured.md, 1.84 of two cores with the shortest scripts. A process works on a script for its CPU time over this:
unlike the time of a burst, that does not depend on what else runs here."""

PATIENCE_S, PATIENT = (10.0, 60.0, 300.0), 0.95
"""Times [s] within which this share of the scripts of the rush is to be taken up."""

COSTS_S = (0.2, 0.5, 1.0, 2.0, 5.0)
"""CPU times of a script [s] for which the processes are counted."""

PROCESSES_MAX = 400

LOAD = 1.5
"""Scripts of a rehearsal come so many times as fast as they are graded."""

REHEARSING, GREEDY_SHARE = 12, 1 / 3
"""Learners of a rehearsal, and the share of the scripts that one of them hands in."""

WARM_UP = {True: 2, False: 8}
"""Scripts that each process grades before it is measured, in a quick study and else."""

SHARES = {"median_s": 50, "p95_s": 95, "p99_s": 99, "longest_s": 100}


@dataclass(frozen=True)
class Capacity(Measurement):
    """A queue of scripts on this machine, with a grading process for each core."""

    script: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Returns the CPU time of a script in the whole service [s], the least of the bursts: what else runs on the
        machine only adds to it."""
        source, queued = SCRIPTS[self.script]()
        each, rounds = (2 * CORES, 1) if quick else (max(queued, 2 * CORES), 5)
        with serve_clients(1, GRADER_WORKERS=str(CORES)) as (client,):
            measure_queue(client, SCRIPT, WARM_UP[quick])
            return {"cpu_s": min(measure_queue(client, source, each)[1] for _ in range(rounds))}


@dataclass(frozen=True)
class Footprint(Measurement):
    """The memory of the service with so many grading processes, after each has graded."""

    processes: int

    def measure(self, quick: bool, done: Records) -> Record:
        """Returns the proportional set size of server, grading processes and jails [MB]."""
        with serve_clients(1, GRADER_WORKERS=str(self.processes)) as (client,):
            measure_queue(client, SCRIPTS[KINDS[0]]()[0], WARM_UP[quick] * self.processes)
            return {"memory_mb": read_memory_mb(client.server)}


@dataclass(frozen=True)
class Rehearsal(Measurement):
    """A rush on the real server: learners hand in more than is graded, and one of them a third of it."""

    script: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Returns times from handing in to verdict [s], of the greedy learner and of the others. They are measured, and
        simulated with the time that a script took in a process on average, `service_s`."""
        source, _ = SCRIPTS[self.script]()
        scripts, burst = (12, 4) if quick else (90, 24)
        with serve_clients(REHEARSING, GRADER_WORKERS=str(CORES)) as clients:
            measure_queue(clients[0], SCRIPT, WARM_UP[quick])
            rate, _ = measure_queue(clients[0], source, burst)
            arrivals = list(draw_rehearsal(scripts, LOAD * rate))
            measured = rehearse(clients, source, arrivals)
        ended_s = max(arrival.time_s + time_s for arrival, time_s in zip(arrivals, measured, strict=True))
        service_s = CORES * (ended_s - arrivals[0].time_s) / scripts  # under such a load no process rests
        waits = simulate_queue([replace(arrival, service_s=service_s) for arrival in arrivals], CORES)
        simulated = [wait + service_s for wait in waits]
        greedy = np.array([arrival.learner == 0 for arrival in arrivals])
        record: Record = {"scripts": len(arrivals), "processes": CORES, "load": LOAD, "service_s": service_s}
        for who, among in (("greedy", greedy), ("others", ~greedy)):
            for name, times in (("measured", measured), ("simulated", simulated)):
                record |= {
                    f"{who}_{name}_{key}": value for key, value in compute_shares(np.array(times)[among]).items()
                }
        return record


def draw_rehearsal(scripts: int, per_second: float) -> Iterator[Arrival]:
    """Yields scripts that come at random, so many a second, each by the greedy learner or one of the others."""
    random, now_s = Random(0), 0.0
    for _ in range(scripts):
        now_s += random.expovariate(per_second)
        greedy = random.random() < GREEDY_SHARE
        yield Arrival(now_s, 0 if greedy else random.randrange(1, REHEARSING))


def rehearse(clients: Sequence[Client], source: str, arrivals: Sequence[Arrival]) -> list[float]:
    """Hand in at these times, on connections of their own; returns the times until the verdicts are heard [s]."""
    began_s = time.monotonic() + 1.0

    def hand_in(arrival: Arrival) -> float:
        client, due_s = clients[arrival.learner].open_another(), began_s + arrival.time_s
        time.sleep(max(0.0, due_s - time.monotonic()))
        client.graded("servo-threshold", f"{source}# {next(NUMBERS)}\n")
        client.connection.close()
        return time.monotonic() - due_s

    with ThreadPoolExecutor(len(arrivals)) as pool:
        return list(pool.map(hand_in, arrivals))


def read_memory_mb(pid: int) -> float:
    """Returns the proportional set size of a process and its descendants [MB]: shared pages count in parts."""
    kb = 0
    for member in list_family(pid):
        lines = Path(f"/proc/{member}/smaps_rollup").read_text(encoding="utf-8").splitlines()
        kb += next((int(line.split()[1]) for line in lines if line.startswith("Pss:")), 0)
    return kb / 1024


def draw_class(service_s: float, learners: int = LEARNERS, each: int = EACH) -> list[Arrival]:
    """Returns the scripts of a class in order of time, each by a learner drawn at random; the deadline is at time 0."""
    random = np.random.default_rng(0)
    scripts = learners * each
    rush = round(RUSH_SHARE * scripts)
    times = np.append(random.uniform(-DAY_S, -RUSH_S, scripts - rush), random.uniform(-RUSH_S, 0.0, rush))
    pairs = zip(np.sort(times).tolist(), random.integers(0, learners, scripts).tolist(), strict=True)
    return [Arrival(time_s, learner, service_s) for time_s, learner in pairs]


def compute_shares(times_s: Sequence[float]) -> Record:
    """Returns the median, the 95th and the 99th percentile, and the longest [s]."""
    return {name: float(np.percentile(times_s, share)) for name, share in SHARES.items()}


def plan(_quick: bool) -> Sequence[Measurement]:
    """Returns capacities, footprints and rehearsals."""
    return [*map(Capacity, KINDS), *map(Footprint, (1, 2)), *map(Rehearsal, KINDS[:1])]


def summarise(records: Records) -> Record:
    """Simulates the class for each script and machine; how many processes it takes; and the records."""
    one, two = (records[Footprint(processes)]["memory_mb"] for processes in (1, 2))
    return {
        "learners": LEARNERS,
        "each": EACH,
        "rush_s": RUSH_S,
        "rush_share": RUSH_SHARE,
        "day_s": DAY_S,
        "memory_mb": {"server": 2 * one - two, "process": two - one},
        "scripts": {key.script: summarise_script(record) for key, record in select_kind(records, Capacity).items()},
        "processes": {f"{cpu_s:g}": summarise_processes(cpu_s) for cpu_s in COSTS_S},
        "rehearsals": {key.script: record for key, record in select_kind(records, Rehearsal).items()},
    }


def summarise_script(record: Record) -> Record:
    """Returns what was measured of a script, and the waits of the rush on each machine."""
    service_s = record["cpu_s"] / BUSY
    arrivals = draw_class(service_s)
    rush = [place for place, arrival in enumerate(arrivals) if arrival.time_s > -RUSH_S]
    machines = {}
    for cores in MACHINES:
        waits = simulate_queue(arrivals, cores)
        last_s = max(0.0, *(arrivals[place].time_s + waits[place] + service_s for place in rush))
        minutes = [int((arrivals[place].time_s + RUSH_S) // 60) for place in rush]
        by_minute = [
            [waits[place] for place, at in zip(rush, minutes, strict=True) if at == minute]
            for minute in sorted(set(minutes))
        ]
        machines[str(cores)] = compute_shares([waits[place] for place in rush]) | {
            "last_verdict_s": last_s,
            "by_minute_s": [float(np.median(of_minute)) for of_minute in by_minute],
        }
    return record | {
        "service_s": service_s,
        "cpu_hours": len(arrivals) * record["cpu_s"] / 3600,
        "machines": machines,
    }


def summarise_processes(cpu_s: float) -> Record:
    """Returns how many processes the rush takes for each patience, where a script takes so much CPU time [s]."""
    rush = [arrival for arrival in draw_class(cpu_s / BUSY) if arrival.time_s > -RUSH_S]
    return {f"{value:g}": count_processes(rush, value, PATIENT, range(1, PROCESSES_MAX)) for value in PATIENCE_S}


def draw(_records: Records, summary: Record) -> Figure:
    """Draws how long scripts wait on each machine, by the minute in which they are handed in."""
    figure = Figure(figsize=(9, 3.4))
    panels = figure.subplots(1, len(summary["scripts"]))
    for axes, (name, script) in zip(panels, summary["scripts"].items(), strict=True):
        for (cores, machine), mark in zip(script["machines"].items(), "o^s", strict=True):
            minutes = [place + 0.5 - len(machine["by_minute_s"]) for place in range(len(machine["by_minute_s"]))]
            axes.plot(minutes, [wait / 60 for wait in machine["by_minute_s"]], f"{mark}-", ms=4, label=f"{cores} cores")
        axes.set_title(f"{name}: {script['cpu_s']:.2g} s of CPU time a script")
        axes.set_xlabel("handed in [minutes from the deadline]")
        axes.set_ylabel("median wait [min]")
        axes.set_ylim(0, None if script["machines"][str(MACHINES[0])]["median_s"] > RUSH_S / 60 else 1)
        axes.legend()
    return figure


STUDY = Study("deadline", plan, summarise, {"deadline": draw})
