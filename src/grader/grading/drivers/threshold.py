"""Calls the student's function once for every model and integrator, and hands back what it claims.

Runs in the jail. Result `claim<i>` holds no number (None), one or two; `other<i>` is the text of anything else.
"""

from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np


def run(student: object, inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """One fresh model for every call, so that what a call changes in it is gone in the next."""
    entry = getattr(student, inputs["entry"], None)
    if not callable(entry):
        raise TypeError(f"the script defines no function {inputs['entry']}")
    for index, call in enumerate(inputs["calls"]):
        model = mujoco.MjModel.from_xml_string(inputs["models"][call["model"]])
        try:
            claim = entry(model, call["integrator"])
        except Exception as error:
            error.add_note(f"(model {call['model'] + 1} of {len(inputs['models'])}, integrator {call['integrator']})")
            raise
        numbers = read_numbers(claim)
        if numbers is None:
            submit(f"other{index}", np.frombuffer(repr(claim)[:200].encode(errors="replace"), dtype=np.uint8))
        else:
            submit(f"claim{index}", np.array(numbers, dtype=np.float64))


def read_numbers(claim: object) -> list[float] | None:
    """No number, one or two finite ones; None where the claim is anything else."""
    if claim is None:
        return []
    if isinstance(claim, np.ndarray):
        claim = claim.tolist()
    items: list[Any] = list(claim) if isinstance(claim, tuple | list) else [claim]
    if not 1 <= len(items) <= 2 or not all(is_number(item) for item in items):
        return None
    return [float(item) for item in items]


def is_number(item: object) -> bool:
    """A finite real number, also one of NumPy's, but no truth value."""
    if isinstance(item, bool) or not isinstance(item, int | float | np.integer | np.floating):
        return False
    return bool(np.isfinite(float(item)))
