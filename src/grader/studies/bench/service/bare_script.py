"""Calls a script's function on the trials of a plan with nothing around it, in a plain process: no jail, no driver, no
trace, no force. A process reads one line of JSON for each plan, and answers with the CPU time of the calls [s]. Models
and data are made before."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco

from grader.exercises import Plan
from grader.exercises.kinds.rk4.judging.driver import start_data
from grader.numerics.process import prepare

Call = Callable[[], object]


class BareProcess:
    """A process that calls scripts' functions."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process

    def measure_cpu_s(self, kind: str, source: str, plan: Plan) -> float:
        """Returns the CPU time of all calls [s]: what the script itself needs."""
        trials = [*plan.inputs["trials"], *plan.hidden_inputs.get("trials", [])]
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps({"kind": kind, "source": source, "trials": trials}) + "\n")
        self._process.stdin.flush()
        return float(self._process.stdout.readline())


@contextmanager
def open_bare_process() -> Iterator[BareProcess]:
    """A process that has MuJoCo and NumPy imported, with the profiling timer off."""
    command = [sys.executable, "-m", __name__]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)  # noqa: S603
    try:
        yield BareProcess(process)
    finally:
        process.communicate()  # which closes its input, and so ends it


def list_calls_of_threshold(functions: Mapping[str, Any], trial: Mapping[str, Any]) -> list[Call]:
    """Returns the one call of a trial."""
    inputs, function = trial["inputs"], functions[trial["entries"][0]]
    model = mujoco.MjModel.from_xml_string(inputs["model"])
    return [lambda: function(model, inputs["integrator"])]


def list_calls_of_rk4(functions: Mapping[str, Any], trial: Mapping[str, Any]) -> list[Call]:
    """Returns a call for each run of a trial."""
    inputs, function = trial["inputs"], functions[trial["entries"][0]]

    def build_run(timestep_s: float, steps: int) -> Call:
        model = mujoco.MjModel.from_xml_string(inputs["model"])
        model.opt.timestep = timestep_s
        data = start_data(model, inputs["start"])

        def take_steps() -> None:
            for _ in range(steps):
                function(model, data)

        return take_steps

    return [build_run(**run) for run in inputs["runs"]]


LIST_CALLS: Mapping[str, Callable[[Mapping[str, Any], Mapping[str, Any]], list[Call]]] = {
    "threshold": list_calls_of_threshold,
    "rk4": list_calls_of_rk4,
}
"""Makes the calls of a trial, by the kind of the exercise."""


def answer_plans() -> None:
    """Answers every line of standard input."""
    prepare()
    sys.modules["mjcourse"] = course = ModuleType("mjcourse")
    vars(course)["model_path"] = Path
    for line in sys.stdin:
        plan = json.loads(line)
        module = sys.modules["script"] = ModuleType("script")
        exec(compile(plan["source"], "script.py", "exec"), vars(module))  # noqa: S102  a reference solution
        calls = [call for trial in plan["trials"] for call in LIST_CALLS[plan["kind"]](vars(module), trial)]
        began = time.process_time()
        for call in calls:
            call()
        print(time.process_time() - began, flush=True)


if __name__ == "__main__":
    answer_plans()
