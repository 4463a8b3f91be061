"""Every route with every kind of credential: who gets through, and that whoever is refused changes nothing.

What is found must stand in the tables of SECURITY.md. GRADER_TEST_REWRITE=1 writes them anew; then read what changed.
"""

import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from datetime import timedelta
from functools import cached_property
from http.client import HTTPConnection
from typing import Any
from urllib.parse import urlencode, urlsplit

import httpx
import pytest
from fastapi import APIRouter
from sqlalchemy import MetaData, Table

from grader.api import routes as api_routes
from grader.courses.people import devices
from grader.courses.people.identity import COOKIE, DEFAULT_COURSE, CredentialKind, Role, Scope, issue
from grader.courses.people.members import get_named
from grader.gate.admission import PREFIX
from grader.settings import Settings
from grader.store import credentials, tickets
from grader.store.engine.database import Database
from grader.store.outbox import DEAD, Delivery, Destination
from grader.store.platforms import get_context
from grader.store.reviewing.line_comments import LineComment
from grader.store.tables import now
from grader.web.routes import router as page_router
from support.sites import ROOT, Site, open_site, write_content

pytestmark = pytest.mark.slow

PAGE = ROOT / "SECURITY.md"
BEGIN, END = "<!-- {}: written by tests/gate/test_rights.py -->", "<!-- end -->"
ELSEWHERE = "another course"
UNLIMITED: Any = {
    "rate_per_s": 1e6, "rate_burst": 10**6, "address_rate_per_s": 1e6, "address_rate_burst": 10**6,
}  # fmt: skip

ROLES = (Role.STUDENT, Role.INSTRUCTOR, Role.SERVICE)
STRANGERS = ("nobody", "revoked", "expired")
RESTRICTED = {(role, scope): f"{role} with {scope}" for role in (Role.INSTRUCTOR, Role.SERVICE) for scope in Scope}
OWN = {role: f"{role}'s session" for role in (Role.STUDENT, Role.INSTRUCTOR)}
SESSIONS = (*OWN.values(), "revoked session", "expired session", f"session of {ELSEWHERE}")
TOKENS = ("revoked", "expired", *ROLES, *RESTRICTED.values(), ELSEWHERE)
API_KINDS = ("nobody", *TOKENS, *SESSIONS)
PAGE_KINDS = ("nobody", *SESSIONS, Role.INSTRUCTOR.value)
"""Pages know sessions alone: a token, such as the last one, is nobody's."""

ANSWER = {"quiz": "small", "question": "q1", "answer": 1}
NONSENSE = {"nonsense": "1"}
HOOK = "https://example.org/hook"
PLATFORM = {
    "issuer": "https://lms.example", "client_id": "c", "login_url": "https://lms.example/login",
    "token_url": "https://lms.example/token", "keys_url": "https://lms.example/keys",
}  # fmt: skip
BODIES: dict[str, Any] = {
    "POST /submissions": ANSWER,
    "POST /answers:validate": ANSWER,
    "POST /lms/quizzes/{quiz_id}:show": {"learner": {"namespace": "school", "id": "s1"}},
    "POST /lms/submissions": {**ANSWER, "learner": {"namespace": "school", "id": "s1"}},
    "POST /labs:run": {"quiz": "small", "lab": "five"},
    "POST /reviews:claim": {"submission_id": "{submission_id}"},
    "POST /reviews:heartbeat": {"submission_id": "{submission_id}"},
    "POST /reviews:release": {"submission_id": "{submission_id}"},
    "POST /reviews:recompute": {"quiz": "small", "question": "q4"},
    "PUT /submissions/{submission_id}/review": {"points": 0.5},
    "PUT /submissions/{submission_id}/review/second": {"points": 0.5},
    "POST /reviews/comments": {"quiz": "small", "question": "q4", "text": "Well done."},
    "PUT /reviews/comments/{comment_id}": {"text": "Very well done."},
    "POST /submissions/{submission_id}/comments": {"line": 1, "text": "Why?"},
    "PATCH /members/{member_id}": {"role": "instructor"},
    "POST /invitations": {"names": ["new"]},
    "POST /tokens": {"user": "new", "role": "student"},
    "POST /roster:import": "name\nnew one\n",
    "PUT /quizzes/{quiz_id}/policy": {"attempts": 3},
    "PUT /quizzes/{quiz_id}/extensions": {"user": "ann", "attempts": 1},
    "POST /regrades": {"quiz": "small", "scope": "all"},
    "POST /lti/platforms": {**PLATFORM, "client_id": "another"},
    "POST /lti/platforms/{platform_id}:approve": {"deployment_id": "1"},
    "POST /webhooks": {"url": HOOK},
    "POST /courses": {"name": "a new one"},
    "POST /devices": {"client_name": "a laptop"},
    "POST /devices:token": {"device_code": "{device_code}"},
}
"""What each route takes; those that are left out take no body."""

