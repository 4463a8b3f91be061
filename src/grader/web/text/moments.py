"""Moments on pages: UTC in words within `<time>`, which static/times.js writes in the zone of the reader."""

import re
from datetime import UTC, datetime

from markupsafe import Markup, escape

from grader.courses.rules.policy import format_moment

SPOKEN = re.compile(r"(?:[A-Z][a-z]{2} )?(\d{1,2} [A-Z][a-z]{2} \d{4}, \d{2}:\d{2} UTC)")
"""A moment in a sentence, as `format_moment` and `format_day` write it; the group has no day of the week."""

TAG = Markup('<time class="nowrap" datetime="{}" title="{}">{}</time>')


def format_day(moment: datetime) -> str:
    """Returns a moment with its day of the week: `Fri 27 Nov 2026, 18:00 UTC`."""
    return f"{moment:%a} {format_moment(moment)}"


def tag_moment(moment: datetime) -> Markup:
    """Returns a moment for a page: `27 Nov 2026, 18:00 UTC` within `<time>`."""
    return TAG.format(moment.isoformat(), format_moment(moment), format_moment(moment))


def tag_clock(moment: datetime) -> Markup:
    """Returns the time of day of a moment of the next hours: `18:00 UTC` within `<time>`."""
    return TAG.format(moment.isoformat(), format_moment(moment), f"{moment:%H:%M} UTC")


def tag_moments(sentence: str) -> Markup:
    """Puts every moment of a sentence of ours into `<time>`. Never for what a learner has typed."""
    return Markup(SPOKEN.sub(tag_match, str(escape(sentence))))  # noqa: S704


def tag_match(match: re.Match[str]) -> str:
    """Returns a moment of a sentence within `<time>`; what is no date stays text."""
    try:
        moment = datetime.strptime(match[1], "%d %b %Y, %H:%M UTC").replace(tzinfo=UTC)
    except ValueError:
        return match[0]
    return TAG.format(moment.isoformat(), match[1], match[0])
