"""An erased learner is nowhere in the database, and statistics, gradebook and feed go on."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import MetaData, text
from sqlalchemy.exc import DBAPIError
from typer.testing import CliRunner

from grader.commands.main import cli
from grader.errors import Conflict, NotFound, Unprocessable
from grader.gate.admission import PREFIX as API
from grader.settings import Settings
from support.databases import BACKENDS, database_url
from support.sites import Site, open_site, write_content

pytestmark = pytest.mark.slow

ADA = "Ada \u201cTELLTALE\u201d Lovelace%"
STORY = "TELLTALE: I was ill in May."


@pytest.fixture(params=BACKENDS)
def term(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    """A site where Ada and Bob have answered, and the command line works on the same database."""
    with database_url(request.param, tmp_path) as url:
        content = write_content(tmp_path / "content")
        monkeypatch.setenv("GRADER_DATABASE_URL", url)
        with open_site(Settings(database_url=url, content=content, workers=0)) as site:
            yield site


def answer(client: httpx.Client, question: str, given: Any, **headers: str) -> str:
    body = {"quiz": "small", "question": question, "answer": given}
    response = client.post(f"{API}/submissions", json=body, headers=headers)
    assert response.status_code == 201, response.text
    made: str = response.json()["id"]
    return made


def leave_traces(site: Site, name: str) -> tuple[httpx.Client, list[str]]:
    """Answers of a learner, a review, an extension and an invitation: all that is kept of somebody."""
    learner, tina = site.client(name), site.client("tina", "instructor")
    ids = [
        answer(learner, "q1", 2),
        answer(learner, "q1", 1, **{"Idempotency-Key": f"key of {name.encode().hex()} TELLTALE"}),
        answer(learner, "q2", "TELLTALE = 6 ms"),
        answer(learner, "q4", f"{STORY} {name}"),
        answer(learner, "q4", f"again {name}"),
    ]
    held = tina.post(f"{API}/reviews:claim", json={"submission_id": ids[3]})
    review = {"points": 0.5, "comment": f"Dear {name}, well done."}
    headers = {"If-Match": held.headers["ETag"]}
    assert tina.put(f"{API}/submissions/{ids[3]}/review", json=review, headers=headers).status_code == 200
    extension = {"user": name, "attempts": 1}
    assert tina.put(f"{API}/quizzes/small/extensions", json=extension).status_code == 200
    assert tina.post(f"{API}/invitations", json={"names": [name]}).status_code == 201
    return learner, ids


def everything(site: Site) -> dict[str, str]:
    """The rows of every table, as text, by table."""
    tables = MetaData()
    with site.app.state.services.database.engine.connect() as connection:
        tables.reflect(connection)
        return {
            name: repr([tuple(row) for row in connection.execute(table.select())])
            for name, table in tables.tables.items()
        }


def run(*arguments: str) -> str:
    done = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output.strip()


def test_nothing_tells_who_an_erased_learner_was(term: Site, tmp_path: Path) -> None:
    ada, ids = leave_traces(term, ADA)
    _, bobs = leave_traces(term, "Bob")
    before = everything(term)
    assert {name for name, rows in before.items() if "TELLTALE" in rows} >= {
        "members", "credentials", "submissions", "verdicts", "idempotency_keys", "audit",
    }  # fmt: skip
    name = run("erase", "--user", ADA)
    after = everything(term)
    # Keys and open answers of Bob's hold the word too: look for what is Ada's alone.
    for trace in ("Lovelace", ADA.encode().hex()):
        assert [table for table, rows in after.items() if trace in rows] == []
        if "sqlite" in term.settings.database:
            files = [path.read_bytes() for path in tmp_path.glob("grader.db*")]
            assert not any(trace.encode() in content for content in files)
    tina = term.client("tina", "instructor")
    seen = {one: tina.get(f"{API}/submissions/{one}").json() for one in (*ids, *bobs)}
    assert {(seen[id_]["user"], seen[id_]["answer"]) for id_ in ids} == {(name, None)}
    assert seen[bobs[3]]["answer"] == f"{STORY} Bob"
    assert seen[bobs[3]]["verdict"]["findings"][0]["message"] == "Dear Bob, well done."
    assert [item["id"] for item in tina.get(f"{API}/reviews").json()["items"]] == [bobs[4]]
    assert ada.get(f"{API}/quizzes").status_code == 401
    assert {item["name"] for item in tina.get(f"{API}/members").json()["items"]} == {"Bob", "tina"}


def test_statistics_gradebook_and_feed_go_on(term: Site) -> None:
    leave_traces(term, ADA)
    leave_traces(term, "Bob")
    tina, lms = term.client("tina", "instructor"), term.client("lms", "service")
    statistics, book = (tina.get(f"{API}/{path}") for path in ("quizzes/small/statistics", "gradebook.csv"))
    feed = lms.get(f"{API}/results").json()
    name = run("erase", "--user", ADA)
    assert tina.get(f"{API}/quizzes/small/statistics").json() == statistics.json()
    again = tina.get(f"{API}/gradebook.csv", headers={"If-None-Match": book.headers["ETag"]})
    points = {line.split(",", 1)[1] for line in book.text.splitlines() if "TELLTALE" in line}
    assert {line.split(",", 1)[1] for line in again.text.splitlines() if line.startswith(name)} == points != set()
    assert "TELLTALE" not in again.text
    told = lms.get(f"{API}/results", params={"cursor": feed["next_cursor"]}).json()["items"]
    last = {item["question"]: item for item in feed["items"] if item["user"] == ADA}
    assert {one["question"]: one["points"] for one in told} == {key: one["points"] for key, one in last.items()}
    assert all(one["revision"] == last[one["question"]]["revision"] + 1 for one in told)
    assert {one["user"] for one in told} == {name}
    assert tina.post(f"{API}/quizzes/small/results:recount").status_code == 200
    assert tina.get(f"{API}/quizzes/small/statistics").json() == statistics.json()


def test_the_same_name_is_somebody_new_afterwards(term: Site) -> None:
    leave_traces(term, ADA)
    run("erase", "--user", ADA)
    assert term.client(ADA).get(f"{API}/submissions").json()["items"] == []


def test_a_learner_who_chose_the_name_is_found_by_id_and_namesakes_stay(term: Site) -> None:
    leave_traces(term, "Bob")
    tina = term.client("tina", "instructor")
    link = tina.put(f"{API}/course/link").json()["join_url"]
    browser = term.anonymous({"Origin": term.origin})
    code = link.partition("code=")[2]
    assert browser.post("/join", data={"code": code, "name": "Bob"}).status_code in (200, 303)
    audit = tina.get(f"{API}/audit").json()["items"]
    [other] = [one["actor"] for one in audit if one["action"] == "joined"]
    name = run("erase", "--id", other)
    changed = [one for one, old in zip(tina.get(f"{API}/audit").json()["items"][1:], audit, strict=True) if one != old]
    assert [(one["action"], one["name"], one["subject"]) for one in changed] == [("joined", name, name)]
    assert "Bob" in {item["name"] for item in tina.get(f"{API}/members").json()["items"]}


def test_a_learner_of_another_system_is_found_by_its_id_and_old_numbers_are_exported(
    term: Site, tmp_path: Path
) -> None:
    body = {"quiz": "small", "question": "q1", "answer": 1, "learner": {"namespace": "s", "id": "x1:a"}}
    made = term.client("lms", "service").post(f"{API}/lms/submissions", json=body).json()
    assert made["user"] == "s:x1:a"
    with term.app.state.services.database.write() as session:  # as an earlier version stored it
        session.execute(text("UPDATE submissions SET answer = '[NaN,-Infinity]' WHERE id = :id"), {"id": made["id"]})
    assert term.client("tina", "instructor").get(f"{API}/submissions/{made['id']}").json()["answer"] == [None, None]
    run("export", "--user", "s:x1:a", "--out", str(tmp_path / "x1"))
    held = json.loads((tmp_path / "x1/learner.json").read_text(), parse_constant=pytest.fail)
    assert [one["answer"] for one in held["submissions"]] == [["NaN", "-Infinity"]]
    for nobody in ("s:x2", "x1:a", ":x1:a"):
        with pytest.raises(NotFound, match="or NAMESPACE:ID of another system"):
            run("erase", "--user", nobody)
    assert run("erase", "--user", "s:x1:a").startswith("erased-")


def test_an_answer_that_is_being_graded_is_waited_for(term: Site) -> None:
    _, ids = leave_traces(term, ADA)
    with term.app.state.services.database.write() as session:
        session.execute(text("UPDATE submissions SET status = 'running' WHERE id = :id"), {"id": ids[0]})
    with pytest.raises(Conflict, match=r"1 of the learner's answers"):
        run("erase", "--user", ADA)
    assert "TELLTALE" in everything(term)["members"]


def test_only_learners_of_the_course_are_erased(term: Site) -> None:
    leave_traces(term, "Bob")
    for wrong, error in (
        (("--user", "tina"), Unprocessable),
        (("--user", "nobody"), NotFound),
        (("--user", "Bob", "--course", "other"), NotFound),
        (("--user", "Bob", "--id", "1"), Unprocessable),
    ):
        with pytest.raises(error):
            run("erase", *wrong)


CHANGES = (
    "DELETE FROM audit",
    "UPDATE audit SET action = 'nothing'",
    "UPDATE audit SET at = CURRENT_TIMESTAMP, name = 'erased-1'",
    "UPDATE audit SET actor = 'x'",
    "UPDATE audit SET name = 'tina2'",
    "UPDATE audit SET subject = ''",
    "UPDATE audit SET detail = '[]'",
)


def test_the_audit_log_allows_nothing_else(term: Site) -> None:
    term.client("tina", "instructor")
    database = term.app.state.services.database
    for change in CHANGES:
        with pytest.raises(DBAPIError, match="append-only"), database.write() as session:
            session.execute(text(change))
