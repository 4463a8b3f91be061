"""The layers one by one. A test build is a copy of the code in the cell with one lock left out; what is shipped has
no switch for that.

Without:             still holds (each line is a test below)
    landlock         host files are not in the cell, the runtime is mounted read-only, sockets and links are refused
    seccomp          no host files, no writing outside, no network to reach, nobody to signal, no capability to mount
    namespaces       no host files (the outer cell), no writing, no sockets, no forks, no signals, no /proc
    capabilities     no mounts (SIGSYS), no host files, no sockets
    rlimits          no forks, memory and CPU time (the keeper sets those), the disk is full at 16 MB
    no new privs     bubblewrap has set it already, on everything in the cell
"""

import importlib.metadata
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from grader.domain.run import Job, Limits, RunStatus
from grader.errors import JailRefused
from grader.sandbox import policy
from grader.sandbox.jail import Jail
from grader.sandbox.locks import attest, cell, seccomp, selftest
from sandbox.conftest import ROOT, Content, landlock_abi

DRIVER = "def run(student, inputs, submit):\n    submit('answer', [1.0])\n"
LIMITS = Limits(cpu_s=2, wall_s=10, memory_mb=256)
LEFT_OUT = {
    "landlock": ("lockdown", "def load_landlock(read, read_write, abi_min): pass"),
    "seccomp": ("lockdown", "def load_seccomp(program): pass"),
    "limits": ("lockdown", "def set_limits(rlimits): pass"),
    "no new privileges": ("lockdown", "def drop_privileges(): pass"),
    "namespaces": ("namespaces", "def enter(scratch, size, inodes, hidden): pass"),
    "capabilities": ("namespaces", "def drop_capabilities(): pass"),
    "probe": ("lockdown", "def probe_locks(outside): return {}"),
}


def test_build(folder: Path, layer: str) -> Path:
    """A copy of the code in the cell without one layer."""
    module, nothing = LEFT_OUT[layer]
    inside = folder / "inside"
    shutil.copytree(cell.INSIDE, inside, ignore=shutil.ignore_patterns("__pycache__"))
    with (inside / f"{module}.py").open("r+") as file:
        assert nothing[: nothing.index(":")].split("(")[0] in file.read()
        file.write(f"\n\n{nothing}\n")
    for path in (folder, inside):
        path.chmod(0o755)
    return inside


test_build.__test__ = False  # type: ignore[attr-defined]


@contextmanager
def jail_without(layer: str, folder: Path, content: Content) -> Iterator[Jail]:
    """A jail that lacks one layer and does not look."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(attest, "check_locks", lambda *arguments: None)
        patch.setattr(selftest, "run_selftest", lambda *arguments: selftest.SelfTest(()))
        with Jail(content.models, workers=1, inside=test_build(folder, layer)) as jail:
            yield jail


HOST_FILE = "open('/etc/passwd')"
PACKAGES = "import numpy\nopen(numpy.__path__[0] + '/trap.py', 'w')"
SOCKET = "import socket\nsocket.socket()"
REACH = "import socket\nsocket.create_connection(('1.1.1.1', 53), 0.2)"
DATAGRAM = "import socket\nsocket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(b'x', ('1.1.1.1', 53))"
FORK = "import os\nos.fork()"
KILL = "import os\nos.kill({SERVER}, 0)"
LINK = "import os\nos.symlink('/etc', 'x')"
MOUNT = """
import ctypes
libc = ctypes.CDLL(None, use_errno=True)
if libc.mount(b'x', b'/scratch', b'tmpfs', 0, None):
    raise OSError(ctypes.get_errno(), 'mount')
