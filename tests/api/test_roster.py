"""Rosters over HTTP and on the command line: all rows or none, the same again changes nothing, and who may what."""

import csv
import io
import json
import re
import zipfile
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.testing import CliRunner

from grader.commands.main import cli
from grader.courses.people.rosters.enrolment import BEYOND, LAST
from grader.courses.people.tokens import create_token
from grader.errors import Conflict, FaultyRows, NotFound
from support.sites import Site

API = "/api/v1"
IMPORT = f"{API}/roster:import"
ROSTER = (
    "name,email,role,external_id\n"
    "Ada Lovelace,ada@school.example,student,s1\n"
    "Bob,,student,s2\n"
    "Grace Hopper,grace@school.example,instructor,t1\n"
    "=cmd|' /C calc'!A0,,student,-1\n"
)
COUNTS = {"dry_run": False, "created": 0, "changed": 0, "unchanged": 0, "left_out": 0}
NOTHING = {**COUNTS, "reasons": [], "roles": [], "namesakes": []}


def send(client: httpx.Client, text: str | bytes, kind: str = "text/csv", **query: Any) -> httpx.Response:
    query = {"namespace": "school", **query}
    return client.post(IMPORT, content=text, params=query, headers={"Content-Type": kind})


def members(client: httpx.Client) -> dict[str, dict[str, Any]]:
    return {item["name"]: item for item in client.get(f"{API}/members").json()["items"]}


@pytest.fixture
def tina(either_site: Site) -> httpx.Client:
    return either_site.client("tina", "instructor")


def test_a_roster_makes_members_and_the_same_again_changes_nothing(tina: httpx.Client) -> None:
    assert send(tina, ROSTER, dry_run=True).json() == {**NOTHING, "dry_run": True, "created": 4}
    assert members(tina).keys() == {"tina"}
    assert send(tina, ROSTER).json() == {**NOTHING, "created": 4}
    roster = members(tina)
    ada = roster["Ada Lovelace"]
    assert (ada["email"], ada["role"], ada["learner"]) == (
        "ada@school.example", "student", {"namespace": "school", "id": "s1"},
    )  # fmt: skip
    assert roster["Grace Hopper"]["role"] == "instructor"
    assert send(tina, ROSTER).json() == {**NOTHING, "unchanged": 4}
    assert members(tina) == roster
    changed = ROSTER.replace("Bob,,student", "Bob B.,bob@school.example,instructor")
    promoted = {"id": roster["Bob"]["id"], "name": "Bob B.", "before": "student", "after": "instructor"}
    assert send(tina, changed).json() == {**NOTHING, "changed": 1, "unchanged": 3, "roles": [promoted]}
    assert members(tina)["Bob B."]["id"] == roster["Bob"]["id"]
    actions = [(item["action"], item["detail"]) for item in tina.get(f"{API}/audit").json()["items"]]
    assert ("roster imported", {**COUNTS, "changed": 1, "unchanged": 3}) in actions
    assert "ada@school.example" not in str(actions)


def test_a_letter_that_is_written_as_two_characters_makes_nobody_a_second_time(tina: httpx.Client) -> None:
    composed, decomposed = "Zo\u00eb", "Zoe\u0308"
    send(tina, f"name,external_id\n{composed},9\n", namespace="canvas")
    assert send(tina, f"name,external_id\n{decomposed},9\n", namespace="canvas").json()["unchanged"] == 1
    for name in (composed, decomposed):
        assert tina.post(f"{API}/tokens", json={"user": f"{name}2", "role": "student"}).status_code == 201
    assert [name for name in members(tina) if name.endswith("2")] == [f"{composed}2"]


def test_a_name_of_the_roster_makes_nobody_a_second_time(tina: httpx.Client) -> None:
    """A link or a token for such a name would be somebody else's, and the marks too."""
    send(tina, "name,external_id\nHana,7\n", namespace="canvas")
    hana = members(tina)["Hana"]["id"]
    for path, body in (("tokens", {"user": "Hana", "role": "student"}), ("invitations", {"names": ["Hana"]})):
        refused = tina.post(f"{API}/{path}", json=body)
        assert refused.status_code == 409
        assert f"give an id in its place, one of {hana}" in refused.text
    assert tina.post(f"{API}/invitations", json={"names": [hana, "Ivo"]}).json()["items"][0]["name"] == "Hana"
    assert tina.post(f"{API}/invitations", json={"member": hana}).status_code == 201
    token = tina.post(f"{API}/tokens", json={"user": hana, "role": "student"}).json()["token"]
    assert tina.get(f"{API}/me", headers={"Authorization": f"Bearer {token}"}).json()["user"] == "Hana"
    assert set(members(tina)) == {"tina", "Hana", "Ivo"}
    assert tina.post(f"{API}/tokens", json={"user": "tina", "role": "instructor"}).status_code == 201


