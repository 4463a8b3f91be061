"""A word in everything that a learner can send: the export has it, and once they are erased it is nowhere."""

import json
import os
import re
import shutil
import subprocess
import time
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import MetaData
from sqlalchemy.engine import make_url
from typer.testing import CliRunner

from grader.commands.main import cli
from grader.gate.admission import PREFIX as API
from grader.settings import Settings
from grader.store import platforms
from grader.store.courses import AuditEntry
from grader.store.engine.database import Database
from grader.store.outbox import ALL, DEAD, WEBHOOK, Delivery, Destination
from grader.store.platforms import LtiUser, PlatformRow
from grader.store.tables import Base, Credential, Submission, now
from grader.store.upkeep import holdings
from support.databases import BACKENDS, database_url
from support.sites import ROOT, Site, open_site

pytestmark = [pytest.mark.slow, pytest.mark.jail]

WORD = re.compile(r"telltale[a-z]+", re.IGNORECASE)
"""Each field has a word of its own, so that a failure names the field."""

OURS = {"Sec-Fetch-Site": "same-origin"}
SCRIPTS = {
    "import": "import sys\nprint('telltaleprinted')\nprint('telltalestderr', file=sys.stderr)\n"
    "raise ValueError('/home/telltaleraised')\n",
    "call": "def is_stable(model, integrator, timestep):\n    return True\n"
    "def largest_stable_timestep(model, integrator):\n    raise KeyError('telltalekeyerror')\n",
    "class": "class TelltaleError(Exception):\n    pass\n"
    "def largest_stable_timestep(model, integrator):\n    raise TelltaleError('telltaleclass')\n",
    "value": "def largest_stable_timestep(model, integrator):\n    return 'telltalereturned'\n",
    "attribute": "import mujoco\ndef largest_stable_timestep(model, integrator):\n"
    "    return mujoco.MjData(model).telltaleattribute\n",
    "right": (ROOT / "reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py").read_text()
    + "\n# telltalecomment\nprint('telltaleright')\n",
}
WITHOUT_A_PLACE = {
    "telltaleagent", "telltalereferer", "telltalerequest", "telltaleevent", "telltalequery", "telltalepath",
    "telltalecontrol", "telltalepress", "telltalefield", "telltalebroken", "telltalevalidated",
}  # fmt: skip
"""What is sent, and never in the database."""


@dataclass
class Learner:
    """A learner's browser: it says a word in every header that a browser may choose."""

    browser: httpx.Client
    member: str = ""
    waiting: list[str] = field(default_factory=list)

    def answer(self, quiz: str, question: str, answer: Any, **headers: str) -> None:
        body = {"quiz": quiz, "question": question, "answer": answer}
        made = self.browser.post(f"{API}/submissions", json=body, headers=headers)
        assert made.status_code in (201, 202), made.text
        self.waiting.append(made.headers["location"])

    def wait(self) -> None:
        """Until every script is graded."""
        deadline = time.monotonic() + 300
        for location in self.waiting:
            while self.browser.get(location).json()["status"] in ("queued", "running"):
                assert time.monotonic() < deadline
                time.sleep(0.1)


