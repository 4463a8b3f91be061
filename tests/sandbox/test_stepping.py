"""Scripts that want MuJoCo's own integrators in a process from which they were removed.

Each program defines `step(model, data)` and is named for what a kind of exercise says of it: `forbidden` where the
count is above zero, the jail's own status elsewhere. None but the honest one may get the states right.
"""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.sandbox.jail import Jail
from sandbox.conftest import ROOT

PROGRAMS = sorted((ROOT / "tests" / "hostile" / "stepping").glob("*.py"))
XML = """
<mujoco>
  <option integrator="RK4" timestep="0.002"/>
  <worldbody><body><joint axis="0 1 0"/><geom size=".1" pos="0 0 -.5"/></body></worldbody>
</mujoco>
"""
INPUTS = {"xml": XML, "q": 0.7, "v": -1.3, "steps": 5}
DRIVER = """
import mujoco
import numpy as np

def run(student, inputs, submit):
    model = mujoco.MjModel.from_xml_string(inputs["xml"])
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = inputs["q"], inputs["v"]
    rows = []
    for _ in range(inputs["steps"]):
        student.step(model, data)
        rows.append([*data.qpos, *data.qvel])
    submit("states", rows)
"""
LIMITS = Limits(cpu_s=5, wall_s=10)
# Attacks that get every state right where the integrators are kept.
STEPS = [
    "steps",
    "code_under_a_trusted_name",
    "ctypes_from_a_thread_pool",
    "steps_in_an_audit_hook",
    "steps_in_a_finalizer",
    "steps_in_a_signal_handler",
    "modules_under_another_name",
    "calls_back_from_a_warning",
    "calls_a_saved_pointer",
    "rolls_out",
    "a_thread_of_the_import_rolls_out",
    "a_generator_of_the_import",
    "is_halfway_through_its_steps",
    "drops_the_pages",
]


def true_states() -> list[list[float]]:
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = INPUTS["q"], INPUTS["v"]
    rows = []
    for _ in range(5):
        mujoco.mj_step(model, data)
        rows.append([*data.qpos, *data.qvel])
    return rows


def run(jail: Jail, source: str, without_integrators: bool = True) -> RunReport:
    return jail.run(Job(source, DRIVER, INPUTS, LIMITS, without_integrators=without_integrators))


def right(report: RunReport) -> bool:
    return "states" in report.results and np.allclose(report.results["states"], true_states(), rtol=0, atol=1e-9)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_program(path: Path, jail: Jail) -> None:
    report = run(jail, path.read_text())
    said = RunStatus.FORBIDDEN if report.stepped else report.status
    assert said == path.stem.split("__")[0], (report.status, report.reason, report.stderr)
    assert right(report) == (path.stem == "returned__is_honest")


@pytest.mark.parametrize("name", STEPS)
def test_it_would_step_if_the_integrators_were_kept(name: str, jail: Jail) -> None:
    (path,) = (path for path in PROGRAMS if path.stem.endswith(f"__{name}"))
    report = run(jail, path.read_text(), without_integrators=False)
    assert right(report), (report.status, report.reason)
    assert report.stepped == 0