FORMS: dict[str, dict[str, str]] = {
    "POST /instructor/people/invitations": {"names": "new", "role": "student"},
    "POST /instructor/people/members/{member_id}": {"do": "instructor"},
    "POST /instructor/people/tokens": {"user": "new", "new": "new", "role": "instructor", "days": ""},
    "POST /instructor/extensions": {"quiz": "small", "names": "ann", "attempts": "1"},
    "POST /instructor/extensions/publication": {"quiz": "small"},
    "POST /instructor/dates": {"quiz": "small", "attempts": "3"},
    "POST /instructor/regrades": {"quiz": "small", "scope": "all"},
    "POST /instructor/review/{submission_id}": {"do": "decide", "points": "0.5", "comment": ""},
    "POST /instructor/review/{submission_id}/lines": {"do": "write", "line": "1", "text": "Why?"},
    "POST /instructor/review/{submission_id}/try": {"source": "pass"},
    "POST /instructor/class/{quiz_id}/{question_id}/comment": {"mistake": "none", "text": "Look again."},
    "POST /instructor/courses": {"name": "one more"},
    "POST /instructor/lti/platforms": {**PLATFORM, "client_id": "by a form"},
}

CONTENT = {"quiz_id", "question_id", "lesson", "attempt", "name", "path", "sha256"}
"""Parameters of paths that name nothing of one course: courses may share their content."""

NO_EFFECT = {
    "POST /answers:validate", "POST /labs:run", "POST /reviews:recompute", "POST /quizzes/{quiz_id}/results:recount",
    "POST /submissions/{submission_id}:stop", "POST /submissions/{submission_id}/comments",
    "PUT /submissions/{submission_id}/review/second", "POST /lti/contexts/{context_id}:roster",
    "POST /instructor/review/{submission_id}/lines", "POST /instructor/review/{submission_id}/try",
    "POST /instructor/class/{quiz_id}/{question_id}/comment",
}  # fmt: skip
"""Routes that store nothing, or for which nothing is prepared: no script was handed in,
no second mark, no roster."""


@dataclass(frozen=True)
class Row:
    """A route: its name in the table, method, path, and what it does."""

    name: str
    method: str
    path: str
    effect: str

    @property
    def is_read(self) -> bool:
        return self.method == "GET"


api_router = APIRouter()
api_routes.include_in(api_router)


def routes_in(router: Any, prefix: str = "") -> Iterator[Row]:
    """The routes of a router and of those that it includes, as they are registered."""
    for route in router.routes:
        inner = getattr(route, "original_router", None)
        if inner is not None:
            yield from routes_in(inner, prefix + route.include_context.prefix)
            continue
        effect = re.split(r"(?<=\.)\s|\n", route.endpoint.__doc__ or "")[0]
        for method in sorted(route.methods):
            path = prefix + route.path
            yield Row(f"{method} {path.removeprefix(PREFIX)}", method, path, effect)


