"""The limit at the slider of the timestep against closed forms, and the close-up of a short event."""

import json
from itertools import pairwise
from math import inf, sqrt
from pathlib import Path
from typing import Any

import pytest

from grader.domain.lab import LabConfig
from grader.labs import find_timestep_limit, run_lab, watch_lab
from labs.made_up import HINGE

ROOT = Path(__file__).parents[2]
XML = (ROOT / "models/pendulum_servo.xml").read_text()
INERTIA, WEIGHT = 0.2501, 9.81 * 0.5
"""Of the pendulum about its hinge [kg m2], and what gravity adds to the stiffness as it hangs [N m/rad]."""


def config(**changes: Any) -> LabConfig:
    """The lesson's lab of the servo."""
    labs = json.loads((ROOT / "quizzes/1.3-labs.json").read_text())["labs"]
    lab = {key: value for key, value in labs[1].items() if key not in ("id", "kind")}
    return LabConfig.model_validate_json(json.dumps(lab | changes), strict=True)


def closed_form(integrator: str, kp: float, kv: float) -> float:
    """The limit [s] of I q'' = -K q - c q': explicit in both, implicit in the damper, implicit in both."""
    stiffness = kp + WEIGHT
    root = sqrt(kv**2 + 4 * INERTIA * stiffness)
    return {
        "Euler": 4 * INERTIA / (root + kv),
        "implicitfast": (root + kv) / stiffness,
        "discrete": inf,
    }[integrator]


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "discrete"])
@pytest.mark.parametrize(("kp", "kv"), [(8080, 5), (20_000, 0), (3000, 40)])
def test_the_limit_is_that_of_the_closed_form(integrator: str, kp: float, kv: float) -> None:
    limit = find_timestep_limit(config(), XML, {"stiffness kp": kp, "damping kv": kv, "integrator": integrator})
    expected = closed_form(integrator, kp, kv)
    assert limit is not None
    assert limit.control == "timestep h"
    if expected > 0.02:  # the slider's end
        assert limit.timestep_s is None
    else:
        assert limit.timestep_s == pytest.approx(expected, abs=2e-6)  # the width of the search


def test_without_a_slider_or_with_a_controller_there_is_no_limit() -> None:
    assert find_timestep_limit(config(controls=[]), XML) is None
    assert find_timestep_limit(config(controller="data.ctrl[0] = 0"), XML) is None
    assert (
        find_timestep_limit(config(plots=[], readouts=[], setup=""), HINGE.replace("damping", "stiffness='-9' damping"))
        is None
    )


def test_an_early_warning_is_seen_in_close_up() -> None:
    diverging: dict[str, float | str | bool]
    diverging = {"stiffness kp": 40_000, "timestep h": 0.008, "integrator": "implicitfast"}
    plain, watched = run_lab(config(), XML, diverging), watch_lab(config(), XML, diverging)
    (event, *_), end = watched.warnings, 2.2 * plain.warnings[0].time_s
    assert event == plain.warnings[0]
    assert event.time_s < 0.5
    close = [time for time in watched.times if time <= end]
    assert max(b - a for a, b in pairwise(close)) == pytest.approx(0.008)  # every step
    assert watched.times[-1] == pytest.approx(plain.times[-1])
    assert watched.rows[-1] == plain.rows[-1]
    assert len(watched.times) > len(plain.times)


def test_a_calm_run_is_the_ordinary_one() -> None:
    assert watch_lab(config(), XML).times == run_lab(config(), XML).times
