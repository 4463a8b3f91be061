"""The box of a verdict's films: film.js fetches the runs when it comes near the screen, and changes no size."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from grader.domain.pages.pictures import OwnFilm
from grader.web.text.numbers import write_quantity
from grader.web.verdict import evidence as read


@dataclass(frozen=True)
class FilmBox:
    """What is drawn before the films are there. `has_distance` leaves room for a curve below them; without it there are
    several films to choose from."""

    title: str
    about: str
    has_distance: bool = False
    choice: str = "At the lower end of your bracket"
    """The title of the first film, until they are there."""
    timesteps_ms: tuple[float, float, float] | None = None
    """The range of timesteps that the reader may choose, and the claimed one; None where that would tell the limits."""
    limits: str = ""
    """The limits in words, with that range."""


def describe_film(evidence: Mapping[str, Any]) -> FilmBox | None:
    """Returns the box of the films that the API makes of this evidence; None where it makes none."""
    if read.read_one(evidence, "motion", read.Motion) and read.read_list(evidence, "differences", read.Difference):
        return FilmBox(
            "Your motion beside the right one",
            "Two runs under the same force, one clock. The dashed outline over yours is the right one.",
            has_distance=True,
        )
    if (own := read.read_one(evidence, "film", OwnFilm)) is not None:
        return FilmBox(own.title, own.about, choice=own.title)
    claims = read.read_list(evidence, "claims", read.Claim)
    if not any(claim.claim_ms or claim.said_none for claim in claims):
        return None
    limits = {limit.case: limit for limit in read.read_list(evidence, "limits", read.Limit)}
    first, (low, high) = claims[0], claims[0].search_ms
    about = [describe_limit(claim.integrator, limits[claim.case]) for claim in claims if claim.case in limits]
    chosen = (low, high, min(high, max(low, first.claim_ms[0] if first.claim_ms else high)))
    return FilmBox(
        "Your claim, let go",
        "The judge's own runs at what you claimed, side by side, one clock. What lies between two frames of a run, "
        "MuJoCo never computed.",
        timesteps_ms=chosen if about else None,
        limits=", ".join(dict.fromkeys(about)),
    )


def describe_limit(integrator: str, limit: read.Limit) -> str:
    """Returns the limit of one integrator in words."""
    return f"{integrator} {'none' if limit.linear_ms is None else write_quantity(limit.linear_ms, 'ms')}"
