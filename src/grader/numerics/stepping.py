"""Steps a workspace in chunks in C, and finds the step at which MuJoCo first warned."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import nan

import mujoco
import numpy as np
from mujoco import mjtWarning
from numpy.typing import NDArray

from grader.numerics.scene import FULL_STATE
from grader.numerics.workspace import Workspace

CHUNK = 128
"""Steps in the first call into C; each later call takes GROWTH times as many, up to CHUNK_MAX. Source: measured on the
lesson's models. A call with its checks costs about 1 us, 2 % of 128 steps and 0.4 % of 512; a short first chunk wastes
little time on a run that diverges early."""

GROWTH = 4

CHUNK_MAX = 512

RK4 = int(mujoco.mjtIntegrator.mjINT_RK4)
"""A plain number: to compare one with the enumeration takes as long as a step of a small model."""

STEPS_MAX = 20_000_000
"""Most steps of one run, about 10 s of computing for the servo."""


@dataclass(frozen=True)
class MujocoWarning:
    """A warning of MuJoCo: its kind, such as BADQACC, and the time [s] at which the step began."""

    kind: str
    time_s: float


Controller = Callable[[mujoco.MjModel, mujoco.MjData], object]
Stepper = Callable[[mujoco.MjModel, mujoco.MjData], object]


def advance_coarsely(workspace: Workspace, steps: int) -> int:
    """Step `steps` times, or until a chunk warns; return the number of steps before that chunk. After a warning the
    state is undefined."""
    done, chunk, time_s = 0, CHUNK, workspace.data.time
    while done < steps:
        chunk = min(chunk, steps - done)
        before, time_s = time_s, _step_chunk(workspace, chunk)
        if not time_s > before:
            return done
        done += chunk
        chunk = min(GROWTH * chunk, CHUNK_MAX)
    return done


def advance_exactly(workspace: Workspace, steps: int, chunk: int = CHUNK) -> int:
    """Step `steps` times, or until a step warns or time does not advance; return the number of completed steps. The
    state is saved every CHUNK_MAX steps or more. A chunk that warned is taken again from its start, which is reached
    from the last saved state, in chunks a GROWTH-th as long and at last step by step."""
    model, data = workspace.model, workspace.data
    known, workspace.known = workspace.known, None
    done, saved_at, time_s = 0, 0, data.time
    while done < steps:
        chunk = min(chunk, steps - done)
        if known is None or done - saved_at >= CHUNK_MAX:
            known, saved_at = workspace.saved, done
            mujoco.mj_getState(model, data, known, FULL_STATE)
        before, time_s = time_s, _step_chunk(workspace, chunk)
        if not time_s > before:
            if chunk == 1:
                return done
            mujoco.mj_resetData(model, data)
            mujoco.mj_setState(model, data, known, FULL_STATE)
            if done > saved_at:
                mujoco.mj_step(model, data, done - saved_at)
            return done + advance_exactly(workspace, chunk, max(1, chunk // GROWTH))
        done += chunk
        chunk = min(GROWTH * chunk, CHUNK_MAX)
    return done


def _step_chunk(workspace: Workspace, chunk: int) -> float:
    """Take a chunk of steps; return the time [s] after it, NaN where MuJoCo warned. A full buffer raises a warning and
    may raise FatalError later in the same chunk; the warning then counts."""
    try:
        mujoco.mj_step(workspace.model, workspace.data, chunk)  # by position, which binds 0.15 us faster than by name
    except mujoco.FatalError:
        if not any(workspace.warned):
            raise
    return nan if any(workspace.warned) else workspace.data.time


def make_advance(controller: Controller | None, stepper: Stepper | None) -> Callable[[Workspace, int], int]:
    """Like `advance_exactly`, step by step, with a call before each step or another function in place of mj_step."""

    def advance(workspace: Workspace, steps: int) -> int:
        return _advance_singly(workspace, steps, controller, stepper or mujoco.mj_step)

    return advance


def make_advance_until(kind: mjtWarning) -> Callable[[Workspace, int], int]:
    """Step through automatic resets until `kind` is counted, like a script that reads only this counter."""

    def advance(workspace: Workspace, steps: int) -> int:
        model, data, counts = workspace.model, workspace.data, workspace.counts
        for done in range(steps):
            mujoco.mj_step(model, data)
            if counts[kind]:
                return done
        return steps

    return advance


def derives_last_stage(model: mujoco.MjModel) -> bool:
    """Whether mj_step leaves derived quantities, such as energy and xpos, of RK4's last stage: of no state of the run.

    Every other integrator leaves those of the state at which the step began.
    """
    return bool(model.opt.integrator == RK4)


def derive_copy(model: mujoco.MjModel, data: mujoco.MjData, copy: mujoco.MjData) -> None:
    """Give `copy` the state of `data`, and derived quantities that belong to it; `data` stays as it is, bit for bit.
    Raises mujoco.FatalError if the memory of the model is too small."""
    mujoco.mj_copyState(model, data, copy, FULL_STATE)
    mujoco.mj_forward(model, copy)


def find_first_warning(workspace: Workspace) -> mjtWarning | None:
    """Returns the first kind of warning with a count, in the order of mjtWarning; None if there is none."""
    return next(_list_kinds(workspace.counts), None)


def take_warnings(counts: NDArray[np.int32], time_s: float) -> list[MujocoWarning]:
    """What MuJoCo has counted since the last call; clears the counters, which it leaves at 1 after a reset."""
    if not counts.any():
        return []
    kinds = list(_list_kinds(counts))
    counts[:] = 0
    return [MujocoWarning(kind.name.removeprefix("mjWARN_"), time_s) for kind in kinds]


def _list_kinds(counts: NDArray[np.int32]) -> Iterator[mjtWarning]:
    return (mjtWarning(int(kind)) for kind in np.flatnonzero(counts))


def _advance_singly(
    workspace: Workspace, steps: int, controller: Controller | None = None, step: Stepper = mujoco.mj_step
) -> int:
    model, data, warned = workspace.model, workspace.data, workspace.warned
    for done in range(steps):
        if controller is not None:
            controller(model, data)
        before = data.time
        step(model, data)
        if any(warned) or not data.time > before:
            return done
    return steps
