"""Steps a workspace in chunks in C, and finds the step at which MuJoCo first warned."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import mjtWarning
from numpy.typing import NDArray

from grader.numerics.scene import FULL_STATE
from grader.numerics.workspace import Workspace

CHUNK = 64
"""Steps in the first call into C; each later call takes twice as many, up to CHUNK_MAX.

Source: measured on the lesson's models. A call with its checks costs about 1.5 us, 4 % of 64 steps and 0.5 % of 512; a
short first chunk wastes little time on a run that diverges early.
"""

CHUNK_MAX = 512

STEPS_MAX = 20_000_000
"""Most steps of one run, about 10 s of computing for the servo."""

CLEAN = bytes(4 * int(mjtWarning.mjNWARNING))
"""The bytes of warning counters that are all 0; comparing bytes costs 0.2 us, `any()` 1 us."""


@dataclass(frozen=True)
class Raised:
    """A warning of MuJoCo: its kind, such as BADQACC, and the time [s] at which the step began."""

    kind: str
    time_s: float


Controller = Callable[[mujoco.MjModel, mujoco.MjData], object]
Stepper = Callable[[mujoco.MjModel, mujoco.MjData], object]


def advance_coarsely(workspace: Workspace, steps: int) -> int:
    """Step `steps` times, or until a chunk warns; return the number of steps before that chunk.

    After a warning the state is undefined.
    """
    done, chunk = 0, CHUNK // 2
    while done < steps:
        chunk = min(2 * chunk, CHUNK_MAX, steps - done)
        if _warned(workspace, chunk):
            return done
        done += chunk
    return done


def _warned(workspace: Workspace, chunk: int) -> bool:
    """Take a chunk of steps; return whether MuJoCo warned or time did not advance.

    A full buffer raises a warning and may raise FatalError later in the same chunk; the warning then counts.
    """
    data, before = workspace.data, workspace.data.time
    try:
        mujoco.mj_step(workspace.model, data, nstep=chunk)
    except mujoco.FatalError:
        if workspace.counts.tobytes() == CLEAN:
            raise
    return workspace.counts.tobytes() != CLEAN or not data.time > before


def advance_exactly(workspace: Workspace, steps: int) -> int:
    """Step `steps` times, or until a step warns or time does not advance; return the number of completed steps."""
    model, data = workspace.model, workspace.data
    saved = np.empty(mujoco.mj_stateSize(model, FULL_STATE)) if steps > 1 else None
    done, chunk = 0, CHUNK // 2
    while done < steps:
        chunk = min(2 * chunk, CHUNK_MAX, steps - done)
        if saved is not None and chunk > 1:
            mujoco.mj_getState(model, data, saved, FULL_STATE)
        if _warned(workspace, chunk):
            if saved is None or chunk == 1:
                return done
            mujoco.mj_resetData(model, data)
            mujoco.mj_setState(model, data, saved, FULL_STATE)
            return done + _advance_singly(workspace, chunk)
        done += chunk
    return done


def advance_by(controller: Controller | None, stepper: Stepper | None) -> Callable[[Workspace, int], int]:
    """Like `advance_exactly`, step by step, with a call before each step or another function in place of mj_step."""

    def advance(workspace: Workspace, steps: int) -> int:
        return _advance_singly(workspace, steps, controller, stepper or mujoco.mj_step)

    return advance


def advance_counting(kind: mjtWarning) -> Callable[[Workspace, int], int]:
    """Step through automatic resets until `kind` is counted, like a script that reads only this counter."""

    def advance(workspace: Workspace, steps: int) -> int:
        model, data, counts = workspace.model, workspace.data, workspace.counts
        for done in range(steps):
            mujoco.mj_step(model, data)
            if counts[kind]:
                return done
        return steps

    return advance


def first_warning(workspace: Workspace) -> mjtWarning | None:
    """The first kind of warning with a count, in the order of mjtWarning; None if there is none."""
    return next(_kinds(workspace.counts), None)


def raised(counts: NDArray[np.int32], time_s: float) -> list[Raised]:
    """What MuJoCo has counted since the last call; clears the counters, which it leaves at 1 after a reset."""
    if not counts.any():
        return []
    kinds = list(_kinds(counts))
    counts[:] = 0
    return [Raised(kind.name.removeprefix("mjWARN_"), time_s) for kind in kinds]


def _kinds(counts: NDArray[np.int32]) -> Iterator[mjtWarning]:
    return (mjtWarning(int(kind)) for kind in np.flatnonzero(counts))


def _advance_singly(
    workspace: Workspace, steps: int, controller: Controller | None = None, step: Stepper = mujoco.mj_step
) -> int:
    model, data, counts = workspace.model, workspace.data, workspace.counts
    for done in range(steps):
        if controller is not None:
            controller(model, data)
        before = data.time
        step(model, data)
        if counts.tobytes() != CLEAN or not data.time > before:
            return done
    return steps
