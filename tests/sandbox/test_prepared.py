"""What is done before a job arrives: code objects are loaded, and pages of memory are the child's own."""

import marshal
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.domain.run import Job, RunStatus
from grader.sandbox.jail import Jail
from grader.sandbox.locks import cell
from sandbox.conftest import MODELS

pytestmark = pytest.mark.jail

DRIVER = """
exec(codes["part"])

def run(student, inputs, submit):
    submit("answer", [answer()])
"""

FAULTS = """
import resource
import mujoco

def count():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def work():
    before = count()
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.add_joint(axis=[0, 1, 0])
    body.add_geom(size=[0.1, 0, 0], pos=[0, 0, 1])
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(3):
        mujoco.mj_step(model, data)
        data.qpos.copy() + data.qvel
    return count() - before
"""


def compile_part(number: int) -> bytes:
    return marshal.dumps(compile(f"def answer():\n    return {number}.0\n", "<part>", "exec"))


@pytest.mark.parametrize("number", [1, 2])
def test_a_driver_finds_its_code_whether_the_zygote_has_loaded_it_or_the_job_brings_it(number: int) -> None:
    large = marshal.dumps(compile(f"x = {'y' * 200_000!r}", "<large>", "exec"))  # beyond a packet of the zygote's
    with Jail(MODELS, workers=1, codes=[compile_part(1), large]) as jail:
        report = jail.run(Job("", DRIVER, {}, codes={"part": compile_part(number)}))
    assert report.status is RunStatus.RETURNED, report.reason
    assert report.results["answer"].tolist() == [number]


@pytest.fixture
def unrehearsed(tmp_path: Path) -> Iterator[Jail]:
    """A jail whose children do not rehearse."""
    inside = tmp_path / "inside"
    shutil.copytree(cell.INSIDE, inside)
    zygote = inside / "zygote.py"
    text = zygote.read_text(encoding="utf-8")
    assert text.count('config["rehearsal"].run()') == 1
    zygote.write_text(text.replace('config["rehearsal"].run()', "pass"), encoding="utf-8")
    with Jail(MODELS, workers=1, inside=inside) as jail:
        yield jail


def count_faults(jail: Jail) -> float:
    report = jail.run(Job(FAULTS, "def run(student, inputs, submit):\n    submit('faults', [student.work()])", {}))
    assert report.status is RunStatus.RETURNED, report.reason
    return float(report.results["faults"][0])


def test_a_script_copies_fewer_pages_after_the_rehearsal(jail: Jail, unrehearsed: Jail) -> None:
    assert count_faults(jail) < 0.75 * count_faults(unrehearsed)
