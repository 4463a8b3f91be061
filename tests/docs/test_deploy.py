"""What docs/deploy.md says, and the files of deploy/, done as far as one machine without systemd can."""

import os
import re
import shlex
import shutil
import socket
import ssl
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ipaddress import ip_network
from pathlib import Path

import httpx
import psycopg
import pytest
from sqlalchemy.engine import make_url
from starlette.types import Receive, Scope, Send

from grader.courses.people.identity import DEFAULT_COURSE
from grader.gate.admission import PREFIX as API
from grader.settings import Settings
from grader.store.courses import audit_page
from grader.store.engine.database import Database
from support import command_line
from support.databases import CONNECT_S, POSTGRES, need_postgresql
from support.proxies import DEPLOY, PROXIES, adapted, free_port
from support.servers import serving
from support.sites import Site, open_site, write_content
from support.tokens import issue_token

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "deploy.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
COMMANDS = sorted({line for block in BLOCKS for line in block.splitlines() if line.startswith("grader ")})
START_S = 120.0
SMALL = {"quiz": "small", "question": "q2"}


# -- the page ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_of_the_page_exists_with_its_options(line: str) -> None:
    _, name, *words = shlex.split(line)
    if name == "()":
        return
    done = command_line.grader(name, "--help")
    assert done.returncode == 0, done.stderr
    for option in (word for word in words if word.startswith("--")):
        assert option in re.sub(r"\s+", " ", done.stdout)


def test_files_and_settings_of_the_page_exist() -> None:
    names = {name for name in re.findall(r"deploy/([\w@.-]+)", PAGE) if not name.endswith(".md")}
    assert names - {"secrets"} == {path.name for path in DEPLOY.iterdir() if path.is_file()}
    everything = PAGE + "".join(path.read_text() for path in DEPLOY.iterdir() if path.is_file())
    named = set(re.findall(r"\bGRADER_([A-Z][A-Z0-9_]+)\b", everything)) - {"NAME"}
    assert named <= {name.upper() for name in Settings.model_fields}


