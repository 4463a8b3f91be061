"""Lets the student's function take the steps of every run of a trial, and submits the states after each. Runs in the
jail. Results of run i: `q<i>`, `v<i>`, `a<i>`, `t<i>` (positions, velocities, activations, time; one row a step, up to
the first that is not finite).

While it steps, mj_forward adds a smooth force f(q, v, t) = a sin(P q + V v + w t + p) in every dof. No other function
of MuJoCo adds it, so a trajectory that another function has computed differs. The force is drawn for each submission,
so a recorded trajectory differs too. `add_force` also runs in our own process, around the judge's mj_forward.

The trace of a trial holds some steps of its runs: the first two, and the first two with an active constraint. After the
runs of a trial with a `probe` it also holds single steps from drawn states, at several timesteps and under a strong
force: there the slopes of the stages differ so much that step_trace.py and tableau.py can tell them apart. The note
`lines` says in which lines the last of these steps calls mj_forward and changes the state; `changed`, which fields of
the model the first step of a trial has changed; `long`, how many timesteps a step with too many calls has moved
data.time."""

import io
import itertools
import math
import operator
import struct
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from typing import Any

import mujoco
import numpy as np

Forward = Callable[[mujoco.MjModel, mujoco.MjData], object]
Step = Callable[[mujoco.MjModel, mujoco.MjData], object]
Row = np.ndarray[Any, np.dtype[np.float64]]
Rows = dict[str, Row]
Fields = list[Any]
"""Arrays, which the types of Python 3.11 do not know as buffers."""

STATE = {"t": "time", "q": "qpos", "v": "qvel", "a": "act"}
"""What is kept of a state, by its short name, in the order of `mj_getState`."""

STATE_BITS = sum(int(getattr(mujoco.mjtState, f"mjSTATE_{name.upper()}")) for name in STATE.values())

CALLS_MAX = 16
"""A step with more calls of mj_forward is not noted."""

FEW = 3
"""Degrees of freedom up to which the force of a run is computed without NumPy: to compile it takes 0.1 ms."""

NOTED = 2
"""Steps that are noted in one place."""

GLANCE = 16
"""Whether a constraint is active is looked up every so many steps."""

LINES_MAX, LINE_COLUMNS = 64, 4
"""Rows of the note `lines`, and numbers of each."""

CHANGES_MAX = 4
"""Changed fields of the model that are noted."""

note: Callable[..., bool] = globals().get("note", lambda *_: False)
"""Adds to the trial's trace: the harness defines it."""

load_model: Callable[[str], mujoco.MjModel] = globals().get("load_model", mujoco.MjModel.from_xml_string)
"""Returns a new model: the harness defines it."""


