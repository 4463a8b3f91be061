"""The queue before a deadline: closed forms of queueing theory, the order of the real queue, and the real server."""

import random
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from itertools import accumulate
from math import factorial
from pathlib import Path

import numpy as np
import pytest

from grader.queue import jobs
from grader.studies.bench.published.deadline_tables import describe_s
from grader.studies.bench.service import deadline
from grader.studies.bench.service.deadline import (
    BUSY,
    DAY_S,
    EACH,
    LEARNERS,
    RUSH_S,
    RUSH_SHARE,
    Capacity,
    Footprint,
    Rehearsal,
    draw_class,
    summarise,
    summarise_processes,
    summarise_script,
)
from grader.studies.bench.service.queueing import Arrival, TurnQueue, count_processes, simulate_queue
from grader.studies.bench.service.submitting import Client, serve_clients
from grader.studies.bench.study import Measurement
from support.databases import BACKENDS, open_database

MANY = 150_000
"""Scripts of a simulated day: means then lie within 3 % of the closed forms."""


def draw_arrivals(per_second: float, service_s: np.ndarray, learners: int = 500) -> list[Arrival]:
    """Scripts that come at random times, so many a second on average, each by a random learner."""
    rng = np.random.default_rng(3)
    gaps = rng.exponential(size=len(service_s))
    times = accumulate((gaps / gaps.mean() / per_second).tolist())
    return [
        Arrival(*one) for one in zip(times, rng.integers(0, learners, len(service_s)), service_s.tolist(), strict=True)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("load", [0.3, 0.7, 0.9])
def test_one_process_with_equal_scripts_waits_as_pollaczek_and_khinchine_say(load: float) -> None:
    """Source: M/D/1, mean wait load s / (2 (1 - load)). The order in which scripts are taken leaves the mean alone."""
    waits = simulate_queue(draw_arrivals(load / 0.2, np.full(MANY, 0.2)), 1)
    assert np.mean(waits) == pytest.approx(load * 0.2 / (2 * (1 - load)), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("processes", "load"), [(1, 0.6), (2, 0.8), (4, 0.8), (16, 0.9)])
def test_many_processes_with_random_scripts_wait_as_erlang_says(processes: int, load: float) -> None:
    """Source: M/M/c, probability of a wait by Erlang's formula C, mean wait C s / (c (1 - load))."""
    service_s = np.random.default_rng(4).exponential(size=MANY)
    service_s *= 0.2 / service_s.mean()
    waits = simulate_queue(draw_arrivals(processes * load / 0.2, service_s), processes)
    offered = processes * load
    full = offered**processes / factorial(processes) / (1 - load)
    erlang_c = full / (sum(offered**n / factorial(n) for n in range(processes)) + full)
    assert np.mean(np.array(waits) > 0) == pytest.approx(erlang_c, rel=0.02)
    assert np.mean(waits) == pytest.approx(erlang_c * 0.2 / (processes * (1 - load)), rel=0.06)


def test_without_chance_waits_are_those_of_a_fluid() -> None:
    """Scripts of 1 s, one every 0.4 s, for two processes: each waits 0.1 s longer than the one before, on average."""
    arrivals = [Arrival(0.4 * number, number, 1.0) for number in range(400)]
    waits = simulate_queue(arrivals, 2)
    assert waits[-1] == pytest.approx(0.1 * 399, abs=1.0)
    assert simulate_queue(arrivals, 3) == [0.0] * 400


def test_no_process_rests_while_a_script_waits() -> None:
    rng = random.Random(5)
    arrivals = [Arrival(time, rng.randrange(4), rng.random()) for time in sorted(rng.random() * 9 for _ in range(80))]
    waits = simulate_queue(arrivals, 3)
    starts = [arrival.time_s + wait for arrival, wait in zip(arrivals, waits, strict=True)]
    ends = [start + arrival.service_s for start, arrival in zip(starts, arrivals, strict=True)]
    for arrival, start in zip(arrivals, starts, strict=True):
        for moment in np.linspace(arrival.time_s, start, 5)[1:-1] if start > arrival.time_s else ():
            assert sum(begin <= moment < end for begin, end in zip(starts, ends, strict=True)) == 3


def test_each_learner_in_turn() -> None:
    """A hundred scripts of one learner make another wait for two, and ten others for one of each."""
    greedy = [Arrival(0.0, 1, 1.0)] * 100
    assert simulate_queue([*greedy, Arrival(0.5, 2, 1.0)], 1)[-1] in (0.5, 1.5)
    others = [Arrival(0.5, learner, 1.0) for learner in range(2, 12)]
    waits = simulate_queue([*greedy, *others], 1)[100:]
    assert max(waits) <= 0.5 + 11
    assert sorted(np.diff(sorted(waits)).round(6)) == pytest.approx([1.0] * 9)


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("seed", range(3))
def test_scripts_are_taken_in_the_order_of_the_real_queue(backend: str, seed: int, tmp_path: Path) -> None:
    rng, queue = random.Random(seed), TurnQueue()
    with open_database(backend, tmp_path) as database:
        taken: list[tuple[str, str]] = []
        for script in range(150):
            if rng.random() < 0.55:
                name = f"learner {rng.randrange(rng.randint(1, 6))}"
                with database.write() as session:
                    jobs.put(session, jobs.GRADE, str(script), share=name)
                queue.put(jobs.hash_share(name), script)
            elif queue:
                with database.write() as session:
                    claimed = jobs.claim(session, owner=1)
                    assert claimed is not None
                    jobs.finish(session, claimed)
                taken.append((claimed.subject, str(queue.claim())))
    assert len(taken) > 40
    assert [real for real, _ in taken] == [simulated for _, simulated in taken]


def test_the_processes_that_are_needed_are_the_fewest() -> None:
    arrivals = [Arrival(0.1 * number, number, 1.0) for number in range(300)]
    needed = count_processes(arrivals, 2.0, 0.95, range(1, 30))
    shares = [np.mean(np.array(simulate_queue(arrivals, number)) <= 2.0) for number in (needed - 1, needed)]
    assert shares[0] < 0.95 <= shares[1]
    with pytest.raises(ValueError, match="more processes"):
        count_processes(arrivals, 2.0, 0.95, range(1, 3))


def test_a_class_hands_in_a_quarter_in_the_last_minutes() -> None:
    arrivals = draw_class(0.1)
    times = np.array([arrival.time_s for arrival in arrivals])
    assert len(times) == LEARNERS * EACH
    assert np.all(np.diff(times) >= 0)
    assert (times[0] >= -DAY_S, times[-1] <= 0) == (True, True)
    assert np.mean(times > -RUSH_S) == RUSH_SHARE
    assert len({arrival.learner for arrival in arrivals}) > 0.95 * LEARNERS


@pytest.mark.slow
def test_more_cores_wait_less_and_what_is_too_slow_is_late() -> None:
    """Source: a rush of 5,000 scripts of 2 s takes two cores 5,000 s, of which 600 s are before the deadline."""
    summary = summarise_script({"cpu_s": 2.0 * BUSY})
    machines = summary["machines"]
    assert machines["2"]["last_verdict_s"] == pytest.approx(5000 - 600, rel=0.02)
    assert machines["2"]["median_s"] > machines["4"]["median_s"] > machines["16"]["median_s"]
    assert machines["16"]["last_verdict_s"] == pytest.approx(5000 / 8 - 600, abs=15)
    assert summary["cpu_hours"] == pytest.approx(20_000 * 2 * BUSY / 3600)


@pytest.mark.slow
def test_more_processes_are_needed_for_less_patience_and_longer_scripts() -> None:
    """Source: a rush of 5,000 scripts of 2 s in 600 s keeps 16.7 processes busy; with 300 s to spare two thirds do."""
    short, long = (list(summarise_processes(cpu_s * BUSY).values()) for cpu_s in (1.0, 2.0))
    for needed in (short, long):
        assert needed == sorted(needed, reverse=True)
    assert all(one < other for one, other in zip(short, long, strict=True))
    assert 17 <= long[0] <= 22
    assert 11 <= long[-1] <= 17


@pytest.mark.parametrize(
    ("time_s", "shown"), [(0.0, "0 s"), (9.94, "9.9 s"), (42.4, "42 s"), (119.4, "119 s"), (4400.0, "73 min")]
)
def test_times_have_the_digits_that_an_operator_needs(time_s: float, shown: str) -> None:
    assert describe_s(time_s) == shown


@pytest.mark.slow
def test_the_study_measures_the_real_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(deadline, "REHEARSING", 2)
    monkeypatch.setattr(deadline, "CORES", 1)
    # What is simulated is held against laws above.
    monkeypatch.setattr(deadline, "MACHINES", (16,))
    monkeypatch.setattr(deadline, "COSTS_S", (1.0,))
    keys: list[Measurement] = [Footprint(1), Footprint(2), Capacity("reference"), Rehearsal("reference")]
    with ExitStack() as servers:

        @cache
        def start(workers: str) -> list[Client]:
            return servers.enter_context(serve_clients(2 if workers == "1" else 1, GRADER_WORKERS=workers))

        @contextmanager
        def share(students: int, **environment: str) -> Iterator[list[Client]]:
            yield start(environment["GRADER_WORKERS"])[:students]

        monkeypatch.setattr(deadline, "serve_clients", share)
        records = {key: key.measure(True, {}) for key in keys}
    summary, record = summarise(records), records[keys[-1]]
    assert summary["scripts"]["reference"]["cpu_s"] > 0
    assert 50 < summary["memory_mb"]["process"] < 500
    assert 50 < summary["memory_mb"]["server"] < 1000
    for who in ("greedy", "others"):
        measured, simulated = (record[f"{who}_{kind}_median_s"] for kind in ("measured", "simulated"))
        assert 0.2 < measured / simulated < 5
