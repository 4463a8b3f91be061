"""Lets the student's function take the steps of every run of a trial, and submits the states after each.

Runs in the jail. Results of run i: `q<i>`, `v<i>`, `a<i>`, `t<i>` (positions, velocities, activations, time; one row a
step, up to the first that is not finite).

While it steps, mj_forward adds a smooth force f(q, v, t) = a sin(P q + V v + w t + p) in every dof. No other function
of MuJoCo adds it, so a trajectory that another function has computed differs. The force is drawn for each submission,
so a recorded trajectory differs too. `with_force` also runs in our own process, around the judge's mj_forward.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

Forward = Callable[[mujoco.MjModel, mujoco.MjData], object]

STATE = {"q": "qpos", "v": "qvel", "a": "act", "t": "time"}


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


def before_import() -> None:
    """Replaces mj_forward by one whose force can be switched, before the student's module imports it."""
    raw = mujoco.mj_forward
    chosen: list[Forward] = [raw]

    def mj_forward(m: mujoco.MjModel, d: mujoco.MjData) -> None:
        chosen[0](m, d)

    def choose_force(spec: Mapping[str, Any] | None) -> None:
        chosen[0] = raw if spec is None else with_force(raw, spec)

    mj_forward.__doc__, mj_forward.__module__, mj_forward.__qualname__ = raw.__doc__, raw.__module__, raw.__qualname__
    mujoco.mj_forward = mj_forward
    globals()["choose_force"] = choose_force


def trial(
    functions: Sequence[Callable[..., object]], inputs: Mapping[str, Any], submit: Callable[[str, Any], None]
) -> None:
    """Simulates every run from its start by the student's steps."""
    (entry,) = functions
    choose_force: Callable[[Mapping[str, Any] | None], None] = globals()["choose_force"]
    for index, run in enumerate(inputs["runs"]):
        model = mujoco.MjModel.from_xml_string(inputs["model"])
        model.opt.timestep = run["timestep_s"]
        choose_force(inputs["force"])
        try:
            rows = record(entry, model, started(model, inputs["start"]), run["steps"])
        finally:
            choose_force(None)
        finite = np.logical_and.accumulate(np.isfinite(np.hstack(list(rows.values()))).all(axis=1))
        for name, values in rows.items():
            submit(f"{name}{index}", values[: int(np.sum(finite))])


def started(model: mujoco.MjModel, start: Mapping[str, Sequence[float]]) -> mujoco.MjData:
    """Returns a new data at the start of a run; derived quantities are not computed."""
    data = mujoco.MjData(model)
    for name, values in start.items():
        getattr(data, name)[:] = values
    return data


def record(
    entry: Callable[..., object], model: mujoco.MjModel, data: mujoco.MjData, steps: int
) -> dict[str, np.ndarray[Any, np.dtype[np.float64]]]:
    """Returns the state after every step, by its short name."""
    rows = {short: np.empty((steps, np.size(getattr(data, name)))) for short, name in STATE.items()}
    for step in range(steps):
        entry(model, data)
        for short, name in STATE.items():
            rows[short][step] = getattr(data, name)
    return rows
