"""Controls the zygote and its children from the supervisor: starts the cell, requests children, ends both."""

import base64
import contextlib
import json
import math
import os
import select
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from grader.errors import JailFault
from grader.sandbox import policy
from grader.sandbox.locks import attest, cell, seccomp
from grader.sandbox.locks.cgroup import Group

PACKET_BYTES_MAX = 1 << 16
START_S_MAX = 60.0
CHILD_S_MAX = 20.0


@dataclass(eq=False)
class Child:
    """A single-use child, locked down and waiting for its job; -1 is a closed descriptor."""

    zygote: "Zygote"
    job: int
    stdout: int
    stderr: int
    results: int
    status: socket.socket
    pidfd: int = -1
    pid: int = -1
    group: Group | None = None

    @classmethod
    def open(cls, zygote: "Zygote") -> "tuple[Child, list[int]]":
        """Make the pipes of a new child: our ends, and the child's in the order in which the zygote expects them."""
        with contextlib.ExitStack() as on_error:
            pipes = []
            for _ in range(4):
                pipe = os.pipe()
                on_error.callback(os.close, pipe[0])
                on_error.callback(os.close, pipe[1])
                pipes.append(pipe)
            (its_job, job), (stdout, its_out), (stderr, its_err), (results, its_results) = pipes
            status, its_status = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            on_error.pop_all()
        child = cls(zygote, job, stdout, stderr, results, status)
        return child, [its_job, its_out, its_err, its_results, its_status.detach()]

    def alive(self) -> bool:
        """Whether the child still runs."""
        return self.zygote.alive() and not select.select([self.pidfd], [], [], 0)[0]

    def limit(self, memory_bytes: int, cpu_s: float) -> None:
        """Let the keeper set the resource limits of the job. Raises JailFault if the keeper does not, or is gone."""
        limits = {
            "RLIMIT_DATA": memory_bytes,
            "RLIMIT_AS": memory_bytes + policy.ADDRESS_SPACE_EXTRA,
            "RLIMIT_CPU": math.ceil(cpu_s * policy.CPU_BACKSTOP_FACTOR) + policy.CPU_BACKSTOP_S,
        }
        try:
            if self.group is not None:
                self.group.limit(memory_bytes)
            self.status.send(json.dumps({"limits": limits}).encode())
            answer = self.status.recv(PACKET_BYTES_MAX)
        except OSError as error:
            raise JailFault(f"The limits of a child cannot be set: {error}") from error
        if answer != b"limited":
            raise JailFault(f"The limits of a child cannot be set: {answer.decode(errors='replace')}")

    def ask_for_removal(self) -> None:
        """Ask its keeper to remove MuJoCo's integrators; the answer, b"removed", comes on `status`. Raises OSError if
        the keeper is gone."""
        self.status.send(json.dumps({"remove": "integrators"}).encode())

    def kill(self) -> None:
        """End it, and every process in its pid namespace."""
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self.pidfd, signal.SIGKILL)

    def hang_up(self) -> None:
        """Close the job's channel, after the whole job has been written."""
        if self.job >= 0:
            os.close(self.job)
            self.job = -1

    def close(self) -> None:
        """End the child if it still runs, and release its resources."""
        if self not in self.zygote.children:
            return
        self.zygote.children.discard(self)
        if self.pidfd >= 0:
            self.kill()
            os.close(self.pidfd)
        self.hang_up()
        for descriptor in (self.stdout, self.stderr, self.results):
            os.close(descriptor)
        self.status.close()
        if self.group is not None:
            self.group.remove()