def test_a_roster_names_members_of_its_names_whom_no_row_finds(tina: httpx.Client) -> None:
    """Who was invited by name and comes with an id is a member twice."""
    tina.post(f"{API}/invitations", json={"names": ["Ada Lovelace", "Bob", "Eve"]})
    invited = members(tina)
    tina.delete(f"{API}/members/{invited['Bob']['id']}")
    twice = {"namesakes": [{"id": invited["Ada Lovelace"]["id"], "name": "Ada Lovelace"}]}
    assert send(tina, ROSTER, dry_run=True).json() == {**NOTHING, "dry_run": True, "created": 4, **twice}
    assert send(tina, ROSTER).json() == {**NOTHING, "created": 4, **twice}
    assert send(tina, ROSTER).json() == {**NOTHING, "unchanged": 4, **twice}
    by_our_id = f"name,external_id\nEve,{invited['Eve']['id']}\n"
    assert send(tina, by_our_id, namespace="grader").json() == {**NOTHING, "unchanged": 1}
    assert send(tina, "name\nEve\n").json() == {**NOTHING, "unchanged": 1}


def test_a_faulty_roster_changes_nothing_and_names_each_cell(tina: httpx.Client) -> None:
    refused = send(tina, ROSTER + "Eve,nobody,king,s9\n")
    assert refused.status_code == 422
    assert refused.headers["content-type"] == "application/problem+json"
    assert [(fault["file"], fault["key"]) for fault in refused.json()["faults"]] == [
        ("roster.csv", "line 6, role"), ("roster.csv", "line 6, email"),
    ]  # fmt: skip
    assert members(tina).keys() == {"tina"}
    for kind, text in (("application/json", b"{}"), ("application/zip", b"PK"), ("text/csv", b"name\n\xff")):
        assert send(tina, text, kind).status_code == 422


def test_what_was_exported_is_imported_again_and_changes_nothing(either_site: Site, tina: httpx.Client) -> None:
    send(tina, ROSTER)
    either_site.client("zoe")
    exported = tina.get(f"{API}/roster.csv")
    assert exported.headers["content-type"] == "text/csv; charset=utf-8"
    rows = list(csv.DictReader(io.StringIO(exported.text)))
    assert [(row["name"], row["namespace"], row["external_id"]) for row in rows if row["name"] in ("Bob", "zoe")] == [
        ("Bob", "school", "s2"), ("zoe", "", ""),
    ]  # fmt: skip
    assert not [cell for row in rows for cell in row.values() if cell.startswith(("=", "-"))]
    assert tina.get(f"{API}/roster.csv", params={"bom": True}).content.startswith("\ufeff".encode())
    before = members(tina)
    assert send(tina, exported.content).json() == {**NOTHING, "unchanged": 6}
    packed = tina.get(f"{API}/roster.zip", params={"namespace": "school"})
    assert send(tina, packed.content, "application/zip").json() == {**NOTHING, "unchanged": 6}
    assert members(tina) == before
    other = either_site.client("tina", "instructor", course=f"{either_site.course}-2")
    assert send(other, exported.content).json() == {**NOTHING, "created": 5, "unchanged": 1}
    assert other.get(f"{API}/roster.csv").text == exported.text


def test_who_came_by_themselves_is_exported_with_our_id_and_found_by_it(site: Site) -> None:
    tina = site.client("tina", "instructor")
    from grader.courses.people.members import make_unnamed

    with site.app.state.services.database.write() as session:
        member = make_unnamed(session, str(site.course), "Eve").id
    text = tina.get(f"{API}/roster.csv").text
    assert f"Eve,,student,grader,{member}" in text
    assert send(tina, text.replace("Eve", "Eve E.")).json()["changed"] == 1
    assert members(tina)["Eve E."]["id"] == member
    elsewhere = site.client("tina", "instructor", course=f"{site.course}-2")
    refused = send(elsewhere, text)
    assert (refused.status_code, refused.json()["faults"][0]["key"]) == (422, "line 2, external_id")


