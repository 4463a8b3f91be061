"""What the page has of a lab before it runs: every part in its place and final size, and nothing of an expression."""

from math import log
from typing import Any

from pydantic import BaseModel

from grader.domain.lab import LabConfig, Slider
from grader.labs.lengths import choose_length_s
from grader.labs.watching import TIMESTEP

HEIGHT_MIN, HEIGHT_MAX = 160, 480
"""The height of scene and plots together [px] that an author may ask for."""

STRIP, SHARED_STRIP, STRIP_MIN = 214, 132, 90
"""The height of one plot alone, and of one among several [px]."""

AXIS = 26
"""The height of the time axis under the plots [px]."""

LOG_RATIO = 100.0
"""From this ratio of its ends on a slider is logarithmic."""

TOGGLES = {
    "contacts": "contacts",
    "forces": "contact forces",
    "frames": "body frames",
    "joints": "joint axes",
    "com": "centres of mass",
    "sites": "sites",
    "cameras": "cameras",
    "shadows": "shadows",
}
"""What a learner may draw over the scene."""

LAB = ("camera", "height", "autoplay", "overlays", "toggles", "forceScale")
CONTROL = ("type", "label", "unit", "min", "max", "step", "value", "digits", "options", "reset")
READOUT = ("label", "digits", "unit")
TRACE = ("label", "dash", "color")
PLOT = ("xlabel", "ylabel", "height", "window", "ymin", "ymax")


def build_view(lab: LabConfig) -> dict[str, Any]:
    """Returns the controls of a lab and the labels of its readouts and traces, without expressions or MJCF."""
    return _pick(lab, LAB) | {
        "controls": [_pick(control, CONTROL) for control in lab.controls],
        "readouts": [_pick(readout, READOUT) for readout in lab.readouts],
        "plots": [_pick(plot, PLOT) | {"traces": [_pick(trace, TRACE) for trace in plot.traces]} for plot in lab.plots],
    }


def _pick(part: BaseModel, names: tuple[str, ...]) -> dict[str, Any]:
    """The fields of the part with these names, as plain JSON."""
    return part.model_dump(mode="json", include=set(names))


def build_skeleton(lab: LabConfig) -> dict[str, Any]:
    """Returns what the template needs beside the view. Its texts are the author's and not safe."""
    return {
        "height": compute_height(lab),
        "is_bare": not (lab.plots or lab.readouts),
        "seconds": choose_length_s(lab),
        "controls": [
            _pick(control, CONTROL) | (describe_slider(control) if isinstance(control, Slider) else {})
            for control in lab.controls
        ],
        "toggles": {name: text for name, text in TOGGLES.items() if name in (lab.toggles or ())},
        "shown": list(list_shown_overlays(lab)),
    }


def compute_height(lab: LabConfig) -> int:
    """Returns the height of the stage [px]: what its plots need, or more where the author's scene is higher."""
    strip = STRIP if len(lab.plots) < 2 else SHARED_STRIP
    strips = sum(max(STRIP_MIN, min(plot.height or strip, HEIGHT_MAX)) for plot in lab.plots) if lab.plots else strip
    return round(max(strips + AXIS, min(lab.height or HEIGHT_MIN, HEIGHT_MAX)))


def list_shown_overlays(lab: LabConfig) -> tuple[str, ...]:
    """Returns the overlays that are on when the lab opens."""
    if isinstance(lab.overlays, dict):
        return tuple(name for name, on in lab.overlays.items() if on)
    return tuple(lab.overlays or ())


def describe_slider(slider: Slider) -> dict[str, Any]:
    """Where a slider stands between its ends, from 0 to 1, and whether the stability limit has its place under it."""
    low, high, value = slider.min, slider.max, slider.value
    if low > 0 and high / low >= LOG_RATIO:
        low, high, value = log(low), log(high), log(value)
    return {"position": round((value - low) / (high - low), 6), "has_limit": slider.set == TIMESTEP}
