"""Lets the student's function take the steps of every run of a trial, and submits the states after each.

Runs in the jail. Results of run i: `q<i>`, `v<i>`, `a<i>`, `t<i>` (positions, velocities, activations, time; one row a
step, up to the first that is not finite).

While it steps, mj_forward adds a smooth force f(q, v, t) = a sin(P q + V v + w t + p) in every dof. No other function
of MuJoCo adds it, so a trajectory that another function has computed differs. The force is drawn for each submission,
so a recorded trajectory differs too. `with_force` also runs in our own process, around the judge's mj_forward.

The trace of a trial holds some steps of its runs: the first two, and the first two with an active constraint. After
the runs of a trial with a `probe` it also holds single steps from drawn states, at several timesteps and under a
strong force: there the slopes of the stages differ so much that recorded.py and tableau.py can tell them apart.
"""

import contextlib
import io
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

Forward = Callable[[mujoco.MjModel, mujoco.MjData], object]
Step = Callable[[mujoco.MjModel, mujoco.MjData], object]
Row = np.ndarray[Any, np.dtype[np.float64]]
Rows = dict[str, Row]

STATE = {"q": "qpos", "v": "qvel", "a": "act", "t": "time"}

CALLS_MAX = 16
"""A step with more calls of mj_forward is not noted."""

NOTED = 2
"""Steps that are noted in one place."""

GLANCE = 16
"""Whether a constraint is active is looked up every so many steps."""

note: Callable[..., bool] = globals().get("note", lambda *_: False)
"""Adds to the trial's trace: the harness defines it."""


