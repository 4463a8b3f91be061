"""The chance that one fixed answer, which ignores its inputs, is right in every case of an exercise."""

from bisect import bisect_left
from collections.abc import Sequence
from functools import cache, partial
from itertools import accumulate, repeat
from math import inf, log, prod
from operator import mul

import numpy as np
from numpy.typing import NDArray

from grader.domain.plugins import describe_error
from grader.errors import GraderError, PluginError
from grader.exercises.kind import Content, Intervals, TextOf
from grader.exercises.parameters import Case, ExerciseParameters, WrongInCase
from grader.exercises.running.planning import (
    AnyKind,
    AnyTrial,
    build_case_trials,
    load_kinds,
    read_parameters,
    refuse_text,
)
from grader.questions import ModelXml, Question
from grader.questions.kinds.script import ScriptQuestion

Boxes = NDArray[np.float64]
"""Accepted boxes, one for each draw: (draws, coordinates, 2), the last axis lowest and highest."""

DRAWS = 200
"""How often every case is drawn."""

CONFIDENCE = 0.95
"""Confidence level of the upper bound of each proportion. Source: Clopper and Pearson, Biometrika 26 (1934) 404."""

FEW, MANY = 16, 64
"""Numbers of draws that share a point; between them the growth of the share with the tolerance is measured."""

TREND_ORDER = 2
"""The degree of the polynomial by which one coordinate may follow another."""

WIDTHS = tuple(accumulate(repeat(2**0.25, 240), mul, initial=1.0))
"""The factors by which a tolerance is widened, up to 2^60."""


def compute_chance_of_luck(
    question: Question, model_xml: ModelXml, text_of: TextOf = refuse_text
) -> tuple[float, float]:
    """Returns a bound of the chance that the best fixed answer is right in every case, and the largest chance allowed.
    Cases are drawn independently of each other, so their chances multiply. A case that cannot be judged by intervals,
    or draws nothing, counts as 1. The cases after the product is small enough are not drawn, nor are those that draw as
    the last one does, where its chance is small enough for all of them. Raises PluginError where the kind fails,
    WrongInCase for a draw that cannot be posed, and JailFault."""
    assert isinstance(question, ScriptQuestion)
    kind = load_kinds()[question.check.kind]
    parameters = read_parameters(kind, question)
    content = Content(question.entry, model_xml, text_of)
    chance, left = 1.0, list(enumerate(parameters.cases))
    try:
        while left and chance > parameters.luck:
            index, case = left.pop(0)
            chance_of_case = compute_chance_of_case(kind, parameters, case, content, index)
            chance *= chance_of_case
            others = chance_of_case ** sum(describe_draws(other) == describe_draws(case) for _, other in left)
            if chance * others <= parameters.luck:
                return chance * others, parameters.luck
    except (WrongInCase, GraderError):
        raise
    except Exception as error:  # code of another package: anything may be raised
        raise PluginError(f"the kind fails: {describe_error(error, type(kind).__module__)}") from error
    return chance, parameters.luck


def describe_draws(case: Case) -> str:
    """Returns the case without what changes neither its draws nor what is accepted."""
    return case.model_dump_json(exclude={"id", "title", "hidden", "points", "hint"})


def compute_chance_of_case(
    kind: AnyKind, parameters: ExerciseParameters, case: Case, content: Content, index: int
) -> float:
    """Returns the chance that the best fixed answer is right in one case."""
    drawn: list[Sequence[Intervals]] = []

    def draw(seed: int) -> Sequence[AnyTrial]:
        return build_case_trials(kind, parameters, case, content, [seed, index])

    for seed in range(DRAWS):
        trials = draw(seed)
        if (bound := kind.bound_luck(parameters, trials)) is not None:
            return bound
        parts = list_accepted(kind, parameters, trials)
        if parts is None:
            hits = kind.count_lucky(parameters, [draw(other) for other in range(DRAWS)])
            return 1.0 if hits is None else prod(compute_upper_bound(count, DRAWS) for count in hits)
        if seed == 1 and parts == drawn[0]:
            return 1.0
        drawn.append(parts)
    return prod(compute_chance_of_part(select_boxes(part)) for part in zip(*drawn, strict=True))


def list_accepted(
    kind: AnyKind, parameters: ExerciseParameters, trials: Sequence[AnyTrial]
) -> Sequence[Intervals] | None:
    """Returns what a kind accepts. Raises TypeError where that is no list of lists of intervals."""
    parts = kind.list_accepted(parameters, trials)
    try:
        if parts is None or all(np.asarray(part, dtype=np.float64).shape[1:] == (2,) for part in parts):
            return parts
    except (TypeError, ValueError):
        pass
    why = "must return a list of lists of intervals, such as [[(0.9, 1.1), (1.9, 2.1)]]"
    raise TypeError(f"list_accepted {why}, not {parts!r:.100}")


