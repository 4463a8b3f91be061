"""Makes system calls that Python does not offer, through the C library."""

import ctypes
import os
import platform

libc = ctypes.CDLL(None, use_errno=True)

# The same number on every architecture.
LANDLOCK_CREATE_RULESET, LANDLOCK_ADD_RULE, LANDLOCK_RESTRICT_SELF = 444, 445, 446
SECCOMP = {"x86_64": 317, "aarch64": 277}.get(platform.machine(), -1)

PR_SET_PDEATHSIG, PR_SET_DUMPABLE, PR_CAPBSET_DROP, PR_SET_NO_NEW_PRIVS, PR_CAP_AMBIENT = 1, 4, 24, 38, 47


def build_error(what: str) -> OSError:
    """Return the error of the last call; `what` names the attempt."""
    number = ctypes.get_errno()
    return OSError(number, f"{what}: {os.strerror(number)}")


def prctl(option: int, *values: int) -> int:
    """Return the result of prctl(2), -1 on error."""
    return int(libc.prctl(option, *[ctypes.c_ulong(value) for value in (*values, 0, 0, 0, 0)[:4]]))


def syscall(number: int, *values: object) -> int:
    """Return the result of a system call by number, -1 on error."""
    libc.syscall.restype = ctypes.c_long
    return int(libc.syscall(ctypes.c_long(number), *values))
