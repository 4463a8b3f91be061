"""Calls the student's function with the arguments of every call, and submits the results. Runs in the jail. Result j of
call i is `r<i>_<j>`. A call whose results cannot be read leaves `other<i>`, the text of what was returned, and
`printed<i>`, whether the function printed. The judge calls the author's programs through `results_of` too, in its own
process. The trace has one note, `used`: the functions of MuJoCo that the first call used, and which of its inputs any
call changed."""

import contextlib
import io
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

Rows = np.ndarray[Any, np.dtype[np.float64]]
Function = Callable[..., object]

TEXT_CHARS_MAX = 200

EVENTS_MAX = 2000
"""Calls and returns of functions that are looked at in the first call: each costs time."""
NAMES_MAX = 16
STATE = ("qpos", "qvel", "act", "ctrl")
FIELDS = ("body_mass", "body_inertia", "dof_damping", "dof_armature", "jnt_stiffness", "actuator_gainprm")
OPTIONS = ("timestep", "gravity", "integrator")

note: Callable[..., bool] = globals().get("note", lambda *_: False)
"""Adds to the trial's trace: the harness defines it."""

load_model: Callable[[str], mujoco.MjModel] = globals().get("load_model", mujoco.MjModel.from_xml_string)
"""Returns a new model: the harness defines it."""

show: Callable[[object], str] = globals().get("show", repr)
"""Returns the text of any value: the harness defines it."""


class Listener(io.TextIOBase):
    """Passes text on, and notes whether there was any."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream
        self.has_text = False

    def write(self, text: str) -> int:
        """Returns the number of characters."""
        self.has_text = self.has_text or bool(text.strip())
        self.stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Flushes the stream that the text is passed on to."""
        self.stream.flush()


def trial(functions: Sequence[Function], inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Makes every call on a new model and new data."""
    (entry,) = functions
    used, changed = dict[str, None](), dict[str, None]()
    try:
        make_calls(note_changes(entry, changed), used, inputs, submit)
    finally:
        note("used", {"functions": [*used][:NAMES_MAX], "changed": [*changed][:NAMES_MAX]})


def make_calls(
    function: Function, used: dict[str, None], inputs: Mapping[str, Any], submit: Callable[[str, Any], None]
) -> None:
    """Makes every call, and submits its results."""
    for index, call in enumerate(inputs["calls"]):
        listener = Listener(sys.stdout)
        with contextlib.redirect_stdout(listener):
            watched = function if index else note_functions(function, used)
            values = call_function(watched, compile_model(inputs["model"]), call, inputs["results"])
        if isinstance(values, str):
            submit(f"other{index}", np.frombuffer(values.encode(errors="replace"), dtype=np.uint8))
            submit(f"printed{index}", np.array([listener.has_text], dtype=np.uint8))
            continue
        for position, array in enumerate(values):
            submit(f"r{index}_{position}", array)


def note_functions(function: Function, used: dict[str, None]) -> Function:
    """Returns a function that notes in `used` which functions of MuJoCo it calls."""
    left = [EVENTS_MAX]

    def look(frame: Any, event: str, called: Any) -> None:
        left[0] -= 1
        if event == "c_call" and str(getattr(called, "__name__", "")).startswith("mj"):
            used[called.__name__] = None
        if left[0] <= 0:
            sys.setprofile(None)

    def call(*arguments: object) -> object:
        sys.setprofile(look)
        try:
            return function(*arguments)
        finally:
            sys.setprofile(None)

    return call


def note_changes(function: Function, changed: dict[str, None]) -> Function:
    """Returns a function that notes in `changed` which of its arguments differ afterwards, and in which part."""

    def call(*arguments: object) -> object:
        before = [read_parts(index, argument) for index, argument in enumerate(arguments)]
        try:
            return function(*arguments)
        finally:
            for index, (argument, old) in enumerate(zip(arguments, before, strict=True)):
                new = read_parts(index, argument)
                changed.update((name, None) for name, value in old.items() if new.get(name) != value)

    return call


def read_parts(index: int, argument: object) -> dict[str, bytes]:
    """Returns the bytes of what a function may change in an argument, by name."""
    if isinstance(argument, np.ndarray):
        return {f"argument {index + 1}": argument.tobytes()}
    if isinstance(argument, mujoco.MjData):
        return {f"data.{name}": getattr(argument, name).tobytes() for name in STATE}
    if isinstance(argument, mujoco.MjModel):
        fields = {f"model.{name}": getattr(argument, name).tobytes() for name in FIELDS}
        options = {f"model.opt.{name}": np.asarray(getattr(argument.opt, name)).tobytes() for name in OPTIONS}
        return fields | options
    return {}


def compile_model(xml: str) -> mujoco.MjModel | None:
    """Returns the model of a case; None where `xml` is empty."""
    return load_model(xml) if xml else None


def call_function(
    function: Function,
    model: mujoco.MjModel | None,
    call: Mapping[str, Any],
    results: Sequence[Mapping[str, str | None]],
    times: int = 1,
) -> list[Rows] | str:
    """Returns the results of one call, or the text of a return value that cannot be read. `call` has `arguments`
    (numbers, nested lists, "model", "data") and `start`, the state in which `data` is given. Each of `results` has a
    `name`, and a `field` if it is left in `data`. The function is called `times` over."""
    data = None if model is None else start_data(model, call["start"])
    objects = {"model": model, "data": data}
    returned: object = None
    for _ in range(times):
        arguments = [
            objects[argument]
            if isinstance(argument, str)
            else np.array(argument, dtype=np.float64)
            if isinstance(argument, list)
            else argument
            for argument in call["arguments"]
        ]
        returned = function(*arguments)
    parts = separate(returned, [str(result["name"]) for result in results if result["field"] is None])
    if parts is None:
        return show(returned)[:TEXT_CHARS_MAX]
    values = iter(parts)
    found = [
        to_numbers(next(values) if result["field"] is None else getattr(data, result["field"])) for result in results
    ]
    whole = [array for array in found if array is not None]
    return whole if len(whole) == len(found) else show(returned)[:TEXT_CHARS_MAX]


def start_data(model: mujoco.MjModel, start: Mapping[str, Any]) -> mujoco.MjData:
    """Returns a new data in the state of a call; derived quantities are not computed."""
    data = mujoco.MjData(model)
    if start["key"] is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(start["key"]).id)
    for name in ("qpos", "qvel", "act", "ctrl"):
        if start[name] is not None:
            getattr(data, name)[:] = start[name]
    return data


def separate(returned: object, names: Sequence[str]) -> list[Any] | None:
    """Returns one value for each name: of a dict by name, else in order; None if there are more or fewer."""
    if not names:
        return []
    if isinstance(returned, dict):
        return [returned[name] for name in names] if set(returned) == {*names} else None
    if isinstance(returned, tuple) and len(returned) == len(names):
        return list(returned)
    if len(names) == 1:
        return [returned]
    is_row = isinstance(returned, list) or (isinstance(returned, np.ndarray) and returned.ndim > 0)
    return list(returned) if is_row and len(returned) == len(names) else None  # type: ignore[arg-type, call-overload]


def to_numbers(value: object) -> Rows | None:
    """Returns finite real numbers as an array; None for anything else, such as texts and truth values."""
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):
        return None
    if array.dtype.kind not in "iuf" or not are_all_finite(array):
        return None
    return np.array(array, dtype=np.float64)


def are_all_finite(values: Any) -> bool:
    """Whether every number is finite."""
    return bool(np.all(np.isfinite(values)))
