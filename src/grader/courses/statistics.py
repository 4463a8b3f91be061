"""What a teacher wants to know of a quiz: how hard each question is, what it tells apart, and what goes wrong. Pure."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist, correlation, median

from grader.domain.verdict import Status

Z = NormalDist().inv_cdf(0.975)
"""Half the width of a 95 % interval, in standard errors."""

FIGURES = 0.005
"""Relative width of a cluster of numbers without a tolerance: half a unit of the third figure, at 1.00."""

ROUNDING = 1e-9
"""Shares that differ by less are equal: 0.1 + 0.2 is 0.3."""

LEARNERS_MIN = 4
"""Fisher's interval has the standard error 1 / sqrt(n - 3)."""


@dataclass(frozen=True)
class Row:
    """One learner at one question: the points that count, and what they answered first.

    `option` and `value` are those of the first attempt, as is `first_status`; `diagnoses` are those of all attempts.
    """

    learner: str
    question: str
    points: float
    max_points: float
    first_status: Status
    option: int | None = None
    value: float | None = None
    diagnoses: tuple[str, ...] = ()

    @property
    def share(self) -> float:
        """Points as a part of the maximum, 0 to 1."""
        return self.points / self.max_points


@dataclass(frozen=True)
class Estimate:
    """A number from `n` learners with its 95 % interval."""

    value: float
    low: float
    high: float
    n: int


@dataclass(frozen=True)
class Cluster:
    """Nearly equal wrong numbers: their median, the least and the greatest, and how many learners gave them."""

    value: float
    low: float
    high: float
    learners: int


@dataclass(frozen=True)
class QuestionStatistics:
    """One question. `mistakes` counts learners by diagnosis, `options` by the index that they chose first."""

    question: str
    difficulty: Estimate
    right_at_once: Estimate
    discrimination: Estimate | None
    options: dict[int, int]
    clusters: tuple[Cluster, ...]
    mistakes: dict[str, int]


def statistics_of(rows: Iterable[Row], tolerances: Mapping[str, float] | None = None) -> tuple[QuestionStatistics, ...]:
    """The statistics of every question that has rows, in the order of their first rows.

    `tolerances` are those of numeric questions, in their units. Time grows as n log n with the rows.
    Raises ValueError where a learner has two rows at a question.
    """
    by_question: dict[str, list[Row]] = defaultdict(list)
    totals: dict[str, tuple[float, float]] = defaultdict(lambda: (0.0, 0.0))
    for row in rows:
        by_question[row.question].append(row)
        points, max_points = totals[row.learner]
        totals[row.learner] = points + row.points, max_points + row.max_points
    tolerances = tolerances or {}
    return tuple(_one(name, rows, totals, tolerances.get(name)) for name, rows in by_question.items())


def _one(
    question: str, rows: Sequence[Row], totals: Mapping[str, tuple[float, float]], tolerance: float | None
) -> QuestionStatistics:
    if len({row.learner for row in rows}) < len(rows):
        raise ValueError(f"a learner has two rows at {question}")
    wrong = [row.value for row in rows if row.value is not None and row.first_status is not Status.CORRECT]
    return QuestionStatistics(
        question=question,
        difficulty=mean_share([row.share for row in rows]),
        right_at_once=mean_share([float(row.first_status is Status.CORRECT) for row in rows]),
        discrimination=item_rest(rows, totals),
        options=dict(sorted(Counter(row.option for row in rows if row.option is not None).items())),
        clusters=clusters_of(wrong, tolerance),
        mistakes=dict(Counter(sorted(one for row in rows for one in set(row.diagnoses))).most_common()),
    )


def mean_share(shares: Sequence[float]) -> Estimate:
    """The mean of shares in [0, 1] with Wilson's score interval, for partial points too.

    The variance of a share is at most that of a 0/1 answer of the same mean (Bhatia and Davis 2000), so for partial
    points the interval is wider than it need be. It never leaves [0, 1], and has a width also where all shares are
    equal, which neither the normal interval nor the bootstrap has.
    Source: Wilson 1927. Raises ValueError for no shares.
    """
    n = len(shares)
    if not n:
        raise ValueError("no shares")
    p = math.fsum(shares) / n
    middle = (p + Z * Z / (2 * n)) / (1 + Z * Z / n)
    half = Z * math.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n)) / (1 + Z * Z / n)
    return Estimate(p, max(0.0, min(p, middle - half)), min(1.0, max(p, middle + half)), n)


def item_rest(rows: Sequence[Row], totals: Mapping[str, tuple[float, float]]) -> Estimate | None:
    """Pearson's correlation of a question's share with the share of points of the learner's other questions.

    For 0/1 answers it is the point-biserial correlation. A learner without another question is left out. The 95 %
    interval is Fisher's (1915), exact for two normal variables and approximate here. None where it is undefined:
    fewer than 4 learners, or all equal on either side.
    """
    items, rests = [], []
    for row in rows:
        points, max_points = totals[row.learner]
        if (rest := max_points - row.max_points) > ROUNDING:
            items.append(row.share)
            rests.append((points - row.points) / rest)
    n = len(items)
    if n < LEARNERS_MIN or max(items) - min(items) < ROUNDING or max(rests) - min(rests) < ROUNDING:
        return None
    r = max(-1.0, min(1.0, correlation(items, rests)))
    if abs(r) == 1:
        return Estimate(r, r, r, n)
    z, half = math.atanh(r), Z / math.sqrt(n - 3)
    return Estimate(r, math.tanh(z - half), math.tanh(z + half), n)


def clusters_of(values: Iterable[float], tolerance: float | None = None) -> tuple[Cluster, ...]:
    """Numbers that at least two learners share, the largest cluster first; one value a learner.

    From the least value up, a cluster takes in what lies within `tolerance` of its first value; without one, within
    half a unit of the third figure. The order of the values does not matter.
    """
    groups: list[list[float]] = []
    for value in sorted(value for value in values if math.isfinite(value)):
        if groups and value - groups[-1][0] <= _width(groups[-1][0], tolerance):
            groups[-1].append(value)
        else:
            groups.append([value])
    found = [Cluster(median(group), group[0], group[-1], len(group)) for group in groups if len(group) > 1]
    return tuple(sorted(found, key=lambda cluster: (-cluster.learners, cluster.value)))


def _width(value: float, tolerance: float | None) -> float:
    return FIGURES * abs(value) if tolerance is None else tolerance
