"""Ten thousand trivial submissions in a row, and a census before and after. Not part of the suite: it takes minutes.

PYTHONPATH=src:tests python tests/sandbox/soak.py [SUBMISSIONS]
"""

import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from grader.domain.run import Job, RunStatus
from grader.sandbox.jail import Jail
from sandbox.conftest import at_rest_with, jailed, resident_kb

MODELS = Path(__file__).parents[2] / "models"
DRIVER = "def run(student, inputs, submit):\n    submit('answer', [inputs['n']])\n"
WORKERS = 2
AT_REST = 3 + 2 * WORKERS


def figures(label: str) -> None:
    """One line: what this process and the jail hold at rest."""
    census = at_rest_with(AT_REST, patience_s=60)
    jail_kb = sum(map(resident_kb, jailed()))
    mounts = len(Path("/proc/mounts").read_text().splitlines())
    shown = f"resident {resident_kb(os.getpid()) / 1024:.1f} MB, jail's processes {jail_kb / 1024:.1f} MB"
    print(f"{label:>7}: {census}, mounts of the machine {mounts}, {shown}", flush=True)


def main(submissions: int) -> None:
    with Jail(MODELS, workers=WORKERS) as jail:

        def one(n: int) -> bool:
            report = jail.run(Job(f"print({n})", DRIVER, {"n": n}))
            return (
                report.status is RunStatus.RETURNED and report.stdout == f"{n}\n" and report.results["answer"][0] == n
            )

        def several(count: int) -> int:
            """Two callers, and nothing kept of a job when it is done."""
            with ThreadPoolExecutor(WORKERS) as pool:
                return sum(pool.map(lambda first: sum(map(one, range(first, count, WORKERS))), range(WORKERS)))

        right = several(200)
        figures("before")
        began = time.monotonic()
        right += several(submissions)
        seconds = time.monotonic() - began
        figures("after")
        print(f"{right} of {submissions + 200} right, {submissions / seconds:.0f} a second, {jail.restarts} restarts")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)