def add_force(forward: Forward, spec: Mapping[str, Any], *, few: int = FEW) -> Forward:
    """Returns `forward` with the force of `spec` added for models of its size; it leaves qfrc_applied as it was. What
    it looks up of a model and its data it keeps for the next call: this runs ten thousand times in a grading."""
    model_type, data_type, nq, nv, *fields = LOOKED_UP
    position, velocity = (np.array(spec[name], dtype=np.float64) for name in ("position", "velocity"))
    size = position.shape[1], velocity.shape[1]
    prepare = prepare_few if size[1] <= few else prepare_many
    push = prepare(np.column_stack([position, velocity, spec["phase"]]), spec["amplitude"], float(spec["rate"]))
    known: tuple[Any, ...] = (None, None, None, None)

    def forced(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        nonlocal known
        found = known  # of this call: another thread may look up another data
        if found[0] is not model or found[1] is not data:
            if type(model) is not model_type or type(data) is not data_type or (nq(model), nv(model)) != size:
                forward(model, data)
                return
            qpos, qvel, applied = (field(data) for field in fields)
            found = known = model, data, applied, push(data, qpos, qvel, applied)
        _, _, applied, add_to_applied = found
        saved = applied.copy()
        add_to_applied()
        try:
            forward(model, data)
        finally:
            applied[...] = saved

    return forced


Push = Callable[[mujoco.MjData, Row, Row, Row], Callable[[], None]]
"""Takes a data with its qpos, qvel and qfrc_applied; returns what adds the force of the present state to the last."""


def prepare_many(rows: Row, amplitude: Sequence[float], rate: float) -> Push:
    """Computes the force of many joints by NumPy: `rows` are P, V and p side by side."""
    sin, multiply, add, _ = FUNCTIONS
    project, size = rows.dot, np.array(amplitude, dtype=np.float64)

    def push(data: mujoco.MjData, qpos: Row, qvel: Row, applied: Row) -> Callable[[], None]:
        state, force = np.ones(rows.shape[1]), np.empty(len(rows))
        at, speed = state[: len(qpos)], state[len(qpos) : -1]

        def add_to_applied() -> None:
            at[...], speed[...] = qpos, qvel
            project(state, force)
            if rate:
                add(force, rate * data.time, force)
            sin(force, force)
            multiply(force, size, force)
            add(applied, force, applied)

        return add_to_applied

    return push


def prepare_few(rows: Row, amplitude: Sequence[float], rate: float) -> Push:
    """Computes the force of a few joints as one Python function with all numbers written out: NumPy takes twice as long
    for so few."""
    nv, names = len(rows), [f"x{column}" for column in range(rows.shape[1] - 1)]
    clock = f" + {rate!r} * data.time" if rate else ""
    lines = ["def push(data, qpos, qvel, applied):", " def add_to_applied():"]
    lines += [f"  {', '.join(names[:-nv])}, = qpos.tolist()", f"  {', '.join(names[-nv:])}, = qvel.tolist()"]
    for dof, (*factors, phase) in enumerate(rows.tolist()):
        angle = " + ".join(f"{factor!r} * {name}" for factor, name in zip(factors, names, strict=True))
        lines.append(f"  applied[{dof}] += {float(amplitude[dof])!r} * sin({angle} + {phase!r}{clock})")
    made: dict[str, Any] = {"sin": FUNCTIONS[-1]}
    exec("\n".join([*lines, " return add_to_applied"]), made)  # noqa: S102 - numbers of ours alone
    push: Push = made["push"]
    return lambda data, *views: push(data, *map(memoryview, views))  # type: ignore[arg-type]


def look_up_attributes() -> tuple[Any, ...]:
    """Returns what the force needs of classes and modules."""
    model_type, data_type = mujoco.MjModel, mujoco.MjData
    sizes = (getattr(model_type, name).fget for name in ("nq", "nv"))
    fields = (getattr(data_type, name).fget for name in ("qpos", "qvel", "qfrc_applied"))
    return model_type, data_type, *sizes, *fields


FUNCTIONS = np.sin, np.multiply, np.add, math.sin
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
        elif not probe:
            note("long", None, [(data.time - time) / timestep])

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
        model = load_model(inputs["model"])
        model.opt.timestep = run["timestep_s"]
        data = start_data(model, inputs["start"])

        before = None if index else serialise(model)

        def taped(
            model: mujoco.MjModel = model, data: mujoco.MjData = data, run: Any = run, before: Any = before
        ) -> None:
            chosen[0] = over
            tape.take_step(entry, model, data)
            chosen[0] = forward
            if before is not None and len(tape.steps) == 1 and not np.array_equal(before, serialise(model)):
                note_changes(model, inputs["model"], run["timestep_s"])

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


save_model, size_model = mujoco.mj_saveModel, mujoco.mj_sizeModel


def serialise(model: mujoco.MjModel) -> Row:
    """Returns all that a model holds as bytes, in 16 us."""
    buffer = np.zeros(size_model(model), np.uint8)
    save_model(model, None, buffer)
    return buffer


def note_changes(model: mujoco.MjModel, xml: str, timestep_s: float) -> None:
    """Notes which fields of a model are not those of its text any more; of the timestep, its ratio to the right one."""
    given = mujoco.MjModel.from_xml_string(xml)
    given.opt.timestep = timestep_s
    pairs = ((model, given, "model."), (model.opt, given.opt, "model.opt."))
    names = [
        f"{where}{name}"
        for mine, theirs, where in pairs
        for name in dir(theirs)
        if isinstance(value := getattr(theirs, name), np.ndarray | float | int) and not name.startswith("_")
        if name != "signature"  # a sum over other fields
        if not np.array_equal(value, getattr(mine, name), equal_nan=False)
    ]
    note("changed", {"fields": names[:CHANGES_MAX]}, [model.opt.timestep / timestep_s])


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
    read, widths = mujoco.mj_getState, [np.size(getattr(data, name)) for name in STATE.values()]
    states = np.empty((steps, sum(widths)))
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
            read(model, data, states[step], STATE_BITS)
    return dict(zip(STATE, np.hsplit(states, np.cumsum(widths[:-1])), strict=True))


def run_probe(tape: Tape, entry: Step, model: mujoco.MjModel, data: mujoco.MjData, inputs: Mapping[str, Any]) -> None:
    """Keeps single steps from the drawn states. What they print or raise is dropped: they are no part of the run."""
    raw, chosen, timestep, stdout = globals()["raw"], globals()["chosen"], model.opt.timestep, sys.stdout
    sys.stdout = io.StringIO()
    try:
        mujoco.mj_resetData(model, data)
        over = tape.record_calls(add_force(raw, inputs["force"], few=0), bounded=True)

        def first(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            chosen[0] = over
            look_for_scipy(sys._getframe())
            over(model, data)

        chosen[0] = first
        *others, last = inputs["starts"]
        for start in (*others, last):
            model.opt.timestep, data.time = start["timestep_s"], start["time"]
            for name in tape.names[0]:
                getattr(data, name)[:] = start[name]
            with Watch(tape, entry, data) if start is last and not globals().get("hidden") else nullcontext():
                tape.take_step(entry, model, data, probe=True)
    except BaseException:  # noqa: S110 - the run has been judged without it
        pass
    finally:
        sys.stdout, model.opt.timestep = stdout, timestep


class Watch:
    """Notes in which lines of the script one step calls mj_forward and changes the state, in order: of each the parts
    of the state as bits, the line, and those of its callers in the script. Tracing slows this one step alone."""

    def __init__(self, tape: Tape, entry: Step, data: mujoco.MjData) -> None:
        self.tape, self.data, self.file = tape, data, getattr(getattr(entry, "__code__", None), "co_filename", "")
        self.rows: list[float] = []
        fields, _ = tape.get_fields(data)
        self.fields = fields[: tape.state]
        ends = list(itertools.accumulate(field.nbytes for field in self.fields))
        self.parts = list(map(slice, [0, *ends], ends))
        self.state = self.read()
        self.at: tuple[types.FrameType | None, int] = (None, 0)

    def __enter__(self) -> None:
        sys.settrace(self.follow)

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)
        self.look()
        note("lines", None, self.rows)

    def read(self) -> tuple[bytes, float, int]:
        """Returns the state as bytes, and how often mj_forward was called: this runs at every line of the step."""
        return b"".join(self.fields), self.data.time, len(self.tape.calls)

    def look(self) -> None:
        """Adds a row if the last line has changed something."""
        state = self.read()
        if state == self.state:
            return
        frame, line = self.at
        if frame is not None and len(self.rows) < LINES_MAX * LINE_COLUMNS:
            lines, above = [line], frame.f_back
            while above is not None:
                if above.f_code.co_filename == self.file:
                    lines.append(above.f_lineno)
                above = above.f_back
            self.rows += [self.compare(state), *[*lines, 0, 0][: LINE_COLUMNS - 1]]
        self.state = state

    def compare(self, state: tuple[bytes, float, int]) -> int:
        """Returns which parts of a state are not those of the last one, as bits: positions, velocities, activations,
        time and calls."""
        (now, *others), (then, *before) = state, self.state
        parts = [now[part] != then[part] for part in self.parts]
        changed = [*parts, *[False] * (len(STATE) - 1 - len(parts)), *map(operator.ne, others, before)]
        return sum(1 << bit for bit, differs in enumerate(changed) if differs)

    def follow(self, frame: types.FrameType, event: str, _: object) -> Any:
        """Is called at each line of the script."""
        if frame.f_code.co_filename != self.file:
            return None
        self.look()
        back = frame.f_back if event == "return" else frame
        self.at = (back, back.f_lineno) if back is not None and back.f_code.co_filename == self.file else (None, 0)
        return self.follow


def look_for_scipy(frame: types.FrameType | None) -> None:
    """Notes whether a call comes from SciPy's integrators."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith(SCIPY):
            other_steppers.add(SCIPY)
            return
        frame = frame.f_back
