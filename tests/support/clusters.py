"""Servers that a test starts for itself: PgBouncer, and PostgreSQL with a replica. Neither runs as root."""

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import psycopg
import pytest
from sqlalchemy.engine import make_url

from support.processes import descendants
from support.proxies import free_port, program, running
from support.queue_kills import wait_for
from support.users import NOBODY, as_user

POOLER = """
[databases]
* = host={url.host} port={port} user={url.username} {password}
[pgbouncer]
listen_addr = 127.0.0.1
listen_port = {listen}
unix_socket_dir =
auth_type = any
pool_mode = {mode}
"""


@contextmanager
def open_folder() -> Iterator[Path]:
    """A folder of the user who runs the servers; those of pytest are for root alone."""
    with TemporaryDirectory(prefix="grader-test-") as name:
        if os.geteuid() == 0:
            shutil.chown(name, NOBODY)
        yield Path(name)


@contextmanager
def pgbouncer(url: str, mode: str) -> Iterator[str]:
    """The URL of a database through PgBouncer in this mode. The database must be named by its name alone."""
    parsed, listen = make_url(url), free_port()
    with open_folder() as folder:
        settings = folder / "pgbouncer.ini"
        password = f"password={parsed.password}" if parsed.password else ""
        settings.write_text(
            POOLER.format(url=parsed, port=parsed.port or 5432, password=password, listen=listen, mode=mode)
        )
        with running(as_user(NOBODY, program("pgbouncer"), "--quiet", str(settings)), listen, tls=False):
            yield parsed.set(host="127.0.0.1", port=listen).render_as_string(hide_password=False)


class Pair:
    """A PostgreSQL server with a synchronous replica, and a URL that leads to the one that takes writes."""

    def __init__(self, folder: Path, servers: ExitStack) -> None:
        self._folder, self._servers = folder, servers
        self._ports = {"primary": free_port(), "standby": free_port()}
        self._run("initdb", "--no-sync", "--auth=trust", "--username=postgres", "primary")
        primary = self._start("primary")
        self._primary = primary
        with psycopg.connect(self._url("primary"), autocommit=True) as connection:
            source = f"host=127.0.0.1 port={self._ports['primary']} user=postgres application_name=standby"
            self._run("pg_basebackup", "--no-sync", "--checkpoint=fast", "--write-recovery-conf", "--pgdata=standby",
                      f"--dbname={source}")  # fmt: skip
            self._start("standby")
            # As docs/deploy.md says: after the copy, so that the replica does not wait for one of its own.
            connection.execute("ALTER SYSTEM SET synchronous_standby_names = 'ANY 1 (standby)'")
            connection.execute("SELECT pg_reload_conf()")
            attached = "SELECT 1 FROM pg_stat_replication WHERE sync_state = 'quorum'"
            wait_for(lambda: connection.execute(attached).fetchone() is not None)

    @property
    def url(self) -> str:
        """The URL that a service gets."""
        hosts, ports = ",".join("127.0.0.1" for _ in self._ports), ",".join(map(str, self._ports.values()))
        return f"postgresql://postgres@/postgres?host={hosts}&port={ports}&target_session_attrs=read-write"

    def kill_primary(self) -> None:
        """Ends every process of the primary at once, as a power cut does."""
        for pid in [self._primary.pid, *descendants(self._primary.pid)]:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def promote(self) -> None:
        """Makes the replica take writes."""
        self._run("pg_ctl", "promote", "--wait", "--pgdata=standby")

    def _url(self, name: str) -> str:
        return f"postgresql://postgres@127.0.0.1:{self._ports[name]}/postgres"

    def _run(self, name: str, *arguments: str) -> None:
        subprocess.run(
            as_user(NOBODY, server_program(name), *arguments), cwd=self._folder, check=True, capture_output=True
        )

    def _start(self, name: str) -> "subprocess.Popen[bytes]":
        arguments = ("-D", name, "-p", str(self._ports[name]), "-k", str(self._folder), "-c", "fsync=off")
        process: subprocess.Popen[bytes] = self._servers.enter_context(
            subprocess.Popen(
                as_user(NOBODY, server_program("postgres"), *arguments), cwd=self._folder, stderr=subprocess.DEVNULL
            )
        )
        self._servers.callback(process.send_signal, signal.SIGQUIT)
        wait_for(lambda: self._answers(name))
        return process

    def _answers(self, name: str) -> bool:
        try:
            psycopg.connect(self._url(name)).close()
        except psycopg.OperationalError:
            return False
        return True


@contextmanager
def replicated() -> Iterator[Pair]:
    """A pair; skips where the server programs of PostgreSQL are not installed."""
    with open_folder() as folder, ExitStack() as servers:
        yield Pair(folder, servers)


def server_program(name: str) -> str:
    """A program of PostgreSQL's server, which Debian keeps out of the path."""
    programs = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"), key=lambda path: int(path.parts[4]))
    if not programs:
        pytest.skip(f"there is no {name}: the package postgresql is not installed")
    return str(programs[-1])
