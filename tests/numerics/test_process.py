"""The set-up of the process: no timer, no log, warnings still counted."""

import subprocess
import sys
import threading
from pathlib import Path

import mujoco
import pytest

from grader.numerics.process import prepare
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from numerics.models import LESSON

DIVERGING = """
import sys
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
scene = Scene.from_xml(sys.stdin.read()).at(qpos=[1.0])
assert simulate(scene, seconds=3, timestep_s=0.2, integrator=0).warning is not None
with scene.borrow() as workspace:
    assert workspace.data.timer.duration.sum() == 0
"""


def test_a_fresh_process_that_diverges_is_silent_and_writes_nothing(tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-c", DIVERGING],
        input=LESSON["pendulum_servo"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert list(tmp_path.iterdir()) == []


def test_a_thread_is_silent_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = Scene.from_xml(LESSON["pendulum_servo"]).at(qpos=[1.0])
    warned: list[object] = []

    def diverge() -> None:
        warned.append(simulate(scene, seconds=3, timestep_s=0.2, integrator=0).warning)

    thread = threading.Thread(target=diverge)
    thread.start()
    thread.join()
    assert warned == [mujoco.mjtWarning.mjWARN_BADQACC]
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_the_timer_is_off_and_repeating_is_harmless() -> None:
    prepare()
    prepare()
    scene = Scene.from_xml(LESSON["pendulum"])
    with scene.borrow() as workspace:
        mujoco.mj_step(workspace.model, workspace.data, nstep=1000)
        assert workspace.data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration == 0
