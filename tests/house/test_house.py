"""The checks that are part of the build: style, types, floors, locks, and what it installs."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import import_module, metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent

CHECKS = {
    "style": ["ruff", "check", "."],
    "format": ["ruff", "format", "--check", "."],
    "types": ["mypy"],
    "floors": ["lint-imports"],
}


@pytest.mark.parametrize("name", CHECKS)
def test_the_tree_passes(name: str) -> None:
    tool, *arguments = CHECKS[name]
    done = subprocess.run([BIN / tool, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("lock", sorted(path.name for path in ROOT.glob("requirements*.lock")))
def test_the_locks_name_no_addresses(lock: str) -> None:
    text = (ROOT / lock).read_text()
    assert "://" not in text
    assert "--hash=sha256:" in text


def pins(lock: str) -> set[str]:
    """`name==version` of every package."""
    return set(re.findall(r"^[\w.-]+(?:\[\w,]+\])?==[\w.]+", (ROOT / lock).read_text(), re.MULTILINE))


def lines_of(lock: str) -> set[str]:
    """Each package with its version and hashes; markers are wider where more packages need one."""
    text = re.sub(r" ; [^\\\n]*", " ", (ROOT / lock).read_text())
    return set(re.findall(r"^\S.*(?:\n .*)*", text, re.MULTILINE))


def test_the_locks_agree_to_the_hash() -> None:
    build, plain, whole, dev = (lines_of(f"requirements{name}.lock") for name in ("-build", "", "-all", "-dev"))
    assert build < plain
    assert plain - build < whole < dev
    assert plain < dev


EXTRAS_OF_BENCHMARKS = {"bench", "peers"}


def test_a_server_is_installed_with_every_extra_and_no_build_tool() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    wanted = {re.split("[>=]", extra)[0] for name in extras.keys() - EXTRAS_OF_BENCHMARKS for extra in extras[name]}
    locked = dict(pin.split("==") for pin in pins("requirements-all.lock"))
    assert wanted
    assert wanted <= locked.keys()
    assert not {"pip", "setuptools", "wheel"} & locked.keys()
    # The packages of this environment are those of the lock, so what imports here imports there.
    assert {name: metadata.version(name) for name in wanted} == {name: locked[name] for name in wanted}
    for name in wanted:
        import_module(name)
    for path in ("docs/deploy.md", "deploy/Containerfile"):
        assert "--require-hashes -r requirements-all.lock" in (ROOT / path).read_text()
        assert "-r requirements.lock" not in (ROOT / path).read_text()


def test_what_serving_needs_draws_nothing() -> None:
    assert not [pin for pin in pins("requirements.lock") if pin.startswith(("matplotlib", "pytest", "ruff"))]


def commands(*arguments: str) -> subprocess.CompletedProcess[str]:
    """What `make` would do."""
    return subprocess.run(["make", "-n", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


def test_another_mujoco_has_an_environment_and_a_lock_of_its_own() -> None:
    pinned, other = (commands("test", f"MUJOCO={version}").stdout for version in ("3.14.0", "4.0.0"))
    assert ".venv/bin/python -m pytest" in pinned
    assert ".venv-4.0.0/bin/python -m pytest" in other
    assert ".venv/" not in other
    assert pins("requirements-mujoco-4.0.0.lock") == {f"{name}==4.0.0" for name in MUJOCO_4}
    assert pins("requirements-dev.lock") & {"mujoco==3.14.0", "mujoco==4.0.0"} == {"mujoco==3.14.0"}
    unknown = commands("test", "MUJOCO=2.0.0")
    assert unknown.returncode != 0
    assert "MUJOCO= may be 3.14.0 or 4.0.0" in unknown.stderr


MUJOCO_4 = ("mujoco", "mujoco-core", "mujoco-studio")

FAKE_APT = """#!/bin/sh
echo "$@" >> "$CALLS"
[ "$(wc -l < "$CALLS")" -gt 2 ] || { echo "E: Could not get lock /var/lib/apt/lists/lock" >&2; exit 100; }
case "$*" in *broken*) echo "E: Unable to locate package broken" >&2; exit 100 ;; esac
"""


def install(folder: Path, package: str) -> subprocess.CompletedProcess[str]:
    """`.ci/system-packages` with an apt-get that is busy twice, and no waiting."""
    for name, text in (("apt-get", FAKE_APT), ("sleep", "#!/bin/sh\n"), ("sudo", '#!/bin/sh\nexec "$@"\n')):
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "CALLS": str(folder / "calls")}
    command = [str(ROOT / ".ci/system-packages"), f"no-such-command:{package}"]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_a_busy_package_manager_is_waited_for(tmp_path: Path) -> None:
    done = install(tmp_path, "fine")
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("Another package manager is busy") == 1
    calls = (tmp_path / "calls").read_text().splitlines()
    assert [call.split()[1] for call in calls] == ["update", "update", "update", "install"]


def test_another_failure_of_the_package_manager_is_shown(tmp_path: Path) -> None:
    done = install(tmp_path, "broken")
    assert done.returncode == 1
    assert "Unable to locate package" in done.stderr


@pytest.mark.process
@pytest.mark.parametrize("tool", ["bwrap", "chromium-headless-shell", "node"])
def test_the_tools_that_the_suite_needs_are_here(tool: str) -> None:
    assert shutil.which(tool), f"make test installs {tool}"
