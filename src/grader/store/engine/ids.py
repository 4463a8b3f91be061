"""Ids of rows: those of what happens sort by the time when they were made, those of members do not tell it."""

import secrets
import string
import time
from datetime import datetime

TICKS = 1 << 20
"""Ticks of a millisecond in an id: the first 12 digits are the milliseconds, the next 5 their fraction (RFC 9562,
section 6.2, method 3)."""
RANDOM_DIGITS = 15


def now_ns() -> int:
    """The time since 1970 [ns]."""
    return time.time_ns()


def make_id(after: str = "", random: str = "") -> str:
    """32 hexadecimal digits: 68 bits of time in ticks of about a nanosecond, so that ids sort by time, and 60 random
    bits: RANDOM_DIGITS digits that may be drawn before. It sorts behind the id `after`, also where the clock has been
    set back."""
    earliest = int(after[:-RANDOM_DIGITS], 16) + 1 if after else 0
    return f"{max(now_ns() * TICKS // 1_000_000, earliest):017x}{random or secrets.token_hex(8)[:RANDOM_DIGITS]}"


def first_id(moment: datetime) -> str:
    """The least id that `make_id` makes at a moment."""
    return f"{int(moment.timestamp() * 1000):012x}{'0' * 20}"


def age_s(new_id_: str) -> float | None:
    """The time since `make_id` made an id [s], at least 0; None for another text."""
    if len(new_id_) != 32 or not all(digit in string.hexdigits for digit in new_id_):
        return None
    return max(0, now_ns() // 1_000_000 - int(new_id_[:12], 16)) / 1000


def make_member_id() -> str:
    """128 random bits as 32 hexadecimal digits."""
    return secrets.token_hex(16)
