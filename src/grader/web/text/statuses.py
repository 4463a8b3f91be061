"""What a status is called on pages: a word, an icon and a tone, so that no meaning hangs on a colour."""

from dataclasses import dataclass

from grader.domain.verdict import Status


@dataclass(frozen=True)
class Told:
    """A status for people. `icon` is one of marks.html, `tone` a class of the style sheet."""

    word: str
    icon: str
    tone: str


NOT_ANSWERED = Told("Not answered", "open", "wait")
QUEUED = Told("Waiting for its turn", "waiting", "wait")
RUNNING = Told("Running", "waiting", "wait")
RECEIVED = Told("Received", "waiting", "wait")

STATUSES = {
    Status.CORRECT: Told("Correct", "right", "ok"),
    Status.PARTIAL: Told("Partly correct", "partly", "part"),
    Status.INCORRECT: Told("Not correct", "wrong", "no"),
    Status.NEEDS_REVIEW: Told("Waiting for an instructor", "waiting", "wait"),
    Status.INVALID_ANSWER: Told("Not readable", "unread", "no"),
    Status.CRASHED: Told("Ended with an error", "stopped", "no"),
    Status.TIMED_OUT: Told("Ran out of time", "stopped", "no"),
    Status.OUT_OF_MEMORY: Told("Ran out of memory", "stopped", "no"),
    Status.OUTPUT_TOO_LARGE: Told("Printed or returned too much", "stopped", "no"),
    Status.FORBIDDEN: Told("Not allowed here", "stopped", "no"),
    Status.GRADER_FAULT: Told("The grader failed, not you", "fault", "wait"),
}
"""What each status of a verdict is called."""

PASSED = Told("passed", "right", "ok")
PARTLY = Told("partly", "partly", "part")
FAILED = Told("failed", "wrong", "no")
UNDECIDED = Told("open", "waiting", "wait")
REPLACED = Told("Replaced by a newer answer", "open", "wait")
WAITS = Told("waits", "waiting", "wait")


def describe_status(status: str, *, withheld: bool = False) -> Told:
    """Returns how the status of a verdict is shown. A withheld one was only received."""
    known = Status(status)
    return RECEIVED if withheld and known is Status.NEEDS_REVIEW else STATUSES[known]


def describe_outcome(passed: bool | None, points: float) -> Told:
    """Returns how the outcome of a finding is shown."""
    if passed is None:
        return PARTLY if points > 0 else UNDECIDED
    return PASSED if passed else FAILED