@dataclass
class World:
    """A server, an id of everything there is, and the headers of every kind of credential."""

    site: Site
    ids: dict[str, str] = field(default_factory=dict)
    headers: dict[str, dict[str, str]] = field(default_factory=dict)

    @property
    def database(self) -> Database:
        database: Database = self.site.app.state.services.database
        return database

    def send(self, client: HTTPConnection, row: Row, kind: str, *, real: bool) -> int:
        """The status of a request; without `real`, of one that can have no effect on anything that is there."""
        is_api = row.path.startswith(PREFIX)
        body = (BODIES if is_api else FORMS).get(row.name, {}) if real else NONSENSE
        missing = {name: "9" * 12 for name in self.ids if name not in CONTENT}
        ids = self.ids if real or row.is_read else self.ids | missing
        url = re.sub(r"\{(\w+)[^}]*\}", lambda match: ids[match[1]], row.path)
        headers = {"If-Match": "*", "Sec-Fetch-Site": "same-origin", **self.headers[kind]}
        if row.is_read:
            text = None
        elif isinstance(body, str):
            text, headers["Content-Type"] = body, "text/csv"
        else:
            filled = {key: value.format(**self.ids) if isinstance(value, str) else value for key, value in body.items()}
            text = json.dumps(filled) if is_api else urlencode(filled)
            headers["Content-Type"] = "application/json" if is_api else "application/x-www-form-urlencoded"
        client.request(row.method, url, text, headers)
        response = client.getresponse()
        response.read()
        assert response.status < 500 or row.path == "/readyz", (row.name, kind, response.status)
        return response.status

    @cached_property
    def tables(self) -> dict[str, Table]:
        """Those of the database, as they are there."""
        metadata = MetaData()
        with self.database.engine.connect() as connection:
            metadata.reflect(connection)
        return dict(metadata.tables)

    def snapshot(self) -> list[str]:
        """Every row of the database but those of the other course, and but the times of the last use."""
        with self.database.engine.connect() as connection:
            rows = [
                f"{name} {[value for key, value in row._mapping.items() if key != 'last_used_at']}"
                for name, table in self.tables.items()
                for row in connection.execute(table.select())
            ]
        return sorted(row for row in rows if ELSEWHERE not in row)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    folder = tmp_path_factory.mktemp("rights")
    content = write_content(folder / "content")
    with open_site(Settings(content=content, data=folder / "data", workers=0, **UNLIMITED)) as site:
        world = World(site)
        prepare_things(world)
        prepare_credentials(world)
        yield world


def prepare_things(world: World) -> None:
    """Makes one of everything that a path can name, in the course `default`, whose instructors see all of it."""
    tina, ann = world.site.client("tina", "instructor"), world.site.client("ann")
    world.site.client("bot")

    def made(client: httpx.Client, path: str, body: dict[str, Any], **headers: str) -> str:
        response = client.post(PREFIX + path, json=body, headers=headers)
        assert response.status_code in (201, 202), response.text
        return str((response.json().get("items") or [response.json()])[0]["id"])

    ids = world.ids
    ids |= {"quiz_id": "small", "question_id": "q4", "lesson": "small", "attempt": "1", "name": "chart", "path": "x"}
    ids["sha256"] = "0" * 64
    ids["submission_id"] = made(ann, "/submissions", {"quiz": "small", "question": "q4", "answer": "Because."})
    made(tina, "/invitations", {"names": ["victim"]})
    ids["invitation_id"] = ids["invitation"] = made(tina, "/invitations", {"names": ["guest"]})
    ids["comment_id"] = made(tina, "/reviews/comments", BODIES["POST /reviews/comments"])
    ids["webhook_id"] = made(tina, "/webhooks", {"url": HOOK})
    ids["regrade_id"] = made(tina, "/regrades", BODIES["POST /regrades"])
    ids["platform_id"] = made(tina, "/lti/platforms", PLATFORM)
    members = {item["name"]: item["id"] for item in tina.get(f"{PREFIX}/members").json()["items"]}
    ids["member_id"] = ids["learner"] = members["victim"]
    ids["bot"] = members["bot"]
    [ids["token_id"]] = [item["id"] for item in tina.get(f"{PREFIX}/tokens").json()["items"] if item["name"] == "bot"]
    with world.database.write() as session:
        session.get_one(Destination, ids["webhook_id"]).disabled_at = now()
        context = get_context(session, int(ids["platform_id"]), "deployment", "context", "Robotics")
        context.wanted = DEFAULT_COURSE
        dead = [dead_letter(world, question) for question in ("q1", "q2")]
        of = {"course": DEFAULT_COURSE, "submission_id": ids["submission_id"]}
        line_comment = LineComment(**of, line=1, text="Why?", author=members["tina"], name="tina")
        session.add_all([*dead, line_comment])
        session.flush()
        device = devices.begin(session, "a laptop")
        tickets.change(
            session,
            devices.DEVICE,
            tickets.hash_secret(device.device_code),
            member=ids["bot"],
            course=DEFAULT_COURSE,
            role=Role.STUDENT,
        )
        ids["device_code"] = device.device_code
        ids["line_comment_id"] = line_comment.id
        ids["context_id"], ids["delivery_id"] = str(context.id), str(dead[0].id)


def dead_letter(world: World, question: str) -> Delivery:
    """A result that could not be delivered."""
    return Delivery(
        destination=world.ids["webhook_id"], course=DEFAULT_COURSE, learner=world.ids["member_id"], quiz="small",
        question=question, state=DEAD, version=1, noted_at=now(), has_job=False, attempts=9, forced=False,
    )  # fmt: skip


