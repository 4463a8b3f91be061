"""The skeleton of a lab: its size is known before anything runs, and it holds nothing that a learner may not see."""

import json
from typing import Any

import pytest

from grader.domain.lab import LabConfig, SimLab, UnknownLab
from grader.labs.kinds.integrators.lab import IntegratorsLab
from grader.web.text.lab_box import describe_lab

SECRET = "data.qpos[0] * 4711"


def box(**keys: Any) -> dict[str, Any]:
    return describe_lab(LabConfig.model_validate({"model": "cart", **keys}))


def plot(**keys: Any) -> dict[str, Any]:
    return {"traces": [{"label": "x", "expr": SECRET}], **keys}


@pytest.mark.parametrize(
    ("keys", "height"),
    [
        ({"readouts": [{"label": "x", "expr": SECRET}]}, 240),
        ({"plots": [plot()]}, 240),
        ({"plots": [plot(), plot()]}, 290),
        ({"plots": [plot(height=300)], "height": 200}, 326),
        ({"plots": [plot(height=1)]}, 160),
        ({"height": 400}, 400),
        ({"height": 5000}, 480),
    ],
)
def test_the_height_is_that_of_the_plots_or_of_a_higher_scene(keys: dict[str, Any], height: int) -> None:
    assert box(**keys)["height"] == height


@pytest.mark.parametrize(
    ("low", "high", "value", "position"), [(0, 10, 2.5, 0.25), (1, 99, 50, 0.5), (1, 100, 10, 0.5), (10, 40_000, 10, 0)]
)
def test_a_slider_over_two_decades_is_logarithmic(low: float, high: float, value: float, position: float) -> None:
    slider = {"label": "k", "min": low, "max": high, "value": value, "set": "model.opt.timestep"}
    (drawn,) = box(controls=[slider, {"type": "button", "label": "go", "run": SECRET}])["controls"][:1]
    assert drawn["position"] == pytest.approx(position)
    assert drawn["has_limit"]


def test_nothing_of_an_expression_is_in_the_skeleton() -> None:
    shown = box(
        setup=SECRET, controller=SECRET, stopAt=SECRET, plots=[plot()], readouts=[{"label": "x", "expr": SECRET}],
        controls=[{"label": "k", "min": 0, "max": 1, "value": 0, "apply": SECRET}], toggles=["cameras", "nothing"],
    )  # fmt: skip
    assert "4711" not in json.dumps(shown)
    assert list(shown["toggles"]) == ["cameras"]


def test_each_kind_of_lab_has_its_form() -> None:
    unknown = UnknownLab.model_validate({"id": "x", "kind": "policies", "note": SECRET})
    five = IntegratorsLab.model_validate({"id": "y", "kind": "integrators", "models": [("a", "A model"), "b"]})
    assert describe_lab(SimLab(id="z", model="cart"))["template"] == "labs/simlab.html"
    assert describe_lab(unknown) == {"form": "unknown", "id": "x", "kind": "policies", "title": None}
    assert describe_lab(five)["offered"] == {"a": "A model", "b": "b"}
