"""Lets the student's function take the steps of every run of a trial, and submits the states after each. Runs in the
jail. Results of run i: `q<i>`, `v<i>`, `a<i>`, `t<i>` (positions, velocities, activations, time; one row a step, up to
the first that is not finite).

While it steps, mj_forward adds a smooth force f(q, v, t) = a sin(P q + V v + w t + p) in every dof. No other function
of MuJoCo adds it, so a trajectory that another function has computed differs. The force is drawn for each submission,
so a recorded trajectory differs too. `add_force` also runs in our own process, around the judge's mj_forward.

The trace of a trial holds some steps of its runs: the first two, and the first two with an active constraint. After the
runs of a trial with a `probe` it also holds single steps from drawn states, at several timesteps and under a strong
force: there the slopes of the stages differ so much that step_trace.py and tableau.py can tell them apart."""

import io
import struct
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

Forward = Callable[[mujoco.MjModel, mujoco.MjData], object]
Step = Callable[[mujoco.MjModel, mujoco.MjData], object]
Row = np.ndarray[Any, np.dtype[np.float64]]
Rows = dict[str, Row]
Fields = list[Any]
"""Arrays, which the types of Python 3.11 do not know as buffers."""

STATE = {"q": "qpos", "v": "qvel", "a": "act", "t": "time"}

CALLS_MAX = 16
"""A step with more calls of mj_forward is not noted."""

NOTED = 2
"""Steps that are noted in one place."""

GLANCE = 16
"""Whether a constraint is active is looked up every so many steps."""

note: Callable[..., bool] = globals().get("note", lambda *_: False)
"""Adds to the trial's trace: the harness defines it."""


def add_force(forward: Forward, spec: Mapping[str, Any]) -> Forward:
    """Returns `forward` with the force of `spec` added for models of its size; it leaves qfrc_applied as it was."""
    sin, model_type, data_type, nq, nv, qpos, qvel, time, qfrc_applied = LOOKED_UP
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


def look_up_attributes() -> tuple[Any, ...]:
    """Returns what the force needs of classes and modules."""
    model_type, data_type = mujoco.MjModel, mujoco.MjData
    sizes = (getattr(model_type, name).fget for name in ("nq", "nv"))
    fields = (getattr(data_type, name).fget for name in ("qpos", "qvel", "time", "qfrc_applied"))
    return np.sin, model_type, data_type, *sizes, *fields


LOOKED_UP = look_up_attributes()
"""Looked up before a student's code can replace it."""