def test_a_learner_on_the_roster_hands_in_through_the_lms_as_the_same_member(
    either_site: Site, tina: httpx.Client
) -> None:
    send(tina, ROSTER)
    lms = either_site.client("lms", "service")
    body = {"learner": {"namespace": "school", "id": "s1"}, "quiz": "small", "question": "q1", "answer": 1}
    made = lms.post(f"{API}/lms/submissions", json=body).json()
    assert (made["user"], made["learner"]) == ("Ada Lovelace", members(tina)["Ada Lovelace"]["id"])
    rows = list(csv.DictReader(io.StringIO(lms.get(f"{API}/gradebook.csv", params={"format": "canvas"}).text)))
    first, *not_begun = rows[1:]
    assert (first["Student"], first["SIS User ID"], first["SIS Login ID"]) == ("Ada Lovelace", "s1", "")
    assert not_begun
    assert {list(row.values())[-1] for row in not_begun} == {""}
    moodle = csv.DictReader(io.StringIO(lms.get(f"{API}/gradebook.csv", params={"format": "moodle"}).text))
    first = next(moodle)
    assert (first["ID number"], first["Email address"]) == ("s1", "ada@school.example")


def test_a_service_enters_students_alone_and_brings_nobody_back(either_site: Site, tina: httpx.Client) -> None:
    lms = either_site.client("lms", "service")
    beyond = {"left_out": 1, "reasons": [{"why": BEYOND, "people": 1}]}
    assert send(lms, ROSTER).json() == {**NOTHING, "created": 3, **beyond}
    grace = ROSTER.replace("instructor", "student")
    send(tina, ROSTER)
    assert send(lms, grace).json() == {**NOTHING, "unchanged": 3, **beyond}
    assert members(tina)["Grace Hopper"]["role"] == "instructor"
    tina.delete(f"{API}/members/{members(tina)['Bob']['id']}")
    assert send(lms, grace).json() == {
        **NOTHING, "unchanged": 2, "left_out": 2, "reasons": [{"why": BEYOND, "people": 2}],
    }  # fmt: skip
    assert "Bob" not in members(tina)
    assert send(tina, ROSTER).json() == {**NOTHING, "changed": 1, "unchanged": 3}
    assert "Bob" in members(tina)


def test_a_changed_role_ends_sessions_and_nobody_changes_their_own(site: Site) -> None:
    tina = site.client("tina", "instructor")
    send(tina, ROSTER)
    link = tina.post(f"{API}/invitations", json={"member": members(tina)["Bob"]["id"]}).json()["items"][0]
    send(tina, ROSTER.replace("Bob,,student", "Bob,,instructor"))
    assert link["id"] not in [item["id"] for item in tina.get(f"{API}/invitations").json()["items"]]
    refused = send(tina, "name,role\ntina,student\n")
    assert (refused.status_code, refused.json()["faults"][0]["key"]) == (422, "line 2, role")


def test_a_roster_that_says_no_role_changes_none(tina: httpx.Client) -> None:
    send(tina, ROSTER)
    before = {name: member["role"] for name, member in members(tina).items()}
    for text in (
        "name\ntina\nNew\n",
        "name,external_id\nGrace Hopper,t1\n",
        "name,role,external_id\nGrace Hopper,,t1\n",
    ):
        assert send(tina, text).json()["roles"] == []
    assert {name: member["role"] for name, member in members(tina).items()} == {**before, "New": "student"}


def test_a_roster_leaves_an_instructor_and_names_whose_role_changes(tmp_path: Path) -> None:
    def run(text: str, *words: str) -> str:
        (file := tmp_path / "staff.csv").write_text(text)
        words = ("roster", "import", str(file), "--data", str(tmp_path / "data"), *words)
        return CliRunner().invoke(cli, words, catch_exceptions=False).stdout

    run("name,role\nboss,instructor\nAda,\n")
    with pytest.raises(FaultyRows) as refused:
        run("name,role\nAda,student\nboss,student\n")
    assert str(refused.value) == f"staff.csv: line 3, role: {LAST}"
    swapped = "name,role\nAda,instructor\nboss,student\n"
    told = run(swapped, "--dry-run").splitlines()
    assert told == [
        "0 would be created, 2 would be changed, 0 unchanged",
        "the role of Ada would be changed: student -> instructor",
        "the role of boss would be changed: instructor -> student",
    ]
    assert "the role of boss changed: instructor -> student" in run(swapped)
    assert run("name,role\nAda,student\nEve,instructor\n").startswith("1 created, 1 changed")
    created, remark = run("name,external_id\nEve,s5\n", "--dry-run").splitlines()
    assert created == "1 would be created, 0 would be changed, 0 unchanged"
    assert re.fullmatch(r"no row finds the member Eve \([0-9a-f]{32}\), who may be .*", remark)


