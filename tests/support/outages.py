"""Outages for tests: a PostgreSQL server behind a connection that can be cut, and a disk that can be filled."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psycopg
from sqlalchemy.engine import make_url


class Cable:
    """A TCP connection to a server that can be cut and mended: while it is cut, the port refuses."""

    def __init__(self, target: tuple[str, int]) -> None:
        self._target = target
        self._ends: list[socket.socket] = []
        self._flows = threading.Event()
        self._flows.set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._listen()

    def cut(self) -> None:
        """Closes every connection, and accepts none."""
        for end in [self._listener, *self._ends]:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
        self._accepting.join()
        self._ends.clear()

    def freeze(self) -> None:
        """Keeps every connection and accepts more, and passes nothing on until `thaw`."""
        self._flows.clear()

    def thaw(self) -> None:
        """Passes on what has come, and what comes."""
        self._flows.set()

    def mend(self) -> None:
        """Accepts connections again."""
        self._listener = socket.create_server(("127.0.0.1", self.port))
        self._listen()

    def _listen(self) -> None:
        self._accepting = threading.Thread(target=self._accept, args=(self._listener,), daemon=True)
        self._accepting.start()

    def _accept(self, listener: socket.socket) -> None:
        with suppress(OSError):
            while True:
                ours, _ = listener.accept()
                theirs = socket.create_connection(self._target)
                self._ends += [ours, theirs]
                for source, target in ((ours, theirs), (theirs, ours)):
                    threading.Thread(target=forward, args=(source, target, self._flows), daemon=True).start()


def forward(source: socket.socket, target: socket.socket, flows: threading.Event) -> None:
    """Copies bytes while they flow until one side ends, then ends the other."""
    with suppress(OSError):
        while data := source.recv(65536):
            flows.wait()
            target.sendall(data)
    for end in (source, target):
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)


@contextmanager
def cable_to(url: str) -> Iterator[tuple[Cable, str]]:
    """A cable to the server of a database URL, and the URL through it."""
    parsed = make_url(url)
    cable = Cable((parsed.host or "127.0.0.1", parsed.port or 5432))
    try:
        yield cable, parsed.set(host="127.0.0.1", port=cable.port).render_as_string(hide_password=False)
    finally:
        cable.thaw()
        cable.cut()


LIMIT = """
from pathlib import Path
from sqlalchemy import event
from sqlalchemy.pool import Pool

@event.listens_for(Pool, "checkout")
def limit(connection, *_):
    connection.execute(f"PRAGMA max_page_count = {{1 if Path({mark!r}).exists() else 2**32 - 2}}")
"""
"""Lets a SQLite file grow no more while the file `mark` exists, which SQLite reports as it does a full disk."""

TABLES = ("submissions", "verdicts", "events", "results", "jobs")
FULL = """
CREATE OR REPLACE FUNCTION is_full() RETURNS trigger LANGUAGE plpgsql
    AS $$ BEGIN RAISE EXCEPTION 'No space left on device' USING ERRCODE = 'disk_full'; END $$;
"""
"""Fails as PostgreSQL does where a table cannot grow; what is there can still be read and removed."""


class Disk:
    """The disk of a database: `fill` makes what grows fail in every process, `free` ends it."""

    def __init__(self, url: str, mark: Path) -> None:
        self._url, self._mark = url, mark
        self._is_sqlite = url.startswith("sqlite:")

    @property
    def before(self) -> str:
        """The code that a process runs first, so that it notices."""
        return LIMIT.format(mark=str(self._mark)) if self._is_sqlite else ""

    def fill(self) -> None:
        """From now on no more fits in."""
        self._mark.touch()
        self._change(FULL, "CREATE TRIGGER full_disk BEFORE INSERT OR UPDATE ON {} EXECUTE FUNCTION is_full()")

    def free(self) -> None:
        """Makes room."""
        self._mark.unlink(missing_ok=True)
        self._change("", "DROP TRIGGER IF EXISTS full_disk ON {}")

    def _change(self, first: str, each: str) -> None:
        if not self._is_sqlite:
            with psycopg.connect(self._url, autocommit=True) as connection:
                connection.execute(
                    ";".join([first.strip().rstrip(";"), *(each.format(table) for table in TABLES)]).strip(";")
                )
