"""Measures variants of the reference, each with one mistake, and says which is like the student's model. This text
follows that of `measuring` in a job of the jail, and uses its names."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

names: dict[str, Any] = globals()
"""Those of `measuring`: they stand in the same namespace."""

ALIKE = 0.004
"""Values that differ by no more, relative to the largest number, come from the same mistake."""


def run(student: object, inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Called by the jail. Submits the index of the first variant that is like the student's model in every trial; -1
    if none is."""
    matches = (at for at, texts in enumerate(inputs["variants"]) if is_like(texts, inputs["trials"]))
    submit("match", np.array(next(matches, -1)))


def is_like(texts: list[str], trials: list[Mapping[str, Any]]) -> bool:
    """Whether a variant does in each trial what the student's model does."""
    for trial in trials:
        described = names["describe"](texts[trial["text"]], trial, halved=False)
        if "goals" not in described:
            return False
        for mine, its in zip(trial["found"], described["goals"], strict=True):
            if not (agree(mine["same"], its["same"]) and agree(mine["within"], its["within"])):
                return False
    return True


def agree(mine: Any, its: Any) -> bool:
    """Whether the values of all expressions agree."""
    return all(entry.keys() == its[name].keys() and is_near(entry, its[name]) for name, entry in mine.items())


def is_near(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two results of an expression agree: numbers to ALIKE of the largest, everything else exactly."""
    if "values" not in one:
        return one == other
    try:
        mine, its = (np.array(some["values"], dtype=float) for some in (one, other))
    except (ValueError, TypeError):
        return False
    if mine.shape != its.shape:
        return "lost" in one and "lost" in other
    size = float(np.nanmax(np.abs(mine), initial=0.0))
    return bool(np.allclose(mine, its, rtol=0, atol=ALIKE * size + 1e-9, equal_nan=True))
