"""Cgroups: which folders are taken for delegated, what is written to them, what is read as evidence.

The rules of the files are the kernel's (cgroup v2); here a folder stands in for it, as a kernel with a delegated
memory controller cannot be had everywhere the suite runs.
"""

import os
import signal
from pathlib import Path

import pytest

from grader.domain.run import Job, Limits, RunStatus
from grader.errors import JailFault
from grader.sandbox.jail import Jail, Tier
from grader.sandbox.locks import cgroup
from grader.sandbox.locks.cgroup import Group, find_delegated
from grader.sandbox.policy import CGROUP_MEMORY_EXTRA, MB, THREADS_MAX
from sandbox.conftest import Content

WAITS = """
import time

def run(student, inputs, submit):
    submit("ready", [1.0])
    time.sleep(60)
"""


def hierarchy(root: Path, controllers: str = "cpu memory pids", inhabitants: str = "") -> Path:
    own = root / "proc-self-cgroup"
    own.write_text("1:name=systemd:/x\n0::/grader.service/server\n")
    (root / "cgroup.controllers").write_text("cpu memory pids")
    service = root / "grader.service"
    (service / "server").mkdir(parents=True)
    (service / "cgroup.controllers").write_text(controllers)
    (service / "cgroup.procs").write_text(inhabitants)
    (service / "cgroup.subtree_control").write_text("")
    return own


def test_a_child_is_put_in_a_group_of_its_own_with_limits(tmp_path: Path) -> None:
    make = find_delegated(hierarchy(tmp_path), tmp_path)
    assert make is not None
    group = make(1234)
    assert group.path.parent == tmp_path / "grader.service"
    assert (group.path / "cgroup.procs").read_text() == "1234"
    assert (group.path / "pids.max").read_text() == str(THREADS_MAX)
    group.limit(256 * MB)
    assert (group.path / "memory.max").read_text() == str(256 * MB + CGROUP_MEMORY_EXTRA)
    assert (tmp_path / "grader.service" / "cgroup.subtree_control").read_text() == "+memory +pids"
    assert make(1).path != group.path


@pytest.mark.parametrize(("controllers", "inhabitants"), [("cpu pids", ""), ("cpu memory pids", "1\n")])
def test_what_is_not_delegated_is_left_alone(controllers: str, inhabitants: str, tmp_path: Path) -> None:
    assert find_delegated(hierarchy(tmp_path, controllers, inhabitants), tmp_path) is None
    assert (tmp_path / "grader.service" / "cgroup.subtree_control").read_text() == ""


def test_the_root_group_and_a_first_version_are_not_ours(tmp_path: Path) -> None:
    own = hierarchy(tmp_path)
    own.write_text("0::/\n")
    assert find_delegated(own, tmp_path) is None
    own.write_text("4:memory:/x\n")
    assert find_delegated(own, tmp_path) is None


def test_the_kernels_count_is_the_evidence(tmp_path: Path) -> None:
    group = Group(tmp_path)
    (tmp_path / "memory.events").write_text("low 0\nhigh 0\nmax 12\noom 0\noom_kill 0\n")
    assert not group.ran_out()
    (tmp_path / "memory.events").write_text("low 0\nhigh 0\nmax 12\noom 1\noom_kill 1\n")
    assert group.ran_out()


def test_removing_waits_for_the_dead_but_not_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cgroup, "GONE_S_MAX", 0.05)
    group = Group(tmp_path / "jail-1-1")
    group.path.mkdir()
    group.remove()  # the folder is not empty: the kernel's own files vanish by themselves, these do not
    assert (group.path / "cgroup.kill").read_text() == "1"
    (group.path / "cgroup.kill").unlink()
    group.path.rmdir()
    group.remove()


@pytest.fixture
def groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a group for each child, named for its process; it stands in for the kernel's."""

    def make(pid: int) -> Group:
        group = Group(tmp_path / str(pid))
        group.path.mkdir()
        (group.path / "memory.events").write_text("oom_kill 0\n")
        return group

    monkeypatch.setattr(cgroup, "GONE_S_MAX", 0.0)
    monkeypatch.setattr(cgroup, "find_delegated", lambda: make)
    return tmp_path


@pytest.mark.parametrize("counted", [True, False])
def test_a_script_that_is_killed_ran_out_of_memory_if_its_group_counts_it(
    counted: bool, groups: Path, content: Content
) -> None:
    """As at the group's limit: SIGKILL, which no limit of the supervisor's own explains."""
    limits = Limits(memory_mb=300)

    def end(_result: str) -> None:
        (limit,) = groups.glob("*/memory.max")
        assert limit.read_text() == str(300 * MB + CGROUP_MEMORY_EXTRA)
        if counted:
            (limit.parent / "memory.events").write_text("oom_kill 1\n")
        os.kill(int(limit.parent.name), signal.SIGKILL)

    with Jail(content.models, workers=1) as jail:
        assert jail.tier is Tier.T0
        for old in groups.glob("*/memory.max"):  # of the self-test
            old.unlink()
        job = Job("", WAITS, {}, limits, heard=end)
        if counted:
            assert jail.run(job).status is RunStatus.OUT_OF_MEMORY
        else:
            with pytest.raises(JailFault, match="killed from outside"):
                jail.run(job)
