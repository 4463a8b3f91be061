"""Servers that a test starts for itself: PgBouncer, and PostgreSQL with a replica. Neither runs as root."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sqlalchemy.engine import make_url

from support.proxies import free_port, program, running

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


def ordinary() -> dict[str, Any]:
    """Arguments of Popen that make a program of root run as nobody."""
    return {"user": "nobody", "group": "nogroup", "extra_groups": []} if os.getuid() == 0 else {}


@contextmanager
def open_folder() -> Iterator[Path]:
    """A folder of the user who runs the servers; those of pytest are for root alone."""
    with TemporaryDirectory(prefix="grader-test-") as name:
        if user := ordinary().get("user"):
            subprocess.run(["chown", user, name], check=True)
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
        with running([program("pgbouncer"), "--quiet", str(settings)], listen, **ordinary()):
            yield parsed.set(host="127.0.0.1", port=listen).render_as_string(hide_password=False)