@pytest.fixture(params=BACKENDS)
def site(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    """A server with the lesson and a jail; the command line works on the same database."""
    with database_url(request.param, tmp_path) as url:
        monkeypatch.setenv("GRADER_DATABASE_URL", url)
        unlimited: Any = {"rate_per_s": 1e6, "rate_burst": 10**6, "queue_per_user": 100}
        with open_site(Settings(database_url=url, workers=1, **unlimited)) as site:
            yield site


def browser_of(site: Site) -> httpx.Client:
    chosen = {"User-Agent": "telltaleagent", "Referer": "http://telltalereferer/", "X-Request-ID": "telltalerequest"}
    return site.anonymous({**OURS, **chosen})


def a_named_learner(site: Site, tina: httpx.Client) -> Learner:
    """Somebody on the roster, known to a platform and another service, who has borne another name."""
    roster = "name,email,external_id\nAda Telltalename,telltalemail@school.example,telltaleexternal\n"
    known = {"namespace": "telltalesystem"}
    done = tina.post(f"{API}/roster:import", params=known, content=roster, headers={"Content-Type": "text/csv"})
    assert done.json()["created"] == 1, done.text
    [member] = [item["id"] for item in tina.get(f"{API}/members").json()["items"] if item["name"] != "tina"]
    [link] = tina.post(f"{API}/invitations", json={"member": member}).json()["items"]
    browser = browser_of(site)
    assert browser.post("/signin", data={"code": link["url"].partition("code=")[2]}).status_code == 303
    lms = site.client("lms", "service")
    learner = {**known, "id": "telltaleexternal", "name": "Ada Telltalerenamed"}
    body = {"learner": learner, "quiz": "1.3-check", "question": "q1", "answer": 1}
    assert lms.post(f"{API}/lms/submissions", json=body, headers={"Idempotency-Key": "telltalelms"}).is_success
    tina.get(f"{API}/submissions", params={"user": "Ada Telltalerenamed"})
    with database_of(site).write() as session:
        row = PlatformRow(name="p", issuer="i", client_id="c", login_url="", token_url="", keys_url="",
                          token_audience="", origins="[]")  # fmt: skip
        destination = Destination(course="default", kind=WEBHOOK, quiz=ALL, question=ALL, created_by="tina")
        session.add_all((row, destination))
        session.flush()
        context = platforms.get_context(session, row.id, "d", "c", "Robotics")
        session.flush()
        platforms.enrol(session, context.id, "telltalesubject", member)
        session.add(
            Delivery(
                destination=destination.id, course="default", learner=member, quiz="1.3-check", question="q1",
                state=DEAD, version=1, noted_at=now(), has_job=False, attempts=9, forced=False,
                error="telltaledelivery", sent='{"comment": "telltalesent"}',
            )
        )  # fmt: skip
    return Learner(browser, member)


def an_unnamed_learner(site: Site, tina: httpx.Client) -> Learner:
    """Somebody who came by the course link under a name of their own."""
    url = tina.put(f"{API}/course/link").json()["join_url"]
    browser = browser_of(site)
    data = {"code": url.partition("code=")[2], "name": "Eve Telltalejoined"}
    assert browser.post("/join", data=data).status_code == 303
    [member] = [item["id"] for item in tina.get(f"{API}/members").json()["items"] if item["name"].startswith("Eve")]
    return Learner(browser, member)


def leave_traces(learner: Learner) -> None:
    """Sends a word in every field."""
    browser = learner.browser
    learner.answer("1.3-check", "q1", 2, **{"Idempotency-Key": "telltalekey"})
    learner.answer("1.3-check", "q2", "telltalenumber = 6 ms")
    learner.answer("1.3-check", "q2", "0.005")
    learner.answer("1.3-check", "q4", "telltaletext: I was ill in May.")
    learner.answer("1.3-exercises", "servo-explain", "telltaleexplanation")
    for source in SCRIPTS.values():
        learner.answer("1.3-exercises", "servo-threshold", {"source": source})
    browser.post("/quizzes/1.3-check/q4", data={"answer": "telltaleform", "telltalefield": "1"})
    for body in ({"answer": "telltaleunreadable"}, {"answer": 1, "telltalefield": 1}):
        browser.post(f"{API}/submissions", json={"quiz": "1.3-check", "question": "q2", **body})
    browser.post(f"{API}/submissions", content='{"telltalebroken', headers={"Content-Type": "application/json"})
    validated = {"quiz": "1.3-check", "question": "q4", "answer": "telltalevalidated"}
    assert browser.post(f"{API}/answers:validate", json=validated).status_code == 200
    lab = {"quiz": "1.3-check", "question": "q3", "controls": {"telltalecontrol": 1}, "events": [[0, "telltalepress"]]}
    browser.post(f"{API}/labs:run", json=lab)
    browser.get("/?quiz=telltalequery")
    browser.get("/lessons/telltalepath")
    browser.get(f"{learner.waiting[0]}/events", headers={"Last-Event-ID": "telltaleevent"})
    learner.wait()


def be_dealt_with(learner: Learner, tina: httpx.Client) -> None:
    """What instructors write about a learner: a review, an extension, a new link, another role and back."""
    shown = {one: learner.browser.get(one).json() for one in learner.waiting}
    [location, *_] = [one for one, body in shown.items() if body["question"] == "q4"]
    review = {"points": 0.5, "comment": "Dear telltalereviewed, well done."}
    reviewed = tina.put(f"{location}/review", json=review, headers={"If-Match": "*"})
    assert reviewed.status_code == 200, (reviewed.text, shown[location])
    extension = {"learner": learner.member, "attempts": 1}
    assert tina.put(f"{API}/quizzes/1.3-check/extensions", json=extension).status_code == 200
    assert tina.post(f"{API}/invitations", json={"member": learner.member}).status_code == 201
    for role in ("instructor", "student"):
        assert tina.patch(f"{API}/members/{learner.member}", json={"role": role}).status_code == 200


def database_of(site: Site) -> Database:
    database: Database = site.app.state.services.database
    return database


def words_in(text: str | bytes) -> set[str]:
    words = WORD.findall(text if isinstance(text, str) else text.decode("latin-1"))
    return {word.lower() for word in words}


def words_by_table(site: Site) -> dict[str, set[str]]:
    """The words in the rows of each table."""
    tables = MetaData()
    with database_of(site).engine.connect() as connection:
        tables.reflect(connection)
        texts = {  # as tuples: SQLAlchemy shortens the texts of its own rows
            name: repr([tuple(row) for row in connection.execute(table.select())])
            for name, table in tables.tables.items()
        }
    return {name: words for name, text in texts.items() if (words := words_in(text))}


def run(*arguments: str) -> str:
    done = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output.strip()


def backup_of(site: Site, folder: Path) -> bytes:
    """A backup made now, as docs/deploy.md makes it, with everything that it holds readable."""
    url, file = make_url(site.settings.database), folder / "backup"
    if url.get_backend_name() == "sqlite":
        run("backup", str(file))
        return file.read_bytes()
    assert shutil.which("pg_dump"), "pg_dump is missing: install postgresql-client"
    schema = str(url.query["options"]).partition("search_path=")[2]
    where = {"PGHOST": url.host or "", "PGPORT": str(url.port or 5432), "PGUSER": url.username or "",
             "PGPASSWORD": str(url.password or "")}  # fmt: skip
    command = ["pg_dump", f"--schema={schema}", f"--file={file}", str(url.database)]
    subprocess.run(command, check=True, env={**os.environ, **where}, timeout=120)
    return file.read_bytes()


def test_everything_is_exported_and_nothing_outlives_the_learner(
    site: Site, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    tina = site.client("tina", "instructor")
    learners = [a_named_learner(site, tina), an_unnamed_learner(site, tina)]
    for learner in learners:
        leave_traces(learner)
        be_dealt_with(learner, tina)
    before = words_by_table(site)
    stored = set().union(*before.values())
    assert {"members", "submissions", "verdicts", "results", "idempotency_keys", "audit", "outbox"} <= before.keys()
    assert stored & WITHOUT_A_PLACE == set()
    assert stored >= {"telltaleraised", "telltaleprinted", "telltaleform", "telltalekey", "telltalereviewed"}

    exported = set[str]()
    for learner in learners:
        file = tmp_path / f"{learner.member}.zip"
        assert run("export", "--id", learner.member, "--out", str(file)) == str(file)
        with zipfile.ZipFile(file) as packed:
            exported |= words_in(b"\n".join(map(packed.read, packed.namelist())))
    assert stored - exported == set()

    for learner in learners:
        run("erase", "--id", learner.member)
    assert words_by_table(site) == {}
    assert words_in(backup_of(site, tmp_path)) == set()
    for path in tmp_path.glob("grader.db*"):
        assert words_in(path.read_bytes()) == set(), path
    assert tina.get(f"{API}/quizzes/1.3-check/statistics").status_code == 200
    captured = capfd.readouterr()
    assert words_in(captured.out + captured.err) == {"telltalerequest"}  # the id that a client gives its requests


def test_an_export_reads_well(site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ada = site.client("ada")
    body = {"quiz": "1.3-exercises", "question": "servo-threshold", "answer": {"source": SCRIPTS["import"]}}
    learner = Learner(ada, waiting=[ada.post(f"{API}/submissions", json=body).headers["location"]])
    learner.wait()
    file = Path(run("export", "--user", "ada"))
    assert re.fullmatch(r"learner-[0-9a-f]{8}\.zip", file.name)
    assert file.stat().st_mode & 0o077 == 0
    with zipfile.ZipFile(file) as packed:
        held = json.loads(packed.read("learner.json"))
        [submission] = held["submissions"]
        assert packed.read(submission["script"]).decode() == SCRIPTS["import"]
    assert held["member"]["name"] == "ada"
    assert submission["verdicts"][0]["body"]["status"] == "crashed"
    assert [event["name"] for event in submission["events"]][-1] == "graded"
    [token] = held["credentials"]
    assert token["kind"] == "grt"
    assert not {"secret_hash", "seed"} & {*token, *submission, *submission["verdicts"][0]}
    assert ada.headers["authorization"].split("_")[2] not in json.dumps(held)
    folder = tmp_path / "folder"
    run("export", "--user", "ada", "--out", str(folder))
    assert (folder / submission["script"]).read_text() == SCRIPTS["import"]
    assert "member exported" in (folder / "learner.json").read_text()  # the first one
    for wrong in (("--user", "ada", "--out", str(folder)), ("--user", "nobody"), (), ("--user", "a", "--id", "b")):
        assert CliRunner().invoke(cli, ["export", *wrong]).exception is not None


def test_every_table_that_names_a_learner_is_exported() -> None:
    """A new table with such a column belongs to `holdings`, and to `erasure`."""
    named = {"learner", "member", "submission_id", "subject"}
    tables = {
        mapper.class_ for mapper in Base.registry.mappers if named & {column.key for column in mapper.column_attrs}
    }
    handled = {*holdings.OF_SUBMISSION.values(), *holdings.OF_LEARNER.values()}
    handled |= {Credential, LtiUser, AuditEntry, Submission}
    assert tables == handled
