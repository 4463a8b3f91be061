"""`/readyz` says what does not work and what cures it; `/metrics` is Prometheus' text, for those who may see it."""

import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families
from structlog.testing import capture_logs

from grader.errors import JailFault
from grader.gate import monitoring
from grader.gate.monitoring import Monitor
from grader.gate.readiness import Readiness, run_check
from grader.grading.pipeline import Retries
from grader.numerics.version import INSTALLED, warn_of_newer
from grader.queue import jobs
from grader.queue.worker import Worker
from grader.service import opening
from grader.service.worker import build_graders
from grader.settings import Settings
from grader.store.engine.database import Database
from grader.store.engine.ids import make_id
from support.databases import BACKENDS, database_url
from support.sites import Site

API = "/api/v1"
TOKEN = "a token of sixteen characters or more"


def samples(response: httpx.Response) -> dict[str, float]:
    """Every sample by its name and labels, as `name{a=1,b=2}`."""
    assert response.status_code == 200, response.text
    assert response.headers["content-type"].startswith("text/plain; version=")
    values = {}
    for family in text_string_to_metric_families(response.text):
        for sample in family.samples:
            labels = ",".join(f"{name}={value}" for name, value in sorted(sample.labels.items()))
            values[f"{sample.name}{{{labels}}}" if labels else sample.name] = sample.value
    return values


@pytest.mark.usefixtures("readiness")
def test_readiness_lists_its_checks_and_says_what_cures_them(nobody: httpx.Client) -> None:
    response = nobody.get("/readyz")
    problem = response.json()
    assert (response.status_code, response.headers["content-type"]) == (503, "application/problem+json")
    assert int(response.headers["retry-after"]) > 0
    assert response.headers["cache-control"] == "no-store"
    assert problem["checks"]["database"] == {"ok": True, "backend": "sqlite"}
    assert problem["checks"]["content"]["quizzes"].keys() == {"small"}
    assert not problem["checks"]["worker"]["ok"]
    assert problem["checks"]["mujoco"] == {"ok": True, "version": INSTALLED}
    assert "GRADER_WORKERS" in problem["detail"]
    assert nobody.get("/healthz").json() == {"status": "ok"}


def test_a_mujoco_newer_than_tested_is_a_warning_and_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    assert [warn_of_newer(version) for version in (3_014_000, 4_000_000)] == [None, None]
    warning = warn_of_newer(4_001_012)
    assert warning is not None
    assert "4.1.12 is newer than 4.0.0" in warning
    monkeypatch.setattr(monitoring, "warn_of_newer", lambda: warning)
    assert run_check("mujoco", monitoring.check_mujoco) == {"ok": True, "version": INSTALLED, "warning": warning}


def test_a_service_that_starts_on_a_newer_mujoco_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "warn_of_newer", lambda: "MuJoCo 9.9.9 is newer")
    with capture_logs() as logs:
        opening.open_database(Settings(data=tmp_path)).close()
    assert {"event": "untested MuJoCo", "why": "MuJoCo 9.9.9 is newer", "log_level": "warning"} in logs


@pytest.fixture
def readiness(site: Site) -> Iterator[Readiness]:
    """The site's checks; their results expire before and after a test."""
    readiness: Readiness = site.app.state.services.readiness
    readiness.expire()
    yield readiness
    readiness.expire()


