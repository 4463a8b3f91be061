"""Runs attacks, which must all fail before the jail takes a student's script."""

from collections.abc import Callable
from dataclasses import dataclass

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.errors import JailRefused

# Each snippet must end in the refusal that is named; `held` is printed only by the right one.
ATTACKS = {
    "reads the host's files": "open('/etc/passwd')",
    "lists processes": "import os; assert not os.listdir('/proc'); open('/proc/1/status')",
    "writes outside its directory": "open('/x.txt', 'w')",
    "opens a socket": "import socket; socket.socket()",
    "starts a program": "import os; os.execv('/bin/sh', ['sh'])",
    "forks": "import os; os.fork()",
    "signals others": "import os; os.kill(-1, 9)",
    "changes its scheduling": "import os; os.setpriority(os.PRIO_PROCESS, 0, -5)",
    "becomes another user": "import os; os.setuid(0)",
    "makes a link": "import os; os.symlink('/etc', 'x')",
    "enters a namespace": "import ctypes; ctypes.CDLL(None).unshare(0x10000000)",
    "traces": "import ctypes; ctypes.CDLL(None).ptrace(0, 0, 0, 0)",
}
DRIVER = """
def run(student, inputs, submit):
    from mjcourse import model_path
    for path in model_path("").parent.glob("*.xml") if inputs.get("models") else []:
        path.read_bytes()
    submit("x", [1.0, 2.0])
"""
LIMITS = Limits(cpu_s=5.0, wall_s=30.0)


INTEGRATORS, TIMESTEP_S = "MuJoCo's integrators", 0.002  # MuJoCo's default
STEPS = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><joint axis='0 1 0'/><geom size='.1'/></body></worldbody></mujoco>"
)
data = mujoco.MjData(model)
mujoco.mj_step(model, data)
before = data.time
mujoco.mj_resetData(model, data)
"""
STEPPING = """
import mujoco

def run(student, inputs, submit):
    mujoco.mj_step(student.model, student.data)
    submit("times", [student.before, student.data.time])
"""


@dataclass(frozen=True)
class SelfTest:
    """The attacks that were tried; all of them failed."""

    held: tuple[str, ...]

    def __str__(self) -> str:
        return f"{len(self.held)} of {len(self.held)} attacks held"


def run_selftest(play: Callable[[Job], RunReport], keeps_integrators: Callable[[], str]) -> SelfTest:
    """Run every attack, and one honest script. `keeps_integrators` returns, after a job, the reason why MuJoCo's
    integrators cannot be removed here. If it is empty, a script must be able to step while it is imported, but not
    afterwards. Raises JailRefused if an attack succeeded; the text names it."""
    honest = play(Job("import mujoco, numpy as np\nx = np.arange(3.0)", DRIVER, {}, LIMITS))
    if honest.status is not RunStatus.RETURNED:
        raise JailRefused(f"The jail cannot run an honest script: {honest.reason}")
    reports = {name: play(Job(source, DRIVER, {}, LIMITS)) for name, source in ATTACKS.items()}
    through = [f"{name} ({r.status}: {r.reason})" for name, r in reports.items() if r.status is not RunStatus.FORBIDDEN]
    if through:
        raise JailRefused(f"The jail's self-test failed: {'; '.join(through)}")
    if keeps_integrators():
        return SelfTest(tuple(reports))
    report = play(Job(STEPS, STEPPING, {}, LIMITS, without_integrators=True))
    if report.stepped != 1 or "times" not in report.results or report.results["times"].tolist() != [TIMESTEP_S, 0.0]:
        raise JailRefused(f"The jail's self-test failed: {INTEGRATORS} remain ({report.status}: {report.reason})")
    return SelfTest((*reports, f"uses {INTEGRATORS}"))
