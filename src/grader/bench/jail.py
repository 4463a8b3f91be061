"""What the jail costs above the script's own time, idle and in bursts, beside an interpreter and a cell made anew."""

import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from grader.domain.run import Job, RunStatus
from grader.sandbox import cell, policy
from grader.sandbox.jail import Jail

WORKERS = 2
BURST = 200
PAUSE_S = 0.05
"""Between idle runs [s]: long enough for a spare to be made again."""

SOURCE = "import mujoco, numpy as np\n\nprint('hello')\n\n\ndef answer():\n    return np.arange(3.0)\n"
DRIVER = """
import time

began = time.perf_counter()

def run(student, inputs, submit):
    submit("answer", student.answer())
    submit("own_s", [time.perf_counter() - began])
"""


def overheads(models: Path, rounds: int, bursts: int) -> tuple[dict[str, list[float]], float]:
    """Wall times [s] by what was run, and the median rate of the bursts [jobs/s].

    `models` is the folder that the jail shows to scripts. Idle runs take turns with a new interpreter and a single-use
    bubblewrap cell, so that load on the machine meets all three alike.
    """
    runtime = cell.discover()
    importing = f"import sys; sys.path += {list(map(str, runtime.packages))!r}; import mujoco, numpy"
    single_use = cell.bubblewrap(runtime, models, cell.INSIDE, control=0)
    single_use[-2:] = [importing]
    commands = {
        "new interpreter": [str(runtime.executable), *cell.ISOLATED, "-c", importing],
        "single-use bubblewrap": single_use,
    }
    times: dict[str, list[float]] = {name: [] for name in ("jail, idle", "jail, in a burst", *commands)}
    with Jail(models, WORKERS) as jail:
        _overhead_s(jail)
        for _ in range(rounds):
            time.sleep(PAUSE_S)
            times["jail, idle"].append(_overhead_s(jail))
            for name, command in commands.items():
                start = time.perf_counter()
                subprocess.run(command, env=policy.ENVIRONMENT, check=True, capture_output=True)  # noqa: S603
                times[name].append(time.perf_counter() - start)
        rates = []
        for _ in range(bursts):
            with ThreadPoolExecutor(WORKERS) as pool:
                start = time.perf_counter()
                times["jail, in a burst"] += pool.map(lambda _: _overhead_s(jail), range(BURST))
                rates.append(BURST / (time.perf_counter() - start))
    return times, float(np.median(rates))


def _overhead_s(jail: Jail) -> float:
    """The time of one job above the script's own [s]."""
    start = time.perf_counter()
    report = jail.run(Job(SOURCE, DRIVER, {}))
    total_s = time.perf_counter() - start
    assert report.status is RunStatus.RETURNED, report.reason
    return total_s - float(report.results["own_s"][0])
