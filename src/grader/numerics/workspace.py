"""Workspaces: what a run steps, lent to one run at a time and used again."""

import copy
from collections import deque
from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

BARE_AFTER = 20_000
"""Steps that a scene's skipping runs have taken before it gets a model without visuals.

Source: measured on the lesson's models; making one takes about 1 ms, and a step then costs 0.05 us less.
"""

Strip = Callable[[], mujoco.MjModel | None]


class Workspace:
    """A model and a data that one run holds alone. `counts` (7,) are the live warning counters."""

    def __init__(self, model: mujoco.MjModel, *, bare: bool = False) -> None:
        self.model = copy.copy(model)
        self.data = mujoco.MjData(self.model)
        self.option = self.model.opt
        self.counts: NDArray[np.int32] = self.data.warning.number
        self.bare = bare


class Stock:
    """A scene's workspaces that no run holds; skipping runs get bare ones, of a model without visuals, once it pays.

    `strip` makes the bare model, or None where that would be no different. Threads may take and give back at once.
    """

    def __init__(self, model: mujoco.MjModel, strip: Strip | None = None) -> None:
        self._whole = model
        self._bare: mujoco.MjModel | None = None
        self._strip = strip
        self._steps = 0
        self._free: dict[bool, deque[Workspace]] = {False: deque(), True: deque()}

    def take(self, *, skip: bool) -> Workspace:
        """A workspace for one run; its data is as the last run left it."""
        if skip and self._strip is not None and self._steps >= BARE_AFTER:
            strip, self._strip = self._strip, None
            self._bare = strip()
        bare = self._bare if skip else None
        try:
            return self._free[bare is not None].pop()
        except IndexError:
            return Workspace(self._whole if bare is None else bare, bare=bare is not None)

    def give_back(self, workspace: Workspace, steps: float) -> None:
        """For the next run; `steps` is how many were taken in it with skipping on."""
        if steps > 0:  # neither backwards nor not a number
            self._steps += round(min(steps, BARE_AFTER))
        self._free[workspace.bare].append(workspace)
