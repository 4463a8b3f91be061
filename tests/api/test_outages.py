"""The database is away or the disk is full: 503 with Retry-After, one line in the log, and all is well afterwards."""

import json
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import psycopg
import pytest
from sqlalchemy import event, make_url, text

from grader.courses.people.identity import COOKIE
from grader.courses.people.sign_in import create_sign_in_code, redeem_sign_in_code
from grader.gate.single_call import NAME
from grader.settings import Settings
from grader.store.engine.database import Database
from support.databases import database_url
from support.outages import Cable, cable_to
from support.sites import Site, open_site

API = "/api/v1"
ANSWER = {"quiz": "small", "question": "q1", "answer": 1}

PAGES = ("/", "/instructor", "/instructor/review", "/instructor/gradebook", "/instructor/statistics")

Cabled = tuple[Cable, Site]


@pytest.fixture
def cabled(content: Path, tmp_path: Path) -> Iterator[Cabled]:
    with (
        database_url("postgresql", tmp_path) as url,
        cable_to(url) as (cable, cabled_url),
        open_site(Settings(content=content, database_url=cabled_url, workers=0)) as site,
    ):
        yield cable, site


def refused(response: httpx.Response) -> dict[str, Any]:
    """The problem of a 503, whose parts are those that every one has."""
    assert (response.status_code, response.headers["content-type"]) == (503, "application/problem+json")
    assert int(response.headers["retry-after"]) > 0
    problem: dict[str, Any] = response.json()
    assert problem["request_id"] == response.headers["x-request-id"]
    return problem


def lines_of(told: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in told.splitlines()]


@pytest.mark.postgres
def test_a_lost_postgresql_is_503_until_it_is_back(cabled: Cabled, capsys: pytest.CaptureFixture[str]) -> None:
    cable, site = cabled
    ann = site.client("ann")
    assert ann.post(f"{API}/submissions", json=ANSWER).status_code == 201
    cable.cut()
    capsys.readouterr()
    for response in (ann.post(f"{API}/submissions", json=ANSWER), ann.get(f"{API}/quizzes/small"), ann.get("/healthz")):
        if response.request.url.path != "/healthz":
            assert "postgres" not in str(refused(response))
    log = capsys.readouterr().err
    assert [line["why"] for line in lines_of(log) if line.get("status") == 503] == ["database: OperationalError"] * 2
    assert len(log.splitlines()) == 3, log
    cable.mend()
    assert ann.post(f"{API}/submissions", json=ANSWER).status_code == 201
    assert len(ann.get(f"{API}/submissions").json()["items"]) == 2


@pytest.mark.postgres
def test_no_route_fails_otherwise_while_postgresql_is_away(cabled: Cabled) -> None:
    """Every address without parts of its own, of the API and the pages: 503 with Retry-After, or it needs no rows."""
    cable, site = cabled
    teacher = site.client("tina", "instructor")
    with site.app.state.services.database.write() as session:
        code = create_sign_in_code(session, "tina", "instructor")
        teacher.cookies.set(COOKIE, redeem_sign_in_code(session, code).secret)
    documented = {path for path, has in site.app.openapi()["paths"].items() if "get" in has and "{" not in path}
    assert {f"{API}/submissions", f"{API}/gradebook.csv", f"{API}/reviews"} <= documented
    cable.cut()
    answers = {path: teacher.get(path) for path in sorted({*documented, *PAGES})}
    away = {path for path, response in answers.items() if response.status_code == 503}
    assert {*PAGES, *(path for path in documented if path.startswith(API))} - away == set()
    assert [path for path in away if int(answers[path].headers.get("retry-after", 0)) < 1] == []
    assert [path for path, response in answers.items() if response.status_code >= 500 and path not in away] == []


@pytest.mark.postgres
def test_readiness_and_metrics_follow_a_lost_postgresql(cabled: Cabled) -> None:
    cable, site = cabled
    nobody = site.anonymous()
    assert refused(nobody.get("/readyz"))["checks"]["database"]["ok"]
    assert "grader_database_up 1.0" in nobody.get("/metrics").text
    cable.cut()
    time.sleep(1.1)  # findings are kept for a second
    assert refused(nobody.get("/readyz"))["checks"]["database"] == {
        "ok": False, "why": "The database is away, full or read-only.",
    }  # fmt: skip
    shown = nobody.get("/metrics").text
    assert "grader_database_up 0.0" in shown
    assert "grader_queue_jobs" not in shown
    assert nobody.get("/healthz").status_code == 200
    cable.mend()
    time.sleep(1.1)
    assert nobody.get("/readyz").json()["checks"]["database"]["ok"]


