"""The warm process of the cell: imports MuJoCo once, holds no secret, never runs a student's code, forks children.

Control messages (one packet each, on the socket whose number is `argv[1]`):
    in   the configuration, once, as JSON;  then so many code objects as it says, as marshal writes them;
         then per child any byte with five descriptors: job, stdout, stderr, results, status
    out  JSON {"keeps_integrators": why they cannot be removed here, or ""} with a pidfd of this process
On a child's status socket, between the supervisor and the child's keeper:
    out  "child" with the child's pidfd
    in   {"limits": resource limits of its job}           out  "limited"
    in   {"remove": "integrators"}                        out  "removed"
    out  {"ended": wait status, "cpu_s": CPU time, "stepped": calls of removed integrators}, when the child has died
A keeper whose supervisor hangs up ends the child.
"""

import base64
import contextlib
import ctypes
import fcntl
import gc
import importlib
import json
import marshal
import os
import resource
import select
import signal
import socket
import struct
import sys
import traceback
from typing import Any

from . import guest, integrators, lockdown, namespaces, rehearsal
from .kernel import PR_SET_DUMPABLE, libc, prctl

PACKET_BYTES_MAX = 1 << 18
STDIO_UNBUFFERED = 2
THREAD_ATTRIBUTES_BYTES = 256  # more than sizeof(pthread_attr_t) anywhere
ABOVE_ALL_TARGETS = 100
BURY_S = 1.0  # so long an ended keeper may stay a zombie, where its signal came at a bad moment


def main() -> None:
    """Warm up, then serve until the control socket closes."""
    control = socket.socket(fileno=int(sys.argv[1]))
    config = json.loads(control.recv(PACKET_BYTES_MAX))
    config["filter"] = base64.b64decode(config["filter"])
    guest.CODES.extend(marshal.loads(control.recv(PACKET_BYTES_MAX)) for _ in range(config["codes"]))  # noqa: S302
    _become(config["user"])
    gc.disable()  # imports make hardly any garbage, and to look for it takes a tenth of their time
    _import(config["preload"])
    _forget_others(config["others_beside"], set(config["packages"]))
    guest.prepare(config["models"], config["directory"])
    if lockdown.forbid_writable_code():
        guest.refuse_callbacks()
    pages, why_not = _find_integrators()
    _quiet_mujoco()
    _unbuffer_c_stdio()
    _shrink_thread_stacks(config["thread_stack"])
    config["rehearsal"] = rehearsal.Rehearsal()
    signal.signal(signal.SIGCHLD, _bury)
    gc.collect()
    gc.freeze()
    gc.enable()
    myself = os.pidfd_open(os.getpid())
    socket.send_fds(control, [json.dumps({"keeps_integrators": why_not}).encode()], [myself])
    os.close(myself)
    control.settimeout(BURY_S)
    while True:
        try:
            message, descriptors, _, _ = socket.recv_fds(control, 16, 5)
        except TimeoutError:
            continue  # here Python handles a signal that came just before the wait, and so did not end it
        if not message:
            os._exit(0)
        if os.fork() == 0:
            _keep(config, control, descriptors, pages)
        for descriptor in descriptors:
            os.close(descriptor)


def _bury(_number: int, _frame: object) -> None:
    """Wait for keepers that have ended; if SIGCHLD were ignored, their CPU time would be counted nowhere."""
    with contextlib.suppress(ChildProcessError):  # none is left
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _import(names: list[str]) -> None:
    """Import what scripts use. Exits if MuJoCo cannot be imported."""
    for name in names:
        with contextlib.suppress(ImportError):  # such as the viewer, where no graphics library is installed
            importlib.import_module(name)
    if "mujoco" not in sys.modules:
        sys.exit(f"MuJoCo cannot be imported by user {os.getuid()}: let this user read the Python packages.")


def _forget_others(folders: list[str], packages: set[str]) -> None:
    """Let Python find only these packages in folders that hold others: where no mounts hide those, Landlock refuses to
    open what Python has found, and a script whose libraries try to import it would end."""
    for folder in folders:
        finder: Any = sys.path_importer_cache[folder]
        finder._path_cache &= packages  # what the folder was found to hold, which nobody may look up again


def _find_integrators() -> tuple[integrators.Pages | None, str]:
    """Return the pages that hold MuJoCo's integrators, or None and the reason."""
    try:
        return integrators.find_integrators(), ""
    except (integrators.IntegratorsUnavailable, OSError, ValueError, struct.error) as error:
        return None, str(error)


