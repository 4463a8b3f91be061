"""The locks that a child puts on itself, in this order: limits, no new privileges, Landlock, seccomp."""

import _ctypes
import ctypes
import mmap
import os
import re
import resource
import select
import stat
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .kernel import (
    LANDLOCK_ADD_RULE,
    LANDLOCK_CREATE_RULESET,
    LANDLOCK_RESTRICT_SELF,
    PR_SET_DUMPABLE,
    PR_SET_NO_NEW_PRIVS,
    SECCOMP,
    build_error,
    libc,
    prctl,
    syscall,
)

# include/uapi/linux/landlock.h
LANDLOCK_VERSION_FLAG, LANDLOCK_RULE_PATH_BENEATH = 1, 1
WRITE_FILE, READ_FILE, READ_DIR = 1 << 1, 1 << 2, 1 << 3
REMOVE_DIR, REMOVE_FILE, MAKE_DIR, MAKE_REG, TRUNCATE = 1 << 4, 1 << 5, 1 << 7, 1 << 8, 1 << 14
READ = READ_FILE | READ_DIR
# Plain files and directories only: no sockets, FIFOs, devices or links, and nothing is executed.
READ_WRITE = READ | WRITE_FILE | REMOVE_DIR | REMOVE_FILE | MAKE_DIR | MAKE_REG | TRUNCATE
ON_FILES = READ_FILE | WRITE_FILE | TRUNCATE
NET_BIND_AND_CONNECT_TCP = 3
SCOPE_ABSTRACT_SOCKETS_AND_SIGNALS = 3


def set_limits(rlimits: Mapping[str, int]) -> None:
    """Set soft and hard resource limits, by their names in `resource`."""
    for name, value in rlimits.items():
        resource.setrlimit(getattr(resource, name), (value, value))


def drop_privileges() -> None:
    """Give up set-user-id programs, and deny other processes of the user access to this one."""
    if prctl(PR_SET_NO_NEW_PRIVS, 1):
        raise build_error("NO_NEW_PRIVS")
    if prctl(PR_SET_DUMPABLE, 0):
        raise build_error("DUMPABLE")


def load_landlock(read: Sequence[str], read_write: Sequence[str], abi_min: int) -> None:
    """Restrict this process to the paths `read` and `read_write`; refuse TCP, abstract sockets and signals to others.
    Raises OSError if this kernel's Landlock is missing or older than `abi_min`."""
    abi = syscall(LANDLOCK_CREATE_RULESET, None, ctypes.c_size_t(0), LANDLOCK_VERSION_FLAG)
    if abi < max(abi_min, 1):
        raise OSError(f"Landlock ABI {abi}, at least {abi_min} is needed")
    handled = _read_handled_access(abi)
    attributes = struct.pack("=QQQ", handled, NET_BIND_AND_CONNECT_TCP, SCOPE_ABSTRACT_SOCKETS_AND_SIGNALS)
    size = 8 if abi < 4 else 16 if abi < 6 else 24
    ruleset = syscall(LANDLOCK_CREATE_RULESET, attributes[:size], ctypes.c_size_t(size), 0)
    if ruleset < 0:
        raise build_error("landlock_create_ruleset")
    for paths, rights in ((read, READ), (read_write, READ_WRITE)):
        for path in paths:
            _allow(ruleset, path, rights & handled)
    if syscall(LANDLOCK_RESTRICT_SELF, ruleset, 0):
        raise build_error("landlock_restrict_self")
    os.close(ruleset)


def load_seccomp(program: bytes) -> None:
    """Load the filter on every thread. It comes last, as it forbids the calls of the other locks."""

    class Program(ctypes.Structure):
        _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_char_p))

    set_mode_filter, tsync = 1, 1
    loaded = Program(len(program) // 8, program)
    if syscall(SECCOMP, set_mode_filter, tsync, ctypes.byref(loaded)):
        raise build_error("seccomp")


def probe_locks(outside: str) -> dict[str, Any]:
    """Check what cannot be seen from outside: whether Landlock holds, and which descriptors are open."""
    try:
        os.close(os.open(outside, os.O_RDONLY))
        reads_outside = True
    except PermissionError:
        reads_outside = False
    everything = range(resource.getrlimit(resource.RLIMIT_NOFILE)[0])
    poll = select.poll()
    for descriptor in everything:
        poll.register(descriptor, 0)
    closed = {descriptor for descriptor, event in poll.poll(0) if event & select.POLLNVAL}
    return {"reads_outside": reads_outside, "descriptors": [d for d in everything if d not in closed]}


def forbid_writable_code() -> bool:
    """Make writable and executable memory read-only, here and in every child; return False if there is none. libffi
    keeps such memory for callbacks from C, unless it was built with static trampolines. Its free part is used up first,
    so that a later request for a callback fails and does not write to it."""
    found = re.findall(r"^(\w+)-(\w+) rwx", Path("/proc/self/maps").read_text(), re.M)
    if not found:
        return False
    allocate, code = ctypes.CDLL(_ctypes.__file__).ffi_closure_alloc, ctypes.c_void_p()
    allocate.restype, allocate.argtypes = ctypes.c_void_p, [ctypes.c_size_t, ctypes.c_void_p]
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (1, hard))  # libffi cannot ask for more
    try:
        while allocate(1, ctypes.addressof(code)):
            pass
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    for low, high in ((int(low, 16), int(high, 16)) for low, high in found):
        if libc.mprotect(ctypes.c_void_p(low), ctypes.c_size_t(high - low), mmap.PROT_READ | mmap.PROT_EXEC):
            raise build_error("mprotect")
    return True


def _read_handled_access(abi: int) -> int:
    bits = 13 if abi < 2 else 14 if abi < 3 else 15 if abi < 5 else 16
    return int((1 << bits) - 1)


def _allow(ruleset: int, path: str, rights: int) -> None:
    handle = os.open(path, os.O_PATH | os.O_CLOEXEC)
    if not stat.S_ISDIR(os.fstat(handle).st_mode):
        rights &= ON_FILES
    if syscall(LANDLOCK_ADD_RULE, ruleset, LANDLOCK_RULE_PATH_BENEATH, struct.pack("=Qi", rights, handle), 0):
        raise build_error(f"landlock_add_rule {path}")
    os.close(handle)