"""
MEMFD = "import os\nos.memfd_create('x')"
PROC = "open('/proc/1/status').read()"
BOMB = "x = []\nwhile True:\n    x.append(bytes(1 << 20))"
SPIN = "while True:\n    pass"
DISK = "with open('big', 'wb') as file:\n    while True:\n        file.write(bytes(1 << 20))"
CELL = "open('/cell/inside/guest.py').read()"

STILL_HOLDS = [
    ("landlock", HOST_FILE, "forbidden"),
    ("landlock", PACKAGES, "forbidden"),
    ("landlock", SOCKET, "forbidden"),
    ("landlock", LINK, "forbidden"),
    ("seccomp", HOST_FILE, "forbidden"),
    ("seccomp", PACKAGES, "forbidden"),
    # Landlock: no TCP; before Linux 6.7 OSError, as for the datagram
    ("seccomp", REACH, "forbidden" if landlock_abi() >= 4 else "crashed"),
    ("seccomp", DATAGRAM, "crashed"),  # OSError: network is unreachable
    ("seccomp", LINK, "forbidden"),
    ("seccomp", KILL, "crashed"),  # ProcessLookupError: there is nobody of that number
    ("seccomp", MOUNT, "forbidden"),
    ("namespaces", HOST_FILE, "forbidden"),
    ("namespaces", PACKAGES, "forbidden"),
    ("namespaces", SOCKET, "forbidden"),
    ("namespaces", FORK, "forbidden"),
    ("namespaces", KILL, "forbidden"),
    ("namespaces", PROC, "forbidden"),
    ("capabilities", MOUNT, "forbidden"),
    ("capabilities", HOST_FILE, "forbidden"),
    ("capabilities", SOCKET, "forbidden"),
    ("limits", FORK, "forbidden"),
    ("limits", BOMB, "out_of_memory"),
    ("limits", SPIN, "timed_out"),
    ("limits", DISK, "crashed"),
    ("no new privileges", HOST_FILE, "forbidden"),
    ("no new privileges", SOCKET, "forbidden"),
]
# That the layer was really off: what only this layer stops now goes through.
GETS_THROUGH = [("landlock", CELL), ("seccomp", SOCKET), ("seccomp", MEMFD)]


@pytest.mark.parametrize("layer", sorted({layer for layer, _, _ in STILL_HOLDS}))
def test_what_holds_without_a_layer(layer: str, tmp_path: Path, content: Content) -> None:
    with jail_without(layer, tmp_path, content) as jail:
        for without, source, status in STILL_HOLDS:
            if without == layer:
                report = jail.run(Job(source.replace("{SERVER}", "4194000"), DRIVER, {}, LIMITS))
                assert report.status == status, (source, report.reason)
        for without, source in GETS_THROUGH:
            if without == layer:
                assert jail.run(Job(source, DRIVER, {}, LIMITS)).status is RunStatus.RETURNED, source


@pytest.mark.parametrize(
    ("layer", "named"),
    [
        ("landlock", "landlock"),
        ("seccomp", "seccomp"),
        ("limits", "limits"),
        ("namespaces", "user namespace"),
        ("capabilities", "CapBnd"),
        ("probe", "descriptors"),
    ],
)
def test_attestation_catches_a_child_that_skipped_a_layer(
    layer: str, named: str, tmp_path: Path, content: Content
) -> None:
    with pytest.raises(JailRefused, match=f"lacks: .*{named}"):
        Jail(content.models, workers=1, inside=test_build(tmp_path, layer))


def test_the_self_test_finds_a_hole_that_attestation_would_not(tmp_path: Path, content: Content) -> None:
    """A filter is loaded, so that the kernel says Seccomp: 2, but it lets everything through."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(seccomp, "build_filter", lambda own_pid: b"\x06\x00\x00\x00\x00\x00\xff\x7f")  # RET_ALLOW
        with pytest.raises(JailRefused, match=r"self-test failed: .*socket"):
            Jail(content.models, workers=1)


def test_without_landlock_the_service_refuses(monkeypatch: pytest.MonkeyPatch, content: Content) -> None:
    monkeypatch.setattr(policy, "LANDLOCK_ABI_MIN", 99)
    monkeypatch.setattr(policy, "LANDLOCK_ABI_MIN_ALONE", 99)
    with pytest.raises(JailRefused, match="Landlock ABI"):
        Jail(content.models, workers=1, allow_t2=True)


def test_without_libseccomp_the_service_refuses(monkeypatch: pytest.MonkeyPatch, content: Content) -> None:
    monkeypatch.setitem(sys.modules, "pyseccomp", None)
    seccomp.build_filter.cache_clear()
    with pytest.raises(JailRefused, match="libseccomp"):
        Jail(content.models, workers=1)
    seccomp.build_filter.cache_clear()


def test_without_bubblewrap_the_service_refuses(monkeypatch: pytest.MonkeyPatch, content: Content) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(JailRefused, match="bubblewrap"):
        Jail(content.models, workers=1)


def test_without_mujoco_the_service_refuses(monkeypatch: pytest.MonkeyPatch, content: Content) -> None:
    """As where root started it from a virtual environment that only root can read."""
    monkeypatch.setattr(policy, "PRELOAD", ("json",))
    with pytest.raises(JailRefused, match=r"MuJoCo cannot be imported by user \d+: let this user read the Python"):
        Jail(content.models, workers=1)