def _become(user: int | None) -> None:
    """Change from root to the user nobody, and stay dumpable, so that /proc/self/uid_map can be written."""
    if user is None:
        return
    os.setgroups([])
    os.setresgid(user, user, user)
    os.setresuid(user, user, user)
    prctl(PR_SET_DUMPABLE, 1)


def _quiet_mujoco() -> None:
    """Turn off the text and log file of warnings: an honest scan over unstable timesteps raises thousands. Turn off the
    wheel's profiling timer too, a callback with which small models step half as fast; `data.timer` reads 0."""
    mujoco: Any = sys.modules["mujoco"]
    mujoco.mj_resetCallbacks()
    log = mujoco.MjLogConfig.get()
    log.logto_console = log.logto_file = False
    log.set()


def _unbuffer_c_stdio() -> None:
    """Keep what MuJoCo prints from C from being lost when the child is killed."""
    for name in ("stdout", "stderr"):
        libc.setvbuf(ctypes.c_void_p.in_dll(libc, name), None, STDIO_UNBUFFERED, 0)


def _shrink_thread_stacks(size: int) -> None:
    """Set the default stack size of new threads; the interpreter took its own from RLIMIT_STACK when it started."""
    attributes = ctypes.create_string_buffer(THREAD_ATTRIBUTES_BYTES)
    libc.pthread_attr_init(attributes)
    libc.pthread_attr_setstacksize(attributes, ctypes.c_size_t(size))
    if libc.pthread_setattr_default_np(attributes):
        raise OSError("the size of thread stacks cannot be set")
    libc.pthread_attr_destroy(attributes)


def _keep(
    config: dict[str, Any], control: socket.socket, descriptors: list[int], pages: integrators.Pages | None
) -> None:
    """In the keeper: enter the namespaces, fork the child as pid 1, serve it until it dies, report how it ended."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    control.close()
    status = socket.socket(fileno=descriptors.pop())
    try:
        code = pages.open() if pages else None
        if config["namespaces"]:
            namespaces.enter(**config["namespaces"], hidden=[pages.library] if pages else [])
        child = os.fork()
        if child == 0:
            status.close()
            _child(config, descriptors, pages, code)
        for descriptor in descriptors:
            os.close(descriptor)
        handle = os.pidfd_open(child)
        socket.send_fds(status, [b"child"], [handle])
        _serve(status, child, handle, pages, code)
        _, ended, usage = os.wait4(child, 0)
        stepped = pages.count() if pages else 0
        last = {"ended": ended, "cpu_s": usage.ru_utime + usage.ru_stime, "stepped": stepped}
        status.send(json.dumps(last).encode())
    except BaseException as error:
        with contextlib.suppress(OSError):
            status.send(f"fault {error!r}"[:2000].encode())
    os._exit(0)


def _serve(
    status: socket.socket, child: int, handle: int, pages: integrators.Pages | None, code: tuple[int, int] | None
) -> None:
    """Do what the supervisor asks, until the child has died."""
    waiting: list[int | socket.socket] = [status, handle]
    while handle not in select.select(waiting, [], [])[0]:
        message = status.recv(PACKET_BYTES_MAX)
        if not message:
            os.kill(child, signal.SIGKILL)
            return
        asked = json.loads(message)
        if "limits" in asked:  # only this process may set them, being of the child's user and its parent
            for name, value in asked["limits"].items():
                resource.prlimit(child, getattr(resource, name), (value, value))
            status.send(b"limited")
        elif pages and code:
            pages.remove(code[0])
            status.send(b"removed")


def _child(
    config: dict[str, Any], descriptors: list[int], pages: integrators.Pages | None, code: tuple[int, int] | None
) -> None:
    """In the child: set every lock, report that it is ready, run the job. Never returns."""
    try:
        if pages and code:
            pages.lay_over(code[1])
        # Moved above the target numbers first, so that no descriptor is overwritten.
        high = [fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, ABOVE_ALL_TARGETS) for descriptor in descriptors]
        for descriptor, target in zip(high, (guest.JOB, guest.STDOUT, guest.STDERR, guest.RESULTS), strict=True):
            os.dup2(descriptor, target)
        os.closerange(guest.JOB + 1, 1 << 16)
        namespaces.begin()
        if config["namespaces"]:
            namespaces.drop_capabilities()
        os.chdir(config["directory"])
        guest.reseed()
        lockdown.set_limits(config["rlimits"])
        lockdown.drop_privileges()
        lockdown.load_landlock(**config["landlock"])
        lockdown.load_seccomp(config["filter"])
        guest.say_ready(lockdown.probe_locks(__file__))
        config["rehearsal"].run()
        work = guest.receive()
    except BaseException:
        os.write(guest.STDERR, traceback.format_exc()[-2000:].encode())
        os._exit(111)
    guest.play(work)
