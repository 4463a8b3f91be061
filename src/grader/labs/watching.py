"""A run as a learner watches it: short events in close-up, and the stability limit at the slider of the timestep."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import mujoco

from grader.domain.lab import LabConfig, Slider
from grader.labs.controls import Wish
from grader.labs.pulls import Pull
from grader.labs.record import LabRun, Limit
from grader.labs.runs import Event, Variant, build_lab_scene, run_lab
from grader.numerics.stability.limit import find_spectral_limit

SHORT_S = 0.5
"""A first warning before this time is a short event."""

AFTERWARDS = 2.2
"""How long a close-up lasts, in times of the event."""

LIMIT_WIDTH_S = 1e-6
"""The width to which the limit is searched: a slider shows three figures."""

DEGREES_OF_FREEDOM_MAX = 30
"""The cost of a linearisation grows with their square; larger models have no limit shown."""

TIMESTEP = "model.opt.timestep"
"""The path that a slider of the timestep sets [s]."""


def watch_lab(
    config: LabConfig, xml: str, controls: Mapping[str, Wish] | None = None, events: Sequence[Event] = (),
    seconds: float | None = None, *, pulls: Sequence[Pull] = (),
) -> LabRun:  # fmt: skip
    """Run a lab as `run_lab` does, with its `limit`; where MuJoCo warned early, with more frames around the warning.
    Raises what `run_lab` raises."""
    run = run_lab(config, xml, controls, events, seconds, pulls=pulls)
    if run.warnings and run.warnings[0].time_s < SHORT_S:
        close_up = Variant(close_up_s=AFTERWARDS * run.warnings[0].time_s)
        run = run_lab(config, xml, controls, events, seconds, pulls=pulls, variant=close_up)
    return replace(run, limit=find_timestep_limit(config, xml, controls))


def find_timestep_limit(config: LabConfig, xml: str, controls: Mapping[str, Wish] | None = None) -> Limit | None:
    """Returns the linear stability limit under these controls, at the equilibrium, within the range of the timestep's
    slider. None if there is no such slider or no equilibrium, if a controller acts, which the linearisation does not
    know, or if small motions grow at the slider's lower end already: then the timestep is not the cause."""
    sliders = [
        control
        for control in config.controls
        if isinstance(control, Slider) and control.set == TIMESTEP and control.min > 0
    ]
    if not sliders or config.controller is not None:
        return None
    slider = sliders[0]
    scene = build_lab_scene(config, xml, controls)
    if not 0 < scene.model.nv <= DEGREES_OF_FREEDOM_MAX:
        return None
    try:
        limit = find_spectral_limit(scene, low_s=slider.min, high_s=slider.max, width_s=LIMIT_WIDTH_S)
    except (ValueError, mujoco.FatalError):
        return None
    return None if limit == slider.min else Limit(slider.label, limit)
