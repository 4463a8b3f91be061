"""TrialProgress: how far a script is within a trial."""

from dataclasses import dataclass
from typing import Literal, get_args

Unit = Literal["episode", "s"]

COUNT_MAX = 9999


@dataclass(frozen=True)
class TrialProgress:
    """How far a trial is that takes long: at an episode, counted from 1, or at a simulated second, of so many. Raises
    ValueError for another unit and for counts that are not between 0 and COUNT_MAX."""

    at: int
    of: int
    unit: Unit

    def __post_init__(self) -> None:
        if self.unit not in get_args(Unit):
            raise ValueError(f"the unit of progress is {' or '.join(get_args(Unit))}, not {self.unit!r}")
        if not 0 <= self.at <= self.of <= COUNT_MAX:
            raise ValueError(f"{self.at} of {self.of} is no progress: at most {COUNT_MAX}, and no more than the whole")

    @property
    def words(self) -> str:
        """As it is shown: `episode 3 of 20`, or `3 of 8 s`."""
        return f"episode {self.at} of {self.of}" if self.unit == "episode" else f"{self.at} of {self.of} s"


def ignore_progress(*_: object) -> None:
    """Ignores how far a script is."""
