"""Hands over the model that the student made, as MJCF text. This file is the text of the driver, which runs in the
jail: NumPy, MuJoCo and the standard library alone."""

from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np

BYTES_MAX = 256 * 1024


def trial(functions: Any, inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Submits the bytes of the MJCF; where the function returns none, the name of the type of what it does. Raises
    ValueError where the MJCF is too long."""
    (entry,) = functions
    made = entry(*inputs["arguments"])
    if isinstance(made, mujoco.MjSpec):
        made.compile()  # without which MuJoCo writes no XML
        made = made.to_xml()
    if not isinstance(made, str | bytes):
        submit("returned", np.frombuffer(type(made).__name__.encode(), dtype=np.uint8))
        return
    data = made.encode(errors="replace") if isinstance(made, str) else made
    if len(data) > BYTES_MAX:
        raise ValueError(f"the MJCF is longer than {BYTES_MAX // 1024} KB")
    submit("mjcf", np.frombuffer(data, dtype=np.uint8))
