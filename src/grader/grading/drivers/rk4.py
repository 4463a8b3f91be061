"""Lets the student's function take the steps of every run, and hands back the states after each.

Runs in the jail, behind the text of hidden_force.py. Results of run i: `q<i>`, `v<i>`, `a<i>`, `t<i>` (positions,
velocities, activations, time; one row a step, up to the first that is not finite), and `refused`, the text of what
the guard refused. `prepare` is called before the student's module is imported.
"""

import errno
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np

STATE = {"q": "qpos", "v": "qvel", "a": "act", "t": "time"}
NEVER = {"gc.get_objects", "gc.get_referrers", "gc.get_referents", "sys._current_frames", "sys.settrace"} | {
    "sys._current_exceptions",
    "sys.setprofile",
    "sys.monitoring.register_callback",
}
FRAMES = {"tb_frame", "gi_frame", "cr_frame", "ag_frame"}
"""Attributes through which a frame is found without asking sys for it."""

CALLBACKS = ["passive", "control", "contactfilter", "sensor", "time", "act_dyn", "act_gain", "act_bias"]

Ask = Callable[[tuple[str, Any]], Any]
Keeper = Generator[Any, tuple[str, Any], None]


def prepare(inputs: dict[str, Any]) -> None:
    """Put the force into mj_forward, and shut the ways to dig for it."""
    refused: list[str] = []
    keeper = keep(inputs.pop("forces"), refused)
    next(keeper)
    globals()["ask"] = keeper.send
    mujoco.mj_forward = forward_through(keeper.send)
    for name in CALLBACKS:
        for module in (mujoco, sys.modules.get("mujoco._callbacks")):
            if hasattr(module, f"set_mjcb_{name}"):
                setattr(module, f"set_mjcb_{name}", refusing(keeper.send, f"a MuJoCo callback (mjcb_{name})"))
    for module in (signal, sys.modules["_signal"]):  # a handler would be given the keeper's frame
        module.__dict__["signal"] = refusing(keeper.send, "a signal handler")
    sys.addaudithook(guard(keeper, refused, trusted_places()))


def keep(forces: list[Any], refused: list[str]) -> Keeper:
    """Holds the force and the list of refusals in a frame of its own; what it is asked to do is the only way in."""
    raw = mujoco.mj_forward
    choices = [with_force(raw, spec) for spec in forces]  # type: ignore[name-defined]  # noqa: F821 - text before this
    forward = raw
    reply: Any = None
    while True:
        what, about = yield reply
        reply = None
        if what == "forward":
            try:
                forward(*about)
            except Exception as error:
                reply = error.with_traceback(None)
        elif what == "run":
            forward = raw if about is None else choices[about]
        elif what == "refused":
            refused.append(about)
        else:
            reply = list(refused)


def forward_through(ask: Ask) -> Callable[..., None]:
    """What the student sees as mujoco.mj_forward.

    One thread at a time: the keeper cannot be asked while it is answering. The lock is re-entrant, so that whoever asks
    from within an answer gets the keeper's ValueError and does not wait for himself for ever.
    """
    raw, lock = mujoco.mj_forward, threading.RLock()

    def mj_forward(m: mujoco.MjModel, d: mujoco.MjData) -> None:
        with lock:
            error = ask(("forward", (m, d)))
        if error is not None:
            raise error

    mj_forward.__doc__, mj_forward.__module__, mj_forward.__qualname__ = raw.__doc__, raw.__module__, raw.__qualname__
    return mj_forward


def refuse(ask: Ask, what: str) -> None:
    """Remember it, and say no as the jail does."""
    ask(("refused", what))
    raise PermissionError(errno.EPERM, f"this exercise does not allow {what}")


def refusing(ask: Ask, what: str) -> Callable[..., None]:
    """A function that takes None (there is nothing to take back) and refuses everything else."""

    def setter(*values: object) -> None:
        if values != (None,):
            refuse(ask, what)

    return setter


