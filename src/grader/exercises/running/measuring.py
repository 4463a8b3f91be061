"""Compiles and simulates what a script made in a second process of the jail, and never in ours. A model in our process
would read our files (`<include>`, `<hfield file>`), and take our time and memory."""

import base64
from collections.abc import Callable
from dataclasses import dataclass
from inspect import getsource
from typing import Any

from grader.domain.run import Job, RunReport, RunStatus
from grader.domain.verdict import Status
from grader.exercises.driving import measurer
from grader.exercises.driving.embedding import compile_code
from grader.exercises.kind import CPU_S_MAX, Measurement, Results, Trial

Run = Callable[[Job], RunReport]
"""Runs a job in the jail. Raises JailFault."""


DRIVER = 'exec(codes["measurer"])\nload(codes["program"])\n'


def limit_cpu(run: Run, most_s: float = CPU_S_MAX) -> Run:
    """Returns `run` for the trials of one script, which together have this CPU time [s]."""
    spent_s = 0.0

    def run_within(job: Job) -> RunReport:
        nonlocal spent_s
        if spent_s >= most_s:
            return RunReport(RunStatus.TIMED_OUT)
        report = run(job)
        spent_s += report.cpu_s
        return report

    return run_within


@dataclass(frozen=True)
class MeasuringFailure:
    """How a measuring program ended that did not return, and why: in words without numbers of the case, and with."""

    status: Status
    why: str
    detail: str


def measure(measurement: Measurement, trial: Trial[Any], results: Results, run: Run) -> Results | MeasuringFailure:
    """Returns what the measuring program submits. The program is the kind's, so whatever ends it is what the script
    made. Raises JailFault."""
    encoded = {
        name: (array.dtype.str, array.shape, base64.b64encode(array.tobytes()).decode())
        for name, array in results.items()
    }
    codes = {"measurer": compile_code(getsource(measurer)), "program": compile_code(measurement.program)}
    inputs = {"inputs": trial.inputs if trial.measured is None else trial.measured, "results": encoded}
    report = run(Job("", DRIVER, inputs, measurement.limits, codes=codes))
    if report.status is RunStatus.RETURNED:
        return report.results
    detail = report.reason if report.status is RunStatus.CRASHED else ""
    return MeasuringFailure(Status(report.status.value), explain_end(report.status, measurement), detail)


def explain_end(status: RunStatus, measurement: Measurement) -> str:
    """Returns the sentence for a measuring program that did not return."""
    made, limits = "What you made", measurement.limits
    if status is RunStatus.TIMED_OUT:
        allowed = f"more than {limits.cpu_s:g} s, or {measurement.cpu_s_all:g} s in all cases together"
        return f"{made} takes too much CPU time to compile and simulate: {allowed}."
    if status is RunStatus.OUT_OF_MEMORY:
        return f"{made} takes too much memory to compile and simulate: more than {limits.memory_mb} MB."
    return f"{made} cannot be compiled and simulated."
