"""Every error this service raises on purpose, by whose fault it is.

GraderError
├── ContentError      the author's: a quiz, model or exercise is wrong; all of them are listed at once
├── InvalidAnswer     the student's: an answer that cannot be read; it uses no attempt
├── CallerError       the caller's: becomes an HTTP status, in one place
│   ├── Unauthorized     401
│   ├── Forbidden        403
│   ├── NotFound         404
│   ├── Conflict         409
│   ├── Outdated         412
│   ├── TooLarge         413
│   ├── Unprocessable    422
│   ├── Unconditional    428
│   └── TooManyRequests  429
├── LabError          a lab's expression went wrong while it ran: question, control, line and column
└── JailFault         ours: the jail broke; retried, then `grader_fault`, and no attempt is used
    └── JailRefused   this machine cannot hold the jail: refuse to start

What a student's script does wrong is no exception but a status in its Verdict; what physics does (divergence) is
data in a Rollout.
"""

from collections.abc import Iterable
from dataclasses import dataclass


class GraderError(Exception):
    """The root of the tree."""


@dataclass(frozen=True, order=True)
class Fault:
    """One thing that is wrong with the content: where it stands, and how to mend it."""

    file: str
    key: str
    why: str

    def __str__(self) -> str:
        """As `grader check` lists it: `file: key: why`."""
        return f"{self.file}: {self.key}: {self.why}"


class ContentError(GraderError):
    """The content folder is wrong; `faults` lists everything that is."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(map(str, self.faults)))


class InvalidAnswer(GraderError):
    """An answer that cannot be understood; the message tells the student why and what would be."""


class CallerError(GraderError):
    """A request that cannot be served; `status` is the HTTP code."""

    status = 400


class Unauthorized(CallerError):
    """No valid token."""

    status = 401


class Forbidden(CallerError):
    """A valid token of the wrong role."""

    status = 403


class NotFound(CallerError):
    """Not there, or not yours to see: both look the same."""

    status = 404


class Conflict(CallerError):
    """Not now: the state of the resource forbids it."""

    status = 409


class Outdated(CallerError):
    """The resource has changed since the caller last saw it."""

    status = 412


class TooLarge(CallerError):
    """More bytes than the limit."""

    status = 413


class Unprocessable(CallerError):
    """Well-formed, but not meaningful."""

    status = 422


class Unconditional(CallerError):
    """A change that must say which state of the resource it was made for."""

    status = 428


class TooManyRequests(CallerError):
    """Slow down; `retry_after_s` says by how much."""

    status = 429

    def __init__(self, message: str, retry_after_s: int) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class LabError(GraderError):
    """A lab's expression failed while it ran; the message names control, line and column."""


class JailFault(GraderError):
    """The jail broke, not the student's script."""


class JailRefused(JailFault):
    """This machine lacks a layer without which no student's code may run."""
