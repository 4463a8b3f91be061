"""The supervisor's end of the zygote: start it, ask it for children, end it."""

import base64
import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import JailFault
from . import attest, cell, policy, seccomp

START_S_MAX = 60.0
CHILD_S_MAX = 20.0
PACKET_BYTES_MAX = 4096


@dataclass
class Child:
    """A process that is locked down and waits for its one job; the descriptors are ours to close."""

    pid: int
    pidfd: int
    job: int
    stdout: int
    stderr: int
    results: int
    status: socket.socket
    zygote: "Zygote"
    _closed: bool = field(default=False)

    def kill(self) -> None:
        """End it, and with it all that is in its pid namespace."""
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self.pidfd, signal.SIGKILL)

    def alive(self) -> bool:
        """Has it not ended yet?"""
        return not select.select([self.pidfd], [], [], 0)[0]

    def hang_up(self) -> None:
        """Close the way in: the script is all there."""
        if self.job >= 0:
            os.close(self.job)
            self.job = -1

    def close(self) -> None:
        """Let go of every descriptor; the zygote has one child less."""
        if self._closed:
            return
        self._closed = True
        self.hang_up()
        for descriptor in (self.pidfd, self.stdout, self.stderr, self.results):
            os.close(descriptor)
        self.status.close()
        self.zygote.children -= 1


