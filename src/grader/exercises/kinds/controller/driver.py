"""Asks the student's controller at every step of a simulation that is not here. This file is the text of the driver,
which runs in the jail: NumPy, MuJoCo and the standard library alone.

A message is a letter and float64 numbers: "B" begins an episode, "S" asks for the controls of one step. With the form
`make` the numbers of a step are the time and the observation; with `control` time, qpos, qvel, act and the target, if
there is one. An answer is "C" with the controls, which are missing at the begin, or "X" with an exception as JSON. The
model is the public one: what is written into it, or into data, changes nothing that is judged."""

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any

import mujoco
import numpy as np

note: Callable[..., bool] = globals().get("note", lambda *_: False)
load_model: Callable[[str], mujoco.MjModel] = globals().get("load_model", mujoco.MjModel.from_xml_string)
exchange: Callable[[bytes | None], bytes | None] = globals().get("exchange", lambda _: None)
explain: Callable[[BaseException], bytes] = globals().get("explain", lambda error: repr(error).encode())

Step = Callable[[Any], Any]

WRITTEN = ("qpos", "qvel", "time")
STATE = sum(map(int, (mujoco.mjtState.mjSTATE_TIME, mujoco.mjtState.mjSTATE_QPOS, mujoco.mjtState.mjSTATE_QVEL,
                      mujoco.mjtState.mjSTATE_ACT)))  # fmt: skip
"""The state as a message has it; MuJoCo writes its parts in this order."""
forward, get_state, set_state = mujoco.mj_forward, mujoco.mj_getState, mujoco.mj_setState


def trial(functions: Any, inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Answers the messages of one trial. An exception is the answer to its step, and the judge ends that episode."""
    (entry,) = functions
    begin = make_step if inputs["form"] == "make" else control_step
    step: Step | None = None
    message = exchange(None)
    while message is not None:
        try:
            if message[:1] == b"B":
                step = begin(entry, load_model(inputs["model"]), inputs)
                answer = b"C"
            else:
                assert step is not None
                answer = b"C" + check_controls(step(np.frombuffer(message, "<f8", offset=1)), inputs["nu"]).tobytes()
        except Exception as error:
            answer = b"X" + explain(error)
        message = exchange(answer)


def make_step(entry: Any, model: mujoco.MjModel, inputs: Mapping[str, Any]) -> Step:
    """Returns what calls `act(t, observation)`, of an `act` that the student's function makes for each episode."""
    act = entry(model)
    if not callable(act):
        raise TypeError(f"{inputs['entry']} returned {describe(act)} in place of a function act(t, observation)")

    def step(values: Any) -> Any:
        return act(float(values[0]), values[1:].copy())

    return step


def control_step(entry: Any, model: mujoco.MjModel, inputs: Mapping[str, Any]) -> Step:
    """Returns what calls `control(model, data)`, with a data of the student's own that is set to the state."""
    data, size = mujoco.MjData(model), mujoco.mj_stateSize(model, STATE)
    ctrl, now = data.ctrl, np.empty(size)
    state = {"seen": False, "returned": False}

    def step(values: Any) -> Any:
        given = values[:size]
        set_state(model, data, given, STATE)
        forward(model, data)
        returned = entry(model, data, *values[size:].tolist())
        if not state["seen"]:
            get_state(model, data, now, STATE)
            state["seen"] = now.tobytes() != given.tobytes() and note_written(model, now, given)
        if returned is not None and not state["returned"] and ctrl.any():
            state["returned"] = note("wrote", {"parts": ["ctrl"]})
        return ctrl.copy() if returned is None else returned

    return step


def note_written(model: mujoco.MjModel, now: Any, given: Any) -> bool:
    """Notes which part of the state the student's function has changed, if any."""
    ends = np.cumsum([1, model.nq, model.nv])
    differs = dict(zip(("time", "qpos", "qvel"), np.split(now != given, ends), strict=False))
    changed = [name for name in WRITTEN if differs[name].any()]
    return bool(changed) and note("wrote", {"parts": changed})


def check_controls(returned: Any, nu: int) -> Any:
    """Returns the controls (nu,). Raises TypeError and ValueError with what the student should return."""
    try:
        controls = np.asarray(returned, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"the controller returned {describe(returned)} instead of {describe_wanted(nu)}") from None
    except OverflowError:
        raise ValueError("the controller returned a whole number that is too large for a float") from None
    if returned is None:  # which NumPy makes nan
        raise TypeError(f"the controller returned None instead of {describe_wanted(nu)}")
    if controls.size != nu:
        shape, wanted = controls.shape, describe_wanted(nu)
        raise ValueError(f"the controller returned an array of shape {shape} instead of {wanted}")
    if not all(map(isfinite, controls.ravel().tolist())):
        raise ValueError("the controller returned a control that is not finite (nan or inf)")
    return controls.reshape(nu)


def describe_wanted(nu: int) -> str:
    """Returns what a controller should return."""
    return "one control" if nu == 1 else f"{nu} controls"


def describe(value: Any) -> str:
    """Returns what a value is, in two words."""
    return "None" if value is None else f"a {type(value).__name__}"