class Tape:
    """Keeps steps as the bytes of float64: what mj_forward is asked, and what it answers. A step has the number of
    calls, whether it is of the probe, the timestep; the state before, each call, the state after. A call has the time,
    the fields that are asked, and those that are answered."""

    def __init__(self, start: Mapping[str, Sequence[float]]) -> None:
        self.calls: list[bytes] = []
        self.steps: list[bytes] = []
        act, ctrl = ["act"] if start["act"] else [], ["ctrl"] if start["ctrl"] else []  # what is empty adds nothing
        self.names = ["qpos", "qvel", *act, *ctrl], ["qacc", *(["act_dot"] if act else []), "qacc_smooth"]
        self.state = 2 + len(act)
        self.known: tuple[Any, Fields, Fields] = (None, [], [])
        """The last data with its fields, which show its present numbers: to look them up takes longer than a copy."""

    def get_fields(self, data: mujoco.MjData) -> tuple[Fields, Fields]:
        """Returns the fields of `data` that are asked, and those that are answered."""
        if data is not self.known[0]:
            asked, answered = self.names
            self.known = data, [getattr(data, name) for name in asked], [getattr(data, name) for name in answered]
        return self.known[1:]

    def record_calls(self, forward: Forward, *, bounded: bool = False) -> Forward:
        """Returns `forward`, taped. A call beyond the tape is not kept; where `bounded`, it raises TooMany."""
        calls, join, pack, data_type = self.calls, b"".join, ONE.pack, mujoco.MjData

        def taped(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            if bounded and len(calls) > CALLS_MAX:
                raise TooManyCalls
            if len(calls) > CALLS_MAX or type(data) is not data_type:
                forward(model, data)
                return
            asked, answered = self.get_fields(data)
            before = join((pack(data.time), *asked))
            forward(model, data)
            calls.append(join((before, *answered)))

        return taped

    def take_step(self, entry: Step, model: mujoco.MjModel, data: mujoco.MjData, *, probe: bool = False) -> None:
        """Takes a step and keeps it."""
        calls, (asked, answered) = self.calls, self.get_fields(data)
        calls.clear()
        timestep, time, before = model.opt.timestep, data.time, b"".join((*asked, answered[0]))
        entry(model, data)
        if len(calls) <= CALLS_MAX:
            head = HEAD.pack(len(calls), probe, timestep, time)
            self.steps.append(b"".join((head, before, *calls, ONE.pack(data.time), *asked[: self.state])))

    def note_steps(self) -> None:
        """Adds the steps to the trace, and by what else the script may step."""
        for step in self.steps:
            note("step", None, step)
        self.steps.clear()
        if other_steppers:
            note("others", {"names": sorted(other_steppers)})


SCIPY = "scipy.integrate"
other_steppers: set[str] = set()
"""By what else the script steps: mj_forwardSkip, or SCIPY."""
HEAD, ONE = struct.Struct("<4d"), struct.Struct("<d")


class TooManyCalls(BaseException):
    """Ends a step that calls mj_forward too often to be read, such as one that chooses its own substeps."""


def before_import() -> None:
    """Replaces mj_forward by one that can be exchanged, before the student's module imports it."""
    raw, skip = mujoco.mj_forward, mujoco.mj_forwardSkip
    chosen: list[Forward] = [raw]

    def mj_forward(m: mujoco.MjModel, d: mujoco.MjData) -> None:
        chosen[0](m, d)

    mj_forward.__doc__, mj_forward.__module__, mj_forward.__qualname__ = raw.__doc__, raw.__module__, raw.__qualname__
    mujoco.mj_forward = mj_forward

    def forward_skip(*arguments: Any, **named: Any) -> None:
        other_steppers.add("mj_forwardSkip")
        skip(*arguments, **named)

    mujoco.mj_forwardSkip = forward_skip
    globals().update(raw=raw, chosen=chosen)


def trial(functions: Sequence[Step], inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Simulates every run from its start by the student's steps."""
    (entry,) = functions
    raw, chosen, tape = globals()["raw"], globals()["chosen"], Tape(inputs["start"])
    forward, untraced = add_force(raw, inputs["force"]), getattr(entry, "__wrapped__", entry)
    over = tape.record_calls(forward)
    for index, run in enumerate(inputs["runs"]):
        model = mujoco.MjModel.from_xml_string(inputs["model"])
        model.opt.timestep = run["timestep_s"]
        data = start_data(model, inputs["start"])

        def taped(model: mujoco.MjModel = model, data: mujoco.MjData = data) -> None:
            chosen[0] = over
            tape.take_step(entry, model, data)
            chosen[0] = forward

        chosen[0] = forward
        try:
            rows = record_run(untraced, model, data, run["steps"], taped if inputs["taped"] else None)
            if "probe" in inputs:
                run_probe(tape, untraced, model, data, inputs["probe"])
        finally:
            chosen[0] = raw
            tape.note_steps()
        finite = np.logical_and.accumulate(np.isfinite(np.hstack(list(rows.values()))).all(axis=1))
        for name, values in rows.items():
            submit(f"{name}{index}", values[: int(np.sum(finite))])


def start_data(model: mujoco.MjModel, start: Mapping[str, Sequence[float]]) -> mujoco.MjData:
    """Returns a new data at the start of a run; derived quantities are not computed."""
    data = mujoco.MjData(model)
    for name, values in start.items():
        getattr(data, name)[:] = values
    return data


def record_run(
    entry: Step, model: mujoco.MjModel, data: mujoco.MjData, steps: int, taped: Callable[[], None] | None
) -> Rows:
    """Returns the state after every step, by its short name. `taped()` takes a step in place of `entry`: the first
    NOTED ones, and as many once a constraint is active. It is None where no step is noted."""
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


def run_probe(tape: Tape, entry: Step, model: mujoco.MjModel, data: mujoco.MjData, inputs: Mapping[str, Any]) -> None:
    """Keeps single steps from the drawn states. What they print or raise is dropped: they are no part of the run."""
    raw, chosen, timestep, stdout = globals()["raw"], globals()["chosen"], model.opt.timestep, sys.stdout
    sys.stdout = io.StringIO()
    try:
        mujoco.mj_resetData(model, data)
        over = tape.record_calls(add_force(raw, inputs["force"]), bounded=True)

        def first(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            chosen[0] = over
            look_for_scipy(sys._getframe())
            over(model, data)

        chosen[0] = first
        for start in inputs["starts"]:
            model.opt.timestep, data.time = start["timestep_s"], start["time"]
            for name in tape.names[0]:
                getattr(data, name)[:] = start[name]
            tape.take_step(entry, model, data, probe=True)
    except BaseException:  # noqa: S110 - the run has been judged without it
        pass
    finally:
        sys.stdout, model.opt.timestep = stdout, timestep


def look_for_scipy(frame: types.FrameType | None) -> None:
    """Notes whether a call comes from SciPy's integrators."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith(SCIPY):
            other_steppers.add(SCIPY)
            return
        frame = frame.f_back
