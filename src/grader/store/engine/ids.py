"""Ids of rows: those of what happens sort by the time when they were made, those of members do not tell it."""

import secrets
import string
import time
from datetime import datetime


def now_ms() -> int:
    """The time since 1970 [ms]."""
    return time.time_ns() // 1_000_000


def new_id(after: str = "", random: str = "") -> str:
    """32 hexadecimal digits: 48 bits of milliseconds, so that ids sort by time, and 80 random bits: 20 digits that may
    be drawn before. It sorts behind the id `after`, also where the clock has been set back or shows the same
    millisecond."""
    earliest = int(after[:12], 16) + 1 if after else 0
    return f"{max(now_ms(), earliest):012x}{random or secrets.token_hex(10)}"


def first_id(moment: datetime) -> str:
    """The least id that `new_id` makes at a moment."""
    return f"{int(moment.timestamp() * 1000):012x}{'0' * 20}"


def age_s(new_id_: str) -> float | None:
    """The time since `new_id` made an id [s], at least 0; None for another text."""
    if len(new_id_) != 32 or not all(digit in string.hexdigits for digit in new_id_):
        return None
    return max(0, now_ms() - int(new_id_[:12], 16)) / 1000


def new_member_id() -> str:
    """128 random bits as 32 hexadecimal digits."""
    return secrets.token_hex(16)
