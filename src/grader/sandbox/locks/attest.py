"""Checks a child's locks from outside, before it receives the first byte of a script."""

import os
from collections.abc import Mapping
from typing import Any

from grader.errors import JailFault

NAMESPACES = ("user", "pid", "mnt", "net", "ipc", "uts")
CAPABILITIES = ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb")
DESCRIPTORS = [0, 1, 2, 3, 4]  # /dev/null, stdout, stderr, results, job


def read_proc(name: str) -> str:
    """Read a file of /proc; without pathlib, which would keep every pid in memory, as it interns the parts of paths."""
    with open(f"/proc/{name}") as file:  # noqa: PTH123
        return file.read()


def find_pid(pidfd: int) -> int:
    """Returns the id of the process behind a pidfd, in our own pid namespace; -1 when it has ended."""
    return int(dict(line.split(":", 1) for line in read_proc(f"self/fdinfo/{pidfd}").splitlines())["Pid"])


def read_namespaces(pid: int) -> dict[str, str]:
    """Returns the namespaces a process is in."""
    return {name: os.readlink(f"/proc/{pid}/ns/{name}") for name in NAMESPACES}  # noqa: PTH115


def list_missing_locks(pid: int, probed: Mapping[str, Any], zygote: Mapping[str, str] | None, uid: int) -> list[str]:
    """List the locks that the child lacks; none may be missing when it receives a script. `probed` is what the child
    itself reported before any script was in it; `zygote` holds the namespaces of the zygote (None in tier T2); `uid` is
    the user that it must run as."""
    status = dict(line.split(":\t", 1) for line in read_proc(f"{pid}/status").splitlines() if ":\t" in line)
    faults = [name for name in CAPABILITIES if int(status[name], 16)]
    held = {
        "seccomp": status["Seccomp"] == "2",
        "no new privileges": status["NoNewPrivs"] == "1",
        "one thread": status["Threads"] == "1",
        "user": set(status["Uid"].split()) == {str(uid)},
        "descriptors": probed.get("descriptors") == DESCRIPTORS,
        "landlock": probed.get("reads_outside") is False,
        "limits": _read_limits(pid).get("Max core file size") == ["0", "0"],
    }
    if zygote is None:
        faults = [name for name in faults if name != "CapBnd"]  # emptying it takes a user namespace
    else:
        held["pid 1"] = status["NSpid"].split()[-1] == "1"
        ours, its = read_namespaces(os.getpid()), read_namespaces(pid)
        faults += [f"{name} namespace" for name in NAMESPACES if its[name] in (ours[name], zygote[name])]
    return faults + [name for name, holds in held.items() if not holds]


def check_locks(pid: int, probed: Mapping[str, Any], zygote: Mapping[str, str] | None, uid: int) -> None:
    """Refuse a child that lacks a lock. Raises JailFault if a lock is missing; the text names it."""
    try:
        faults = list_missing_locks(pid, probed, zygote, uid)
    except (OSError, KeyError, ValueError) as error:
        raise JailFault(f"A child of the jail cannot be attested: {error}") from error
    if faults:
        raise JailFault(f"A child of the jail lacks: {', '.join(faults)}")


def _read_limits(pid: int) -> dict[str, list[str]]:
    return {row[:26].strip(): row[26:].split()[:2] for row in read_proc(f"{pid}/limits").splitlines()[1:]}
