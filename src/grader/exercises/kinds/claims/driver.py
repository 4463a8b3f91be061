"""Calls the student's function with the model and the data of a case, and submits what it claims. This file is the text
of the driver, which runs in the jail: NumPy, MuJoCo and the standard library alone. Claim i is the result `c<i>`; where
it cannot be read, `other<i>` is the text of what stands in its place. Nothing that is measured enters the jail."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from numbers import Real
from typing import Any

import mujoco
import numpy as np

load_model: Callable[[str], mujoco.MjModel] = globals().get("load_model", mujoco.MjModel.from_xml_string)
"""Returns a new model: the harness defines it."""

show: Callable[[object], str] = globals().get("show", repr)
"""Returns the text of any value: the harness defines it."""

TEXT_CHARS_MAX = 100
KEYS_MAX = 10


def trial(
    functions: Sequence[Callable[..., Any]], inputs: Mapping[str, Any], submit: Callable[[str, Any], None]
) -> None:
    """Calls the function once, and submits each claim."""
    (entry,) = functions
    model = load_model(inputs["model"])
    given = (model, start_data(model, inputs["start"]))
    returned = entry(*given) if inputs["x"] is None else entry(*given, np.array(inputs["x"], dtype=np.float64))
    returned = name_values(returned)
    names = [name for name, _ in inputs["claims"]]
    for index, value in enumerate(separate(returned, names)):
        numbers = to_numbers(value)
        if numbers is not None:
            submit(f"c{index}", numbers)
        else:
            text = ABSENT + list_keys(returned) if value is MISSING else show(value)
            text = text[:TEXT_CHARS_MAX]
            submit(f"other{index}", np.frombuffer(text.encode(errors="replace"), dtype=np.uint8))


MISSING = object()

ABSENT = "nothing"
"""How the text begins that stands for a claim which is not there."""

TRUTHS = (bool, np.bool_)
"""Numbers to Python, and none to a reader."""


def start_data(model: mujoco.MjModel, start: Mapping[str, Any]) -> mujoco.MjData:
    """Returns a new data at the start of the case, forwarded."""
    data = mujoco.MjData(model)
    if start["key"] is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(start["key"]).id)
    for name in ("qpos", "qvel", "act", "ctrl"):
        if start[name] is not None:
            getattr(data, name)[:] = start[name]
    mujoco.mj_forward(model, data)
    return data


def name_values(returned: Any) -> Any:
    """Returns what holds values by names as a dict: a mapping, a named tuple, an object of a dataclass."""
    if isinstance(returned, tuple) and hasattr(returned, "_asdict"):
        return returned._asdict()
    if is_dataclass(returned) and not isinstance(returned, type):
        return {field.name: getattr(returned, field.name) for field in fields(returned)}
    return dict(returned) if isinstance(returned, Mapping) and not isinstance(returned, dict) else returned


def separate(returned: Any, names: Sequence[str]) -> list[Any]:
    """Returns one value for each name: of a dict by name, else in order; MISSING where there is none."""
    if isinstance(returned, dict):
        return [returned.get(name, MISSING) for name in names]
    if len(names) == 1:
        return [returned[0] if isinstance(returned, tuple) and len(returned) == 1 else returned]
    if isinstance(returned, (tuple, list, np.ndarray)) and len(returned) == len(names):
        return list(returned)
    return [returned, *[MISSING] * (len(names) - 1)] if returned is not None else [MISSING] * len(names)


def list_keys(returned: Any) -> str:
    """Returns which keys a dict has in place of the names; empty for what is no dict."""
    if type(returned) is not dict:
        return ""
    return ", among the keys " + ", ".join(repr(key) for key in [*returned][:KEYS_MAX] if type(key) is str)


def to_numbers(value: Any) -> Any:
    """Returns finite real numbers as an array; None for anything else, such as texts and truth values."""
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O" and all(isinstance(one, Real) and not isinstance(one, TRUTHS) for one in array.flat):
            array = array.astype(np.float64)
    except (ValueError, TypeError, OverflowError):
        return None
    if array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        return None
    return np.array(array, dtype=np.float64)