def test_nothing_of_ours_is_in_the_cell(content: Content) -> None:
    command = cell.build_cell_command(cell.find_runtime(), content.models, cell.INSIDE, 3)
    sources = [Path(command[n + 1]) for n, word in enumerate(command) if word in ("--ro-bind", "--bind", "--dev-bind")]
    ours = [ROOT / name for name in ("src/grader/errors.py", "quizzes", "reference_solutions", "tests", "README.md")]
    assert not [path for path in ours if any(path.is_relative_to(source) for source in sources)]
    assert not [word for word in command if word in ("--bind", "--share-net")]


def test_of_what_is_installed_only_the_packages_of_scripts_are_in_the_cell(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, content: Content
) -> None:
    """Neither this package, where it is installed beside MuJoCo with its content, nor a plug-in."""
    packages = tmp_path / "site-packages"
    for name in ("grader", "plugin", "mujoco", "numpy", "numpy.libs", "numpy-2.4.0.dist-info", "grader-1.dist-info"):
        (packages / name).mkdir(parents=True)
        (packages / name / "METADATA").touch()
    monkeypatch.setattr(cell, "_find_package_folder", lambda _: packages)
    runtime = cell.find_runtime()
    ours = {path for path in runtime.binds if path.is_relative_to(tmp_path)}
    assert ours == {packages / name for name in ("mujoco", "numpy", "numpy.libs", "numpy-2.4.0.dist-info/METADATA")}
    assert ours <= set(runtime.readable) and packages not in runtime.readable
    assert packages in runtime.roots and not ours & set(runtime.roots)
    command = cell.build_cell_command(runtime, content.models, cell.INSIDE, 3)
    sources = {command[at + 1] for at, word in enumerate(command) if word == "--ro-bind"}
    assert {Path(source) for source in sources if Path(source).is_relative_to(tmp_path)} == ours


def test_all_that_mujoco_requires_is_a_package_of_scripts() -> None:
    required = [one for one in importlib.metadata.requires("mujoco") or () if "extra ==" not in one]
    required += [one for one in importlib.metadata.requires("etils") or () if 'extra == "epath"' in one]
    names = {re.split(r"[^\w-]", one)[0] for one in required if not one.startswith("mujoco")} - {"etils"}
    imported = {"absl-py": "absl", "pyopengl": "OpenGL", "typing_extensions": "typing_extensions.py"}
    assert {imported.get(name, name) for name in names} <= {*policy.PACKAGES}


@pytest.mark.parametrize("name", ["fastapi", "pytest", "grader", "sqlalchemy"])
def test_no_script_can_import_what_the_grader_needs(name: str, jail: Jail) -> None:
    report = jail.run(Job(f"import {name}\n", DRIVER, {}))
    assert report.status == "crashed"
    assert f"ModuleNotFoundError: No module named '{name}'" in report.stderr


def test_a_script_can_import_what_there_is_and_ask_for_its_version(jail: Jail) -> None:
    lines = ("import mujoco.viewer, mujoco.minimize, mujoco.renderer, mujoco.rollout, numpy.testing",
             "import scipy.optimize, scipy.integrate, scipy.signal, scipy.spatial.transform, scipy.stats, scipy.io",
             "from importlib.metadata import version",
             "print(version('mujoco'), version('numpy'), version('scipy'))")  # fmt: skip
    report = jail.run(Job("\n".join(lines), DRIVER, {}))
    assert report.status == "returned", report
    assert report.stdout.split() == [importlib.metadata.version(name) for name in ("mujoco", "numpy", "scipy")]


def test_a_loader_that_is_a_link_is_in_the_cell(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, content: Content
) -> None:
    """Programs for aarch64 name /lib/ld-linux-aarch64.so.1, which Debian links into a folder beneath."""
    loader = tmp_path / "ld-linux-aarch64.so.1"
    loader.symlink_to("aarch64-linux-gnu/ld-linux-aarch64.so.1")
    monkeypatch.setattr(cell, "LIB", tmp_path)
    command = cell.build_cell_command(cell.find_runtime(), content.models, cell.INSIDE, 3)
    at = command.index(str(loader))
    assert command[at - 2 : at] == ["--symlink", "aarch64-linux-gnu/ld-linux-aarch64.so.1"]
    assert command.index(str(tmp_path)) < at
