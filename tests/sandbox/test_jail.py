"""Students' scripts work as they are written, and how a run ends is told apart by evidence from outside."""

import time
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.errors import JailRefused
from grader.sandbox.jail import Jail, Tier
from grader.sandbox.usage import Usage
from grader.sandbox.watch import POLL_S_MIN
from sandbox.conftest import MODELS

DRIVER = """
def run(student, inputs, submit):
    submit("value", student.main(**inputs))
"""
QUICK = Limits(cpu_s=5, wall_s=30, memory_mb=512)


def run(jail: Jail, source: str, driver: str = DRIVER, limits: Limits = QUICK, **inputs: object) -> RunReport:
    return jail.run(Job(source, driver, inputs, limits))


def value(report: RunReport) -> list[Any]:
    assert report.status is RunStatus.RETURNED, (report.reason, report.stderr)
    result: list[Any] = report.results["value"].tolist()
    return result


def test_the_tier_and_the_self_test_are_told(jail: Jail) -> None:
    assert jail.tier in (Tier.T0, Tier.T1)
    assert len(jail.self_test.held) >= 10
    assert "held" in str(jail.self_test)


def test_arrays_come_back_as_they_were(jail: Jail) -> None:
    source = "import numpy as np\ndef main(n):\n    return np.arange(n, dtype=np.float32).reshape(2, -1)"
    report = run(jail, source, n=6)
    assert report.results["value"].dtype == np.float32
    assert value(report) == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize("name", ["linalg", "optimize", "integrate", "spatial.transform"])
def test_scipy_can_be_imported(jail: Jail, name: str) -> None:
    report = run(jail, f"import scipy.{name}\ndef main():\n    return 1")
    assert (report.status, report.reason) == (RunStatus.RETURNED, "")


def test_mujocos_own_warnings_are_no_output(jail: Jail) -> None:
    source = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><joint axis='0 1 0'/><geom size='.1'/></body></worldbody></mujoco>"
)

def main():
    data = mujoco.MjData(model)
    for _ in range(5000):
        data.qpos[0] = 1e11  # beyond what MuJoCo takes for a number: it warns, and resets the state
        mujoco.mj_step(model, data)
    return data.time < 1
"""
    report = run(jail, source)
    assert (report.status, report.stderr) == (RunStatus.RETURNED, "")
    assert value(report)


def test_the_lessons_own_example_runs(jail: Jail) -> None:
    source = """
import mujoco
from mjcourse import model_path

xml = model_path("pendulum").read_text()
model = mujoco.MjModel.from_xml_string(xml)
again = mujoco.MjModel.from_xml_path(str(model_path("pendulum")))

def main():
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(100):
        mujoco.mj_step(model, data)
    return [model.nq, again.nq, float(data.time)]
"""
    assert value(run(jail, source)) == pytest.approx([1, 1, 100 * 0.002])


def test_rollout_with_threads_and_mjspec(jail: Jail) -> None:
    source = """
import mujoco, numpy as np
from mujoco import rollout
from mjcourse import model_path

def main():
    spec = mujoco.MjSpec.from_file(str(model_path("pendulum")))
    spec.worldbody.add_geom(name="extra", size=[0.1, 0, 0])
    model = spec.compile()
    data = [mujoco.MjData(model) for _ in range(4)]
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states, _ = rollout.rollout(model, data, np.zeros((8, size)), nstep=50)
    return states.shape
"""
    assert value(run(jail, source))[:2] == [8, 50]


def test_many_data_objects_do_not_run_out_of_memory(jail: Jail) -> None:
    """One MjData a step, as beginners write it: glibc's heap must not fragment."""
    source = """
import mujoco
from mjcourse import model_path

def main():
    model = mujoco.MjModel.from_xml_path(str(model_path("double_pendulum")))
    state = None
    for _ in range(300):
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data)
    return [1.0]
"""
    assert value(run(jail, source)) == [1.0]


