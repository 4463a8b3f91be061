"""The jail for an ordinary user: the same programs, started by a user without any rights.

When the suite itself runs as root it starts a second interpreter as an unprivileged user. That user may not be able
to reach this interpreter (it may lie in root's home): then the system's own is taken, if it is of the same version.

Without namespaces Landlock must scope signals and sockets: before Linux 6.12 the jail refuses tier T2.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from grader.sandbox import policy
from sandbox import test_hostile, test_stepping
from sandbox.conftest import ROOT, Content, landlock_abi
from sandbox.test_stepping import INPUTS, true_states
from support.users import as_user

USER = 65533  # neither root nor nobody, and needs no entry in /etc/passwd
SCRIPT = """
import json, os, shutil, sys
from pathlib import Path
from grader.domain.run import Job, Limits
from grader.sandbox.jail import Jail

models, allow_t2 = Path(sys.argv[1]), sys.argv[2] == "T2"
if allow_t2:
    shutil.which = lambda name: None
DRIVER = "def run(student, inputs, submit):\\n    submit('answer', [1.0])\\n"
programs, stepping = json.load(sys.stdin)
with Jail(models, workers=1, allow_t2=allow_t2) as jail:
    ended = {name: jail.run(Job(source, DRIVER, {}, Limits(cpu_s=1, wall_s=1, memory_mb=256))).status
             for name, source in programs.items()}
    for name, source in stepping["programs"].items():
        report = jail.run(Job(source, stepping["driver"], stepping["inputs"], without_integrators=True))
        states = report.results["states"].tolist() if "states" in report.results else None
        stepping["ended"][name] = [report.stepped, states]
    told = {"uid": os.geteuid(), "tier": jail.tier, "held": len(jail.self_test.held)}
    print(json.dumps({**told, "ended": ended, "stepping": stepping["ended"]}))
"""
# Those that need nothing of the suite's own driver; the rest is the same code in the kernel.
PICKED = [
    "forbidden__reads_etc_passwd", "forbidden__writes_into_site_packages", "forbidden__opens_a_tcp_socket",
    "forbidden__fork_bomb", "forbidden__runs_a_shell", "forbidden__kills_everybody", "forbidden__calls_ptrace",
    "forbidden__calls_unshare", "forbidden__int80", "forbidden__makes_a_symlink", "crashed__segfault",
    "crashed__thread_bomb", "out_of_memory__a_long_list", "out_of_memory__shared_mapping", "timed_out__spins",
    "timed_out__sleeps", "output_too_large__floods_stdout", "crashed__results_truncated", "returned__raw_clone",
    "returned__raises_its_limits", "returned__unknown_system_calls", "forbidden__becomes_root",
]  # fmt: skip

# Those that depend on the library's file being out of reach, the plain way, and the honest one.
STEPPING = ["loads_a_second_library", "maps_the_library_itself", "rewrites_the_library_file", "steps", "is_honest"]


def interpreter() -> str | None:
    for candidate in (sys.executable, "/usr/bin/python3"):
        probe = [candidate, "-c", "import sys; print(*sys.version_info[:2])"]
        try:
            done = subprocess.run(as_user(USER, *probe), capture_output=True, text=True, check=False, cwd="/")
        except OSError:
            continue
        if done.stdout.split() == [str(n) for n in sys.version_info[:2]]:
            return candidate
    return None


@pytest.mark.parametrize("tier", ["T1", "T2"])
def test_an_unprivileged_user_has_the_same_jail(tier: str, content: Content, tmp_path: Path) -> None:
    python = interpreter()
    assert python is not None, "no interpreter of this version that an unprivileged user can run"
    models = Path("/tmp") / f"models-{os.getpid()}-{tier}"
    shutil.copytree(content.models, models)
    try:
        done = play(python, models, tier)
    finally:
        shutil.rmtree(models)
    if tier == "T2" and landlock_abi() < policy.LANDLOCK_ABI_MIN_ALONE:
        assert done.stderr.splitlines()[-1].startswith("grader.errors.JailRefused: The jail cannot be set up")
        assert f"Landlock ABI {landlock_abi()}, at least {policy.LANDLOCK_ABI_MIN_ALONE} is needed" in done.stderr
        return
    assert done.returncode == 0, done.stderr
    ended = json.loads(done.stdout)
    assert ended["uid"] != 0
    assert ended["tier"] in ({"T2"} if tier == "T2" else {"T0", "T1"})
    assert ended["held"] >= 10
    wrong = {name: status for name, status in ended["ended"].items() if status != name.split("__")[0]}
    assert not wrong
    right = [name for name, (_, states) in ended["stepping"].items() if states and np.allclose(states, true_states())]
    assert right == ["is_honest"]
    assert ended["stepping"]["steps"][0] == INPUTS["steps"]


def play(python: str, models: Path, tier: str) -> subprocess.CompletedProcess[str]:
    programs = {path.stem: path.read_text() for path in test_hostile.PROGRAMS if path.stem in PICKED}
    stepping = {path.stem.split("__")[1]: path.read_text() for path in test_stepping.PROGRAMS}
    tried = {"programs": {name: stepping[name] for name in STEPPING}, "driver": test_stepping.DRIVER, "inputs": INPUTS}
    packages = Path(mujoco.__file__).parents[1]
    return subprocess.run(
        as_user(USER, python, "-B", "-c", SCRIPT, str(models), tier),
        input=json.dumps([programs, {**tried, "ended": {}}]),
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": f"{ROOT / 'src'}:{packages}"},
        cwd="/",
    )