def prepare_credentials(world: World) -> None:
    """Issues every kind of credential."""
    day, ago = timedelta(days=1), timedelta(days=-1)
    with world.database.write() as session:
        people = {role: get_named(session, f"any {role}", role) for role in ROLES}
        other = get_named(session, "otto", Role.INSTRUCTOR, ELSEWHERE)
        session.flush()
        tina = people[Role.INSTRUCTOR]
        tokens = {role.value: issue(session, CredentialKind.TOKEN, member) for role, member in people.items()}
        tokens |= {
            kind: issue(session, CredentialKind.TOKEN, people[role], day, scopes=frozenset({scope}))
            for (role, scope), kind in RESTRICTED.items()
        }
        tokens |= {
            "revoked": issue(session, CredentialKind.TOKEN, tina),
            "expired": issue(session, CredentialKind.TOKEN, tina, ago),
            ELSEWHERE: issue(session, CredentialKind.TOKEN, other),
        }
        owners = (people[Role.STUDENT], tina, tina, tina, other)
        lifetimes = (day, day, day, ago, day)
        sessions = {
            kind: issue(session, CredentialKind.SESSION, owner, lifetime)
            for kind, owner, lifetime in zip(SESSIONS, owners, lifetimes, strict=True)
        }
        session.flush()
        for text in (tokens["revoked"], sessions["revoked session"]):
            assert credentials.revoke(session, text.split("_")[1], now())
    world.headers = {"nobody": {}}
    world.headers |= {kind: {"Authorization": f"Bearer {text}"} for kind, text in tokens.items()}
    world.headers |= {kind: {"Cookie": f"{COOKIE}={text}"} for kind, text in sessions.items()}


Cells = dict[str, int]
"""The status by kind of credential."""


def refused(status: int) -> bool:
    return status in (401, 403)


def probe(world: World, client: HTTPConnection, rows: list[Row], kinds: tuple[str, ...]) -> dict[Row, Cells]:
    """Who gets through to each route, by requests that change nothing of what was prepared."""
    return {row: {kind: world.send(client, row, kind, real=False) for kind in kinds} for row in rows}


def check_refused(world: World, client: HTTPConnection, outcomes: Mapping[Row, Cells]) -> None:
    """Whoever was refused is refused the real thing as well, and changes nothing."""
    before = world.snapshot()
    for row, cells in outcomes.items():
        for kind, status in cells.items():
            if not row.is_read and refused(status):
                assert world.send(client, row, kind, real=True) == status, (row.name, kind)
    assert world.snapshot() == before


def check_elsewhere(world: World, client: HTTPConnection, outcomes: Mapping[Row, Cells], kind: str) -> None:
    """An instructor of another course finds nothing of this one, by any id."""
    before = world.snapshot()
    for row, cells in outcomes.items():
        if names_a_thing(row) and not is_alike(cells):
            cells[kind] = world.send(client, row, kind, real=True)
            shows_nothing = (303,) if row.is_read else (409,)  # leads elsewhere; a page that says why
            assert cells[kind] in (403, 404, *shows_nothing), (row.name, cells[kind])
    assert world.snapshot() == before


def names_a_thing(row: Row) -> bool:
    """Whether the path names something of one course."""
    return bool(set(re.findall(r"\{(\w+)", row.path)) - CONTENT)


def is_alike(cells: Cells) -> bool:
    """Whether the credential makes no difference."""
    return len({status if refused(status) else 200 for status in cells.values()}) == 1


def api_line(row: Row, cells: Cells) -> str:
    """The line of a route of the API in the table."""
    if is_alike(cells):
        return line(row.name, "everybody", "", "", row.effect)
    assert {cells[kind] for kind in (*STRANGERS, "revoked session", "expired session")} == {401}, row.name
    for role in (Role.STUDENT, Role.INSTRUCTOR):
        assert refused(cells[role]) == refused(cells[OWN[role]]), (row.name, role)
    who = [role for role in ROLES if not refused(cells[role])]
    scopes = {role: {scope for scope in Scope if not refused(cells[RESTRICTED[role, scope]])} for role in ROLES[1:]}
    assert not any(scopes[role] for role in scopes if role not in who), row.name
    needed = {scope for role in scopes for scope in scopes[role]}
    assert len(needed) <= 1, row.name
    assert all(scopes[role] == needed for role in scopes if role in who), row.name
    scope = "".join(needed) or "no token with scopes"
    return line(row.name, ", ".join(who), scope, told_elsewhere(row, cells[ELSEWHERE]), row.effect)


