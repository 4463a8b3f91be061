"""The style sheet's colours keep their promises: contrast on every surface, and integrators that differ in grey."""

import math
import re
from itertools import combinations
from pathlib import Path

import pytest

CSS = (Path(__file__).parents[2] / "src/grader/web/static/style.css").read_text(encoding="utf-8")
SURFACES = ("page", "card", "sunk")
VERDICTS = ("ok", "no", "part", "wait")
INTEGRATORS = ("euler", "rk4", "implicit", "implicitfast", "discrete")


def tokens(scheme: str) -> dict[str, str]:
    """The colours of a scheme by name."""
    light, dark = re.findall(r":root \{(.*?)\}", CSS, re.DOTALL)[:2]
    return dict(re.findall(r"--([\w-]+): (#[0-9a-f]+)", light if scheme == "light" else dark))


def luminance(colour: str) -> float:
    """Relative luminance. Source: WCAG 2.2."""
    digits = colour[1:] if len(colour) == 7 else "".join(2 * one for one in colour[1:])
    parts = [int(digits[at : at + 2], 16) / 255 for at in (0, 2, 4)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def lightness(colour: str) -> float:
    """CIE L*."""
    return 116 * math.cbrt(luminance(colour)) - 16


@pytest.fixture(params=["light", "dark"])
def colours(request: pytest.FixtureRequest) -> dict[str, str]:
    return tokens(request.param)


def test_text_is_readable_on_every_surface(colours: dict[str, str]) -> None:
    for ink in ("ink", "soft"):
        assert min(contrast(colours[ink], colours[surface]) for surface in SURFACES) >= 4.5
    for verdict in VERDICTS:
        assert min(contrast(colours[verdict], colours[on]) for on in (*SURFACES, f"{verdict}-bg")) >= 4.5


def test_borders_of_fields_and_lines_of_plots_are_seen(colours: dict[str, str]) -> None:
    assert min(contrast(colours["edge"], colours[on]) for on in ("page", "card")) >= 3
    assert min(contrast(colours[name], colours["card"]) for name in INTEGRATORS) >= 3


def test_integrators_differ_in_grey(colours: dict[str, str]) -> None:
    greys = [lightness(colours[name]) for name in INTEGRATORS]
    assert min(abs(value - other) for value, other in combinations(greys, 2)) >= 5


def test_each_integrator_has_dashes_of_its_own() -> None:
    dashes = re.findall(r"\.(\w+) \{ --c: var\(--\w+\); --dash: ([^;]+);", CSS)
    assert {name.lower() for name, _ in dashes} == {*INTEGRATORS}
    assert len({dash for _, dash in dashes}) == len(INTEGRATORS)
