"""The warm process of the cell: imports MuJoCo once, holds no secret, never runs a student's code, forks children.

Control messages (one packet each, on the socket whose number is `argv[1]`):
    in   the configuration, once, as JSON;  then per child any byte with five descriptors:
         job, stdout, stderr, results, status
    out  "ready" with a pidfd of this process
On a child's status socket: out "child" with its pidfd; in its job's own resource limits as JSON, or nothing when it
is no longer needed; out "limited"; and when the child has died, out [wait status, CPU seconds, peak KiB].
"""

import base64
import contextlib
import ctypes
import fcntl
import gc
import importlib
import json
import os
import resource
import signal
import socket
import sys
import traceback
from typing import Any

from . import guest, lockdown, namespaces
from .kernel import PR_SET_DUMPABLE, libc, prctl

PACKET_BYTES_MAX = 1 << 18
STDIO_UNBUFFERED = 2
THREAD_ATTRIBUTES_BYTES = 256  # more than sizeof(pthread_attr_t) anywhere
ABOVE_ALL_TARGETS = 100


def main() -> None:
    """Warm up, then serve until the control socket closes."""
    control = socket.socket(fileno=int(sys.argv[1]))
    config = json.loads(control.recv(PACKET_BYTES_MAX))
    _become(config["user"])
    for name in config["preload"]:
        with contextlib.suppress(ImportError):  # the viewer, say, where there is no graphics library to bind to
            importlib.import_module(name)
    guest.prepare(config["models"], config["directory"])
    _quiet_mujoco()
    _unbuffer_c_stdio()
    _shrink_thread_stacks(config["thread_stack"])
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    gc.collect()
    gc.freeze()
    config["filter"] = base64.b64decode(config["filter"])
    myself = os.pidfd_open(os.getpid())
    socket.send_fds(control, [b"ready"], [myself])
    os.close(myself)
    while True:
        message, descriptors, _, _ = socket.recv_fds(control, 16, 5)
        if not message:
            os._exit(0)
        if os.fork() == 0:
            _keep(config, control, descriptors)
        for descriptor in descriptors:
            os.close(descriptor)


def _become(user: int | None) -> None:
    """From root to nobody, before anything is imported; dumpable again, as /proc/self/uid_map must be ours."""
    if user is None:
        return
    os.setgroups([])
    os.setresgid(user, user, user)
    os.setresuid(user, user, user)
    prctl(PR_SET_DUMPABLE, 1)


def _quiet_mujoco() -> None:
    """No text for each warning, in no file either: an honest scan over unstable timesteps raises thousands."""
    mujoco: Any = sys.modules["mujoco"]
    log = mujoco.MjLogConfig.get()
    log.logto_console = log.logto_file = False
    log.set()


def _unbuffer_c_stdio() -> None:
    """What MuJoCo prints from C must not be lost when the child is killed."""
    for name in ("stdout", "stderr"):
        libc.setvbuf(ctypes.c_void_p.in_dll(libc, name), None, STDIO_UNBUFFERED, 0)


def _shrink_thread_stacks(size: int) -> None:
    """The default of every thread to come; the interpreter took its own from RLIMIT_STACK when it started."""
    attributes = ctypes.create_string_buffer(THREAD_ATTRIBUTES_BYTES)
    libc.pthread_attr_init(attributes)
    libc.pthread_attr_setstacksize(attributes, ctypes.c_size_t(size))
    if libc.pthread_setattr_default_np(attributes):
        raise OSError("the size of thread stacks cannot be set")
    libc.pthread_attr_destroy(attributes)


def _keep(config: dict[str, Any], control: socket.socket, descriptors: list[int]) -> None:
    """In the keeper: enter the namespaces, fork the child as their pid 1, wait for it, tell how it ended."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    control.close()
    status = socket.socket(fileno=descriptors.pop())
    try:
        if config["namespaces"]:
            namespaces.enter(**config["namespaces"])
        child = os.fork()
        if child == 0:
            status.close()
            _child(config, descriptors)
        for descriptor in descriptors:
            os.close(descriptor)
        handle = os.pidfd_open(child)
        socket.send_fds(status, [b"child"], [handle])
        _limit(child, status)
        _, ended, usage = os.wait4(child, 0)
        status.send(json.dumps([ended, usage.ru_utime + usage.ru_stime, usage.ru_maxrss]).encode())
    except BaseException as error:
        status.send(f"fault {error!r}"[:2000].encode())
    os._exit(0)


def _limit(child: int, status: socket.socket) -> None:
    """Set the job's own limits on the waiting child: only this process may, being of its user and above it."""
    message = status.recv(PACKET_BYTES_MAX)
    if not message:
        os.kill(child, signal.SIGKILL)
        return
    for name, value in json.loads(message).items():
        resource.prlimit(child, getattr(resource, name), (value, value))
    status.send(b"limited")


def _child(config: dict[str, Any], descriptors: list[int]) -> None:
    """In the child: every lock, then the word that it is ready, then the job. Never returns."""
    try:
        # First out of the way of the targets, then onto them.
        high = [fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, ABOVE_ALL_TARGETS) for descriptor in descriptors]
        for descriptor, target in zip(high, (guest.JOB, guest.STDOUT, guest.STDERR, guest.RESULTS), strict=True):
            os.dup2(descriptor, target)
        os.closerange(guest.JOB + 1, 1 << 16)
        namespaces.begin()
        if config["namespaces"]:
            namespaces.drop_capabilities()
        os.chdir(config["directory"])
        guest.reseed()
        lockdown.limit(config["rlimits"])
        lockdown.no_new_privileges()
        lockdown.landlock(**config["landlock"])
        lockdown.seccomp(config["filter"])
        guest.say_ready(lockdown.probe(__file__))
        work = guest.read_job()
    except BaseException:
        os.write(guest.STDERR, traceback.format_exc()[-2000:].encode())
        os._exit(111)
    guest.play(work)
