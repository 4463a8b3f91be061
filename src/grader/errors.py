"""Every error this service raises on purpose, by whose fault it is.

GraderError
├── ContentError      the author's: a quiz, model or exercise is wrong; all faults are listed at once
├── InvalidAnswer     the student's: an answer that cannot be read; it uses no attempt
├── CallerError       the caller's: a request that cannot be served
│   ├── Unauthorized     no valid token
│   ├── Forbidden        the wrong role
│   ├── NotFound         not there, or not the caller's to see
│   ├── Conflict         not in this state
│   ├── Outdated         changed since the caller saw it
│   ├── TooLarge         more bytes than allowed
│   ├── Unprocessable    well-formed, but not meaningful
│   ├── FaultyRows       rows of a file that cannot be taken; all are listed at once
│   ├── Unconditional    a precondition is missing
│   └── TooManyRequests  too often
├── PluginError       the operator's: an installed package of kinds cannot be used
├── NotReady          ours: a part of the service does not work now; `/readyz` tells which
├── LabError          a lab's expression failed while it ran: question, control, line and column
├── LabRefused        a lab does not offer these settings: controls, presses, lengths
├── ScriptStopped     the learner's: a running script that they have stopped
├── ContentLost       ours: the content of a submission is not in the database; retried, then `grader_fault`
└── JailFault         ours: the jail broke; retried, then `grader_fault`, and no attempt is used
    └── JailRefused   this machine cannot isolate a script: refuse to start

A student's script that fails is no exception but a status in its Verdict; a simulation that diverges is data in a
Rollout. The faces give an error its HTTP status.
"""

from collections.abc import Iterable
from dataclasses import dataclass


class GraderError(Exception):
    """The root of the tree."""


@dataclass(frozen=True, order=True)
class Fault:
    """One thing that is wrong with the content: the file, the key in it, and how to mend it."""

    file: str
    key: str
    why: str

    def __str__(self) -> str:
        """As `grader check` lists it: `file: key: why`."""
        return f"{self.file}: {self.key}: {self.why}"


class ContentError(GraderError):
    """The content folder is wrong; `faults` lists every fault."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(map(str, self.faults)))


class PluginError(GraderError):
    """An installed package of kinds cannot be used; the message names it, what it lacks, and the cure."""


class InvalidAnswer(GraderError):
    """An answer that cannot be read; the message tells the student why, and what can be read."""


class CallerError(GraderError):
    """A request that cannot be served; the message says why."""


class Unauthorized(CallerError):
    """No valid token."""


class Forbidden(CallerError):
    """A valid token of the wrong role."""


class NotFound(CallerError):
    """Not there, or not the caller's to see: both give the same answer."""


class Conflict(CallerError):
    """Not now: the state of the resource forbids it."""


class Outdated(CallerError):
    """The resource has changed since the caller last saw it."""


class TooLarge(CallerError):
    """More bytes than the limit."""


class Unprocessable(CallerError):
    """Well-formed, but not meaningful."""


class WrongMoments(Unprocessable):
    """The zone or a moment of a form cannot be read: a sentence a line, each with the label of its field."""


class FaultyRows(CallerError):
    """Rows of a file cannot be taken, so that none was; `faults` lists each with its file, line and column."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(map(str, self.faults)))


class Unconditional(CallerError):
    """A change must name the state of the resource that it was made for."""


class TooManyRequests(CallerError):
    """Too many requests; the caller may try again after `retry_after_s` seconds."""

    def __init__(self, message: str, retry_after_s: int) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class NotReady(GraderError):
    """A part of the service does not work now; the message says which, and what cures it, to anybody."""


class LabError(GraderError):
    """A lab's expression failed while it ran.

    `key` names the expression, such as `q3.sim.controls.0.apply`; `why` gives line, column and reason.
    """

    def __init__(self, key: str, why: str) -> None:
        self.key, self.why = key, why
        super().__init__(f"{key}: {why}")


class LabRefused(GraderError):
    """A lab cannot run with these settings; the message names what it offers."""


class ScriptStopped(GraderError):
    """The learner has stopped the script while it ran; `has_seen_hidden` once it had its hidden inputs."""

    def __init__(self, has_seen_hidden: bool) -> None:
        self.has_seen_hidden = has_seen_hidden
        super().__init__(has_seen_hidden)


class ContentLost(GraderError):
    """The database does not hold the content of this digest, or it can no longer be loaded."""


class JailFault(GraderError):
    """The jail broke, not the student's script."""


class JailRefused(JailFault):
    """This machine lacks a layer of isolation that is required."""
