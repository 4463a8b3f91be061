"""What the jail costs: overhead above the student's own time, idle and in bursts, beside what it is compared with.

`python -m grader.bench.jail` prints the figures as JSON.
"""

import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from grader.domain.run import Job, RunStatus
from grader.sandbox import cell, policy
from grader.sandbox.jail import Jail

WORKERS = 2
BURST = 200
BURSTS = 3
ROUNDS = 40
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
IMPORTS = "import mujoco, numpy"


def measure(models: Path, quick: bool = False) -> dict[str, Any]:
    """Medians and 95th percentiles [ms], bursts [jobs/s], ratios to the jail's median of the same run.

    `models` is the folder that the jail shows to scripts. Idle runs take turns with a cold interpreter and a single-use
    bubblewrap cell, so that load on the machine meets all three alike.
    """
    rounds = 10 if quick else ROUNDS
    runtime = cell.discover()
    one_use = _single_use(runtime, models)
    cold = [str(runtime.executable), *cell.ISOLATED, "-c", _importing(runtime)]
    seen: dict[str, list[float]] = {"idle": [], "idle_total": [], "cold_interpreter": [], "single_use_bubblewrap": []}
    with Jail(models, WORKERS) as jail:
        _once(jail)
        for _ in range(rounds):
            time.sleep(PAUSE_S)
            total_s, own_s = _once(jail)
            seen["idle"].append(total_s - own_s)
            seen["idle_total"].append(total_s)
            seen["cold_interpreter"].append(_process(cold))
            seen["single_use_bubblewrap"].append(_process(one_use))
        bursts = [_burst(jail, seen) for _ in range(1 if quick else BURSTS)]
        tier = str(jail.tier)
    found = {name: _spread(values) for name, values in seen.items()}
    ratios = {
        name: found[name]["median_ms"] / found["idle"]["median_ms"]
        for name in ("cold_interpreter", "single_use_bubblewrap")
    }
    return {
        "tier": tier,
        "rounds": rounds,
        **found,
        "burst_jobs_per_s": float(np.median(bursts)),
        "ratio_to_idle": ratios,
    }


def _once(jail: Jail) -> tuple[float, float]:
    """One job's whole time and the script's own [s]."""
    start = time.perf_counter()
    report = jail.run(Job(SOURCE, DRIVER, {}))
    total_s = time.perf_counter() - start
    assert report.status is RunStatus.RETURNED, report.reason
    return total_s, float(report.results["own_s"][0])


def _burst(jail: Jail, seen: dict[str, list[float]]) -> float:
    """BURST jobs in a row from WORKERS callers [jobs/s]; the overhead of each is kept."""
    with ThreadPoolExecutor(WORKERS) as pool:
        start = time.perf_counter()
        runs = list(pool.map(lambda _: _once(jail), range(BURST)))
        elapsed_s = time.perf_counter() - start
    seen.setdefault("burst", []).extend(total_s - own_s for total_s, own_s in runs)
    return BURST / elapsed_s


def _process(command: list[str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, env=policy.ENVIRONMENT, check=True, capture_output=True)  # noqa: S603
    return time.perf_counter() - start


def _importing(runtime: cell.Runtime) -> str:
    return f"import sys; sys.path += {list(map(str, runtime.packages))!r}; {IMPORTS}"


def _single_use(runtime: cell.Runtime, models: Path) -> list[str]:
    """The same cell around a fresh interpreter instead of the zygote."""
    command = cell.bubblewrap(runtime, models, cell.INSIDE, control=0)
    command[-2:] = [_importing(runtime)]
    return command


def _spread(seconds: list[float]) -> dict[str, float]:
    median, p95 = np.percentile(np.array(seconds) * 1e3, (50, 95))
    return {"median_ms": float(median), "p95_ms": float(p95)}


if __name__ == "__main__":
    print(json.dumps(measure(Path(sys.argv[1] if len(sys.argv) > 1 else "models")), indent=1))
