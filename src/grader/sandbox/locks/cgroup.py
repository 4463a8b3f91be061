"""Limits memory and processes of one child where cgroup v2 has been delegated to this service (tier T0). Used only
where an administrator has delegated a cgroup, as systemd does with `Delegate=yes` and `DelegateSubgroup=`: the service
runs in a leaf whose parent it owns and which holds no process. Only children are ever moved."""

import contextlib
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from grader.sandbox.policy import CGROUP_MEMORY_EXTRA, THREADS_MAX

ROOT = Path("/sys/fs/cgroup")
CONTROLLERS = {"memory", "pids"}
GONE_S_MAX = 2.0
_numbers = count()


@dataclass(frozen=True)
class Group:
    """The cgroup of one child."""

    path: Path

    def limit(self, memory_bytes: int) -> None:
        """Set the job's memory limit, a little above the child's own RLIMIT_DATA."""
        (self.path / "memory.max").write_text(str(memory_bytes + CGROUP_MEMORY_EXTRA))

    def ran_out(self) -> bool:
        """Whether the kernel ended a process of this group for lack of memory."""
        rows = dict(row.split() for row in (self.path / "memory.events").read_text().splitlines())
        return int(rows.get("oom_kill", 0)) > 0

    def remove(self) -> None:
        """End every process that is left in the group, then delete it."""
        deadline = time.monotonic() + GONE_S_MAX
        with contextlib.suppress(OSError):
            (self.path / "cgroup.kill").write_text("1")
        while time.monotonic() < deadline:
            try:
                self.path.rmdir()
            except FileNotFoundError:
                return
            except OSError:  # dead processes have not left the group yet
                time.sleep(0.001)
            else:
                return


def find_delegated(own: Path = Path("/proc/self/cgroup"), root: Path = ROOT) -> Callable[[int], Group] | None:
    """Return a function that puts a process into a new group; None where no cgroup is delegated."""
    parent = _find_parent(own, root)
    if parent is None:
        return None

    def make_group(pid: int) -> Group:
        group = Group(parent / f"jail-{os.getpid()}-{next(_numbers)}")
        group.path.mkdir()
        (group.path / "pids.max").write_text(str(THREADS_MAX))
        with contextlib.suppress(FileNotFoundError):  # without swap there is no such file
            (group.path / "memory.swap.max").write_text("0")
        (group.path / "cgroup.procs").write_text(str(pid))
        return group

    return make_group


def _find_parent(own: Path, root: Path) -> Path | None:
    """Returns the parent of our own group, where it has been delegated to us."""
    rows = [row.split("::", 1)[1] for row in own.read_text().splitlines() if row.startswith("0::")]
    if not rows or rows[0] in ("", "/") or not (root / "cgroup.controllers").is_file():
        return None
    parent = (root / rows[0].lstrip("/")).parent
    try:
        if not set((parent / "cgroup.controllers").read_text().split()) >= CONTROLLERS:
            return None
        if (parent / "cgroup.procs").read_text().strip() or not os.access(parent, os.W_OK):
            return None
        (parent / "cgroup.subtree_control").write_text(" ".join(f"+{name}" for name in sorted(CONTROLLERS)))
    except OSError:
        return None
    return parent
