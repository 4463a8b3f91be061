"""Records what a version leaves behind: its databases as SQL, and what its server answered.

Run in a checkout of that version, with this file of a later one:
PYTHONPATH=src:tests python .../record.py OUT. A term in small: choices, scripts, reviews, a webhook, idempotency keys.
"""

import json
import re
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx

from grader.settings import Settings
from grader.store.engine import revisions
from support.databases import BACKENDS, database_url
from support.sites import ROOT, Site, open_site
from support.tokens import issue_token

API = "/api/v1"
COURSE = "robots"
WAIT_S = 120.0
PROGRAMS = ROOT / "reference_solutions/1.3-exercises/servo-threshold"
ANSWERS: list[tuple[str, str, str, Any]] = [
    ("Ada", "1.3-check", "q1", 0),
    ("Ada", "1.3-check", "q1", 1),
    ("Bob", "1.3-check", "q1", 2),
    ("Ada", "1.3-exercises", "servo-threshold", "correct__spectral_radius.py"),
    ("Bob", "1.3-exercises", "servo-threshold", "incorrect__returns_the_bound.py"),
    ("Ada", "1.3-exercises", "servo-explain", "The damper is missing from the bound."),
    ("Bob", "1.3-exercises", "servo-explain", "It is the same."),
]


def wait_for_verdict(client: httpx.Client, place: str) -> dict[str, Any]:
    """The submission once nothing is to be graded any more."""
    end = time.monotonic() + WAIT_S
    while True:
        seen: dict[str, Any] = client.get(place).raise_for_status().json()
        if seen["status"] in ("graded", "needs_review"):
            return seen
        assert time.monotonic() < end, seen
        time.sleep(0.1)


def play(site: Site) -> dict[str, Any]:
    """A term in small; returns the tokens, the requests and what was answered."""
    people = {"Ada": "student", "Bob": "student", "Grace": "instructor", "feed": "service"}
    tokens = {name: issue_token(site.settings, name, role, COURSE) for name, role in people.items()}
    clients = {name: site.anonymous({"Authorization": f"Bearer {token}"}) for name, token in tokens.items()}
    requests: list[dict[str, Any]] = []
    for number, (user, quiz, question, answer) in enumerate(ANSWERS):
        given = {"source": (PROGRAMS / answer).read_text()} if str(answer).endswith(".py") else answer
        body = {"quiz": quiz, "question": question, "answer": given}
        sent = clients[user].post(f"{API}/submissions", json=body, headers={"Idempotency-Key": f"key-{number}"})
        wait_for_verdict(clients[user], sent.raise_for_status().headers["Location"])
        requests.append({"user": user, "key": f"key-{number}", "body": body, "place": sent.headers["Location"]})
    grace = clients["Grace"]
    for place, points in ((requests[-2]["place"], 1), (requests[-1]["place"], 0)):
        match = {"If-Match": grace.get(place).headers["ETag"]}
        review = {"points": points, "comment": "Read, and thought about."}
        grace.put(f"{place}/review", json=review, headers=match).raise_for_status()
    clients["feed"].post(f"{API}/webhooks", json={"url": "https://lms.example.org/hook"}).raise_for_status()
    return {"tokens": tokens, "requests": requests, "answers": answers(clients, [one["place"] for one in requests])}


def answers(clients: dict[str, httpx.Client], places: list[str]) -> dict[str, Any]:
    """What must be the same after an upgrade: submissions, the feed, the gradebook."""
    grace = clients["Grace"]
    books = {quiz: grace.get(f"{API}/gradebook.csv?quiz={quiz}").raise_for_status().text for quiz in QUIZZES}
    feed = clients["feed"].get(f"{API}/results?limit=100").raise_for_status().json()["items"]
    return {
        "submissions": {place: grace.get(place).raise_for_status().json() for place in places},
        "gradebooks": books,
        "results": feed,
    }


QUIZZES = sorted({quiz for _, quiz, _, _ in ANSWERS})


def dump(backend: str, url: str, file: Path) -> str:
    """The whole database as SQL that any later version of SQLite or PostgreSQL reads; its schema is named `SCHEMA`."""
    if backend == "sqlite":
        with sqlite3.connect(file) as connection:
            return "\n".join(connection.iterdump()) + "\n"
    schema = re.search(r"search_path%3D(\w+)|search_path=(\w+)", url)
    assert schema is not None
    name = schema[1] or schema[2]
    command = ["pg_dump", "--no-owner", "--no-privileges", "--column-inserts", f"--schema={name}", url]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    kept = [line for line in text.splitlines() if line and not line.startswith(("--", "\\", "CREATE SCHEMA", "SET "))]
    return "\n".join(kept).replace(name, "SCHEMA") + "\n"


def main(out: Path) -> None:
    """Writes `REVISION-BACKEND.sql` and `REVISION-BACKEND.json`."""
    out.mkdir(exist_ok=True)
    for backend in BACKENDS:
        with TemporaryDirectory() as name, database_url(backend, Path(name)) as url:
            settings = Settings(data=Path(name), workers=1, database_url=None if backend == "sqlite" else url)
            with open_site(settings) as site:
                recorded = play(site)
            stem = f"{revisions.find_newest()}-{backend}"
            (out / f"{stem}.sql").write_text(dump(backend, url, Path(name, "grader.db")))
            (out / f"{stem}.json").write_text(json.dumps(recorded, indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
