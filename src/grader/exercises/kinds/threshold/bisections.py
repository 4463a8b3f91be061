"""Mutants of the right bisection. The noted runs say which timestep was tried after which outcome; the mutant that
would have tried the same ones is the mistake. Nothing is simulated: the outcomes are those of the runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

from grader.exercises.kinds.threshold.judging.judge import Bracket
from grader.exercises.kinds.threshold.observation import CLOSE, Observation
from grader.exercises.kinds.threshold.search_trace import SearchRun

Ends = tuple[float, float]

RUNS_MIN = 3
"""Fewer tried middles leave open which bisection it is."""

LOOKS_MAX = 2
"""Runs before the first middle: a look at one end of the search, or at both."""


def halve(low: float, high: float) -> float:
    """Returns the middle."""
    return (low + high) / 2


def keep_one_inside(low: float, middle: float, high: float, *, is_unstable: bool) -> Ends:
    """Returns the ends of the half that holds the limit."""
    return (low, middle) if is_unstable else (middle, high)


def move_low_always(_: float, middle: float, high: float, *, is_unstable: bool) -> Ends:
    """The line that moves the lower end stands outside of the `else`."""
    return (middle, middle) if is_unstable else (middle, high)


def move_high_always(low: float, middle: float, _: float, *, is_unstable: bool) -> Ends:
    """The line that moves the upper end stands outside of the `if`."""
    return (low, middle) if is_unstable else (middle, middle)


def move_low_never(low: float, middle: float, high: float, *, is_unstable: bool) -> Ends:
    """The lower end stays."""
    return (low, middle) if is_unstable else (low, high)


def move_high_never(low: float, middle: float, high: float, *, is_unstable: bool) -> Ends:
    """The upper end stays."""
    return (low, high) if is_unstable else (middle, high)


def keep_one_outside(low: float, middle: float, high: float, *, is_unstable: bool) -> Ends:
    """The test is turned round."""
    return (middle, high) if is_unstable else (low, middle)


@dataclass(frozen=True)
class Bisection:
    """A bisection with one mistake, and the sentence on it."""

    sentence: str
    update: Callable[..., Ends] = keep_one_inside
    find_middle: Callable[[float, float], float] = halve

    def follow(self, runs: Sequence[SearchRun], low: float, high: float) -> Ends | None:
        """Returns the ends that are left, if the bisection tries the timesteps of the runs; None if it does not. The
        outcomes are those of the runs."""
        for run in runs:
            middle = self.find_middle(low, high)
            if abs(run.timestep_s - middle) > CLOSE * middle:
                return None
            low, high = self.update(low, middle, high, is_unstable=bool(run.warnings))
        return low, high


RIGHT = Bisection("")

ENDS = "Where the middle is unstable it is the new upper end, where it is stable the new lower end"

MUTANTS: tuple[Bisection, ...] = (
    Bisection(
        "After an unstable run your search goes on upwards, so that it ends at the upper end. Where the middle is "
        "unstable it is the new upper end, where it is stable the new lower end.",
        keep_one_outside,
    ),
    Bisection(
        "Your search moves its lower end to the middle after unstable runs as well, so that both ends meet there. "
        f"{ENDS}, and never both.",
        move_low_always,
    ),
    Bisection(
        "Your search moves its upper end to the middle after stable runs as well, so that both ends meet there. "
        f"{ENDS}, and never both.",
        move_high_always,
    ),
    Bisection(
        f"Your search never moves its lower end: after a stable run it tries the same timestep again. {ENDS}.",
        move_low_never,
    ),
    Bisection(
        f"Your search never moves its upper end: after an unstable run it tries the same timestep again. {ENDS}.",
        move_high_never,
    ),
    Bisection(
        "Your middle is half the difference of the two ends, (high - low) / 2: it is half their sum, (low + high) / 2.",
        find_middle=lambda low, high: (high - low) / 2,
    ),
    Bisection(
        "Your middle is low + high / 2: without parentheses only high is halved. It is (low + high) / 2.",
        find_middle=lambda low, high: low + high / 2,
    ),
)


AGAIN = f"Your search tries the same timestep again and again. {ENDS}."
"""What is true of all mutants that come to a stand."""


def explain_wrong_bisection(observed: Observation) -> str | None:
    """Returns the sentence of the mutant that tries the timesteps of all runs, if the right bisection does not; of
    several, of the one that ends with what is returned. Runs without any warning leave open whether the search is wrong
    or what it takes for unstable."""
    runs, claim, (shortest_s, longest_s) = observed.search.runs, observed.claim, observed.parameters.search_s
    if observed.search.total > len(runs) or not isinstance(claim, Bracket):
        return None
    tried = [runs[looks:] for looks in range(LOOKS_MAX + 1) if is_look(runs[:looks], shortest_s, longest_s)]
    tried = [middles for middles in tried if len(middles) >= RUNS_MIN and any(run.warnings for run in middles)]
    if any(RIGHT.follow(middles, shortest_s, longest_s) for middles in tried):
        return None
    matches = [
        (bisection, ends)
        for bisection, middles in product(MUTANTS, tried)
        if (ends := bisection.follow(middles, shortest_s, longest_s)) is not None
    ]
    if len(matches) > 1:
        matches = [(bisection, ends) for bisection, ends in matches if list(ends) == claim.numbers] or matches
    return matches[0][0].sentence if len(matches) == 1 else AGAIN if matches else None


def is_look(runs: Sequence[SearchRun], *ends: float) -> bool:
    """Whether runs are at the ends of the search alone."""
    return all(any(abs(run.timestep_s - end) <= CLOSE * end for end in ends) for run in runs)
