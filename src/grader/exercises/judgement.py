"""What a judge reads, and what it says of one trial. The judges in the folders `judging` of the kinds import this,
NumPy, MuJoCo and `grader.numerics` alone: they also judge on the learner's own machine."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

Outcome = TypeVar("Outcome")

Results = Mapping[str, NDArray[np.generic]]
"""The arrays that a driver submitted in one trial, by name. They are claims of the student's process."""


@dataclass(frozen=True)
class Part:
    """One of several findings of a trial, with a share of its points. `title` is public; the rest is as in
    Judgement."""

    id: str
    title: str
    passed: bool
    message: str
    detail: str = ""
    measured: Any = None
    expected: Any = None
    points: float = 1.0


@dataclass(frozen=True)
class Judgement(Generic[Outcome]):
    """A kind's judgement on one trial. `message` is a sentence without numbers of the case, of the student's result, or
    of the expected result. It tells the direction of an error at most. `detail` is a sentence that may have numbers;
    the runner leaves it, `measured` and `expected` out of hidden trials. `measured` and `expected` are plain JSON.
    `outcome` is what the kind passes to its `name_mistake` and `build_pictures`; None if the script raised.

    A trial that passed counts only if one of the trials in `needs` (ids) passed without a need of its own; otherwise
    its message is `unmet`. `review` is a sentence that asks for a person's decision; empty if none is needed.

    `parts` are the findings of the trial where it has several: it has passed if all have, and each has its own points.
    `crashed`: the script raised before there was anything to judge, in a trial whose steps are played; or the file that
    was handed in could not be read."""

    passed: bool
    message: str
    outcome: Outcome
    detail: str = ""
    measured: Any = None
    expected: Any = None
    needs: tuple[str, ...] = ()
    unmet: str = ""
    review: str = ""
    parts: tuple[Part, ...] = ()
    crashed: bool = False


EXACT = re.compile(r"\b(Decimal|Fraction|mpf)\(")
"""How numbers begin, as text, that are numbers to Python and none to NumPy."""


def tell_to_convert(text: str) -> str:
    """Returns the end of the sentence on results that are no finite numbers: what to do about exact numbers, if the
    text of the results has any; else nothing."""
    exact = EXACT.search(text)
    return f": convert each {exact[1]} by float(...) before you return it" if exact else ""


def list_counting(judgements: Mapping[str, Judgement[Any]]) -> set[str]:
    """Returns the ids of the trials that count, of judgements by the trials' ids: those that passed and need no other,
    or need one that passed and needs none."""
    firm = {id for id, judgement in judgements.items() if judgement.passed and not judgement.needs}
    return {
        id
        for id, judgement in judgements.items()
        if judgement.passed and (not judgement.needs or firm & {*judgement.needs})
    }