def test_files_threads_and_the_usual_modules(jail: Jail) -> None:
    source = """
import json, os, sys, tempfile, threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

@dataclass
class Point:
    x: float

def main():
    Path("out.txt").write_text("hello")
    os.mkdir("folder")
    with tempfile.NamedTemporaryFile("w") as file, open(os.devnull, "w") as null:
        json.dump({"x": 1}, file)
        print("gone", file=null)
    assert __name__ != "__main__" and Path(__file__).read_text().startswith("\\nimport json")
    with ThreadPoolExecutor(4) as pool:
        return list(pool.map(float, range(4))) + [len(Path("out.txt").read_text()), Point(2.0).x]

if __name__ == "__main__":
    sys.exit("never")
"""
    assert value(run(jail, source)) == [0, 1, 2, 3, 5, 2]


def test_the_module_is_named_for_its_file(jail: Jail) -> None:
    source = "import sys\nprint(__name__, sys.modules[__name__].__file__)\ndef main():\n    return [0]"
    for filename, name in (("my-answer.py", "my_answer"), ("numpy.py", "submission"), ("../../x.py", "x")):
        report = jail.run(Job(source, DRIVER, {}, QUICK, filename))
        assert report.stdout.split() == [name, Path(filename).name]


def test_short_work_takes_the_cpu_time_that_it_takes(jail: Jail) -> None:
    """The kernel's own clock of a process with a limit counts ticks of 1 to 10 ms; that of a thread is exact."""
    source = """
import time

def main():
    rows = []
    for _ in range(40):
        began, exact, ns = time.process_time(), time.thread_time(), time.process_time_ns()
        sum(range(20_000))
        rows.append((time.process_time() - began, time.thread_time() - exact, (time.process_time_ns() - ns) / 1e9))
    return rows
"""
    taken = np.asarray(value(run(jail, source)))
    assert np.all(taken > 0)
    assert np.ptp(taken, axis=1).max() < 0.5e-3
    assert np.ptp(taken.sum(axis=0)) < 0.2 * taken[:, 1].sum()


def test_the_driver_is_executed_before_the_module_is_imported(jail: Jail) -> None:
    driver = """
import mujoco
mujoco.mj_step = lambda model, data: 7

def run(student, inputs, submit):
    submit("value", [student.mj_step(None, None)])
"""
    assert value(run(jail, "from mujoco import mj_step", driver)) == [7]