@pytest.mark.postgres
@pytest.mark.slow
def test_a_postgresql_that_keeps_its_connections_and_is_silent_is_named_in_time(
    cabled: Cabled, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("readiness", "monitoring"):
        monkeypatch.setattr(f"grader.gate.{module}.DEADLINE_S", 0.5)
    cable, site = cabled
    nobody = site.anonymous()
    assert nobody.get("/readyz").json()["checks"]["database"]["ok"]
    cable.freeze()
    threads = []
    for _ in range(4):
        time.sleep(1.1)  # findings are kept for a second
        began = time.monotonic()
        problem = refused(nobody.get("/readyz"))
        assert problem["checks"]["database"] == {"ok": False, "why": "There is no answer after 0.5 s."}
        assert problem["checks"]["content"]["ok"]
        assert "database: There is no answer" in problem["detail"]
        assert "grader_database_up 0.0" in nobody.get("/metrics").text
        assert time.monotonic() - began < 4
        threads.append([thread.name for thread in threading.enumerate()].count(NAME))
    assert max(threads) <= 3, threads  # two checks and the metrics
    cable.thaw()
    time.sleep(1.1)
    assert nobody.get("/readyz").json()["checks"]["database"]["ok"]
    assert "grader_database_up 1.0" in nobody.get("/metrics").text


@pytest.mark.postgres
def test_sessions_that_the_server_ends_are_opened_again(content: Path, tmp_path: Path) -> None:
    with database_url("postgresql", tmp_path) as plain:
        name = f"outage-{secrets.token_hex(6)}"
        url = make_url(plain).update_query_dict({"application_name": name}).render_as_string(hide_password=False)
        with open_site(Settings(content=content, database_url=url, workers=0)) as site:
            ann = site.client("ann")
            assert ann.post(f"{API}/submissions", json=ANSWER).status_code == 201
            end = "SELECT pg_terminate_backend(pid, 10000) FROM pg_stat_activity WHERE application_name = %s"
            with psycopg.connect(plain, autocommit=True) as other:
                assert other.execute(end, (name,)).fetchall()
            assert ann.post(f"{API}/submissions", json=ANSWER).status_code == 201


@contextmanager
def full(site: Site) -> Iterator[None]:
    """Lets the SQLite file grow no more, which SQLite reports as it does a full disk."""
    engine = site.app.state.services.database.engine

    def limit(connection: Any, _record: Any) -> None:
        connection.execute("PRAGMA max_page_count = 1")  # means: as many as the file has

    event.listen(engine, "connect", limit)
    engine.dispose()  # the limit is each connection's own
    yield
    event.remove(engine, "connect", limit)
    engine.dispose()


def test_a_full_sqlite_file_is_503_until_there_is_room(
    open_site_with: Callable[..., Site], capsys: pytest.CaptureFixture[str]
) -> None:
    site = open_site_with()
    ann = site.client("ann")
    long = {"quiz": "small", "question": "q4", "answer": "because " * 1000}
    with full(site):
        while ann.post(f"{API}/submissions", json=long).status_code == 201:
            pass  # into the pages that are free within the file
        capsys.readouterr()
        refused(ann.post(f"{API}/submissions", json=long))
        (line,) = lines_of(capsys.readouterr().err)
        assert (line["status"], line["why"]) == (503, "database: SQLITE_FULL")
        assert ann.get(f"{API}/submissions").status_code == 200
    assert ann.post(f"{API}/submissions", json=long).status_code == 201


def test_metrics_tell_of_a_full_disk_as_readiness_does(
    open_site_with: Callable[..., Site], monkeypatch: pytest.MonkeyPatch
) -> None:
    nobody = open_site_with().anonymous()
    assert "grader_database_up 1.0" in nobody.get("/metrics").text
    monkeypatch.setattr(Database, "free_bytes", property(lambda _: 1))
    shown = nobody.get("/metrics").text
    assert "grader_database_up 0.0" in shown and "grader_queue_jobs" in shown


def test_a_fault_of_a_statement_is_no_outage(open_site_with: Callable[..., Site]) -> None:
    site = open_site_with()
    ann = site.client("ann")
    with site.app.state.services.database.write() as session:
        session.execute(text("ALTER TABLE submissions RENAME COLUMN quiz TO other"))
    assert ann.get(f"{API}/submissions").status_code == 500


@pytest.mark.postgres
def test_tables_of_an_earlier_revision_are_503_and_told_by_readyz(content: Path, tmp_path: Path) -> None:
    with (
        database_url("postgresql", tmp_path) as url,
        open_site(Settings(content=content, database_url=url, workers=0)) as site,
    ):
        ann, database = site.client("ann"), site.app.state.services.database
        newest = database.revision
        assert ann.get("/readyz").json()["checks"]["database"]["ok"]
        database.migrate("0006", beside_others=True)
        assert "not those that this version needs" in refused(ann.get(f"{API}/submissions"))["detail"]
        time.sleep(1.1)  # findings are kept for a second
        why = refused(ann.get("/readyz"))["checks"]["database"]["why"]
        assert why.startswith(f"The tables are of revision 0006, this version needs {newest}")
        with database.write() as session:  # as beside the first server of a later version
            session.execute(text("UPDATE alembic_version SET version_num = '9999'"))
        time.sleep(1.1)
        assert ann.get("/readyz").json()["checks"]["database"]["ok"]
