"""Compiles the policy into a kernel filter, once, on the trusted side; every child loads it."""

import errno
import mmap
import os
from collections.abc import Callable
from functools import cache
from typing import Any

from grader.errors import JailRefused
from grader.sandbox.policy import ALLOWED, FCNTL_COMMANDS, KILLED, PR_SET_NAME, REFUSED

CLONE_VM, CLONE_SIGHAND, CLONE_THREAD = 0x100, 0x800, 0x10000
A_THREAD = CLONE_VM | CLONE_SIGHAND | CLONE_THREAD
# NEWNS, NEWCGROUP, NEWUTS, NEWIPC, NEWUSER, NEWPID, NEWNET, NEWTIME
NEW_NAMESPACES = 0x20000 | 0x02000000 | 0x04000000 | 0x08000000 | 0x10000000 | 0x20000000 | 0x40000000 | 0x80


# linux/mman.h
SHARED, PRIVATE, KIND, ANONYMOUS, GROWS_DOWN = 0x01, 0x02, 0x0F, 0x20, 0x100
WRITE, EXECUTE = mmap.PROT_WRITE, mmap.PROT_EXEC


@cache
def build_filter(own_pid: int | None = 1) -> bytes:
    """Compile the filter to BPF. `own_pid`: the one process that tgkill (raise, abort) may reach, or None. Raises
    JailRefused if libseccomp is missing."""
    try:
        import pyseccomp as sc  # forks helpers when imported: never inside the cell
    except (ImportError, RuntimeError) as error:
        raise JailRefused(f"libseccomp is not installed: {error}") from error

    eperm, enosys, enotty = (sc.ERRNO(number) for number in (errno.EPERM, errno.ENOSYS, errno.ENOTTY))
    rules = sc.SyscallFilter(enosys)
    rules.set_attr(sc.Attr.ACT_BADARCH, sc.KILL_PROCESS)  # int 0x80 and x32
    rules.set_attr(sc.Attr.CTL_NNP, 1)

    def add(action: int, name: str, *conditions: object) -> None:
        try:
            rules.add_rule(action, name, *conditions)
        except OSError as error:
            if error.errno != errno.EFAULT:  # a call that this machine or libseccomp does not know
                raise

    for names, action in ((ALLOWED, sc.ALLOW), (REFUSED, eperm), (KILLED, sc.KILL_PROCESS)):
        for name in names:
            add(action, name)
    for command in FCNTL_COMMANDS:
        add(sc.ALLOW, "fcntl", sc.Arg(1, sc.EQ, command))
    add(enotty, "ioctl")  # isatty() asks
    add(sc.ALLOW, "clone", sc.Arg(0, sc.MASKED_EQ, A_THREAD | NEW_NAMESPACES, A_THREAD))
    add(eperm, "clone", sc.Arg(0, sc.MASKED_EQ, CLONE_THREAD, 0))
    add(sc.ALLOW, "prlimit64", sc.Arg(2, sc.EQ, 0))  # reading only
    add(eperm, "prlimit64", sc.Arg(2, sc.NE, 0))
    add(sc.ALLOW, "prctl", sc.Arg(0, sc.EQ, PR_SET_NAME))
    add(eperm, "prctl", sc.Arg(0, sc.NE, PR_SET_NAME))
    if own_pid is None:
        add(eperm, "tgkill")
    else:
        add(sc.ALLOW, "tgkill", sc.Arg(0, sc.EQ, own_pid))
        add(eperm, "tgkill", sc.Arg(0, sc.NE, own_pid))
    _add_memory_rules(sc, add)
    return _export(rules)


def _add_memory_rules(sc: Any, add: Callable[..., None]) -> None:
    """Refuse machine code that a script has written, and memory that RLIMIT_DATA does not count. Executable memory must
    be a private, read-only mapping of a file, which is how libraries are loaded. RLIMIT_DATA counts neither shared
    anonymous memory (ENOMEM) nor stacks that grow (ENOSYS)."""
    eperm, enomem = sc.ERRNO(errno.EPERM), sc.ERRNO(errno.ENOMEM)

    def protection(mask: int, value: int) -> object:
        return sc.Arg(2, sc.MASKED_EQ, mask, value)

    def flags(mask: int, value: int) -> object:
        return sc.Arg(3, sc.MASKED_EQ, mask, value)

    of_file = KIND | ANONYMOUS | GROWS_DOWN
    add(sc.ALLOW, "mmap", protection(EXECUTE, 0), flags(KIND | GROWS_DOWN, PRIVATE))
    add(sc.ALLOW, "mmap", protection(EXECUTE, 0), flags(of_file, SHARED))
    add(enomem, "mmap", protection(EXECUTE, 0), flags(of_file, SHARED | ANONYMOUS))
    add(sc.ALLOW, "mmap", protection(EXECUTE | WRITE, EXECUTE), flags(of_file, PRIVATE))
    add(eperm, "mmap", protection(EXECUTE | WRITE, EXECUTE | WRITE))
    add(eperm, "mmap", protection(EXECUTE | WRITE, EXECUTE), flags(ANONYMOUS, ANONYMOUS))
    add(sc.ALLOW, "mprotect", protection(EXECUTE, 0))
    add(eperm, "mprotect", protection(EXECUTE, EXECUTE))


def _export(rules: object) -> bytes:
    """Returns the compiled program; pyseccomp 0.1.2 exports to a file only."""
    handle = os.memfd_create("filter")
    try:
        with open(handle, "w+b", closefd=False) as file:
            rules.export_bpf(file)  # type: ignore[attr-defined]
        return os.pread(handle, 1 << 20, 0)
    finally:
        os.close(handle)
