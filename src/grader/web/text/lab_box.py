"""A lab as the page's skeleton: every part of it has its place and its final size before a script runs."""

from math import log
from typing import Any

from grader.domain.lab import IntegratorsLab, Lab, LabConfig, Slider, UnknownLab
from grader.labs import TIMESTEP, choose_length_s
from grader.questions import lab_view
from grader.web.text.prose import cached_prose

HEIGHT, HEIGHT_MIN, HEIGHT_MAX = 264, 160, 480
"""The height of scene and plots together [px], and what an author may ask for."""

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


def describe_lab(lab: Lab | LabConfig) -> dict[str, Any]:
    """Returns the variables of lab.html. Its texts are the author's and not safe; `note` is safe HTML."""
    view = lab_view(lab)
    if isinstance(lab, UnknownLab):
        return {"form": "unknown", **view}
    note = cached_prose(lab.note) if lab.note else ""
    if isinstance(lab, IntegratorsLab):
        return view | {"form": "integrators", "note": note, "height": HEIGHT, "offered": lab.offered}
    return view | {
        "form": "scene",
        "note": note,
        "height": compute_height(lab),
        "is_bare": not (lab.plots or lab.readouts),
        "seconds": choose_length_s(lab),
        "controls": [
            control | describe_slider(one) if isinstance(one, Slider) else control
            for control, one in zip(view["controls"], lab.controls, strict=True)
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
