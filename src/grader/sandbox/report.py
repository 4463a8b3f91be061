"""Turns the ending of a run into a RunReport. Evidence from outside outranks the claims of the script."""

import os
import signal

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.errors import JailFault, ScriptStopped
from grader.sandbox.cleaning import clean, clean_reason
from grader.sandbox.frames import MalformedMessage, Message, parse_message
from grader.sandbox.policy import KB, MB, RESULT_BYTES_MAX
from grader.sandbox.spent import explain_time_out
from grader.sandbox.watch import Cause, Ending

# Reasons for an end that the script's process does not explain.
SILENT = {
    RunStatus.CRASHED: "The script ended with an error.",
    RunStatus.FORBIDDEN: "The script did something that scripts may not do.",
    RunStatus.OUT_OF_MEMORY: "The script ran out of memory.",
}
# An unexplained SIGKILL counts as the CPU limit once this share of it is used.
NEARLY = 0.9
NO_MEMORY = (b"bad_alloc", b"MemoryError", b"ould not allocate", b"annot allocate memory")


def build_report(ending: Ending, job: Job) -> RunReport:
    """Decide the status; of a script that ran out of time, say where. Nothing that a script does can make this raise.
    Raises JailFault if something other than the jail or a limit killed the process, and ScriptStopped."""
    if ending.cause is Cause.STOP:
        raise ScriptStopped(ending.hidden_sent)
    limits = job.limits
    status, reason, message = _decide(ending, limits)
    if status is RunStatus.TIMED_OUT:
        waits = ending.cause is Cause.WALL
        reason += explain_time_out(ending.results, job.source, waits=waits, hidden=ending.hidden_sent)
    cap = limits.output_kb * KB
    return RunReport(
        status=status, reason=clean_reason(reason),
        results=message.results if message and status is RunStatus.RETURNED else {},
        hidden_results=message.hidden if message and status is RunStatus.RETURNED else {},
        stdout=clean(ending.stdout, cap), stderr=clean(ending.stderr, cap), cpu_s=ending.cpu_s, wall_s=ending.wall_s,
        stepped=ending.stepped, talked=ending.talked
    )  # fmt: skip


def _decide(ending: Ending, limits: Limits) -> tuple[RunStatus, str, Message | None]:
    stopped = _explain_stop(ending, limits)
    if stopped:
        return *stopped, None
    code = os.waitstatus_to_exitcode(ending.wait_status)
    if code < 0:
        return *_explain_signal(-code, ending), None
    try:
        message = parse_message(ending.results)
    except MalformedMessage as error:
        why = "" if ending.hidden_sent else f": {error}"  # names and exit codes may reveal hidden inputs, like reasons
        return RunStatus.CRASHED, f"The results that the script sent back cannot be used{why}.", None
    if message.end is None or code != 0:
        how = "" if ending.hidden_sent else f" (exit code {code})"
        return RunStatus.CRASHED, f"The script ended its own process{how} before it was graded.", None
    reason = "" if ending.hidden_sent else message.reason
    return message.end, reason or SILENT.get(message.end, ""), message


def _explain_stop(ending: Ending, limits: Limits) -> tuple[RunStatus, str] | None:
    """Return the status of a run that the supervisor, or the kernel at a limit, ended; None if it ended by itself."""
    if ending.oom_killed:
        return RunStatus.OUT_OF_MEMORY, SILENT[RunStatus.OUT_OF_MEMORY]
    killed = os.WIFSIGNALED(ending.wait_status) and os.WTERMSIG(ending.wait_status) == signal.SIGKILL
    out_of_time = killed and ending.cause is None and ending.cpu_s >= NEARLY * limits.cpu_s
    stops = {
        Cause.CPU: (RunStatus.TIMED_OUT, f"The script used up its CPU time of {limits.cpu_s:g} s."),
        Cause.WALL: (RunStatus.TIMED_OUT, f"The script was still waiting for something after {limits.wall_s:g} s."),
        Cause.OUTPUT: (
            RunStatus.OUTPUT_TOO_LARGE,
            f"The script printed more than {limits.output_kb} KB: take `print` out of its loops and steps.",
        ),
        Cause.MEMORY: (RunStatus.OUT_OF_MEMORY, f"The script used more than {limits.memory_mb} MB of memory."),
        Cause.PART: (RunStatus.TIMED_OUT, "The script used up the CPU time that one case may take."),
        Cause.ANSWER: (RunStatus.CRASHED, "The script's process answered what it was not asked."),
        Cause.RESULTS: (RunStatus.OUTPUT_TOO_LARGE, f"The script sent back more than {RESULT_BYTES_MAX // MB} MB."),
    }
    cause = Cause.CPU if out_of_time else ending.cause
    if cause is not None:
        return stops[cause]
    if killed:
        raise JailFault("A child of the jail was killed from outside.")
    return None


def _explain_signal(number: int, ending: Ending) -> tuple[RunStatus, str]:
    if number == signal.SIGSYS:
        return RunStatus.FORBIDDEN, "The script made a system call that scripts may not make."
    if any(words in ending.stderr + ending.late_stderr for words in NO_MEMORY):
        return RunStatus.OUT_OF_MEMORY, SILENT[RunStatus.OUT_OF_MEMORY]
    try:
        name = signal.Signals(number).name
    except ValueError:
        name = f"signal {number}"
    return RunStatus.CRASHED, f"The script's process was ended by {name} ({signal.strsignal(number) or 'unknown'})."
