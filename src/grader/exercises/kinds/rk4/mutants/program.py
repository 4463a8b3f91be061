"""The right step as a program with parameters: a mutant changes one of them. It runs in our own process, from the
states in a trace, under the force that mj_forward carried there."""

import copy
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.exercises.kinds.rk4.judging.driver import Forward, add_force
from grader.exercises.kinds.rk4.judging.run import Force
from grader.exercises.kinds.rk4.step_trace import Step

Vector = NDArray[np.float64]
Four = tuple[float, float, float, float]
Choices = tuple[str, str, str, str, str]
Accelerate = Callable[[mujoco.MjModel, mujoco.MjData], Vector]
Move = Callable[[mujoco.MjModel, Vector, Vector, float], Vector]

THIRDS: Four = (0.0, 0.5, 0.5, 1.0)
"""How far from the start each stage is, in timesteps."""
WEIGHTS: Four = (1 / 6, 1 / 3, 1 / 3, 1 / 6)

ATOL = 1e-11
"""The largest difference of two states that are the same, relative to the largest number of the step.

Source: honest code differs by 1e-15, the nearest mutants by 1e-7.
"""

CONSTRAINED_ATOL = 1e-7
"""The same where a constraint acts: its solver stops at 1e-8, from wherever it was warm-started."""


def read_acceleration(model: mujoco.MjModel, data: mujoco.MjData) -> Vector:
    """Returns data.qacc."""
    return np.array(data.qacc)


def read_velocity(_: mujoco.MjModel, data: mujoco.MjData) -> Vector:
    """Returns data.qvel."""
    return np.array(data.qvel)


def move_rightly(model: mujoco.MjModel, qpos: Vector, velocity: Vector, h: float) -> Vector:
    """Returns positions after `h` [s] at a constant velocity."""
    moved = qpos.copy()
    mujoco.mj_integratePos(model, moved, velocity, h)
    return moved


@dataclass(frozen=True)
class StepProgram:
    """A step in four stages, counted from 0, and its end. The defaults are right. `origins_*`: whether a stage, or the
    end (place 4), begins at the "start" of the step or at what stands "here" in data. `velocities`: whether the
    position of a stage moves by the velocity of the "slope", that of the "start", or its "own" new one; that of the end
    by the "slope" or the "new" one. `written_*`: whether a stage writes that part of data at all."""

    reach_q: Four = THIRDS
    reach_v: Four = THIRDS
    reach_a: Four = THIRDS
    times: tuple[float, ...] = (*THIRDS, 1.0)
    slopes: tuple[int, int, int, int] = (0, 0, 1, 2)
    calls: tuple[bool, ...] = (True,) * 4
    origins_q: Choices = ("start",) * 5
    origins_v: Choices = ("start",) * 5
    velocities: Choices = ("slope",) * 5
    written_q: tuple[bool, ...] = (True,) * 4
    written_v: tuple[bool, ...] = (True,) * 4
    weights_q: Four = WEIGHTS
    weights_v: Four = WEIGHTS
    weights_a: Four = WEIGHTS
    accelerate: Accelerate = read_acceleration
    rate: Accelerate = read_velocity
    """By what positions move."""
    move: Move = move_rightly
    bare_data: tuple[str, ...] = ()
    """Parts of data that stand at 0 in every call, as in a data of its own."""
    clips: bool = False
    """Whether the last position is clipped to the range of each joint."""


class Mismatch(Exception):
    """Ends a program that asks mj_forward in another state than the step in a trace does."""


@dataclass
class Bench:
    """Runs programs from the states of steps of one model."""

    model: mujoco.MjModel
    data: mujoco.MjData = field(init=False)
    prepared: dict[int, tuple[Step, Sequence[Vector], Forward]] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.model = copy.copy(self.model)
        self.data = mujoco.MjData(self.model)

    def prepare(self, step: Step, force: Force) -> tuple[Sequence[Vector], Forward]:
        """Returns the states of a step, and mj_forward under its force. They are kept: hundreds of programs follow the
        same step."""
        if id(step) not in self.prepared:
            forward = add_force(mujoco.mj_forward, vars(force))
            self.prepared[id(step)] = step, list_states(self.model, step), forward
        return self.prepared[id(step)][1:]

    def follow(self, program: StepProgram, step: Step, force: Force) -> tuple[int, bool]:
        """Returns how many states of a step a program reaches, in order, and whether these are all: those in which
        mj_forward is called, and the one after the step. Calls in the same state count once."""
        model, data = self.model, self.data
        states, forward = self.prepare(step, force)
        last, largest = len(states) - 1, 1.0 + float(np.max(np.abs(states)))
        tolerance = ATOL * largest
        model.opt.timestep = step.timestep_s
        mujoco.mj_resetData(model, data)
        data.time, data.qpos[:], data.qvel[:] = step.time[0], step.qpos[0], step.qvel[0]
        data.act[:], data.ctrl[:], data.qacc[:] = step.act[0], step.ctrl[0], step.qacc[0]
        reached = 0

        def call() -> None:
            nonlocal reached, tolerance
            for name in program.bare_data:
                setattr(data, name, 0.0) if name == "time" else getattr(data, name).fill(0.0)
            state = read_state(model, data)
            is_again = reached and np.max(np.abs(state - states[reached - 1])) <= tolerance
            is_end = reached == last and np.max(np.abs(state - states[last])) <= tolerance
            if not is_again and not is_end:
                if reached == last or np.max(np.abs(state - states[reached])) > tolerance:
                    raise Mismatch
                reached += 1
            forward(model, data)
            if data.nefc:
                tolerance = CONSTRAINED_ATOL * largest

        with suppress(Mismatch):
            take_step(program, model, data, call)
            ends = bool(np.max(np.abs(read_state(model, data) - states[last])) <= tolerance)
            return reached + ends, ends and reached == last
        return reached, False