def told_elsewhere(row: Row, status: int) -> str:
    """What an instructor of another course gets."""
    return str(status) if refused(status) or names_a_thing(row) else "their own"


def page_line(row: Row, cells: Cells) -> str:
    """The line of a page in the table."""
    if is_alike(cells):
        who = "whoever brings the code, ticket or provider's answer" if refused(cells["nobody"]) else "everybody"
        return line(row.name, "not here: 404" if set(cells.values()) == {404} else who, "", row.effect)
    assert {cells[kind] for kind in ("nobody", "revoked session", "expired session", "instructor")} == {401}, row.name
    roles = [role for role, kind in OWN.items() if not refused(cells[kind])]
    return line(row.name, ", ".join(roles), told_elsewhere(row, cells[f"session of {ELSEWHERE}"]), row.effect)


def line(*cells: str) -> str:
    """A row of a Markdown table."""
    name, *rest = (cell.replace("|", "\\|") for cell in cells)
    return f"| {' | '.join((f'`{name}`', *rest))} |"


def compare(name: str, lines: list[str]) -> None:
    """Holds a table of SECURITY.md against what was found, or writes it."""
    text, begin = PAGE.read_text(encoding="utf-8"), BEGIN.format(name)
    before, _, rest = text.partition(begin)
    table, _, after = rest.partition(END)
    head = [one for one in table.splitlines() if one.startswith("|")][:2]
    if os.environ.get("GRADER_TEST_REWRITE"):
        new = "\n".join((begin, "", *head, *lines, "", END))
        PAGE.write_text(before + new + after, encoding="utf-8")
        return
    written = [one for one in table.splitlines() if one.startswith("|")][2:]
    assert written == lines, "run this file with GRADER_TEST_REWRITE=1, and read what changes in SECURITY.md"


@pytest.fixture
def client(world: World) -> Iterator[HTTPConnection]:
    with closing(connection_to(world.site)) as connection:
        yield connection


def connection_to(site: Site) -> HTTPConnection:
    """A client that keeps no cookies, and costs a fraction of httpx's."""
    return HTTPConnection(urlsplit(site.origin).netloc, timeout=60)


def test_who_gets_through_to_every_route_of_the_api(world: World, client: HTTPConnection) -> None:
    rows = list(routes_in(api_router))
    assert {(row.method.lower(), row.path) for row in rows} == {
        (method, path) for path, methods in world.site.app.openapi()["paths"].items() for method in methods
    }
    outcomes = probe(world, client, rows, API_KINDS)
    check_refused(world, client, outcomes)
    for kind in (ELSEWHERE, f"session of {ELSEWHERE}"):
        check_elsewhere(world, client, outcomes, kind)
    compare("routes of the API", [api_line(row, cells) for row, cells in outcomes.items()])


def test_who_gets_through_to_every_page(world: World, client: HTTPConnection) -> None:
    rows = list(routes_in(page_router))
    leaving = [row for row in rows if row.name == "POST /signout"]  # ends the session that asks for it
    outcomes = probe(world, client, [row for row in rows if row not in leaving], PAGE_KINDS)
    check_refused(world, client, outcomes)
    check_elsewhere(world, client, outcomes, f"session of {ELSEWHERE}")
    lines = [page_line(row, cells) for row, cells in outcomes.items()]
    compare("pages", [*lines, *(line(row.name, "everybody", "", row.effect) for row in leaving)])


def test_what_is_allowed_has_its_effect(tmp_path: Any) -> None:
    """Otherwise a request that nobody could get through would look well guarded."""
    content = write_content(tmp_path / "content")
    with open_site(Settings(content=content, data=tmp_path / "data", workers=0, **UNLIMITED)) as site:
        world = World(site)
        prepare_things(world)
        prepare_credentials(world)
        client = connection_to(site)
        rows = [row for row in routes_in(api_router) if not row.is_read]
        for row in sorted(rows, key=lambda row: (row.method == "DELETE", not row.path.endswith(":enable"), row.path)):
            before = world.snapshot()
            kind = Role.SERVICE if "/lms/" in row.path else Role.INSTRUCTOR
            status = world.send(client, row, kind, real=True)
            if row.name not in NO_EFFECT:
                assert status < 300, f"{row.name}: {status}; write a body that does something into BODIES"
                has_effect = world.snapshot() != before
                assert has_effect, f"{row.name} changes nothing; name it in NO_EFFECT, with the reason, if it need not"
        client.close()
