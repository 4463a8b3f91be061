"""The tables of docs/deploy.md about the hours before a deadline, and what sentences say about them."""

from collections.abc import Iterator

from grader.studies.bench.published.claims import Results, claim, demand, span
from grader.studies.bench.published.tables import table
from grader.studies.bench.service.deadline import BUSY, MACHINES, PATIENCE_S, PATIENT

NAMES = {"reference": "a right answer", "long": "one that computes for seconds"}

KIND = "reference"
"""The scripts of the rehearsal."""

SIMILAR = 1.5
"""Largest factor between times of a rehearsal and simulated ones with which the page says that they agree."""


@table(
    *("a script, its CPU time", "cores", "scripts a minute", "median wait", "95 of 100", "99 of 100", "longest"),
    *("last verdict after", "CPU time of all", "memory"),
)
def deadline(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields the waits of the rush for each script and machine, with what the machine grades and holds."""
    memory = results["deadline"]["memory_mb"]
    for name, script in results["deadline"]["scripts"].items():
        for cores, machine in script["machines"].items():
            waits = (describe_s(machine[key]) for key in ("median_s", "p95_s", "p99_s", "longest_s", "last_verdict_s"))
            rate = f"{float(format(60 * int(cores) / script['service_s'], '.2g')):,.0f}"
            held = f"{(memory['server'] + int(cores) * memory['process']) / 1024:.1f} GB"
            yield f"{NAMES[name]}, {script['cpu_s']:.2g} s", cores, rate, *waits, f"{script['cpu_hours']:.2g} h", held


@table(
    "CPU time of a script", *(f"{100 * PATIENT:g} of 100 wait at most {patience_s:g} s" for patience_s in PATIENCE_S)
)
def deadline_processes(results: Results) -> Iterator[tuple[str, ...]]:
    """Yields how many grading processes, each with a core, keep the waits of the rush short."""
    for cpu_s, needed in results["deadline"]["processes"].items():
        yield f"{cpu_s} s", *(str(needed[f"{patience_s:g}"]) for patience_s in PATIENCE_S)


def describe_s(time_s: float) -> str:
    """`0 s`, `0.3 s`, `12 s`, `85 min`: with as many digits as an operator needs."""
    if time_s >= 120:
        return f"{time_s / 60:.0f} min"
    return f"{time_s:.0f} s" if time_s >= 10 or time_s < 0.05 else f"{time_s:.1f} s"


@claim
def deadline_class(results: Results) -> str:
    """What the class does."""
    rush = results["deadline"]
    return (
        f"{rush['learners']:,} learners hand in {rush['each']} scripts each, {100 * rush['rush_share']:g} of 100 in "
        f"the last {rush['rush_s'] / 60:g} minutes and the others over the day before"
    )


@claim
def deadline_machines(results: Results) -> str:
    """How long a process works on a script, and whether that is what bursts on two cores take."""
    bursts = {
        row["script"]: row for row in results["service"]["loads"] if row["kind"] == "workers" and row["workers"] == 2
    }
    ratios = [row["cores"] / row["machine_cores"] for row in bursts.values() if row["script"] in NAMES]
    # Runs differ by so much: waits are in proportion.
    demand(min(ratios) + 0.03 >= BUSY, f"{min(ratios)} of the cores are busy, not {BUSY}")
    return (
        f"A process is taken to work on a script for its CPU time over {BUSY:g}, as two processes on two cores keep "
        f"{span(ratios)} of them busy; {' and '.join(map(str, MACHINES[1:]))} cores were not at hand"
    )


@claim
def deadline_memory(results: Results) -> str:
    """What a server and a grading process hold."""
    memory = results["deadline"]["memory_mb"]
    server, process = memory["server"], memory["process"]
    return f"The server holds {server:.0f} MB, and each grading process with its jail {process:.0f} MB"


@claim
def deadline_rehearsal(results: Results) -> str:
    """How long learners waited in the rehearsal, beside the simulation of the same arrivals."""
    run, parts = results["deadline"]["rehearsals"][KIND], list[str]()
    for who in ("others", "greedy"):
        for key in ("median_s", "p95_s"):
            real, simulated = (run[f"{who}_{kind}_{key}"] for kind in ("measured", "simulated"))
            demand(1 / SIMILAR < real / simulated < SIMILAR, f"{who}, {key}: {real} s, simulated {simulated} s")
            parts.append(f"{real:.2g} s ({simulated:.2g} simulated)")
    rates = (
        run["processes"] / seconds for seconds in (run["service_s"], results["deadline"]["scripts"][KIND]["service_s"])
    )
    graded, expected = (f"{rate:.2g}" for rate in rates)
    return (
        f"{run['scripts']} scripts, {run['load']:g} times as many as are graded meanwhile, were graded at {graded} a "
        f"second, where the CPU time of one lets expect {expected}. Half of the verdicts came within {parts[0]} and 95 "
        f"of 100 within {parts[1]}; those of a learner who handed in a third of the scripts within {parts[2]} and "
        f"{parts[3]}"
    )
