"""What is swept: the five integrators and ten timesteps over one horizon."""

import mujoco
import numpy as np
from numpy.typing import NDArray

INTEGRATORS = {
    "Euler": int(mujoco.mjtIntegrator.mjINT_EULER),
    "RK4": int(mujoco.mjtIntegrator.mjINT_RK4),
    "implicit": int(mujoco.mjtIntegrator.mjINT_IMPLICIT),
    "implicitfast": int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST),
    "discrete": int(mujoco.mjtIntegrator.mjINT_DISCRETE),
}

TIMESTEPS_S = tuple(0.016 / 2**k for k in range(10))
"""16 ms down to 31 us by halves, with the default 2 ms among them."""

SAMPLE_EVERY_S = 0.016
SAMPLES = 64
HORIZON_S = SAMPLES * SAMPLE_EVERY_S
"""1.024 s: every timestep divides the sampling interval, so that all runs are compared at the same instants."""

SAMPLE_TIMES_S: NDArray[np.float64] = SAMPLE_EVERY_S * np.arange(SAMPLES + 1, dtype=np.float64)
"""Start included; shape (SAMPLES + 1,)."""

END_TIMES_S: NDArray[np.float64] = SAMPLE_TIMES_S[[0, -1]]
"""For timing: start and end alone, so that nobody pays for recording."""

YARDSTICK = ("Euler", 0.002)
"""MuJoCo's defaults: every CPU time is quoted in runs of this setting on the same scene."""
