"""Moments that are typed into a form: fields of `datetime-local`, and the name of the zone that they are in.

A form has the fields `zone`, and `shown_zone`, the zone in which its moments were shown: UTC as the server writes
them, that of the reader once static/times.js has rewritten them. A moment that still reads as it was shown stays the
moment that it was, whatever the zone says.
"""

import zoneinfo
from collections.abc import Mapping
from datetime import UTC, datetime, tzinfo

from grader.courses.rules.policy import format_moment
from grader.errors import Unprocessable, WrongMoments

DEFAULT = "UTC"


def write_moment(moment: datetime | None, zone: tzinfo = UTC) -> str:
    """Returns a moment as a field of a form holds it: `2026-11-27T18:00`; empty for none."""
    if moment is None:
        return ""
    return moment.astimezone(zone).strftime("%Y-%m-%dT%H:%M" + (":%S" if moment.second else ""))


def find_zone(name: str) -> tzinfo:
    """Returns the zone of a name such as `Europe/Berlin`. UTC needs no database of zones. Raises Unprocessable."""
    name = name.strip() or DEFAULT
    if name.upper() == DEFAULT:
        return UTC
    try:
        return zoneinfo.ZoneInfo(name)
    except (ValueError, OSError, zoneinfo.ZoneInfoNotFoundError) as error:
        why = f"{name[:60]!r} is no time zone. Write a name such as Europe/Berlin or Asia/Kolkata, or UTC."
        if not zoneinfo.available_timezones():
            why = "This server has no database of time zones: write UTC, or have Debian's package tzdata installed."
        raise Unprocessable(why) from error


def convert_moments(
    form: Mapping[str, str], labels: Mapping[str, str], shown: Mapping[str, datetime | None] | None = None
) -> dict[str, str]:
    """Returns the fields of a form with the moments named in `labels` in UTC, as `write_moment` writes them; `shown`
    are those that the page showed. What is no date and time stays as it is typed. Raises WrongMoments."""
    try:
        zone = find_zone(form.get("zone", ""))
    except Unprocessable as error:
        raise WrongMoments(f"Zone: {error}") from error
    before = find_zone_shown(form)
    converted, troubles = dict(form), []
    for name, label in labels.items():
        text, moment = form.get(name, "").strip(), (shown or {}).get(name)
        if moment is not None and text == write_moment(moment, before):
            converted[name] = write_moment(moment)
            continue
        try:
            converted[name] = to_utc(text, zone)
        except Unprocessable as error:
            troubles.append(f"{label}: {error}")
    if troubles:
        raise WrongMoments("\n".join(troubles))
    return converted


def find_zone_shown(form: Mapping[str, str]) -> tzinfo:
    """Returns the zone in which a form showed its moments; UTC where its name is wrong."""
    try:
        return find_zone(form.get("shown_zone", ""))
    except Unprocessable:
        return UTC


def to_utc(text: str, zone: tzinfo) -> str:
    """Returns a typed date and time of a zone as that of UTC. Raises Unprocessable where clocks skip or repeat it."""
    try:
        typed = datetime.fromisoformat(text)
        first, second = (typed.replace(tzinfo=zone, fold=fold).astimezone(UTC) for fold in (0, 1))
    except (ValueError, OverflowError):
        return text
    if typed.tzinfo is not None:
        return text
    if first == second:
        return write_moment(first)
    clock = f"{typed:%H:%M} on {typed.day} {typed:%b %Y}"
    if first.astimezone(zone).replace(tzinfo=None) != typed:
        raise Unprocessable(
            f"{clock} does not exist in {zone}: clocks are put forward. Choose an earlier or a later time."
        )
    raise Unprocessable(
        f"{clock} comes twice in {zone}, as clocks are put back: as {format_moment(first)} and as "
        f"{format_moment(second)}. Write UTC as the zone, and one of the two."
    )
