"""Simulates a scene into a Rollout, a time series without automatically reset states. MuJoCo resets a state that
diverges and continues. Here a run ends at the first warning of any kind, or if time runs backwards, and reports the
step."""

from collections.abc import Callable, Sequence
from math import isfinite
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco import mjtWarning
from numpy.typing import NDArray

from grader.numerics.needs import assert_proved, list_skippable_flags
from grader.numerics.recording import SPARSE, record_steps
from grader.numerics.scene import Scene, Vector
from grader.numerics.stepping import STEPS_MAX, Controller, Stepper, advance_exactly, find_first_warning, make_advance
from grader.numerics.workspace import KEPT, Workspace


class Rollout(NamedTuple):
    """A simulated time series as read-only arrays.

    step (n,), time [s] (n,), qpos (n, nq), qvel (n, nv), act (n, na), beginning with the start. `diverged_at_step` is
    the number of completed steps before the one that raised `warning`, None for a run that did not diverge; `warning`
    is None if time ran backwards without one. `steps` counts the completed steps. `timestep_s` [s] and `integrator` are
    those of the start. `unconstrained` says that mj_step alone took the steps, that the run did not diverge, and
    that MuJoCo found no contact and no active constraint at any of its evaluations. The states are stored together,
    (n, 1 + nq + nv + na), and `columns` are those of qpos, qvel and act.
    """

    step: NDArray[np.int64]
    states: Vector
    columns: tuple[slice, ...]
    timestep_s: float
    integrator: int
    steps: int
    diverged_at_step: int | None
    warning: mjtWarning | None
    unconstrained: bool

    @property
    def time(self) -> Vector:
        """Times of the states [s], (n,)."""
        return self.states[:, 0]

    @property
    def qpos(self) -> Vector:
        """Positions, (n, nq)."""
        return self.states[:, self.columns[0]]

    @property
    def qvel(self) -> Vector:
        """Velocities, (n, nv)."""
        return self.states[:, self.columns[1]]

    @property
    def act(self) -> Vector:
        """Activations, (n, na)."""
        return self.states[:, self.columns[2]]


def simulate(
    scene: Scene, *, seconds: float | None = None, steps: int | None = None, timestep_s: float | None = None,
    integrator: int | None = None, every: int = 1, at_s: Sequence[float] | Vector | None = None,
    controller: Controller | None = None, stepper: Stepper | None = None, skip: bool = True, repeat: bool = False,
) -> Rollout:  # fmt: skip
    """Simulate for `seconds` (rounded to whole steps) or `steps` from the scene's start.

    Keeps the states of every `every`-th step and of the last, or of the steps nearest to the times `at_s` [s after the
    start]; `record_steps` takes them where nearly all are kept. A `controller(model, data)` is called before each step
    and may read and write anything; no part of the engine is then skipped. With `repeat` constraints are skipped too
    where this scene may need them, but a run from its start at the same timestep, under the same integrator and as long
    or longer, did not. A `stepper(model, data)` replaces mj_step; it may read anything, and write `data`.

    Raises ValueError for a length or timestep that is not finite, is negative or takes more than STEPS_MAX steps, and
    for a stepper that wrote its model; mujoco.FatalError if the memory of the model is too small.
    """
    keep = controller is None
    bare = skip and keep and stepper is None
    workspace = scene.lend(timestep_s, integrator, skip=bare)  # not given back, and so discarded, after an exception
    if skip and keep and stepper is not None:
        workspace.option.disableflags |= list_skippable_flags(scene.needs, sensors_read=True)
    count = _count_steps(workspace.timestep_s, seconds, steps)
    setting = (workspace.timestep_s, workspace.integrator)
    if repeat and bare and count <= scene.unconstrained.get(setting, 0):
        workspace.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    wanted = _choose_steps(count, every, at_s, workspace.timestep_s)
    advance = advance_exactly if controller is None and stepper is None else make_advance(controller, stepper)
    written = _save_model(workspace.model) if stepper is not None and keep else b""
    rollout = _record(scene, workspace, wanted, advance)
    if written and _save_model(workspace.model) != written:
        raise ValueError("a stepper may not write its model, which later runs use too")
    if rollout.unconstrained:
        scene.unconstrained[setting] = max(rollout.steps, scene.unconstrained.get(setting, 0))
    if keep and not skip and rollout.diverged_at_step is None:
        assert_proved(scene.needs, workspace.data)
    if keep:
        scene.return_workspace(workspace, rollout.steps if bare else 0)
    return rollout


def _save_model(model: mujoco.MjModel) -> bytes:
    """Returns the whole content of a model; takes 4 us for the lesson's."""
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


Advance = Callable[[Workspace, int], int]


def _count_steps(timestep_s: float, seconds: float | None, steps: int | None) -> int:
    if (seconds is None) == (steps is None):
        raise ValueError("give either seconds or steps")
    if seconds is not None:
        if not isfinite(seconds) or not 0 <= seconds / timestep_s <= STEPS_MAX:
            raise ValueError(f"{seconds} s cannot be simulated in steps of {timestep_s} s")
        steps = round(seconds / timestep_s)
    assert steps is not None
    if not 0 <= steps <= STEPS_MAX:
        raise ValueError(f"{steps} steps is not between 0 and {STEPS_MAX}")
    return int(steps)


def _choose_steps(
    count: int, every: int, at_s: Sequence[float] | Vector | None, timestep_s: float
) -> NDArray[np.int64]:
    """Returns the steps whose states are kept, ascending and unique."""
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


def _record(scene: Scene, workspace: Workspace, wanted: NDArray[np.int64], advance: Advance) -> Rollout:
    data, last = workspace.data, int(wanted[-1]) if len(wanted) else 0
    recorded = None
    if advance is advance_exactly and 0 < last < SPARSE * len(wanted) and scene.inputs is not None:
        recorded = record_steps(workspace, last, scene.inputs)
        if recorded is None:
            scene.restart(workspace)
    if recorded is None:
        rows, done = _collect(workspace, scene.start_vector, wanted, advance)
    else:
        states, done = recorded
        kept = wanted[: int(np.searchsorted(wanted, done, side="right"))]
        rows = states[: done + 1] if len(kept) == done + 1 else states[kept]
        rows = np.ascontiguousarray(rows[:, : workspace.width])
    rows.setflags(write=False)
    diverged = done < last
    warning = find_first_warning(workspace) if diverged else None
    setting = (workspace.columns, workspace.timestep_s, workspace.integrator)
    # MuJoCo keeps the most contacts and constraints of any evaluation since the reset: RK4's stages count too.
    plain = advance is advance_exactly and not diverged
    unconstrained = plain and data.maxuse_con == 0 and data.maxuse_efc == 0
    steps = wanted[: len(rows)]
    return Rollout(steps, rows, *setting, done, done if diverged else None, warning, unconstrained)


def _collect(workspace: Workspace, start: Vector, wanted: NDArray[np.int64], advance: Advance) -> tuple[Vector, int]:
    """Returns the states after the wanted steps, (n, width), and the number of completed steps."""
    rows = np.empty((len(wanted), workspace.width))
    done = 0
    for kept, target in enumerate(wanted.tolist()):
        if target:
            done += advance(workspace, target - done)
            if done < target:
                return rows[:kept].copy(), done  # which frees the others
            mujoco.mj_getState(workspace.model, workspace.data, rows[kept], KEPT)
        else:
            rows[0] = start[: workspace.width]  # a whole integration state begins with what is kept
    return rows, done
