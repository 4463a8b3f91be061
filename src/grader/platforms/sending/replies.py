"""What became of a try to deliver: every sender answers with one of these."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime

RETRY_MAX_S = 86_400.0
"""The longest `Retry-After` that is honoured [s]."""


@dataclass(frozen=True)
class SentReply:
    """The receiver has it. `score` is what a platform has now, as JSON; None for a webhook."""

    score: str | None = None


@dataclass(frozen=True)
class UnneededReply:
    """Nothing is to be sent for the result as it is."""


@dataclass(frozen=True)
class HeldReply:
    """The learner may not see the feedback yet; `for_s` is when to look again [s], None if an instructor decides."""

    for_s: float | None


@dataclass(frozen=True)
class Later:
    """Not now, and not for a failure: try again after a pause [s]."""

    after_s: float


@dataclass(frozen=True)
class Again:
    """It failed, and another try may help, after `after_s` at the earliest [s]. `is_slow` if no answer came in time."""

    why: str
    after_s: float = 0.0
    is_slow: bool = False


@dataclass(frozen=True)
class DeadLetter:
    """It failed for good: a dead letter."""

    why: str


@dataclass(frozen=True)
class Gone:
    """The receiver wants nothing more, ever."""

    why: str


Reply = SentReply | UnneededReply | HeldReply | Later | Again | DeadLetter | Gone


class DeliveryFailure(Exception):
    """Carries a reply out of the middle of a delivery."""

    def __init__(self, reply: Reply) -> None:
        super().__init__(str(reply))
        self.reply = reply


def retry_after_s(headers: Mapping[str, str], now: datetime) -> float:
    """Returns the pause that a server asks for with `Retry-After`, in seconds or as a date [s]; 0 if it does not."""
    text = headers.get("retry-after", "").strip()
    if text.isascii() and text.isdecimal():
        return min(float(text[:9]), RETRY_MAX_S)
    try:
        moment = parsedate_to_datetime(text)
    except ValueError:
        return 0.0
    moment = moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)
    return min(max(0.0, (moment - now).total_seconds()), RETRY_MAX_S)
