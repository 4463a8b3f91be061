"""MuJoCo's own Python tests, as the installed package ships them, run the same inside the jail and outside.

All but one of 4.0.0, which hands C a callback that is written in Python.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from grader.domain.run import Job, Limits, RunStatus
from grader.numerics.version import INSTALLED, parse_version
from grader.sandbox import policy
from grader.sandbox.jail import Jail
from grader.settings import Settings

SUITES = ["bindings_test", "rollout_test", "specs_test", "thread_safety_test", "minimize_test", "vfs_test"]
CALLS_BACK = "mujoco.bindings_test.MuJoCoBindingsTest.test_set_mju_user_malloc_and_free_reset"
REFUSED = "PermissionError: [Errno 1] ctypes callbacks into Python are not available"
RUNNER = """
import importlib, io, json, sys, unittest, warnings


def outcomes(name):
    module = importlib.import_module("mujoco." + name)
    tests = unittest.TestLoader().loadTestsFromModule(module)
    result = unittest.TextTestRunner(stream=io.StringIO(), verbosity=0).run(tests)
    bad = {test.id(): text.strip().splitlines()[-1] for test, text in result.failures + result.errors}
    return {"run": result.testsRun, "skipped": sorted(test.id() for test, _ in result.skipped), "bad": bad}


def main(name):
    sys.argv = ["tests"]
    from absl import flags
    flags.FLAGS(sys.argv)
    return json.dumps(outcomes(name), sort_keys=True).encode()
"""
DRIVER = """
import numpy as np

def run(student, inputs, submit):
    submit("outcomes", np.frombuffer(student.main(inputs["name"]), np.uint8))
"""
LIMITS = Limits(cpu_s=100, wall_s=60, memory_mb=2048, output_kb=1024)
OUTSIDE = RUNNER + "\n\nif __name__ == '__main__':\n    open('outcomes.json', 'wb').write(main(sys.argv[1]))\n"


def outside(name: str, folder: Path) -> dict[str, Any]:
    """The same runner in an ordinary interpreter, in a folder of its own, without a display as in the cell."""
    subprocess.run(
        [sys.executable, "-c", OUTSIDE, name],
        capture_output=True,
        timeout=60,
        check=True,
        cwd=folder,
        env=policy.ENVIRONMENT | {"HOME": str(folder), "TMPDIR": str(folder)},
    )
    outcomes: dict[str, Any] = json.loads((folder / "outcomes.json").read_text())
    return outcomes


@pytest.mark.parametrize("name", SUITES)
def test_mujocos_own_tests_end_the_same_inside_and_outside(name: str, jail: Jail, tmp_path: Path) -> None:
    report = jail.run(Job(RUNNER, DRIVER, {"name": name}, LIMITS))
    assert report.status is RunStatus.RETURNED, (report.reason, report.stderr)
    inside = json.loads(report.results["outcomes"].tobytes())
    assert inside["run"] > 0
    if name == "bindings_test" and parse_version(INSTALLED) >= (4, 0, 0):
        assert inside["bad"].pop(CALLS_BACK) == REFUSED
    assert inside == outside(name, tmp_path)


STEPPING = """
import mujoco
import numpy as np


def simulate(xml):
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[:] = 1.0
    for _ in range(500):
        mujoco.mj_step(model, data)
    return np.concatenate((data.qpos, data.qvel)), np.array([timer.duration for timer in data.timer])
"""


def test_the_wheels_profiling_timer_is_off_and_changes_no_bit(jail: Jail) -> None:
    xml = (Settings().content / "models" / "double_pendulum.xml").read_text(encoding="utf-8")
    driver = "def run(student, inputs, submit):\n    state, timers = student.simulate(inputs['xml'])\n"
    report = jail.run(
        Job(STEPPING, f"{driver}    submit('state', state)\n    submit('timers', timers)\n", {"xml": xml})
    )
    assert report.status is RunStatus.RETURNED, report.reason
    code = f"{STEPPING}\nimport sys\nprint(simulate(sys.stdin.read())[0].tobytes().hex())"
    outside = subprocess.run([sys.executable, "-c", code], input=xml, capture_output=True, text=True, check=True)
    assert report.results["state"].tobytes().hex() == outside.stdout.strip()
    assert not report.results["timers"].any()
