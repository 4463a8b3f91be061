"""A server of this version goes on with the database that the version before has written.

`upgrades/` holds such databases, recorded from servers of that version by `record.py`, and what these answered.
"""

import json
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import psycopg
import pytest
from sqlalchemy.engine import make_url

from grader.settings import Settings
from grader.store.engine import revisions
from grader.store.engine.database import Database
from store.upgrades.record import API, WAIT_S, answers, wait_for_verdict
from support.databases import BACKENDS, CONNECT_S, database_url, own_database
from support.sites import Site, open_site

pytestmark = [pytest.mark.slow, pytest.mark.jail]

FOLDER = Path(__file__).parent / "upgrades"
BEFORE = "0015"


@dataclass
class Upgraded:
    """A server on the database of an earlier version, and what that version's server had answered."""

    site: Site
    recorded: dict[str, Any]

    def client(self, user: str) -> httpx.Client:
        """A client with the token that the earlier version gave."""
        return self.site.anonymous({"Authorization": f"Bearer {self.recorded['tokens'][user]}"})


def restore(backend: str, url: str, text: str) -> None:
    """Executes a recorded database into an empty one."""
    if backend == "sqlite":
        path = Path(make_url(url).database or "")
        path.touch(0o600)
        with closing(sqlite3.connect(path)) as connection:
            connection.executescript(text)
        return
    schema = make_url(url).query["options"]
    assert isinstance(schema, str)
    with psycopg.connect(own_database(), autocommit=True, connect_timeout=CONNECT_S) as connection:
        connection.execute(text.replace("SCHEMA", schema.partition("search_path=")[2]).encode())


@pytest.fixture(scope="module", params=BACKENDS)
def upgraded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Upgraded]:
    """One server for all tests of a database, started as any other: it moves the tables itself."""
    folder, backend = tmp_path_factory.mktemp("data"), request.param
    with database_url(backend, folder, empty=True) as url:
        restore(backend, url, (FOLDER / f"{BEFORE}-{backend}.sql").read_text())
        with closing(Database(url)) as database, database.engine.connect() as connection:
            assert revisions.find_current(connection) == BEFORE
        settings = Settings(data=folder, workers=1, database_url=None if backend == "sqlite" else url)
        with open_site(settings) as site:
            yield Upgraded(site, json.loads((FOLDER / f"{BEFORE}-{backend}.json").read_text()))


def assert_has(now: Any, before: Any, where: str = "") -> None:
    """What was answered before is answered now; objects may have more."""
    if isinstance(before, dict):
        for key, value in before.items():
            assert key in now, f"{where}.{key}"
            assert_has(now[key], value, f"{where}.{key}")
    elif isinstance(before, list):
        assert len(now) == len(before), where
        for position, (one, other) in enumerate(zip(now, before, strict=True)):
            assert_has(one, other, f"{where}[{position}]")
    else:
        assert now == before, where


def test_the_tables_are_the_newest_and_the_answers_those_of_before(upgraded: Upgraded) -> None:
    with upgraded.site.app.state.services.database.engine.connect() as connection:
        assert revisions.find_current(connection) == revisions.find_newest()
    clients = {name: upgraded.client(name) for name in ("Grace", "feed")}
    before = upgraded.recorded["answers"]
    now = answers(clients, list(before["submissions"]))
    assert len(before["submissions"]) == len(upgraded.recorded["requests"])
    assert now["gradebooks"] == before["gradebooks"]
    assert_has(now, before)


def test_a_request_of_before_is_replayed_and_not_counted_again(upgraded: Upgraded) -> None:
    for request in upgraded.recorded["requests"]:
        client = upgraded.client(request["user"])
        sent = client.post(f"{API}/submissions", json=request["body"], headers={"Idempotency-Key": request["key"]})
        assert (sent.status_code in (201, 202), sent.headers["Location"]) == (True, request["place"]), sent.text


def test_a_learner_of_before_answers_on(upgraded: Upgraded) -> None:
    bob, script = upgraded.client("Bob"), upgraded.recorded["requests"][3]["body"]
    sent = bob.post(f"{API}/submissions", json=script).raise_for_status()
    seen = wait_for_verdict(bob, sent.headers["Location"])
    assert (seen["attempt"], seen["verdict"]["status"]) == (2, "correct")


def test_scripts_of_before_are_graded_again_to_the_same_verdict(upgraded: Upgraded) -> None:
    grace = upgraded.client("Grace")
    wanted = {"quiz": "1.3-exercises", "question": "servo-threshold", "scope": "all", "dry_run": True}
    made = grace.post(f"{API}/regrades", json=wanted).raise_for_status()
    place = made.headers["Location"]
    end = time.monotonic() + WAIT_S
    while (seen := grace.get(place).raise_for_status().json())["status"] != "done":
        assert time.monotonic() < end, seen
        time.sleep(0.1)
    assert seen["progress"]["done"] >= 2
    assert grace.get(f"{place}?changed=true").raise_for_status().json()["items"] == []
