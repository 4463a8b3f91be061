"""The quantities that can be measured in a time series, by name, and what of a series is looked at. Answer keys
(`verify`) and the claims of a learner's script share them."""

from collections.abc import Mapping
from typing import Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator

from grader.domain.numbers import NotNegative, Positive, Real

Summary = Literal[
    "max", "min", "mean", "rms", "amplitude", "peak_to_peak", "crossing", "crossings", "period", "frequency",
    "decay_rate", "settling",
]  # fmt: skip
"""A number of a whole series."""

QuantityName = Literal["final", Summary, "trace"]
"""A number of a series; `trace` is the series itself, read at some moments."""

TIMES = frozenset({"crossing", "period", "settling"})
"""Quantities that are times [s]."""

BASE_UNITS = dict.fromkeys(TIMES, "s") | {"frequency": "Hz", "decay_rate": "1/s", "crossings": ""}
"""The units of quantities that are read from the moments of a series, whatever its values are in."""

Direction = Literal["up", "down", "either"]

WINDOW_KEYS: Mapping[str, tuple[str, ...]] = {
    "since": get_args(Summary),
    "until": ("end", "final", *get_args(Summary)),
    "level": ("crossing", "crossings", "period", "frequency", "decay_rate", "settling"),
    "band": ("settling",),
    "direction": ("crossing", "crossings"),
    "count": ("crossing",),
}
"""The quantities that each key of a window has an effect on; `end` is `final` in answer keys."""


class Window(BaseModel):
    """What of a series is looked at, from `since` to `until` [s], and by what: a `level`, the width of a `band` about
    it, and the crossing to find by its `direction` and its `count` from 1."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    since: NotNegative = 0.0
    until: Positive | None = None
    level: Real | None = None
    band: Positive | None = None
    direction: Direction = "up"
    count: int = Field(default=1, ge=1, le=1000)

    @model_validator(mode="after")
    def _until_is_later(self) -> Self:
        if self.until is not None and self.until <= self.since:
            raise ValueError("until must be later than since")
        return self

    def require_used(self, key: str, name: str) -> None:
        """Raises ValueError where a part of the window has no effect on the quantity `name`, which stands under `key`,
        and where `band` is missing."""
        for part, names in WINDOW_KEYS.items():
            if part in self.model_fields_set and getattr(self, part) is not None and name not in names:
                raise ValueError(f"remove `{part}`: with {key} {name} it has no effect, only with {', '.join(names)}")
        if name == "settling" and self.band is None:
            raise ValueError(f"give `band`, how far about the level it may stay, with {key} settling")