class Zygote:
    """One warm process in its cell. The thread that starts it must also use and end it, and live as long: bubblewrap's
    --die-with-parent follows the thread. `alone` leaves out the cell and the namespaces (tier T2). `group` makes a
    cgroup for a child, where delegated. `codes` are code objects that it
    loads for the drivers of jobs. `keeps_integrators` says why MuJoCo's integrators cannot be removed from a
    child here; it is empty where they can. Raises JailFault if it does not start."""

    def __init__(
        self,
        models: Path,
        inside: Path = cell.INSIDE,
        *,
        alone: bool = False,
        group: Callable[[int], Group] | None = None,
        codes: Sequence[bytes] = (),
    ) -> None:
        self.children: set[Child] = set()
        self.made = 0
        self._alone, self._group = alone, group
        self._namespaces: dict[str, str] | None = None
        self._uid = policy.NOBODY if os.geteuid() == 0 else os.geteuid()
        self._pidfd = -1
        runtime = cell.find_runtime()
        configuration = json.dumps(self._configuration(runtime, models) | {"codes": len(codes)}).encode()
        self._control, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            try:
                self._process = self._start(runtime, models, inside, its.fileno())
            except BaseException:
                self._control.close()
                raise
        try:
            self._greet([configuration, *codes])
        except BaseException:
            self.close()
            raise

    def _start(self, runtime: cell.Runtime, models: Path, inside: Path, control: int) -> subprocess.Popen[bytes]:
        if self._alone:
            command = cell.build_zygote_command(runtime, str(inside.parent), control)
            environment = {**policy.ENVIRONMENT, "HOME": "/", "TMPDIR": "/"}
        else:
            # The cell's own environment is in the command: bubblewrap's pid 1 shows what it was started with.
            command, environment = cell.build_cell_command(runtime, models, inside, control), {}
        return subprocess.Popen(  # noqa: S603
            command,
            env=environment,
            pass_fds=[control],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            cwd="/",
        )

    def _configuration(self, runtime: cell.Runtime, models: Path) -> dict[str, Any]:
        """Returns the zygote's configuration, as inside/zygote.py reads it."""
        models_inside = str(models.resolve()) if self._alone else policy.MODELS
        scratch = {"scratch": policy.SCRATCH, "size": policy.SCRATCH_BYTES, "inodes": policy.SCRATCH_INODES}
        # Without a user namespace of its own, NPROC would count all processes of the user.
        without = {"RLIMIT_NPROC"} if self._alone else set()
        return {
            "user": policy.NOBODY if os.geteuid() == 0 else None,
            "preload": policy.PRELOAD,
            "packages": policy.PACKAGES,
            "others_beside": [*map(str, runtime.packages)] if self._alone else [],
            "thread_stack": policy.THREAD_STACK_BYTES,
            "models": models_inside,
            "directory": "/" if self._alone else policy.SCRATCH,
            "namespaces": None if self._alone else scratch,
            "rlimits": {name: value for name, value in policy.RLIMITS.items() if name not in without},
            "landlock": {
                # In the cell mounts hide what scripts may not read. Alone, Landlock must name all the rest.
                "read": [*map(str, runtime.readable if self._alone else runtime.roots), models_inside],
                "read_write": [str(cell.NULL), *([] if self._alone else [policy.SCRATCH])],
                "abi_min": policy.LANDLOCK_ABI_MIN_ALONE if self._alone else policy.LANDLOCK_ABI_MIN,
            },
            "filter": base64.b64encode(seccomp.build_filter(None if self._alone else 1)).decode(),
        }

    def _greet(self, packets: Sequence[bytes]) -> None:
        self._control.settimeout(START_S_MAX)
        try:
            for packet in packets:
                self._control.send(packet)
            message, descriptors, _, _ = socket.recv_fds(self._control, PACKET_BYTES_MAX, 1)
        except OSError as error:
            raise JailFault(f"The zygote did not start ({error}): {self._complaint()}") from error
        if not message or len(descriptors) != 1:
            raise JailFault(f"The zygote did not start: {self._complaint()}")
        self.keeps_integrators = str(json.loads(message)["keeps_integrators"])
        self._pidfd = descriptors[0]
        if not self._alone:
            self._namespaces = attest.read_namespaces(attest.find_pid(self._pidfd))

    def _complaint(self) -> str:
        """Returns the last line that bubblewrap or the zygote wrote before it ended."""
        self._process.kill()
        assert self._process.stderr is not None
        return _read_last_line(self._process.stderr.read())

    @property
    def pid(self) -> int:
        """Its process id in our own pid namespace."""
        return attest.find_pid(self._pidfd)

    def alive(self) -> bool:
        """Whether it still runs."""
        return self._process.poll() is None

    def child(self) -> Child:
        """Make a child, locked down and attested. Raises JailFault if the child cannot be made, or lacks a lock."""
        child, its = Child.open(self)
        self.made += 1
        self.children.add(child)
        try:
            try:
                socket.send_fds(self._control, [b"child"], its)
            finally:
                for descriptor in its:
                    os.close(descriptor)
            self._meet(child)
        except (OSError, ValueError) as error:
            child.close()
            raise JailFault(f"The zygote made no child: {error}") from error
        except BaseException:
            child.close()
            raise
        return child

    def _meet(self, child: Child) -> None:
        child.status.settimeout(CHILD_S_MAX)
        message, descriptors, _, _ = socket.recv_fds(child.status, PACKET_BYTES_MAX, 1)
        if message != b"child" or len(descriptors) != 1:
            raise JailFault(f"The zygote made no child: {message.decode(errors='replace') or 'it has ended'}")
        child.pidfd = descriptors[0]
        probed = json.loads(_read_first_line(child))
        child.pid = attest.find_pid(child.pidfd)
        attest.check_locks(child.pid, probed, self._namespaces, self._uid)
        if self._group is not None:
            child.group = self._group(child.pid)
        for descriptor in (child.job, child.stdout, child.stderr, child.results):
            os.set_blocking(descriptor, False)

    def close(self) -> None:
        """End the zygote and every process in its cell."""
        self._control.close()
        self._process.kill()
        self._process.wait()
        assert self._process.stderr is not None
        self._process.stderr.close()
        if self._pidfd >= 0:
            select.select([self._pidfd], [], [], CHILD_S_MAX)
            os.close(self._pidfd)
            self._pidfd = -1


def _read_first_line(child: Child) -> bytes:
    line, deadline = b"", time.monotonic() + CHILD_S_MAX
    while not line.endswith(b"\n"):
        left = deadline - time.monotonic()
        if left <= 0 or not select.select([child.results], [], [], left)[0]:
            raise JailFault("A child of the jail did not lock itself down in time.")
        read = os.read(child.results, PACKET_BYTES_MAX)
        if not read:
            complaint = _read_last_line(os.read(child.stderr, PACKET_BYTES_MAX))
            raise JailFault(f"A child of the jail did not lock itself down: {complaint}")
        line += read
    return line


def _read_last_line(written: bytes) -> str:
    """Returns the last line that a process wrote; of a traceback it is the error."""
    lines = written.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else "no message"
