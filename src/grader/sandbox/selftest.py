"""Attacks that must fail before the first student's script is let in."""

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


@dataclass(frozen=True)
class SelfTest:
    """What was tried and what held."""

    held: tuple[str, ...]

    def __str__(self) -> str:
        return f"{len(self.held)} of {len(self.held)} attacks held"


def run(play: Callable[[Job], RunReport]) -> SelfTest:
    """Play every attack, and one honest script.

    Raises:
        JailRefused: naming what got through.
    """
    honest = play(Job("import mujoco, numpy as np\nx = np.arange(3.0)", DRIVER, {}, LIMITS))
    if honest.status is not RunStatus.RETURNED:
        raise JailRefused(f"The jail cannot run an honest script: {honest.reason}")
    reports = {name: play(Job(source, DRIVER, {}, LIMITS)) for name, source in ATTACKS.items()}
    through = [f"{name} ({r.status}: {r.reason})" for name, r in reports.items() if r.status is not RunStatus.FORBIDDEN]
    if through:
        raise JailRefused(f"The jail's self-test failed: {'; '.join(through)}")
    return SelfTest(tuple(reports))