# -- units and containers ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", ["grader.service", "grader-worker@.service"])
def test_systemd_reads_the_units(unit: str, tmp_path: Path) -> None:
    (tmp_path / unit).write_text(adapted(unit, {"/opt/grader/bin/grader": "/bin/true"}))
    command = ["systemd-analyze", "verify", "--man=no", str(tmp_path / unit)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # Before systemd 254 the key is unknown, and ignored.
    wrong = [line for line in done.stderr.splitlines() if unit in line and "'DelegateSubgroup'" not in line]
    assert (done.returncode, wrong) == (0, [])


@pytest.mark.parametrize("unit", ["grader.service", "grader-worker@.service"])
def test_a_unit_starts_without_settings(unit: str) -> None:
    """Settings are optional; without `-` systemd refuses a file that is missing."""
    assert re.findall("^EnvironmentFile=(.)", (DEPLOY / unit).read_text(), re.M) == ["-"]


@pytest.mark.parametrize("unit", ["grader.service", "grader-worker@.service"])
def test_a_unit_sets_nothing_that_it_says_stops_bubblewrap(unit: str) -> None:
    text = (DEPLOY / unit).read_text()
    named = set(re.findall(r"\b([A-Z]\w+)=", text[text.index("not to be added are") : text.index("NoNewPrivileges=")]))
    assert {"SystemCallFilter", "RestrictSUIDSGID"} <= named
    assert not named & set(re.findall(r"^(\w+)=", text, re.M))


def test_the_image_holds_what_it_needs_and_its_sources_exist() -> None:
    text = (DEPLOY / "Containerfile").read_text().replace("\\\n", " ")
    ignored = (ROOT / ".containerignore").read_text().split("\n")
    lines = [line.split(maxsplit=1) for line in text.splitlines() if line and not line.startswith("#")]
    assert {name for name, _ in lines} <= {"FROM", "WORKDIR", "COPY", "RUN", "ENV", "USER", "VOLUME", "EXPOSE", "CMD"}
    copied = [words.split()[0] for name, words in lines if name == "COPY" and not words.startswith("--from")]
    assert all((ROOT / path).exists() and path not in ignored for path in copied)
    assert not {"src", "quizzes", "models", "reference_solutions", "setup.py", "pyproject.toml"} & set(ignored)
    last = text[text.rindex("FROM ") :]
    assert "bubblewrap" in last
    assert "python3 -m venv --without-pip /opt/grader " in text
    assert not re.search(r"\b(pip|venv|setuptools)\b", last)
    assert last.index("USER grader") < last.index("CMD")


JAILED = """
[ "$1" = masked ] && mount -t tmpfs -o ro tmpfs /proc/irq
exec unshare --user --map-user=1000 --map-group=1000 "$2" -c 'from grader.commands.main import main; main()' \
    grade 1.3-exercises servo-threshold "$3"
"""
"""An ordinary user in a mount namespace, as in a container; `masked` covers up a part of /proc, as Docker does."""


@pytest.mark.parametrize(
    ("proc", "allow_t2", "code", "said"),
    [
        ("whole", "false", 0, "correct"),
        ("masked", "false", 3, "Can't mount proc .* docs/deploy.md .* GRADER_ALLOW_T2=true"),
        ("masked", "true", 0, "correct"),
    ],
)
@pytest.mark.jail
def test_a_container_without_the_options_gets_a_refusal_or_t2(proc: str, allow_t2: str, code: int, said: str) -> None:
    script = ROOT / "reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py"
    command = [
        "unshare",
        "--user",
        "--map-root-user",
        "--mount",
        "sh",
        "-c",
        JAILED,
        "sh",
        proc,
        sys.executable,
        str(script),
    ]
    environment = {**os.environ, "GRADER_ALLOW_T2": allow_t2}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == code, done.stderr
    assert re.search(said, " ".join((done.stdout + done.stderr).split()))


# -- proxies -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=PROXIES)
def public(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """The service behind a proxy; its `origin` is the proxy's."""
    folder, port = tmp_path_factory.mktemp(request.param), free_port()
    settings = Settings(
        content=write_content(folder / "content"),
        data=folder / "data",
        workers=0,
        public_origin=f"https://localhost:{port}",
        trusted_proxies=(ip_network("127.0.0.1"),),
        address_rate_burst=5,
        address_rate_per_s=0.01,
    )
    with open_site(settings) as site, PROXIES[request.param](folder, port, site.origin):
        yield Site(site.app, settings, settings.origin)


def visitor(site: Site, address: str = "127.0.0.1", **headers: str) -> httpx.Client:
    transport = httpx.HTTPTransport(verify=False, local_address=address)
    return httpx.Client(base_url=site.origin, headers=headers, transport=transport, timeout=60)


def learner(site: Site, name: str = "ada", role: str = "student") -> httpx.Client:
    return visitor(site, Authorization=f"Bearer {issue_token(site.settings, name, role, None)}")


def test_an_answer_comes_through_the_proxy(public: Site) -> None:
    with learner(public) as ada:
        made = ada.post(f"{API}/submissions", json={**SMALL, "answer": "5 ms"})
        assert (made.status_code, made.json()["verdict"]["status"]) == (201, "correct")
        assert ada.get("/metrics").status_code == 404


def test_events_are_not_held_back(public: Site) -> None:
    with learner(public, "eve") as eve:
        made = eve.post(f"{API}/submissions", json={**SMALL, "answer": "4 ms"}).json()
        with public.app.state.services.database.write() as session:
            session.connection().exec_driver_sql("UPDATE submissions SET status = 'queued', revision = 0")
            session.connection().exec_driver_sql("UPDATE events SET name = 'queued'")
        with eve.stream("GET", f"{API}/submissions/{made['id']}/events", timeout=20) as stream:
            first = next(line for line in stream.iter_lines() if line.startswith("event:"))
            assert first == "event: queued"  # the stream is still open


def test_what_is_too_large_is_refused(public: Site) -> None:
    with learner(public, "bob") as bob:
        for size in (3, 5):
            body = b'{"answer": "' + b"x" * (size << 20) + b'"}'
            refused = bob.post(f"{API}/submissions", content=body, headers={"Content-Type": "application/json"})
            assert refused.status_code in (413, 502)  # Caddy before 2.7 says 502


def test_visitors_are_told_apart_and_none_can_pretend_to_be_another(public: Site) -> None:
    def statuses(address: str) -> list[int]:
        with visitor(public, address) as one:
            forged = ({"X-Forwarded-For": f"198.51.100.{number}"} for number in range(7))
            return [one.get("/signin", headers=headers).status_code for headers in forged]

    for address in ("127.0.0.7", "127.0.0.8"):
        seen = statuses(address)
        assert seen.count(429) == 2, seen


QUICK = {
    "nginx": {
        "client_header_timeout 20s": "client_header_timeout 1s",
        "client_body_timeout 20s": "client_body_timeout 1s",
    },
    "caddy": {"read_header 20s": "read_header 1s", "read_body 60s": "read_body 2s"},
}
"""Time limits of deploy/ that a test can wait for."""
HEAD = b"POST / HTTP/1.1\r\nHost: localhost\r\n"


async def list_headers(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers with the headers of the request, once its body has arrived."""
    if scope["type"] != "http":
        return
    while (await receive()).get("more_body"):
        pass
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": repr(scope["headers"]).encode()})


@pytest.fixture(scope="module", params=PROXIES)
def talk(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[bytes], bytes]]:
    """Sends bytes to a proxy with short time limits, and returns everything until it closes the connection."""
    folder, port = tmp_path_factory.mktemp(request.param), free_port()
    trusting = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    trusting.check_hostname, trusting.verify_mode = False, ssl.CERT_NONE

    def talk(sent: bytes) -> bytes:
        plain = socket.create_connection(("127.0.0.1", port), timeout=30)
        with trusting.wrap_socket(plain, server_hostname="localhost") as connection:
            connection.sendall(sent.replace(b"localhost", b"localhost:%d" % port))
            parts = list(iter(lambda: connection.recv(65536), b""))
        return b"".join(parts)

    with serving(list_headers) as upstream, PROXIES[request.param](folder, port, upstream, QUICK[request.param]):
        yield talk


@pytest.mark.parametrize("half", [HEAD, HEAD + b"Content-Length: 100\r\n\r\n{"], ids=["headers", "body"])
def test_half_a_request_is_ended_by_the_proxy(talk: Callable[[bytes], bytes], half: bytes) -> None:
    began = time.monotonic()
    talk(half)
    assert time.monotonic() - began < 15


def test_a_whole_request_is_answered(talk: Callable[[bytes], bytes]) -> None:
    assert b"x-forwarded-for" in talk(HEAD + b"Connection: close\r\nContent-Length: 2\r\n\r\nhi")


def test_a_trailer_is_no_header(talk: Callable[[bytes], bytes]) -> None:
    """uvicorn adds trailers to the headers: an address in one would be believed."""
    trailers = b"X-Forwarded-For: 198.51.100.1\r\nX-More: 1\r\nX-Last: 1\r\n"
    head = HEAD + b"Connection: close\r\nTransfer-Encoding: chunked\r\nTrailer: X-Forwarded-For, X-More, X-Last\r\n"
    shown = talk(head + b"\r\n2\r\nhi\r\n0\r\n" + trailers + b"\r\n")
    assert b"127.0.0.1" in shown
    assert b"198.51.100.1" not in shown


# -- backup and restore ------------------------------------------------------------------------------------------------


def grader() -> list[str]:
    return [sys.executable, "-c", "from grader.commands.main import main; main()"]


def run(command: list[str], **environment: str) -> str:
    done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout.strip()


@contextmanager
def under_load(site: Site) -> Iterator[list[str]]:
    """Three learners who answer without end; yields the ids of what was acknowledged."""
    ended, acknowledged = threading.Event(), list[str]()
    clients = [site.client(f"learner {number}") for number in range(3)]

    def answer(client: httpx.Client) -> None:
        number = 0
        while not ended.is_set():
            number += 1
            body = {"quiz": "small", "question": "q1", "answer": number % 3}
            acknowledged.append(client.post(f"{API}/submissions", json=body).raise_for_status().json()["id"])

    threads = [threading.Thread(target=answer, args=(client,)) for client in clients]
    for thread in threads:
        thread.start()
    try:
        yield acknowledged
    finally:
        ended.set()
        for thread in threads:
            thread.join()


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + START_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def gradebook(site: Site) -> bytes:
    return site.client("tina", "instructor").get(f"{API}/gradebook.csv").raise_for_status().content


def ids_in(url: str) -> set[str]:
    database = Database(url)
    with database.read() as session:
        ids = {row[0] for row in session.connection().exec_driver_sql("SELECT id FROM submissions")}
    database.close()
    return ids


def block(words: str) -> str:
    """The block of commands of the page that has these words."""
    text: str
    [text] = [one for one in BLOCKS if words in one]
    return text


def as_written(commands: str, folder: Path, **environment: str) -> None:
    """Runs commands of the page: its folders lie in `folder`, nobody else owns them, and systemctl does nothing."""
    programs = folder / "bin"
    programs.mkdir(exist_ok=True)
    call = shlex.join(grader())
    for name, body in (("grader", f'exec {call} "$@"'), ("as_postgres", 'exec "$@"'), ("systemctl", "exit 0")):
        (programs / name).write_text(f"#!/bin/sh\n{body}\n")
        (programs / name).chmod(0o755)
    for old, new in {
        "/var/": f"{folder}/var/",
        " -o grader -g grader": "",
        "--owner=grader ": "",
        "--role=grader ": "",
    }.items():
        commands = commands.replace(old, new)
    (folder / "var/backups/grader").mkdir(parents=True, exist_ok=True)
    environment |= {"PATH": f"{programs}:{os.environ['PATH']}", "GRADER_DATA": f"{folder}/var/lib/grader"}
    run(["sh", "-eu", "-c", commands], **environment)


def test_a_sqlite_backup_made_under_load_restores_to_the_same_gradebook(tmp_path: Path) -> None:
    settings = Settings(content=write_content(tmp_path / "content"), data=tmp_path / "var/lib/grader", workers=0)
    saved = tmp_path / "var/backups/grader/monday.db"
    with open_site(settings) as site:
        with under_load(site) as acknowledged:
            wait_until(lambda: len(acknowledged) > 20)
            before = set(acknowledged)
            as_written(block("grader backup /var/backups/grader/monday.db"), tmp_path)
            kept, answered = ids_in(f"sqlite:///{saved}"), len(acknowledged)
            wait_until(lambda: len(acknowledged) > answered + 20)
        assert before <= kept < set(acknowledged)
        assert saved.stat().st_mode & 0o777 == 0o600
        saved.unlink()
        as_written(block("grader backup /var/backups/grader/monday.db"), tmp_path)
        book = gradebook(site)
        site.client("late").post(f"{API}/submissions", json={**SMALL, "answer": "5 ms"}).raise_for_status()
        assert gradebook(site) != book
    as_written(block("mv /var/lib/grader /var/lib/grader.old"), tmp_path)
    with open_site(settings) as site:
        assert gradebook(site) == book


def test_a_backup_neither_overwrites_nor_invents(tmp_path: Path) -> None:
    for place, said in ((tmp_path / "none", "no database"), (tmp_path, "exists")):
        Database(f"sqlite:///{tmp_path}/grader.db").migrate()
        (tmp_path / "there.db").touch()
        done = command_line.grader("backup", str(tmp_path / "there.db"), "--data", str(place))
        assert done.returncode == 2
        assert said in done.stderr
    assert (tmp_path / "there.db").stat().st_size == 0
    assert not (tmp_path / "none").exists()


@pytest.mark.postgres
def test_a_postgresql_backup_made_under_load_restores_to_the_same_gradebook(tmp_path: Path) -> None:
    if shutil.which("pg_dump") is None:
        pytest.fail("pg_dump is missing: install postgresql-client")
    need_postgresql()
    server = psycopg.connect(POSTGRES, autocommit=True, connect_timeout=CONNECT_S)
    name = f"grader_deploy_{os.getpid()}"
    there = make_url(POSTGRES)
    where = {"PGHOST": there.host or "", "PGPORT": str(there.port or 5432), "PGUSER": there.username or "",
             "PGPASSWORD": str(there.password or "")}  # fmt: skip
    url = there.set(database=name).render_as_string(hide_password=False)
    settings = Settings(content=write_content(tmp_path / "content"), database_url=url, workers=0)
    server.execute(f"CREATE DATABASE {name}")
    restore = block("pg_restore").replace("--dbname=grader", f"--dbname={name}")
    restore = re.sub(r"^(as_postgres (?:dropdb|createdb).*) grader$", rf"\1 {name}", restore, flags=re.MULTILINE)
    try:
        with open_site(settings) as site:
            with under_load(site) as acknowledged:
                wait_until(lambda: len(acknowledged) > 20)
                before = set(acknowledged)
                as_written(block("pg_dump"), tmp_path, GRADER_DATABASE_URL=url)
            book = gradebook(site)
            (tmp_path / "var/backups/grader/monday.dump").rename(tmp_path / "loaded.dump")
            as_written(block("pg_dump"), tmp_path, GRADER_DATABASE_URL=url)
            site.client("late").post(f"{API}/submissions", json={**SMALL, "answer": "5 ms"}).raise_for_status()
            assert gradebook(site) != book
        as_written(restore, tmp_path, **where)
        with open_site(settings) as site:
            assert gradebook(site) == book
        (tmp_path / "loaded.dump").replace(tmp_path / "var/backups/grader/monday.dump")
        as_written(restore, tmp_path, **where)
        assert before <= ids_in(url)
    finally:
        server.execute(f"DROP DATABASE IF EXISTS {name} WITH (FORCE)")
        server.close()


# -- upgrade, secrets, pruning -----------------------------------------------------------------------------------------


def test_a_downgrade_keeps_the_answers_and_a_server_refuses_later_tables(tmp_path: Path) -> None:
    settings = Settings(content=write_content(tmp_path / "content"), data=tmp_path / "var/lib/grader", workers=0)
    with open_site(settings) as site:
        site.client("ada").post(f"{API}/submissions", json={**SMALL, "answer": "5 ms"}).raise_for_status()
        book = gradebook(site)
    as_written(block("grader migrate 0006"), tmp_path)
    database = Database(settings.database)
    assert database.revision == "0006"
    with open_site(settings) as site:
        assert gradebook(site) == book
    with database.write() as session:
        session.connection().exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    database.close()
    environment = {**os.environ, "GRADER_DATA": str(settings.data), "GRADER_PORT": "0"}
    done = subprocess.run([*grader(), "serve"], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "The database is at revision 9999" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_new_key_draws_other_hidden_cases(tmp_path: Path) -> None:
    from grader.store.upkeep.installation import hidden_case_secret

    database = Database(f"sqlite:///{tmp_path}/var/lib/grader/grader.db")
    database.migrate()
    old = hidden_case_secret(database)
    as_written(block("grader rotate-secret"), tmp_path)
    assert hidden_case_secret(database) not in (old, b"")
    with database.read() as session:
        (entry,) = audit_page(session, DEFAULT_COURSE, None, 9)
    assert (entry.name, entry.action) == ("command line", "key of the hidden cases rotated")
    database.close()


def test_the_learner_of_the_page_is_erased(tmp_path: Path) -> None:
    settings = Settings(content=write_content(tmp_path / "content"), data=tmp_path / "var/lib/grader", workers=0)
    with open_site(settings) as site:
        ada = site.client("Ada Lovelace")
        ada.post(f"{API}/submissions", json={**SMALL, "answer": "5 ms"}).raise_for_status()
        as_written(block("grader prune") + block("grader erase"), tmp_path)
        assert ada.get(f"{API}/quizzes").status_code == 401
        assert b"Lovelace" not in gradebook(site)


def test_settings_are_read_from_systemds_credentials(tmp_path: Path) -> None:
    # LoadCredential=grader:FOLDER names the credential of FOLDER/database_url grader_database_url.
    (tmp_path / "grader_database_url").write_text("postgresql://a@b/c\n")
    (tmp_path / "grader_oidc_course").write_text("robots")
    code = "from grader.settings import Settings; one = Settings(); print(one.database, one.oidc_course)"
    shown = run([sys.executable, "-W", "error", "-c", code], CREDENTIALS_DIRECTORY=str(tmp_path))
    assert shown == "postgresql://a@b/c robots"
    shown = run([sys.executable, "-c", code], CREDENTIALS_DIRECTORY=str(tmp_path), GRADER_OIDC_COURSE="physics")
    assert shown.endswith(" physics")
