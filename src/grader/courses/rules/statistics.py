"""What a teacher wants to know of a quiz: how hard each question is, what it tells apart, and what goes wrong. Pure."""

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import zip_longest
from statistics import NormalDist, median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grader.domain.verdict import Status

Z = NormalDist().inv_cdf(0.975)
"""Half the width of a 95 % interval, in standard errors."""

FIGURES = 0.005
"""Relative width of a cluster of numbers without a tolerance: half a unit of the third figure, at 1.00."""

ROUNDING = 1e-9
"""Shares that differ by less are equal: 0.1 + 0.2 is 0.3."""

LEARNERS_MIN = 4
"""Fisher's interval has the standard error 1 / sqrt(n - 3)."""


class ResultRow(NamedTuple):
    """One learner at one question: the points that count, and what they answered first. `option` and `value` are those
    of the first attempt, as is `first_status`; `several` is a JSON object with a list of either, where an answer has
    several. `diagnoses` are those of all attempts, as a JSON list."""

    learner: str
    question: str
    points: float
    max_points: float
    first_status: str
    option: int | None = None
    value: float | None = None
    diagnoses: str = "[]"
    several: str | None = None


@dataclass(frozen=True)
class Estimate:
    """A number from `n` learners with its 95 % interval."""

    value: float
    low: float
    high: float
    n: int


@dataclass(frozen=True)
class Cluster:
    """Nearly equal wrong numbers: their median, the least and the greatest, and how many learners gave them. `number`
    is the index of the number among those that the question asks for."""

    value: float
    low: float
    high: float
    learners: int
    number: int = 0


CRASH = re.compile(r"(?:[^:\n]{1,200}: )?([A-Z]\w{0,60}(?:Error|Exception|Interrupt))(?=: |, in line |\.$|$)")
"""A diagnosis that is an exception, with the title of its case or without."""


CRASHED = "Ended with an error: "
"""What the name of an exception follows where crashes are grouped."""


@dataclass(frozen=True)
class QuestionStatistics:
    """One question. `mistakes` counts learners by diagnosis, crashes by the name of the exception; `options` by
    each index that they chose first."""

    question: str
    difficulty: Estimate
    right_at_once: Estimate
    discrimination: Estimate | None
    options: dict[int, int]
    clusters: tuple[Cluster, ...]
    mistakes: dict[str, int]


@dataclass(frozen=True)
class Tally:
    """The answers to one question, counted: its statistics without the discrimination, and its learners' points.
    `learners`, `points` and `max_points` have the same order; a learner has one number in all tallies of a call."""

    statistics: QuestionStatistics
    learners: NDArray[np.intp]
    points: NDArray[np.float64]
    max_points: NDArray[np.float64]


class CommonAnswer(NamedTuple):
    """What the rows of learners who answered alike have in common."""

    first_status: str
    option: int | None
    value: float | None
    diagnoses: str
    several: str | None


Answers = Sequence[tuple[CommonAnswer, int]]
"""The answers to one question, and how many learners gave each."""


def tally_answers(
    pieces: Iterable[Sequence[ResultRow]], tolerances: Mapping[str, Sequence[float | None]] | None = None
) -> dict[str, Tally]:
    """Counts the answers to every question that has rows, in the order of their first rows. `pieces` are some rows
    each: of these one is held at a time. `tolerances` are those of the numbers that questions ask for, in their units.
    Time grows as n log n with the rows. Raises ValueError where a learner has two rows at a question."""
    counted_alike = Counter[tuple[Any, ...]]()
    numbers = NumberByText(), NumberByText()
    columns = []
    for rows in filter(None, pieces):  # what is done column by column takes a third of the time
        learner, question, points, max_points, *answered = zip(*rows, strict=True)
        counted_alike.update(zip(question, *answered, strict=True))
        names = number_texts(learner, numbers[0]), number_texts(question, numbers[1])
        columns.append((*names, np.array(points, float), np.array(max_points, float)))
    if not columns:
        return {}
    answers: dict[str, list[tuple[CommonAnswer, int]]] = {name: [] for name in numbers[1]}
    for (name, *answer), count in counted_alike.items():
        answers[name].append((CommonAnswer._make(answer), count))
    learners, questions, all_points, all_max_points = map(np.concatenate, zip(*columns, strict=True))
    tallies = {}
    for number, name in enumerate(answers):
        at = np.flatnonzero(questions == number)
        if np.bincount(learners[at]).max() > 1:
            raise ValueError(f"a learner has two rows at {name}")
        counted = count_answers(
            name, all_points[at] / all_max_points[at], answers[name], (tolerances or {}).get(name, ())
        )
        tallies[name] = Tally(counted, learners[at], all_points[at], all_max_points[at])
    return tallies


class NumberByText(dict[str, int]):
    """The number of each text that was looked up, from 0, in order of appearance."""

    def __missing__(self, text: str) -> int:
        return self.setdefault(text, len(self))


def number_texts(texts: Sequence[str], numbers: NumberByText) -> NDArray[np.intp]:
    """Returns the number that each text has in `numbers`."""
    return np.fromiter(map(numbers.__getitem__, texts), np.intp, len(texts))


def count_answers(
    question: str, shares: NDArray[np.float64], answers: Answers, tolerances: Sequence[float | None]
) -> QuestionStatistics:
    """Returns the statistics of one question without the discrimination. `shares` of its points have the shape (n,)."""
    right = sum(count for answer, count in answers if answer.first_status == Status.CORRECT)
    return QuestionStatistics(
        question=question,
        difficulty=mean_share(shares.tolist()),
        right_at_once=mean_share([1.0] * right + [0.0] * (len(shares) - right)),
        discrimination=None,
        options=count_options(answers),
        clusters=tuple(
            replace(cluster, number=number)
            for number, values in enumerate(list_wrong_numbers(answers))
            for cluster in find_clusters(values, tolerances[number] if number < len(tolerances) else None)
        ),
        mistakes=count_mistakes(answers),
    )


