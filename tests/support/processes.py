"""The processes below another, as each names its parent. /proc also lists the children of a thread, but may leave some
out while others end."""

from contextlib import suppress

import psutil


def descendants(pid: int) -> list[int]:
    """The processes below `pid`, with those that have ended and that nobody has waited for."""
    with suppress(psutil.NoSuchProcess):
        return [child.pid for child in psutil.Process(pid).children(recursive=True)]
    return []


def descendants_running(pid: int, *names: str) -> list[int]:
    """The processes below `pid` whose command line holds one of the names."""
    return [child for child in descendants(pid) if any(name in command_line(child) for name in names)]


def command_line(pid: int) -> str:
    """The command line of a process, empty once it has ended."""
    with suppress(psutil.NoSuchProcess):
        return " ".join(psutil.Process(pid).cmdline())
    return ""


def program_name(pid: int) -> str:
    """The name of what a process runs, empty once it has ended."""
    with suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).name()
    return ""


def find_parent(pid: int) -> int:
    """The parent of a process, 0 once it has ended."""
    with suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).ppid()
    return 0


def listening_children(pid: int) -> list[int]:
    """The processes that `pid` has started and that listen on a port."""
    pids = []
    for child in psutil.Process(pid).children():
        with suppress(psutil.NoSuchProcess):
            if any(connection.status == psutil.CONN_LISTEN for connection in child.net_connections("tcp")):
                pids.append(child.pid)
    return pids