def list_states(model: mujoco.MjModel, step: Step) -> Sequence[Vector]:
    """Returns the states in which a step calls mj_forward, each once where they follow each other, and the last one. A
    call in the last state itself, after the step, is left out. Quaternions have length 1."""
    positions = [normalise(model, qpos) for qpos in step.qpos]
    rows = np.column_stack([step.time, positions, step.qvel, step.act])[1:]
    calls = [row for row, before in zip(rows[:-1], [None, *rows[:-2]], strict=True) if not np.array_equal(row, before)]
    if len(calls) > 1 and np.array_equal(calls[-1], rows[-1]):
        del calls[-1]
    return [*calls, rows[-1]]


def read_state(model: mujoco.MjModel, data: mujoco.MjData) -> Vector:
    """Returns time, positions, velocities and activations in one array; quaternions have length 1."""
    return np.concatenate([[data.time], normalise(model, data.qpos), data.qvel, data.act])


def normalise(model: mujoco.MjModel, qpos: Vector) -> Vector:
    """Returns positions with quaternions of length 1: that is how mj_forward reads them."""
    if model.nq == model.nv:
        return qpos
    normalised = np.array(qpos)
    mujoco.mj_normalizeQuat(model, normalised)
    return normalised


def take_step(program: StepProgram, model: mujoco.MjModel, data: mujoco.MjData, call: Callable[[], None]) -> None:
    """Advances data by one step of a program; `call()` calls mj_forward."""
    h, t = float(model.opt.timestep), float(data.time)
    q, v, a = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    slopes: list[tuple[Vector, Vector, Vector]] = []
    for stage in range(4):
        if stage:
            slope = slopes[program.slopes[stage]]
            begin_q = q if program.origins_q[stage] == "start" else data.qpos.copy()
            begin_v = v if program.origins_v[stage] == "start" else data.qvel.copy()
            new = begin_v + program.reach_v[stage] * h * slope[1]
            by = {"slope": slope[0], "start": v, "own": new}[program.velocities[stage]]
            if program.written_q[stage]:
                data.qpos[:] = program.move(model, begin_q, by, program.reach_q[stage] * h)
            if program.written_v[stage]:
                data.qvel[:] = new
            data.act[:] = a + program.reach_a[stage] * h * slope[2]
        data.time = t + program.times[stage] * h
        if program.calls[stage]:
            call()
        slopes.append((program.rate(model, data), program.accelerate(model, data), data.act_dot.copy()))
    end_step(program, model, data, slopes, (t, q, v, a))


def end_step(
    program: StepProgram, model: mujoco.MjModel, data: mujoco.MjData, slopes: Sequence[Any], start: Any
) -> None:
    """Writes the end of a step into data."""
    (t, q, v, a), h = start, float(model.opt.timestep)
    by, change, rate = (
        sum(w * slope[part] for w, slope in zip(weights, slopes, strict=True))
        for part, weights in enumerate((program.weights_q, program.weights_v, program.weights_a))
    )
    begin_q = q if program.origins_q[4] == "start" else data.qpos.copy()
    begin_v = v if program.origins_v[4] == "start" else data.qvel.copy()
    data.qvel[:] = begin_v + h * change
    data.qpos[:] = program.move(model, begin_q, data.qvel if program.velocities[4] == "new" else by, h)
    if program.clips:
        clip_to_ranges(model, data.qpos)
    data.act[:] = a + h * rate
    data.time = t + program.times[4] * h


def clip_to_ranges(model: mujoco.MjModel, qpos: Vector) -> None:
    """Clips the positions of limited hinges and slides to their ranges, in place."""
    for joint in np.flatnonzero(model.jnt_limited).tolist():
        place = model.jnt_qposadr[joint]
        qpos[place] = np.clip(qpos[place], *model.jnt_range[joint])