def select_boxes(part: Sequence[Intervals]) -> Boxes:
    """Returns the coordinate with the widest spread relative to its tolerance, and the one with the widest spread of
    what the first leaves open: a period says nothing of a draw that its frequency does not say. Leaving out the others
    can only raise the chance. Compares only the coordinates that all draws have."""
    length = min(map(len, part))
    boxes = np.array([intervals[:length] for intervals in part], dtype=np.float64).reshape(len(part), length, 2)
    if length < 2:
        return boxes
    coordinates = boxes.swapaxes(0, 1)
    first = int(np.argmax([compute_spread(intervals) for intervals in coordinates]))
    rests = [compute_spread(remove_trend(intervals, coordinates[first])) for intervals in coordinates]
    second = max((i for i in range(length) if i != first), key=rests.__getitem__)
    return boxes[:, [second, first]]


def remove_trend(intervals: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns intervals (draws, 2) less what a parabola over the lower ends of `others` says of them, fitted to the
    draws in which both are finite."""
    finite = np.isfinite(intervals[:, 0]) & np.isfinite(others[:, 0])
    if finite.sum() <= TREND_ORDER + 1 or not np.ptp(others[finite, 0]):
        return intervals
    x = (others[:, 0] - np.mean(others[finite, 0])) / np.ptp(others[finite, 0])
    trend = np.polynomial.polynomial.polyfit(x[finite], intervals[finite, 0], TREND_ORDER)
    return intervals - np.where(finite, np.polynomial.polynomial.polyval(x, trend), 0.0)[:, None]


def compute_spread(intervals: NDArray[np.float64]) -> float:
    """Returns how many times wider the lower ends of finite intervals (draws, 2) are spread than an interval is."""
    finite = intervals[np.isfinite(intervals[:, 0])]
    if not len(finite):
        return 0.0
    width = float(np.mean(finite[:, 1] - finite[:, 0]))
    return float(np.std(finite[:, 0])) / width if width else inf


def compute_chance_of_part(boxes: Boxes) -> float:
    """Returns an upper bound of the largest share of boxes that one point lies in. Where at least FEW draws share a
    point, their share is counted. Else the boxes are widened until FEW share one, and the share is carried back to the
    true width by the power law by which it grows from there to MANY: a density without structure below the spacing of
    the draws. Where equal draws show that there is such structure, and where the share does not grow, nothing is
    carried back. A wider box holds the narrower one, so the number that share a point never falls: it is bisected."""
    deepest = cache(partial(count_deepest, boxes))
    equal = int(np.max(np.unique(boxes, axis=0, return_counts=True)[1]))
    if deepest(1.0) >= FEW:
        return compute_upper_bound(deepest(1.0), len(boxes))
    if equal > 1 or deepest(WIDTHS[-1]) < MANY:
        return compute_upper_bound(max(equal, deepest(1.0)), len(boxes))
    few, many = (WIDTHS[bisect_left(WIDTHS, least, key=deepest)] for least in (FEW, MANY))
    dimensions = log(deepest(many) / deepest(few)) / log(many / few)
    return float(compute_upper_bound(deepest(few), len(boxes)) / few ** min(dimensions, boxes.shape[1]))


def count_deepest(boxes: Boxes, widened: float) -> int:
    """Returns the largest number of boxes that share a point, after each box is widened about its centre."""
    lows, highs = boxes[..., 0], boxes[..., 1]
    with np.errstate(invalid="ignore"):
        shift = np.nan_to_num((highs - lows) * (widened - 1) / 2)
    held = [
        find_overlaps(low, high).astype(np.float32)
        for low, high in zip((lows - shift).T, (highs + shift).T, strict=True)
    ]
    together = held[0].T @ held[-1] if len(held) > 1 else held[0].sum(axis=0)
    return int(np.max(together))


def find_overlaps(lows: NDArray[np.float64], highs: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Returns [i, k]: whether interval i holds the lower end of interval k; the most crowded point is such an end."""
    return np.asarray((lows[:, None] <= lows) & (lows <= highs[:, None]))


def compute_upper_bound(hits: int, draws: int) -> float:
    """Returns the upper confidence bound of a share."""
    from scipy import special  # SciPy takes half of the time that the grader takes to start

    return 1.0 if hits >= draws else float(special.betaincinv(hits + 1, draws - hits, CONFIDENCE))
