"""Simulates a scene at a timestep, and says whether MuJoCo warns within a horizon."""

from math import isfinite

from mujoco import FatalError

from grader.numerics.scene import Scene
from grader.numerics.stepping import STEPS_MAX, advance_coarsely


def warns_within(scene: Scene, timestep_s: float, horizon_s: float, *, integrator: int | None = None) -> bool:
    """Whether a run from the scene's start for `horizon_s` (rounded to whole steps) raises any warning after its first
    step. False where no run can be made, or MuJoCo warns of the start itself."""
    if not (timestep_s > 0 and isfinite(timestep_s) and isfinite(horizon_s)) or horizon_s / timestep_s > STEPS_MAX:
        return False
    later = round(horizon_s / timestep_s) - 1
    try:
        with scene.borrow(timestep_s=timestep_s, integrator=integrator, skip=True) as workspace:
            return advance_coarsely(workspace, 1) == 1 and advance_coarsely(workspace, later) < later
    except FatalError:  # out of memory
        return False