def test_a_course_that_nobody_has_is_told_and_not_exported(tmp_path: Path) -> None:
    def run(*words: str) -> str:
        words = ("roster", *words, "--data", str(tmp_path / "data"))
        return CliRunner().invoke(cli, words, catch_exceptions=False).stderr

    (file := tmp_path / "staff.csv").write_text("name\nAda\n")
    assert "robots is a new course." in run("import", str(file), "--course", "robots")
    assert "robot is a new course: did you mean robots?" in run("import", str(file), "--course", "robot", "--dry-run")
    with pytest.raises(NotFound, match="no course 'robot'; the courses are default, robots"):
        run("export", "--course", "robot")
    assert "robots" not in run("export", "--course", "robots")
    run("export")


def test_a_oneroster_file_of_which_nobody_is_taken_says_why(tmp_path: Path) -> None:
    (tmp_path / "users.csv").write_text("sourcedId,givenName,familyName,enabledUser\nu1,A,B,true\nu2,C,D,1\n")
    enrolled = "classSourcedId,userSourcedId,role\nc1,u1,Learner\nc1,u2,student\n"
    (tmp_path / "enrollments.csv").write_text(enrolled)
    done = CliRunner().invoke(cli, ["roster", "import", str(tmp_path), "--data", str(tmp_path / "data")])
    assert done.stdout.splitlines() == [
        "0 created, 0 changed, 0 unchanged, 2 left out",
        "1 left out: enrollments.csv, role: 'Learner' is not student or teacher",
        "1 left out: users.csv, enabledUser: '1' is not true",
    ]


ROUTES = (("POST", IMPORT), ("GET", f"{API}/roster.csv"), ("GET", f"{API}/roster.zip"))


@pytest.mark.parametrize(("method", "path"), ROUTES)
def test_students_strangers_and_tokens_without_the_scope_are_refused(site: Site, method: str, path: str) -> None:
    assert site.anonymous().request(method, path).status_code == 401
    assert site.client("ann").request(method, path).status_code == 403
    with site.app.state.services.database.write() as session:
        token = create_token(session, "lms", "service", site.course, scopes=["results", "lms"])
    scoped = site.anonymous({"Authorization": f"Bearer {token}"}).request(method, path)
    assert (scoped.status_code, "the scope `people`" in scoped.json()["detail"]) == (403, True)


def test_the_command_line_imports_and_exports(tmp_path: Path) -> None:
    def run(*words: str) -> str:
        done = CliRunner().invoke(cli, ["roster", *words, "--data", str(tmp_path / "data")])
        assert done.exit_code == 0, done.output
        return done.stdout

    file, packed = tmp_path / "roster.csv", tmp_path / "roster.zip"
    file.write_text(ROSTER)
    assert json.loads(run("import", str(file), "--namespace", "school", "--dry-run", "--json"))["created"] == 4
    assert run("import", str(file), "--namespace", "school") == "4 created, 0 changed, 0 unchanged\n"
    exported = run("export")
    assert "Ada Lovelace,ada@school.example,student,school,s1" in exported
    assert run("export", "--format", "oneroster", "--namespace", "school", "--out", str(packed)).strip() == str(packed)
    assert json.loads(run("import", str(packed), "--namespace", "school", "--json"))["unchanged"] == 4
    with zipfile.ZipFile(packed) as files:
        files.extractall(tmp_path / "folder")
    assert json.loads(run("import", str(tmp_path / "folder"), "--namespace", "school", "--json"))["unchanged"] == 4
    words = ["token", "create", "--user", "Bob", "--role", "student", "--data", str(tmp_path / "data")]
    with pytest.raises(Conflict, match="1 member has the name 'Bob' already"):
        CliRunner().invoke(cli, words, catch_exceptions=False)
    file.write_text(ROSTER + "Eve,,king,\n")
    with pytest.raises(FaultyRows, match="line 6, role"):
        CliRunner().invoke(
            cli, ["roster", "import", str(file), "--data", str(tmp_path / "data")], catch_exceptions=False
        )
