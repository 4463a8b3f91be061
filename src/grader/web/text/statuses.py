"""What a status is called on pages: a word, an icon and a tone, so that no meaning hangs on a colour."""

from dataclasses import dataclass

from grader.domain.verdict import Status


@dataclass(frozen=True)
class Badge:
    """A status for people. `icon` is one of marks.html, `tone` a class of the style sheet."""

    word: str
    icon: str
    tone: str


NOT_ANSWERED = Badge("Not answered", "open", "wait")
QUEUED = Badge("Waiting for its turn", "waiting", "wait")
RUNNING = Badge("Running", "waiting", "wait")
HALTED = Badge("Stopped", "stopped", "wait")
RECEIVED = Badge("Received", "waiting", "wait")

STATUSES = {
    Status.CORRECT: Badge("Correct", "right", "ok"),
    Status.PARTIAL: Badge("Partly correct", "partly", "part"),
    Status.INCORRECT: Badge("Not correct", "wrong", "no"),
    Status.NEEDS_REVIEW: Badge("Waiting for an instructor", "waiting", "wait"),
    Status.INVALID_ANSWER: Badge("Not readable", "unread", "no"),
    Status.CRASHED: Badge("Ended with an error", "stopped", "no"),
    Status.TIMED_OUT: Badge("Ran out of time", "stopped", "no"),
    Status.OUT_OF_MEMORY: Badge("Ran out of memory", "stopped", "no"),
    Status.OUTPUT_TOO_LARGE: Badge("Printed or returned too much", "stopped", "no"),
    Status.FORBIDDEN: Badge("Not allowed here", "stopped", "no"),
    Status.GRADER_FAULT: Badge("The grader failed, not you", "fault", "wait"),
}
"""What each status of a verdict is called."""

PASSED = Badge("passed", "right", "ok")
PARTLY = Badge("partly", "partly", "part")
FAILED = Badge("failed", "wrong", "no")
UNDECIDED = Badge("open", "waiting", "wait")
REPLACED = Badge("Replaced by a newer answer", "open", "wait")
WAITS = Badge("waits", "waiting", "wait")
SECOND_MARK = Badge("waits for a second mark", "waiting", "wait")


def describe_status(status: str, *, withheld: bool = False) -> Badge:
    """Returns how the status of a verdict is shown. A withheld one was only received."""
    known = Status(status)
    return RECEIVED if withheld and known is Status.NEEDS_REVIEW else STATUSES[known]


def describe_outcome(passed: bool | None, points: float) -> Badge:
    """Returns how the outcome of a finding is shown."""
    if passed is None:
        return PARTLY if points > 0 else UNDECIDED
    return PASSED if passed else FAILED