def count_mistakes(answers: Answers) -> dict[str, int]:
    """Returns how many learners were told each mistake, the most frequent first."""
    lists = Counter[str]()  # each is parsed once
    for answer, count in answers:
        lists[answer.diagnoses] += count
    mistakes = Counter[str]()
    for diagnoses, count in lists.items():
        for mistake in {group_crash(diagnosis) for diagnosis in json.loads(diagnoses)}:
            mistakes[mistake] += count
    return dict(sorted(mistakes.items(), key=lambda mistake: (-mistake[1], mistake[0])))


@lru_cache(maxsize=4096)
def group_crash(diagnosis: str) -> str:
    """Returns the exception behind a diagnosis, whose message and line differ between scripts; any other as it is."""
    match = CRASH.match(diagnosis)
    return f"{CRASHED}{match[1]}" if match else diagnosis


def count_options(answers: Answers) -> dict[int, int]:
    """Returns how many learners chose each option first."""
    counts = Counter[int]()
    for answer, count in answers:
        if answer.option is not None:
            counts[answer.option] += count
        if answer.several is not None:
            for option in set(json.loads(answer.several).get("option", ())):
                counts[option] += count
    return dict(sorted(counts.items()))


def list_wrong_numbers(answers: Answers) -> list[list[float]]:
    """Returns the wrong values of each number that is asked for, one a learner, of first attempts."""
    single = [
        value
        for answer, count in answers
        if (value := answer.value) is not None and answer.first_status != Status.CORRECT
        for _ in range(count)
    ]
    lists = [
        json.loads(answer.several).get("value", [])
        for answer, count in answers
        if answer.several is not None
        for _ in range(count)
    ]
    several = [[value for value in values if value is not None] for values in zip_longest(*lists)]
    return several or [single]


def count_learners(tallies: Sequence[Tally]) -> int:
    """Returns the number of learners with an answer to any of the questions."""
    return int(np.count_nonzero(np.bincount(np.concatenate([of.learners for of in tallies])))) if tallies else 0


def compute_statistics(tallies: Sequence[Tally]) -> tuple[QuestionStatistics, ...]:
    """The statistics of the questions of a quiz: each tells its learners apart by the points at the others."""
    size = 1 + max((int(of.learners.max()) for of in tallies), default=0)
    points, max_points = np.zeros(size), np.zeros(size)
    for of in tallies:
        points[of.learners] += of.points
        max_points[of.learners] += of.max_points
    return tuple(
        replace(
            of.statistics,
            discrimination=item_rest(
                of.points / of.max_points, points[of.learners] - of.points, max_points[of.learners] - of.max_points
            ),
        )
        for of in tallies
    )


def mean_share(shares: Sequence[float]) -> Estimate:
    """The mean of shares in [0, 1] with Wilson's score interval, for partial points too. The variance of a share is at
    most that of a 0/1 answer of the same mean (Bhatia and Davis 2000), so for partial points the interval is wider than
    it need be. It never leaves [0, 1], and has a width also where all shares are equal, which neither the normal
    interval nor the bootstrap has. Source: Wilson 1927. Raises ValueError for no shares."""
    n = len(shares)
    if not n:
        raise ValueError("no shares")
    p = math.fsum(shares) / n
    middle = (p + Z * Z / (2 * n)) / (1 + Z * Z / n)
    half = Z * math.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n)) / (1 + Z * Z / n)
    return Estimate(p, max(0.0, min(p, middle - half)), min(1.0, max(p, middle + half)), n)


def item_rest(
    shares: NDArray[np.float64], points: NDArray[np.float64], max_points: NDArray[np.float64]
) -> Estimate | None:
    """Pearson's correlation of a question's shares with the shares of points of the learners' other questions. `points`
    and `max_points` are those of the other questions; all have the shape (n,). For 0/1 answers it is the point-biserial
    correlation. A learner without another question is left out. The 95 % interval is Fisher's (1915), exact for two
    normal variables and approximate here. None where undefined: below 4 learners, or all equal on a side."""
    has_rest = max_points > ROUNDING
    items, rests = shares[has_rest], points[has_rest] / max_points[has_rest]
    n = len(items)
    if n < LEARNERS_MIN or np.ptp(items) < ROUNDING or np.ptp(rests) < ROUNDING:
        return None
    items, rests = items - items.mean(), rests - rests.mean()
    r = max(-1.0, min(1.0, float(items @ rests / math.sqrt((items @ items) * (rests @ rests)))))
    if abs(r) == 1:
        return Estimate(r, r, r, n)
    z, half = math.atanh(r), Z / math.sqrt(n - 3)
    return Estimate(r, math.tanh(z - half), math.tanh(z + half), n)


def find_clusters(values: Iterable[float], tolerance: float | None = None) -> tuple[Cluster, ...]:
    """Numbers that at least two learners share, the largest cluster first; one value a learner. From the least value
    up, a cluster takes in what lies within `tolerance` of its first value; without one, within half a unit of the third
    figure. The order of the values does not matter."""
    groups: list[list[float]] = []
    for value in sorted(value for value in values if math.isfinite(value)):
        if groups and value - groups[-1][0] <= _width(groups[-1][0], tolerance):
            groups[-1].append(value)
        else:
            groups.append([value])
    clusters = [Cluster(median(group), group[0], group[-1], len(group)) for group in groups if len(group) > 1]
    return tuple(sorted(clusters, key=lambda cluster: (-cluster.learners, cluster.value)))


def _width(value: float, tolerance: float | None) -> float:
    return FIGURES * abs(value) if tolerance is None else tolerance