def with_force(forward: Forward, spec: Mapping[str, Any]) -> Forward:
    """Returns `forward` with the force of `spec` added for models of its size; it leaves qfrc_applied as it was.

    Attributes of classes and modules are looked up here, before a student's code can replace them.
    """
    sin, model_type, data_type = np.sin, mujoco.MjModel, mujoco.MjData
    nq, nv = (getattr(model_type, name).fget for name in ("nq", "nv"))
    qpos, qvel, time, qfrc_applied = (
        getattr(data_type, name).fget for name in ("qpos", "qvel", "time", "qfrc_applied")
    )
    amplitude, position, velocity, phase = (
        np.array(spec[name], dtype=np.float64) for name in ("amplitude", "position", "velocity", "phase")
    )
    rate, size = float(spec["rate"]), (position.shape[1], velocity.shape[1])

    def forced(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if type(model) is not model_type or type(data) is not data_type or (nq(model), nv(model)) != size:
            forward(model, data)
            return
        applied = qfrc_applied(data)
        saved = applied.copy()
        force = position.dot(qpos(data))  # in place from here on: this runs ten thousand times in a grading
        force += velocity.dot(qvel(data))
        force += phase
        if rate:
            force += rate * time(data)
        sin(force, force)
        force *= amplitude
        applied += force
        try:
            forward(model, data)
        finally:
            applied[:] = saved

    return forced


class Tape:
    """Keeps what mj_forward is asked and what it answers, as the bytes of float64: of each call the time, ASKED and
    ANSWERED."""

    def __init__(self) -> None:
        self.calls: list[bytes] = []

    def over(self, forward: Forward, *, bounded: bool = False) -> Forward:
        """Returns `forward`, taped. A call beyond the tape is not kept; where `bounded`, it raises TooMany."""
        calls, join, pack, data_type = self.calls, b"".join, TIME.pack, mujoco.MjData
        known: Any = None  # views of the last data: making them takes longer than copying what they show
        asked: list[Row] = []
        answered: list[Row] = []

        def taped(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            nonlocal known, asked, answered
            if bounded and len(calls) > CALLS_MAX:
                raise TooMany
            if len(calls) > CALLS_MAX or type(data) is not data_type:
                forward(model, data)
                return
            if data is not known:
                known, asked, answered = data, views(data, ASKED), views(data, ANSWERED)
            before = pack(data.time), *[one.tobytes() for one in asked]
            forward(model, data)
            calls.append(join((*before, *[one.tobytes() for one in answered])))

        return taped

    def step(self, entry: Step, model: mujoco.MjModel, data: mujoco.MjData, *, probe: bool = False) -> None:
        """Takes one step and notes it: whether it is of the probe, the number of calls, the timestep; the state before,
        each call, the state after."""
        self.calls.clear()
        pack, parts = TIME.pack, views(data, (*ASKED, "qacc"))
        before = pack(model.opt.timestep), pack(data.time), *[one.tobytes() for one in parts]
        entry(model, data)
        if len(self.calls) > CALLS_MAX:
            return
        after = pack(data.time), *[one.tobytes() for one in parts[:3]]
        numbers = pack(len(self.calls)), pack(probe), *before, *self.calls, *after
        note("step", None, np.frombuffer(b"".join(numbers)))


ASKED = ("qpos", "qvel", "act", "ctrl")
ANSWERED = ("qacc", "act_dot", "qacc_smooth")
TIME = struct.Struct("<d")


def views(data: mujoco.MjData, names: Sequence[str]) -> list[Row]:
    """Returns arrays of `data`, which show its present numbers whenever they are read."""
    return [getattr(data, name) for name in names]


class TooMany(BaseException):
    """Ends a step that calls mj_forward too often to be read, such as one that chooses its own substeps."""


def before_import() -> None:
    """Replaces mj_forward by one that can be exchanged, before the student's module imports it."""
    raw = mujoco.mj_forward
    chosen: list[Forward] = [raw]

    def mj_forward(m: mujoco.MjModel, d: mujoco.MjData) -> None:
        chosen[0](m, d)

    mj_forward.__doc__, mj_forward.__module__, mj_forward.__qualname__ = raw.__doc__, raw.__module__, raw.__qualname__
    mujoco.mj_forward = mj_forward
    globals().update(raw=raw, chosen=chosen)


def trial(functions: Sequence[Step], inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Simulates every run from its start by the student's steps."""
    (entry,) = functions
    raw, chosen, tape = globals()["raw"], globals()["chosen"], Tape()
    forward, untraced = with_force(raw, inputs["force"]), getattr(entry, "__wrapped__", entry)
    for index, run in enumerate(inputs["runs"]):
        model = mujoco.MjModel.from_xml_string(inputs["model"])
        model.opt.timestep = run["timestep_s"]
        data = started(model, inputs["start"])

        def taped(model: mujoco.MjModel = model, data: mujoco.MjData = data) -> None:
            chosen[0] = tape.over(forward)
            tape.step(entry, model, data)
            chosen[0] = forward

        chosen[0] = forward
        try:
            rows = record(untraced, model, data, run["steps"], taped if inputs["taped"] else None)
        finally:
            chosen[0] = raw
        finite = np.logical_and.accumulate(np.isfinite(np.hstack(list(rows.values()))).all(axis=1))
        for name, values in rows.items():
            submit(f"{name}{index}", values[: int(np.sum(finite))])
        if "probe" in inputs:
            probe(entry, model, data, inputs["probe"])


def started(model: mujoco.MjModel, start: Mapping[str, Sequence[float]]) -> mujoco.MjData:
    """Returns a new data at the start of a run; derived quantities are not computed."""
    data = mujoco.MjData(model)
    for name, values in start.items():
        getattr(data, name)[:] = values
    return data


def record(
    entry: Step, model: mujoco.MjModel, data: mujoco.MjData, steps: int, taped: Callable[[], None] | None
) -> Rows:
    """Returns the state after every step, by its short name.

    `taped()` takes a step in place of `entry`: the first NOTED ones, and as many once a constraint is active. It is
    None where no step is noted.
    """
    rows = {short: np.empty((steps, np.size(getattr(data, name)))) for short, name in STATE.items()}
    parts = [(rows[short], name) for short, name in STATE.items()]
    due, watched = NOTED, taped is not None
    for begin in range(0, steps, GLANCE):
        if begin and watched and data.nefc:
            due, watched = NOTED, False
        for step in range(begin, min(begin + GLANCE, steps)):
            if due and taped:
                due -= 1
                taped()
            else:
                entry(model, data)
            for values, name in parts:
                values[step] = getattr(data, name)
    return rows


def probe(entry: Step, model: mujoco.MjModel, data: mujoco.MjData, inputs: Mapping[str, Any]) -> None:
    """Notes single steps from the drawn states. What they print or raise is dropped: they are no part of the run."""
    raw, chosen, tape = globals()["raw"], globals()["chosen"], Tape()
    forward, timestep = with_force(raw, inputs["force"]), model.opt.timestep
    chosen[0] = tape.over(forward, bounded=True)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            mujoco.mj_resetData(model, data)
            for start in inputs["starts"]:
                model.opt.timestep = start["timestep_s"]
                data.time = start["time"]
                for name in ("qpos", "qvel", "act", "ctrl"):
                    getattr(data, name)[:] = start[name]
                tape.step(entry, model, data, probe=True)
    except BaseException:  # noqa: S110 - the run has been judged without it
        pass
    finally:
        chosen[0], model.opt.timestep = raw, timestep
