"""A single-use child of the zygote, as the supervisor holds it: descriptors, limits, the kill."""

import contextlib
import json
import os
import select
import signal
import socket
from dataclasses import dataclass
from typing import Protocol

from grader.errors import JailFault
from grader.sandbox import policy
from grader.sandbox.cgroup import Group

PACKET_BYTES_MAX = 1 << 16


class Parent(Protocol):
    """What a child knows of its zygote."""

    children: "set[Child]"

    def alive(self) -> bool:
        """Is it still there?"""


@dataclass(eq=False)
class Child:
    """A process that is locked down and waits for its one job; -1 stands for a descriptor that is closed."""

    zygote: Parent
    job: int
    stdout: int
    stderr: int
    results: int
    status: socket.socket
    pidfd: int = -1
    pid: int = -1
    group: Group | None = None

    @classmethod
    def open(cls, zygote: Parent) -> "tuple[Child, list[int]]":
        """The pipes of a child to be: our ends, and its own in the order in which the zygote wants them."""
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
        """Has it not ended yet?"""
        return self.zygote.alive() and not select.select([self.pidfd], [], [], 0)[0]

    def limit(self, memory_bytes: int, cpu_s: int) -> None:
        """Have its keeper set this job's own limits, while it waits.

        Raises:
            JailFault: the keeper does not, or is gone.
        """
        limits = {
            "RLIMIT_DATA": memory_bytes,
            "RLIMIT_AS": memory_bytes + policy.ADDRESS_SPACE_EXTRA,
            "RLIMIT_CPU": cpu_s + policy.CPU_BACKSTOP_S,
        }
        try:
            if self.group is not None:
                self.group.limit(memory_bytes)
            self.status.send(json.dumps(limits).encode())
            answer = self.status.recv(PACKET_BYTES_MAX)
        except OSError as error:
            raise JailFault(f"The limits of a child cannot be set: {error}") from error
        if answer != b"limited":
            raise JailFault(f"The limits of a child cannot be set: {answer.decode(errors='replace')}")

    def kill(self) -> None:
        """End it, and with it all that is in its pid namespace."""
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self.pidfd, signal.SIGKILL)

    def hang_up(self) -> None:
        """Close the way in: the job is all there."""
        if self.job >= 0:
            os.close(self.job)
            self.job = -1

    def close(self) -> None:
        """End it if need be, and let go of everything."""
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
