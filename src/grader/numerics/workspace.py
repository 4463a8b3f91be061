"""Workspaces: models and data that runs borrow, one run at a time, and return."""

import copy
from collections import deque
from collections.abc import Callable
from itertools import pairwise

import mujoco
import numpy as np
from mujoco import mjtState
from numpy.typing import NDArray

BARE_AFTER = 20_000
"""Steps that the skipping runs of a scene take before a model without visuals is compiled. Source: measured on the
lesson's models; compiling it takes about 1 ms and saves 0.05 us a step."""

KEPT = int(mjtState.mjSTATE_TIME | mjtState.mjSTATE_QPOS | mjtState.mjSTATE_QVEL | mjtState.mjSTATE_ACT)
"""What a rollout keeps of a state, in this order: one call of `mj_getState` takes half the time of four assignments."""

Strip = Callable[[], mujoco.MjModel | None]


class Workspace:
    """A model and its data, for one run at a time.

    `counts` (7,) is a view of the warning counters, and `warned` the same for `any`, ten times as fast. `timestep_s`
    [s] and `integrator` are those with which it was lent. `known` is the whole integration state at which the data
    stands, None where it may have been written since; `saved` is room for one. `columns` are the slices of qpos, qvel
    and act in a row of KEPT, which has `width` entries.
    """

    def __init__(self, model: mujoco.MjModel, *, bare: bool = False) -> None:
        self.model = copy.copy(model)
        self.data = mujoco.MjData(self.model)
        self.option = self.model.opt
        self.counts: NDArray[np.int32] = self.data.warning.number
        self.warned = memoryview(self.counts)
        self.known: NDArray[np.float64] | None = None
        self.saved = np.empty(mujoco.mj_stateSize(self.model, int(mjtState.mjSTATE_INTEGRATION)))
        bounds = np.cumsum([1, model.nq, model.nv, model.na]).tolist()
        self.columns = tuple(slice(low, high) for low, high in pairwise(bounds))
        self.width: int = bounds[-1]
        self.timestep_s, self.integrator = 0.0, 0
        self.bare = bare


class WorkspacePool:
    """The free workspaces of a scene; thread-safe. Runs that skip parts get bare workspaces, of a model without
    visuals, after BARE_AFTER steps. `strip` compiles the bare model, or returns None if it would not differ."""

    def __init__(self, model: mujoco.MjModel, strip: Strip | None = None) -> None:
        self._whole = model
        self._bare: mujoco.MjModel | None = None
        self._strip = strip
        self._steps = 0
        self._free: dict[bool, deque[Workspace]] = {False: deque(), True: deque()}

    def take(self, *, skip: bool) -> Workspace:
        """Take a workspace for one run; its data is as the last run left it."""
        if skip and self._strip is not None and self._steps >= BARE_AFTER:
            strip, self._strip = self._strip, None
            self._bare = strip()
        bare = self._bare if skip else None
        try:
            return self._free[bare is not None].pop()
        except IndexError:
            return Workspace(self._whole if bare is None else bare, bare=bare is not None)

    def give_back(self, workspace: Workspace, steps: float) -> None:
        """Return a workspace; `steps` is the number of steps taken with skipping on."""
        if self._strip is not None and steps > 0:  # false for negative numbers and NaN
            self._steps += round(min(steps, BARE_AFTER))
        self._free[workspace.bare].append(workspace)