def trusted_places() -> tuple[str, ...]:
    """Where code lies that is not the student's: the libraries, and whoever is calling now."""
    places = (str(Path(os.__file__).parent), str(Path(mujoco.__file__).parents[1]), "<frozen")
    return (*places, *(frame.f_code.co_filename for frame in frames(sys._getframe(1))))


def frames(frame: FrameType | None) -> Iterator[FrameType]:
    """A frame and all that called it."""
    while frame is not None:
        yield frame
        frame = frame.f_back


def guard(keeper: Keeper, refused: list[str], trusted: tuple[str, ...]) -> Callable[[str, tuple[Any, ...]], None]:
    """An audit hook: no walk over the heap, no tracing, no ctypes from the student's code, no look into the keeper.

    What it uses it holds itself: the names of this module can be changed by whoever calls sys._getframe. It remembers
    by itself as well, since the keeper may be the one that is running. Each thread is watched, also while another is.
    """
    busy: set[int] = set()
    never, kept, walk, frame_of, thread = frozenset(NEVER), keep.__code__, frames, sys._getframe, threading.get_ident
    found = frozenset(FRAMES)

    def keeps(frame: FrameType | None) -> bool:
        return any(outer.f_code is kept for outer in walk(frame))

    def hook(event: str, about: tuple[Any, ...]) -> None:
        me = thread()
        if me in busy:
            return
        busy.add(me)
        try:
            looks_in = event == "object.__getattr__" and about[0] is keeper
            if event == "sys._getframe":
                looks_in = keeps(about[0])
            elif event == "object.__getattr__" and about[1] in found:
                looks_in = looks_in or keeps(getattr(about[0], about[1]))
            rewrites = event == "object.__setattr__" and about[0] is walk
            imports = event == "import" and str(about[0]).startswith("mujoco._")
            natively = event.startswith("ctypes.") and not all(
                frame.f_code.co_filename.startswith(trusted) for frame in walk(frame_of(1))
            )
            if event in never or looks_in or rewrites or imports or natively:
                what = "ctypes" if natively else event
                refused.append(what)
                raise PermissionError(errno.EPERM, f"this exercise does not allow {what}")
        finally:
            busy.discard(me)

    return hook


def run(student: object, inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Every run from its start, step by step."""
    entry = getattr(student, inputs["entry"], None)
    if not callable(entry):
        raise TypeError(f"the script defines no function {inputs['entry']}")
    ask: Ask = globals()["ask"]
    for index, job in enumerate(inputs["runs"]):
        model = mujoco.MjModel.from_xml_string(inputs["models"][job["model"]])
        model.opt.timestep = job["timestep_s"]
        ask(("run", index))
        rows = record(entry, model, started(model, job), job["steps"])
        ask(("run", None))
        whole = np.logical_and.accumulate([np.all(np.isfinite(row)) for row in zip_rows(rows)])
        for name, values in rows.items():
            submit(f"{name}{index}", values[: int(np.sum(whole))])
    text = "; ".join(dict.fromkeys(map(str, ask(("report", None)))))
    submit("refused", np.frombuffer(text.encode()[:500], dtype=np.uint8))


def started(model: mujoco.MjModel, job: Mapping[str, Any]) -> mujoco.MjData:
    """A fresh data at the run's start; nothing has been computed from it."""
    data = mujoco.MjData(model)
    for name in ("qpos", "qvel", "act", "ctrl"):
        getattr(data, name)[:] = job[name]
    return data


def record(
    entry: Callable[..., object], model: mujoco.MjModel, data: mujoco.MjData, steps: int
) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """The state after every step, by its short name."""
    rows = {short: np.empty((steps, np.size(getattr(data, name)))) for short, name in STATE.items()}
    for step in range(steps):
        entry(model, data)
        for short, name in STATE.items():
            rows[short][step] = getattr(data, name)
    return rows


def zip_rows(rows: dict[str, np.ndarray[Any, np.dtype[np.float64]]]) -> Iterator[Any]:
    """All that is known of each step, in one row."""
    return iter(np.hstack(list(rows.values())))