def test_checks_run_once_however_many_probe(site: Site, readiness: Readiness, monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[int] = []

    def look() -> dict[str, Any]:
        looks.append(1)
        return {}

    monkeypatch.setattr(readiness, "checks", {"counted": look})
    probes = [threading.Thread(target=site.anonymous().get, args=("/readyz",)) for _ in range(10)]
    for probe in probes:
        probe.start()
    for probe in probes:
        probe.join()
    assert len(looks) == 1


@pytest.mark.usefixtures("readiness")
def test_an_unexpected_failure_is_told_to_the_log_alone(
    site: Site, nobody: httpx.Client, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def gone() -> None:
        raise OSError("a path of the server")

    monkeypatch.setattr(site.app.state.services.database, "check", gone)
    response = nobody.get("/readyz")
    assert response.json()["checks"]["database"] == {"ok": False, "why": "The check failed; the log says why."}
    assert "path" not in response.text
    assert "a path of the server" in capsys.readouterr().err


@pytest.mark.usefixtures("readiness")
def test_a_disk_without_room_is_not_ready(nobody: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grader.gate.monitoring.FREE_BYTES_MIN", 1 << 60)
    told = nobody.get("/readyz").json()["checks"]["database"]
    assert not told["ok"]
    assert told["why"].startswith("The disk of the database is full")


@contextmanager
def worker_on(url: str) -> Iterator[tuple[Database, Worker]]:
    """A worker without tasks on a database that has its tables."""
    database = Database(url)
    database.migrate()
    worker = Worker(database, {}, 1, Retries(1))
    try:
        yield database, worker
    finally:
        worker.stop()
        database.close()


@pytest.fixture(params=BACKENDS)
def idle(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Database, Worker]]:
    with database_url(request.param, tmp_path) as url, worker_on(url) as joined:
        yield joined


def test_a_worker_counts_while_it_lives(idle: tuple[Database, Worker]) -> None:
    database, worker = idle

    def alive() -> int:
        with database.read() as session:
            return worker.alive_on(session)

    assert alive() == 0
    worker.start()
    assert alive() == 1
    worker.stop()
    assert alive() == 0


@pytest.mark.postgres
def test_workers_of_other_processes_count_and_those_of_other_schemas_do_not(tmp_path: Path) -> None:
    with (
        database_url("postgresql", tmp_path) as ours, database_url("postgresql", tmp_path) as theirs,
        worker_on(ours) as (database, first), worker_on(ours) as (_, second), worker_on(theirs) as (_, other),
    ):  # fmt: skip
        for worker in (second, other):
            worker.start()
        with database.read() as session:
            assert first.alive_on(session) == 1


def test_the_queue_is_counted_by_topic_with_its_oldest_job(idle: tuple[Database, Worker]) -> None:
    database, _ = idle
    early = f"{int(make_id()[:12], 16) - 90_000:012x}" + "0" * 20
    with database.write() as session:
        for topic, subject in ((jobs.GRADE, early), (jobs.GRADE, make_id()), (jobs.REGRADE, "not an id of ours")):
            jobs.put(session, topic, subject, share="ann")
    with database.write() as session:
        assert jobs.claim(session, 1, (jobs.REGRADE,))
    with database.read() as session:
        state = jobs.read_state(session)
    assert (state["grade"].waiting, state["grade"].running) == (2, 0)
    assert (state["regrade"].waiting, state["regrade"].running) == (0, 1)
    assert state["grade"].oldest_s == pytest.approx(90, abs=60)
    assert state["regrade"].oldest_s is None


def test_metrics_tell_of_requests_verdicts_and_the_queue(site: Site, ann: httpx.Client, nobody: httpx.Client) -> None:
    before = samples(nobody.get("/metrics"))
    ann.post(f"{API}/submissions", json={"quiz": "small", "question": "q1", "answer": 1})
    ann.get(f"{API}/submissions/nothing")
    after = samples(nobody.get("/metrics"))

    def grown(name: str) -> float:
        return after[name] - before.get(name, 0.0)

    assert grown("grader_verdicts_total{status=correct}") == 1
    assert grown(f"grader_http_requests_total{{method=POST,route={API}/submissions,status=201}}") == 1
    assert grown(f"grader_http_requests_total{{method=GET,route={API}/submissions/{{submission_id}},status=404}}") == 1
    assert grown(f"grader_http_request_duration_seconds_count{{route={API}/submissions}}") == 1
    assert after["grader_database_up"] == 1
    assert after["grader_queue_jobs{state=waiting,topic=grade}"] == 0
    assert after["grader_queue_oldest_seconds{topic=grade}"] == 0
    assert after["grader_workers"] == 0
    assert after["grader_grading_processes"] == 0
    assert after["process_open_fds"] > 0


def test_names_and_labels_of_strangers_never_reach_the_metrics(nobody: httpx.Client) -> None:
    nobody.get("/secret-path-of-mine")
    nobody.request("BREW", "/secret-path-of-mine")
    nobody.get(f"{API}/submissions/secret-path-of-mine")
    shown = nobody.get("/metrics").text
    assert "secret" not in shown
    assert "BREW" not in shown


def test_metrics_follow_the_conventions_of_prometheus(nobody: httpx.Client) -> None:
    for family in text_string_to_metric_families(nobody.get("/metrics").text):
        if family.name.startswith("grader_"):
            assert family.documentation.endswith("."), family.name
            assert re.fullmatch(r"[a-z_]+", family.name)
            assert not re.search(r"_(ms|minutes|kb|mb|count|total)$", family.name), "base units, and no reserved ending"


@pytest.mark.slow
def test_a_public_server_shows_metrics_to_the_bearer_of_the_token_alone(open_site_with: Callable[..., Any]) -> None:
    public = {"public_origin": "https://grader.example"}
    closed = open_site_with(**public).anonymous().get("/metrics")
    assert closed.status_code == 403
    assert "GRADER_METRICS_TOKEN" in closed.json()["detail"]
    opened = open_site_with(**public, metrics_token=TOKEN).anonymous()
    assert opened.get("/metrics").status_code == 401
    assert opened.get("/metrics", headers={"Authorization": f"Bearer {TOKEN}x"}).status_code == 401
    samples(opened.get("/metrics", headers={"Authorization": f"Bearer {TOKEN}"}))


def test_no_grading_process_is_not_ready(tmp_path: Path, content: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = Settings(content=content, data=tmp_path, workers=1)
    graders = build_graders(settings)

    def broken() -> None:
        raise JailFault("bwrap is gone")

    monkeypatch.setattr(graders, "revive", broken)
    with worker_on(f"sqlite:///{tmp_path}/grader.db") as (database, worker):
        monitor = Monitor(database, graders, worker)
        with pytest.raises(Exception, match="No grading process can be started"):
            monitor.check_jail()
