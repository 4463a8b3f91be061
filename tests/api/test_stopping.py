"""A learner stops a script that runs, wherever it runs."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from grader.courses.answering.stopping import STOPPED_LATE, STOPPED_RUNNING, TOO_LATE
from grader.domain.verdict import Status, Verdict
from grader.grading.pipeline import Retries
from grader.queue import jobs
from grader.queue.worker import Worker
from grader.service.accounts import in_database
from grader.service.worker import GradingTask
from grader.settings import Settings
from grader.store import regrades
from grader.store.events import case_now
from grader.store.tables import Submission
from support.databases import BACKENDS, database_url
from support.processes import descendants_running
from support.queue_kills import (
    client_of,
    handed_in,
    process_of,
    settings_on,
    verdicts_of,
    wait_for,
    wait_until_ready,
)
from support.sites import ROOT, Site, open_site

pytestmark = [pytest.mark.slow, pytest.mark.jail]

SUBMISSIONS = "/api/v1/submissions"
ENDLESS = "while True:\n    pass\n"
HANGS = """
calls = 0
def largest_stable_timestep(model, integrator):
    global calls
    calls += 1
    while calls > 3:
        pass
"""
"""Ends its three visible trials, and no hidden one."""
GOOD = (ROOT / "reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py").read_text()


@pytest.fixture(scope="module", params=BACKENDS)
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A server with two grading processes."""
    folder = tmp_path_factory.mktemp("stopping")
    with (
        database_url(request.param, folder) as url,
        open_site(Settings(data=folder, database_url=url, workers=2)) as site,
        ThreadPoolExecutor(2) as pool,
    ):
        list(pool.map(assert_graded, (site.client("ida"), site.client("jan"))))  # both processes have the content now
        yield site


def assert_graded(client: httpx.Client) -> None:
    """A right script is graded."""
    good = handed_in(client, GOOD).json()["id"]
    assert verdicts_of(client, [good])[good]["verdict"]["status"] == "correct"


def start(client: httpx.Client, source: str) -> str:
    """The address of a script that runs."""
    made = handed_in(client, source)
    assert made.status_code == 202, made.text
    address = str(made.headers["location"])
    wait_for(lambda: client.get(address).json()["status"] == "running")
    return address


def stop(client: httpx.Client, address: str) -> httpx.Response:
    """What the server answers, at the latest after a few seconds; by itself the script would end after 20 s."""
    return client.post(f"{address}:stop")


def case_of(site: Site, address: str) -> tuple[int, int] | None:
    """The case that the script is at, as its learner is told."""
    with site.app.state.services.database.read() as session:
        at = case_now(session, address.rpartition("/")[2])
        return None if at is None else (at.case, at.cases)


def assert_stopped(stopped: httpx.Response) -> None:
    assert stopped.status_code == 200, stopped.text
    body = stopped.json()
    assert (body["status"], body["verdict"]["status"]) == ("graded", "invalid_answer")
    assert body["verdict"]["diagnosis"] == STOPPED_RUNNING


def test_an_endless_loop_is_stopped_for_free_and_the_script_beside_it_is_graded(site: Site) -> None:
    ann, bob = site.client("ann"), site.client("bob")
    processes = site.app.state.services.monitor.graders.pids()
    beside = handed_in(bob, GOOD).json()["id"]
    address = start(ann, ENDLESS)
    stopped = stop(ann, address)
    assert_stopped(stopped)
    one = stopped.json()
    assert (one["attempt"], one["verdict"]["max_points"]) == (1, 3.0)
    assert stop(ann, address).status_code == 409
    assert handed_in(ann, GOOD).json()["attempt"] == 1
    assert verdicts_of(bob, [beside])[beside]["verdict"]["status"] == "correct"
    assert site.app.state.services.monitor.graders.pids() == processes
    assert in_database(site.settings, lambda session: regrades.find_reviewed(session, [one["id"]])) == {one["id"]}


def test_the_same_request_is_a_new_one_after_a_free_stop(site: Site) -> None:
    cid, key = site.client("cid"), {"Idempotency-Key": "again"}
    body = {"quiz": "1.3-exercises", "question": "servo-threshold", "answer": {"source": ENDLESS}}
    addresses = []
    for _ in range(2):
        made = cid.post(SUBMISSIONS, json=body, headers=key)
        addresses.append(made.headers["location"])
        wait_for(lambda: cid.get(addresses[-1]).json()["status"] == "running")
        assert_stopped(stop(cid, addresses[-1]))
    assert addresses[0] != addresses[1]


def test_a_script_that_knows_a_hidden_case_is_stopped_at_the_cost_of_an_attempt(site: Site) -> None:
    dot = site.client("dot")
    address = start(dot, HANGS)
    wait_for(lambda: case_of(site, address) == (2, 7))
    stopped = stop(dot, address).json()
    assert (stopped["verdict"]["status"], stopped["verdict"]["points"]) == ("timed_out", 0.0)
    assert stopped["verdict"]["diagnosis"] == STOPPED_LATE
    assert handed_in(dot, "x = 1\n").json()["attempt"] == 2


def test_only_its_learner_stops_a_script(site: Site) -> None:
    eve, address = site.client("eve"), start(site.client("fay"), ENDLESS)
    assert eve.post(f"{address}:stop").status_code == 404
    assert_stopped(stop(site.client("fay"), address))


def test_of_two_who_stop_at_once_one_is_refused(site: Site) -> None:
    address = start(site.client("gus"), ENDLESS)
    answers: list[httpx.Response] = []
    clients = [site.client("gus") for _ in range(2)]
    threads = [threading.Thread(target=lambda one=one: answers.append(stop(one, address))) for one in clients]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    refused, stopped = sorted(answers, key=lambda answer: -answer.status_code)
    assert (refused.status_code, refused.json()["detail"]) == (409, TOO_LATE)
    assert_stopped(stopped)


def test_a_run_that_ends_by_itself_meanwhile_keeps_its_verdict(tmp_path: Path) -> None:
    with open_site(Settings(data=tmp_path, workers=0)) as idle, ThreadPoolExecutor(1) as pool:
        ann, database = idle.client("ann"), idle.app.state.services.database
        made = handed_in(ann, GOOD)
        answers: list[Future[httpx.Response]] = []

        def count_asked() -> int:
            with database.read() as session:
                return len(jobs.list_asked_to_stop(session, worker.owner.id))

        def grade(_submission: Submission) -> Verdict:
            answers.append(pool.submit(stop, ann, made.headers["location"]))
            wait_for(lambda: count_asked() == 1)
            return Verdict(status=Status.CORRECT, points=3.0, max_points=3.0)

        worker = Worker(database, {jobs.GRADE: GradingTask(grade, grade)}, 1, Retries())
        assert worker.do_one()
        assert answers[0].result().json()["verdict"]["status"] == "correct"
        assert stop(ann, made.headers["location"]).status_code == 409


@pytest.mark.postgres
@pytest.mark.process
def test_a_script_is_stopped_in_a_worker_of_its_own(tmp_path: Path) -> None:
    with database_url("postgresql", tmp_path) as url:
        serving, working = settings_on(url, tmp_path, workers=0), settings_on(url, tmp_path, workers=1)
        with process_of("serve", serving) as server, process_of("worker", working) as worker:
            wait_until_ready(server, serving)
            with client_of(serving, "ann") as ann:
                assert_graded(ann)  # the worker has the content from now on
                address = start(ann, ENDLESS)
                grading = descendants_running(worker.pid, "grading.process_main")
                assert_stopped(stop(ann, address))
                assert descendants_running(worker.pid, "grading.process_main") == grading
                assert_graded(ann)
