"""Gives one child namespaces, mounts and capabilities of its own: no other process, no network, no privilege."""

import ctypes
import os
from collections.abc import Sequence
from pathlib import Path

from .kernel import PR_CAP_AMBIENT, PR_CAPBSET_DROP, PR_SET_PDEATHSIG, build_error, libc, prctl

NEWNS, NEWUTS, NEWIPC, NEWUSER, NEWPID, NEWNET = 0x20000, 0x04000000, 0x08000000, 0x10000000, 0x20000000, 0x40000000
RDONLY, NOSUID, NODEV, NOEXEC, BIND, REC, PRIVATE = 1, 2, 4, 8, 0x1000, 0x4000, 0x40000
CAPABILITY_VERSION_3 = 0x20080522
CAP_AMBIENT_CLEAR_ALL = 4
SIGKILL = 9


def enter(scratch: str, size: int, inodes: int, hidden: Sequence[str]) -> None:
    """Enter new user, pid, mount, network, IPC and UTS namespaces. The scratch directory and /proc are empty, and the
    files `hidden` read as /dev/null. The pid namespace begins with the next fork."""
    uid, gid = os.getuid(), os.getgid()
    # When memory is short the kernel must end this process, never the zygote.
    Path("/proc/self/oom_score_adj").write_text("1000")
    if libc.unshare(NEWUSER | NEWPID | NEWNS | NEWNET | NEWIPC | NEWUTS):
        raise build_error("unshare")
    Path("/proc/self/setgroups").write_text("deny")
    Path("/proc/self/uid_map").write_text(f"{uid} {uid} 1")
    Path("/proc/self/gid_map").write_text(f"{gid} {gid} 1")
    _mount(None, "/", None, REC | PRIVATE, "")
    _mount("tmpfs", scratch, "tmpfs", NOSUID | NODEV | NOEXEC, f"size={size},nr_inodes={inodes},mode=0700")
    _mount("tmpfs", "/proc", "tmpfs", RDONLY | NOSUID | NODEV | NOEXEC, "size=4k,nr_inodes=2")
    for path in hidden:
        _mount("/dev/null", path, None, BIND, "")


def begin() -> None:
    """Set up pid 1: it dies with its parent, and its session has no terminal."""
    if prctl(PR_SET_PDEATHSIG, SIGKILL):
        raise build_error("PDEATHSIG")
    os.setsid()


def drop_capabilities() -> None:
    """Empty every capability set; the bounding set first, as dropping it needs a capability."""
    for capability in range(64):
        if prctl(PR_CAPBSET_DROP, capability):
            break
    prctl(PR_CAP_AMBIENT, CAP_AMBIENT_CLEAR_ALL)
    header = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION_3, 0)
    if libc.capset(header, (ctypes.c_uint32 * 6)()):
        raise build_error("capset")


def _mount(source: str | None, target: str, kind: str | None, flags: int, options: str) -> None:
    texts = [text.encode() if text is not None else None for text in (source, target, kind)]
    if libc.mount(*texts, ctypes.c_ulong(flags), options.encode()):
        raise build_error(f"mount {target}")
