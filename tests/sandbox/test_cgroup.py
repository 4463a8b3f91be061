"""Cgroups: which folders are taken for delegated, what is written to them, what is read as evidence.

The rules of the files are the kernel's (cgroup v2); here a folder stands in for it, as a kernel with a delegated
memory controller cannot be had everywhere the suite runs.
"""

from pathlib import Path

import pytest

from grader.sandbox import cgroup
from grader.sandbox.cgroup import Group, delegated
from grader.sandbox.policy import CGROUP_MEMORY_EXTRA, MB, THREADS_MAX


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
    make = delegated(hierarchy(tmp_path), tmp_path)
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
    assert delegated(hierarchy(tmp_path, controllers, inhabitants), tmp_path) is None
    assert (tmp_path / "grader.service" / "cgroup.subtree_control").read_text() == ""


def test_the_root_group_and_a_first_version_are_not_ours(tmp_path: Path) -> None:
    own = hierarchy(tmp_path)
    own.write_text("0::/\n")
    assert delegated(own, tmp_path) is None
    own.write_text("4:memory:/x\n")
    assert delegated(own, tmp_path) is None


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