class Zygote:
    """One warm process in its cell. Used by one thread only, the one that started it and that must live as long."""

    def __init__(self, models: Path, inside: Path = cell.INSIDE, alone: bool = False) -> None:
        self.children = 0
        self.made = 0
        self._alone = alone
        self._namespaces: dict[str, str] | None = None
        self.uid = policy.NOBODY if os.geteuid() == 0 else os.geteuid()
        runtime = cell.discover()
        ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            if alone:
                command = cell.interpreter(runtime, str(inside.parent), its.fileno())
                environment = {**policy.ENVIRONMENT, "HOME": "/", "TMPDIR": "/"}
            else:
                command, environment = cell.bubblewrap(runtime, models, inside, its.fileno()), {}
            self._process = subprocess.Popen(  # noqa: S603
                command, env=environment, pass_fds=[its.fileno()], stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd="/",
            )  # fmt: skip
        assert self._process.stderr is not None
        self._errors = self._process.stderr
        self.control = ours
        try:
            self._configure(self._configuration(runtime, models))
        except BaseException:
            self.close()
            raise

    def _configuration(self, runtime: cell.Runtime, models: Path) -> dict[str, Any]:
        models_inside = str(models.resolve()) if self._alone else policy.MODELS
        read_write = [str(cell.NULL)] + ([] if self._alone else [policy.SCRATCH])
        rlimits = {k: v for k, v in policy.RLIMITS.items() if not (self._alone and k == "RLIMIT_NPROC")}
        scratch = {
            "scratch": policy.SCRATCH,
            "scratch_bytes": policy.SCRATCH_BYTES,
            "scratch_inodes": policy.SCRATCH_INODES,
        }
        return {
            "user": policy.NOBODY if os.geteuid() == 0 else None,
            "preload": policy.PRELOAD,
            "models": models_inside,
            "namespaces": None if self._alone else scratch,
            "directory": "/" if self._alone else policy.SCRATCH,
            "rlimits": rlimits,
            "landlock": {
                "read": [str(path) for path in runtime.readable] + [models_inside],
                "read_write": read_write,
                "abi_min": policy.LANDLOCK_ABI_MIN_ALONE if self._alone else policy.LANDLOCK_ABI_MIN,
            },
            "filter": base64.b64encode(seccomp.build(None if self._alone else 1)).decode(),
        }

    def _configure(self, configuration: dict[str, Any]) -> None:
        self.control.settimeout(START_S_MAX)
        try:
            self.control.send(json.dumps(configuration).encode())
            message, descriptors, _, _ = socket.recv_fds(self.control, PACKET_BYTES_MAX, 1)
        except OSError as error:
            raise JailFault(f"The zygote did not start: {error}; {self._complaint()}") from error
        if message != b"ready" or len(descriptors) != 1:
            raise JailFault(f"The zygote did not start: {self._complaint()}")
        self.pidfd = descriptors[0]
        pid = attest.pid_of(self.pidfd)
        self.pid = pid
        if not self._alone:
            self._namespaces = attest.namespaces(pid)

    def _complaint(self) -> str:
        """The last line that bubblewrap or the zygote wrote before it gave up."""
        self._process.kill()
        stderr = self._errors.read()
        lines = stderr.decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else "it said nothing"

    def alive(self) -> bool:
        """Is it still there?"""
        return self._process.poll() is None

    def child(self) -> Child:
        """A new child, locked down and attested.

        Raises:
            JailFault: it could not be made, or lacks a lock.
        """
        (job_in, job), (stdout, out), (stderr, err), (results, res) = (os.pipe() for _ in range(4))
        status, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            socket.send_fds(self.control, [b"child"], [job_in, out, err, res, its.fileno()])
        except OSError as error:
            for descriptor in (job, stdout, stderr, results):
                os.close(descriptor)
            status.close()
            raise JailFault(f"The zygote is gone: {error}") from error
        finally:
            its.close()
            for descriptor in (job_in, out, err, res):
                os.close(descriptor)
        child = Child(-1, -1, job, stdout, stderr, results, status, self)
        self.children += 1
        self.made += 1
        try:
            self._greet(child)
        except BaseException:
            if child.pidfd >= 0:
                child.kill()
            else:
                child.pidfd = os.open(cell.NULL, os.O_RDONLY)  # so that there is something to close
            child.close()
            raise
        return child

    def _greet(self, child: Child) -> None:
        child.status.settimeout(CHILD_S_MAX)
        try:
            message, descriptors, _, _ = socket.recv_fds(child.status, PACKET_BYTES_MAX, 1)
            if message != b"child" or len(descriptors) != 1:
                raise JailFault(f"The zygote made no child: {message.decode(errors='replace') or 'it is gone'}")
            child.pidfd = descriptors[0]
            probed = json.loads(self._first_line(child))
        except (OSError, ValueError) as error:
            raise JailFault(f"The zygote made no child: {error}") from error
        child.pid = attest.pid_of(child.pidfd)
        attest.check(child.pid, probed, self._namespaces, self.uid)
        for descriptor in (child.job, child.stdout, child.stderr, child.results):
            os.set_blocking(descriptor, False)

    def _first_line(self, child: Child) -> bytes:
        line, deadline = b"", time.monotonic() + CHILD_S_MAX
        while not line.endswith(b"\n"):
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([child.results], [], [], left)[0]:
                raise JailFault("A child of the jail did not lock itself down in time.")
            read = os.read(child.results, PACKET_BYTES_MAX)
            if not read:
                complaint = os.read(child.stderr, PACKET_BYTES_MAX).decode(errors="replace")
                raise JailFault(f"A child of the jail did not lock itself down: {complaint}")
            line += read
        return line

    def close(self) -> None:
        """End the zygote and every process in its cell."""
        self.control.close()
        self._process.kill()
        self._process.wait()
        self._errors.close()
        pidfd = getattr(self, "pidfd", -1)
        if pidfd >= 0:
            select.select([pidfd], [], [], CHILD_S_MAX)
            os.close(pidfd)
            self.pidfd = -1


def lower(child: Child, memory_bytes: int, cpu_s: int) -> None:
    """Have the keeper set this job's own limits on a waiting child.

    Raises:
        JailFault: it does not, or is gone.
    """
    limits = {
        "RLIMIT_DATA": memory_bytes,
        "RLIMIT_AS": memory_bytes + policy.ADDRESS_SPACE_EXTRA,
        "RLIMIT_CPU": cpu_s + policy.CPU_BACKSTOP_S,
    }
    try:
        child.status.send(json.dumps(limits).encode())
        answer = child.status.recv(PACKET_BYTES_MAX)
    except OSError as error:
        raise JailFault(f"The limits of a child cannot be set: {error}") from error
    if answer != b"limited":
        raise JailFault(f"The limits of a child cannot be set: {answer.decode(errors='replace')}")
