"""How long a run of a lab lasts, and how long it may compute."""

import time

from grader.domain.lab import SECONDS_MAX, LabConfig
from grader.errors import LabRefused

SECONDS_TO_WATCH, SECONDS_OF_A_PLOT, SECONDS_TO_READ = 3.0, 5.0, 10.0
"""The length of a run of which the author says nothing: a bare scene, a plot, something to read or to set."""

STEPS_MAX = 200_000
CPU_S_MAX = 20.0
"""Most CPU time of a run [s]: ten times what the most steps of the lesson's models take with a controller."""


def choose_length_s(config: LabConfig) -> float:
    """Says how long the lab runs where the caller does not say [s]. Its `seconds`, else `stopAt`, else the widest plot,
    else 10 s with something to read or to set, and 3 s without."""
    if config.seconds is not None:
        return config.seconds
    if isinstance(config.stopAt, float | int):
        return min(float(config.stopAt), SECONDS_MAX)
    windows = [plot.window or SECONDS_OF_A_PLOT for plot in config.plots]
    otherwise = SECONDS_TO_READ if config.readouts or config.controls else SECONDS_TO_WATCH
    return min(max(windows, default=otherwise), SECONDS_MAX)


def check_cpu(duration: float, last: float) -> None:
    """Raise LabRefused where a run of `duration` [s] has used its CPU time, which ends at `last` [s]."""
    if time.thread_time() > last:
        cure = "take fewer seconds, a larger timestep or a smaller model"
        raise LabRefused(f"{duration:g} s take more than {CPU_S_MAX:g} s of computing: {cure}.")


def check_steps(duration: float, steps: int) -> None:
    """Raise LabRefused where a run of `duration` [s] takes more steps than there may be."""
    if steps > STEPS_MAX:
        too_long = f"{duration:g} s at this timestep take more than {STEPS_MAX} steps"
        raise LabRefused(f"{too_long}: take fewer seconds or a larger timestep.")