def test_a_module_of_512_kb(jail: Jail) -> None:
    line = "x = 1  # padding padding padding padding padding padding\n"
    source = line * (512 * 1024 // len(line) - 1) + "def main():\n    return [x]\n"
    assert value(run(jail, source)) == [1]
    assert run(jail, source + line * 2).status is RunStatus.CRASHED


def test_a_traceback_shows_only_the_students_lines(jail: Jail) -> None:
    source = "import numpy as np\n\ndef main():\n    return np.linalg.inv(np.zeros((2, 2)))  # here\n"
    report = run(jail, source)
    reason = "numpy.linalg.LinAlgError: Singular matrix, in line 4 of your script"
    assert (report.status, report.reason) == (RunStatus.CRASHED, reason)
    assert 'File "submission.py", line 4, in main' in report.stderr
    assert "# here" in report.stderr
    assert report.stderr.count("File ") == 1
    assert "/" not in report.stderr


def test_the_cause_of_an_exception_is_shown_too(jail: Jail) -> None:
    source = "try:\n    {}['a']\nexcept KeyError as error:\n    raise ValueError('no a') from error\n"
    report = run(jail, source)
    assert report.reason == "ValueError: no a, in line 4 of your script"
    assert "KeyError" in report.stderr
    assert "direct cause" in report.stderr


def test_prints_come_back_also_when_the_script_is_killed(jail: Jail) -> None:
    source = "import sys\nprint('out', end='')\nprint('err', end='', file=sys.stderr)\nwhile True:\n    pass\n"
    report = run(jail, source, limits=Limits(cpu_s=0.2, wall_s=30))
    assert (report.status, report.stdout, report.stderr) == (RunStatus.TIMED_OUT, "out", "err")
    assert "CPU" in report.reason
    assert 0.2 <= report.cpu_s < 1.0


def test_output_up_to_the_cap_is_fine(jail: Jail) -> None:
    limits = Limits(output_kb=4)
    driver = "def run(student, inputs, submit):\n    pass\n"
    assert run(jail, "print('x' * 4095)", driver, limits).status is RunStatus.RETURNED
    report = run(jail, "print('x' * 4096)", driver, limits)
    assert (report.status, len(report.stdout)) == (RunStatus.OUTPUT_TOO_LARGE, 4096)


def test_memory_is_the_jobs_own_limit(jail: Jail) -> None:
    source = "import numpy as np\ndef main():\n    return [np.ones(40_000_000).sum()]\n"  # 320 MB
    assert run(jail, source, limits=Limits(memory_mb=256)).status is RunStatus.OUT_OF_MEMORY
    assert value(run(jail, source, limits=Limits(memory_mb=600))) == [4e7]


def test_waiting_is_told_from_working(jail: Jail) -> None:
    report = run(jail, "import time\ntime.sleep(100)", limits=Limits(cpu_s=5, wall_s=0.3))
    assert report.status is RunStatus.TIMED_OUT
    assert "waiting" in report.reason


def test_starving_for_a_core_is_not_held_against_a_script(jail: Jail) -> None:
    """Wall time counts only while the script itself waits: half a second of work takes several times the wall limit of
    0.3 s when seven scripts share the cores, and passes."""
    work = "import time\ndef main():\n    while time.process_time() < 0.5:\n        pass\n    return [1]\n"
    spin = "while True:\n    pass\n"
    with Jail(MODELS, workers=7) as crowded, ThreadPoolExecutor(6) as pool:
        for _ in range(6):
            pool.submit(crowded.run, Job(spin, DRIVER, {}, Limits(cpu_s=0.5, wall_s=60)))
        time.sleep(0.1)
        report = crowded.run(Job(work, DRIVER, {}, Limits(cpu_s=5, wall_s=0.3)))
    assert value(report) == [1]


def test_the_same_script_does_the_same_again(jail: Jail) -> None:
    source = "import random, numpy as np\ndef main():\n    return [random.random(), np.random.rand(), hash('x')]\n"
    assert value(run(jail, source)) == value(run(jail, source))


def test_more_jobs_than_workers_wait_their_turn(jail: Jail) -> None:
    source = "def main(n):\n    return [n * 2.0]\n"
    with ThreadPoolExecutor(8) as pool:
        reports = list(pool.map(lambda n: run(jail, source, n=n), range(40)))
    assert [value(report) for report in reports] == [[n * 2.0] for n in range(40)]


def test_limits_are_not_checked_at_every_message(jail: Jail, monkeypatch: pytest.MonkeyPatch) -> None:
    """A check reads several files of /proc; a run that sends hundreds of results would pay for each."""
    checks, refresh = count(), Usage.refresh

    def counted(usage: Usage) -> None:
        next(checks)
        refresh(usage)

    monkeypatch.setattr(Usage, "refresh", counted)
    driver = "import time\ndef run(_student, _inputs, submit):\n"
    driver += "    for n in range(300):\n        submit(f'r{n}', [1.0])\n        time.sleep(0.0005)\n"
    report = run(jail, "", driver)
    assert (report.status, len(report.results)) == (RunStatus.RETURNED, 300)
    assert next(checks) <= report.wall_s / POLL_S_MIN + 2


def test_a_missing_model_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(JailRefused, match="no folder of models"):
        Jail(tmp_path / "nowhere")


def test_surrogates_in_the_source_are_the_students(jail: Jail) -> None:
    assert run(jail, "x = '\ud800'").status is RunStatus.CRASHED
