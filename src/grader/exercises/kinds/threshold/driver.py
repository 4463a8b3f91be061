"""Calls the student's function with a model and an integrator, and submits what it claims.

Runs in the jail. The result `claim` holds the numbers of the claim: none for None, one, or two. For anything else the
result `other` holds its text.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np


def trial(
    functions: Sequence[Callable[..., object]], inputs: Mapping[str, Any], submit: Callable[[str, Any], None]
) -> None:
    """Makes one call on a fresh model, so that no call sees what another changed."""
    (entry,) = functions
    claim = entry(mujoco.MjModel.from_xml_string(inputs["model"]), inputs["integrator"])
    numbers = read_numbers(claim)
    if numbers is None:
        submit("other", np.frombuffer(repr(claim)[:200].encode(errors="replace"), dtype=np.uint8))
    else:
        submit("claim", np.array(numbers, dtype=np.float64))


def read_numbers(claim: object) -> list[float] | None:
    """Returns the finite numbers of a claim: none for None, one, or two; None if the claim is anything else.

    A number may be an array of one element.
    """
    if claim is None:
        return []
    is_many = isinstance(claim, tuple | list) or (isinstance(claim, np.ndarray) and claim.ndim)
    items: list[Any] = list(claim) if is_many else [claim]  # type: ignore[call-overload]
    numbers = [item.item() if isinstance(item, np.ndarray | np.generic) and item.size == 1 else item for item in items]
    return [float(number) for number in numbers] if 1 <= len(numbers) <= 2 and all(map(is_number, numbers)) else None


def is_number(item: object) -> bool:
    """Whether an item is a finite real number; True and False are not."""
    return isinstance(item, int | float | np.floating) and not isinstance(item, bool) and bool(np.isfinite(float(item)))
