"""Simulates a scene into a Rollout, a time series without automatically reset states.

MuJoCo resets a state that diverges and continues. Here a run ends at the first warning of any kind, or if time runs
backwards, and reports the step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite

import mujoco
import numpy as np
from mujoco import mjtWarning
from numpy.typing import NDArray

from grader.numerics.needs import assert_proved, skippable
from grader.numerics.scene import Scene, Vector, frozen
from grader.numerics.stepping import STEPS_MAX, Controller, Stepper, advance_by, advance_exactly, first_warning
from grader.numerics.workspace import Workspace


@dataclass(frozen=True)
class Rollout:
    """A simulated time series as read-only arrays.

    step (n,), time [s] (n,), qpos (n, nq), qvel (n, nv), act (n, na), beginning with the start. `diverged_at_step` is
    the number of completed steps before the one that raised `warning`, None for a run that did not diverge; `warning`
    is None if time ran backwards without one. `steps` counts the completed steps.
    """

    step: NDArray[np.int64]
    time: Vector
    qpos: Vector
    qvel: Vector
    act: Vector
    timestep_s: float
    integrator: int
    steps: int
    diverged_at_step: int | None
    warning: mjtWarning | None


def simulate(
    scene: Scene,
    *,
    seconds: float | None = None,
    steps: int | None = None,
    timestep_s: float | None = None,
    integrator: int | None = None,
    every: int = 1,
    at_s: Sequence[float] | Vector | None = None,
    controller: Controller | None = None,
    stepper: Stepper | None = None,
    skip: bool = True,
) -> Rollout:
    """Simulate for `seconds` (rounded to whole steps) or `steps` from the scene's start.

    Keeps the states of every `every`-th step and of the last, or of the steps nearest to the times `at_s` [s after the
    start]. A `controller(model, data)` is called before each step and may read and write anything; no part of the
    engine is then skipped. A `stepper(model, data)` replaces mj_step; it may read anything, and write `data`.

    Raises ValueError for a length or timestep that is not finite, is negative or takes more than STEPS_MAX steps, and
    for a stepper that wrote its model; mujoco.FatalError if the memory of the model is too small.
    """
    keep = controller is None
    bare = skip and keep and stepper is None
    with scene.borrow(timestep_s=timestep_s, integrator=integrator, skip=bare, keep=keep) as workspace:
        if skip and keep and stepper is not None:
            workspace.option.disableflags |= skippable(scene.needs, sensors_read=True)
        count = _steps(workspace, seconds, steps)
        wanted = _wanted(count, every, at_s, float(workspace.option.timestep))
        advance = advance_exactly if controller is None and stepper is None else advance_by(controller, stepper)
        written = _bytes_of(workspace.model) if stepper is not None and keep else b""
        rollout = _record(workspace, wanted, advance)
        if written and _bytes_of(workspace.model) != written:  # the workspace is discarded with the exception
            raise ValueError("a stepper may not write its model, which later runs use too")
        if keep and not skip and rollout.diverged_at_step is None:
            assert_proved(scene.needs, workspace.data)
        return rollout


def _bytes_of(model: mujoco.MjModel) -> bytes:
    """The whole content of a model; takes 4 us for the lesson's."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


Advance = Callable[[Workspace, int], int]


def _steps(workspace: Workspace, seconds: float | None, steps: int | None) -> int:
    if (seconds is None) == (steps is None):
        raise ValueError("give either seconds or steps")
    if seconds is not None:
        if not isfinite(seconds) or not 0 <= seconds / workspace.option.timestep <= STEPS_MAX:
            raise ValueError(f"{seconds} s cannot be simulated in steps of {workspace.option.timestep} s")
        steps = round(seconds / workspace.option.timestep)
    assert steps is not None
    if not 0 <= steps <= STEPS_MAX:
        raise ValueError(f"{steps} steps is not between 0 and {STEPS_MAX}")
    return int(steps)


def _wanted(count: int, every: int, at_s: Sequence[float] | Vector | None, timestep_s: float) -> NDArray[np.int64]:
    """The steps whose states are kept, ascending and unique."""
    if at_s is None:
        if every < 1:
            raise ValueError("every must be 1 or more")
        steps = np.arange(0, count + every, every, dtype=np.int64)
        steps[-1] = count
        return steps
    times = np.asarray(at_s, dtype=np.float64)
    if not np.all((times >= 0) & (times <= (count + 0.5) * timestep_s)):
        raise ValueError(f"times must lie between 0 and {count * timestep_s} s")
    return np.unique(np.rint(times / timestep_s).astype(np.int64))


def _kept(rows: Vector, count: int) -> Vector:
    """The first rows, read-only; copied only where that frees the others."""
    if count < len(rows):
        return frozen(rows[:count])
    rows.setflags(write=False)
    return rows


def _record(workspace: Workspace, wanted: NDArray[np.int64], advance: Advance) -> Rollout:
    data = workspace.data
    time = np.empty(len(wanted))
    qpos, qvel, act = (np.empty((len(wanted), part.size)) for part in (data.qpos, data.qvel, data.act))
    kept = done = 0
    target = 0
    for target in wanted.tolist():
        done += advance(workspace, target - done)
        if done < target:
            break
        time[kept], qpos[kept], qvel[kept], act[kept] = data.time, data.qpos, data.qvel, data.act
        kept += 1
    return Rollout(
        step=wanted[:kept],
        time=_kept(time, kept),
        qpos=_kept(qpos, kept),
        qvel=_kept(qvel, kept),
        act=_kept(act, kept),
        timestep_s=float(workspace.option.timestep),
        integrator=int(workspace.option.integrator),
        steps=done,
        diverged_at_step=done if done < target else None,
        warning=first_warning(workspace) if done < target else None,
    )
