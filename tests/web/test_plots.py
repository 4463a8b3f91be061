"""Plots say in words what they show, survive any evidence, and hold no text that could run."""

import json
import re
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.courses.rules.policy import FEEDBACK_EVIDENCE
from grader.web.verdict.card import list_tables
from grader.web.verdict.line_plots import INTEGRATORS, draw_end
from grader.web.verdict.plots import draw_figures, draw_file, extract_light_styles, list_sketches
from grader.web.verdict.svg import Axis, Drawing, estimate_width, format_path, list_decades, list_round_steps, trim
from web.evidence import threshold_verdict

NAMES = ("angles", "claims", "limits", "differences", "order", "charts", "tables", "values", "tableau", "stability")
TEXT_HEIGHT = 10.0
"""Of the capitals of a label, which is 13 units high."""

coordinates = st.floats(-3000, 3000)
HOSTILE = "</text><script>alert(1)</script>\"'&"

json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)


def titles_of(verdict: dict[str, Any]) -> dict[str, str]:
    return {finding["id"]: finding["title"] for finding in verdict["findings"]}


def figures(kind: str, only: tuple[str, ...] = NAMES) -> list[Any]:
    verdict = threshold_verdict(kind)
    evidence = {name: value for name, value in verdict["evidence"].items() if name in only}
    return draw_figures(evidence, titles_of(verdict))


@pytest.mark.slow
def test_the_stability_map_comes_first_and_names_the_mistake() -> None:
    stability, motion = figures("spring")
    assert stability.title == "Your limit is the spring's alone: the damper is missing"
    assert "limit 19.98\u202fms" in stability.pictures
    assert "tinted is stable for ever" in stability.caption
    assert "A run of 3\u202fs may still look stable a little above its limit" in stability.caption
    assert "2/ω = 22.34\u202fms: the spring alone" in stability.pictures
    assert stability.table[1] == (
        "Euler", "22.05 to 22.44\u202fms", "unstable", "unstable", "19.98\u202fms", "20.12\u202fms"
    )  # fmt: skip
    assert motion.table[1][3].startswith("warning at 0.4")
    assert motion.table[3][3].startswith("settles by")


def test_before_the_solution_the_map_holds_no_limit() -> None:
    stability, _ = figures("spring", FEEDBACK_EVIDENCE)
    text = json.dumps([stability.title, stability.caption, str(stability.pictures), stability.table])
    assert "19.98" not in text
    assert "22.34" not in text
    assert "Look at Euler, implicitfast and discrete: " in stability.title


def test_the_label_of_a_limit_keeps_clear_of_the_bound() -> None:
    [stability, *_] = figures("spring")
    wide, narrow = stability.pictures.split("<svg")[1:]
    for picture in (wide, narrow):
        limit, anchor = re.findall(r'x="([\d.]+)" y="[\d.]+"( text-anchor="end")?>(?:limit )?19.98', picture)[0]
        bound = re.findall(r'"reference" d="m([\d.]+)', picture)[0]
        assert float(limit) < float(bound)
        assert anchor


@pytest.mark.slow
def test_a_right_claim_is_magnified() -> None:
    stability, _ = figures("right")
    assert stability.title == "Each of your brackets agrees with its limit"
    assert "Euler, magnified" in stability.pictures
    assert "within 3\u202fs 20.12\u202fms" in stability.pictures
    assert "magnified" not in figures("spring")[0].pictures


ORDER = {"timestep_ms": [4, 2, 1], "error": [2.56e-4, 6.4e-5, 1.6e-5], "slope": 2.0, "expected_slope": 4}
DIFFERENCES = {"case": "a", "tolerance": 1e-10, "time_s": [0.1, 0.2], "qpos": [0.0, 1e-12], "qvel": [1e-13, None]}
CHART = {"case": "a", "title": "energy", "x": {"label": "t"}, "y": {}, "series": [{"label": "", "x": [1], "y": [2]}]}


def test_the_order_is_told_by_what_halving_does() -> None:
    [wrong] = draw_figures({"order": ORDER}, {})
    assert wrong.title == "Halve the timestep and your error falls by a factor of 4; it should be 16"
    assert "yours: order 2.00" in wrong.pictures
    [right] = draw_figures({"order": ORDER | {"slope": 4.01, "error": [2.56e-6, 1.6e-7, 1e-8]}}, {})
    assert right.title == "Halve the timestep and your error falls by a factor of 16, as it should"


@pytest.mark.parametrize("width", [308.0, 734.0])
@pytest.mark.parametrize("slope", [1.0, 2.0, 3.0])
def test_the_name_of_a_line_does_not_lie_on_the_line(width: float, slope: float) -> None:
    rising = [(x, 200 - slope * (x - 50) / 4) for x in (50.0, (50 + width) / 2, width - 20)]
    picture = Drawing(width, 300)
    draw_end(picture, rising, "yours: order 2.01", is_below=True)
    [(end, baseline)] = re.findall(r'x="([\d.]+)" y="([-\d.]+)"', picture.parts[0])
    left = float(end) - estimate_width("yours: order 2.01")
    assert float(baseline) - TEXT_HEIGHT > 200 - slope * (left - 50) / 4


def test_only_integrators_have_the_colours_of_integrators() -> None:
    [figure] = draw_figures({"differences": [DIFFERENCES]}, {"a": "The arm"})
    assert "line solid" in figure.pictures and "line dashed" in figure.pictures
    assert not any(f"line {name}" in figure.pictures for name in INTEGRATORS)


@given(st.lists(st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=9), min_size=1, max_size=3))
def test_a_path_leads_through_its_points_and_rounding_does_not_add_up(lines: list[list[tuple[float, float]]]) -> None:
    at, reached = [0.0, 0.0], []
    for numbers in re.findall(r"[ml]([-\d. ]+)", format_path(lines)):
        values = [float(one) for one in re.findall(r"-?[\d.]+", numbers)]
        for distance in zip(values[::2], values[1::2], strict=True):
            at = [sum(pair) for pair in zip(at, distance, strict=True)]
            reached.append(at)
    points = [point for line in lines for point in line]
    assert np.asarray(reached) == pytest.approx(np.asarray(points), abs=0.0501)


def test_differences_have_a_band_in_which_they_count_as_right() -> None:
    [figure] = draw_figures({"differences": [DIFFERENCES]}, {"a": "The arm"})
    assert "Round-off" in figure.title
    assert "counts as right: up to 10⁻¹⁰" in figure.pictures
    assert draw_figures({"differences": [DIFFERENCES | {"qpos": [0, 0], "qvel": [0, 0]}]}, {}) == []


def test_charts_of_any_kind_of_exercise_are_drawn() -> None:
    [figure] = draw_figures({"charts": [CHART]}, {"a": "The arm"})
    assert figure.title == "The arm: energy"


def test_text_of_a_script_or_an_author_is_text() -> None:
    hostile = CHART | {"title": HOSTILE, "series": [{"label": HOSTILE, "x": [1, 2], "y": [2, 3]}]}
    [figure] = draw_figures({"charts": [hostile]}, {"a": HOSTILE})
    assert "<script" not in figure.pictures
    for picture in str(figure.pictures).split("</svg><svg"):
        assert "alert(1)" in picture
    for sketch in list_sketches({"charts": [hostile]}, {"a": HOSTILE}):
        ET.fromstring(draw_file(sketch, ""))


@pytest.mark.parametrize("kind", ["spring", "right"])
def test_a_plot_as_a_file_is_whole_and_brings_its_colours(kind: str) -> None:
    verdict = threshold_verdict(kind)
    css = ":root {\n  --ink: #111;\n}\n.Euler { --c: red; }\n.plot .line { fill: none; }\n.card { color: red; }\n"
    for sketch in list_sketches(verdict["evidence"], titles_of(verdict)):
        tree = ET.fromstring(draw_file(sketch, extract_light_styles(css)))
        assert tree.tag == "{http://www.w3.org/2000/svg}svg"
        style = tree.find("{http://www.w3.org/2000/svg}style")
        assert style is not None
        assert style.text is not None
        assert "--ink" in style.text
        assert ".plot .line" in style.text
        assert ".card" not in style.text


@settings(max_examples=200)
@given(evidence=st.dictionaries(st.sampled_from(NAMES), json_values, max_size=3))
def test_evidence_of_any_shape_is_drawn_or_left_out(evidence: dict[str, Any]) -> None:
    draw_figures(evidence, {})


numbers = st.floats(allow_nan=False, allow_infinity=False)
values = st.lists(st.none() | numbers, min_size=2, max_size=6)


@settings(max_examples=150)
@given(x=values, y=values, log=st.booleans(), marks=st.lists(numbers, max_size=2))
def test_any_numbers_give_a_picture(
    x: list[float | None], y: list[float | None], log: bool, marks: list[float]
) -> None:
    chart = {"case": "a", "x": {"log": log}, "y": {"log": log}, "series": [{"x": x, "y": y}]}
    chart |= {"marks": [] if log else [{"x": mark} for mark in marks]}
    for figure in draw_figures({"charts": [chart]}, {}):
        for forbidden in ("nan", "inf"):
            assert forbidden not in str(figure.pictures).split("aria-label")[0]
        ET.fromstring(f"<a>{figure.pictures}</a>")


@given(low=st.floats(-1e9, 1e9), size=st.floats(1e-6, 1e9), about=st.integers(2, 8))
def test_ticks_are_round_few_and_on_the_axis(low: float, size: float, about: int) -> None:
    ticks = list_round_steps(low, low + size, about)
    assert len(ticks) <= 2 * about + 2
    assert all(
        low - 1e-6 * abs(low) - size * 1e-6 <= tick <= low + size * (1 + 1e-6) + 1e-6 * abs(low) for tick in ticks
    )


def test_ticks_of_a_log_axis_are_powers_of_ten() -> None:
    assert list_decades(1e-5, 1e-1, 5) == pytest.approx([1e-5, 1e-4, 1e-3, 1e-2, 1e-1])
    assert Axis(1e-5, 1, 0, 100, log=True).label(1e-3) == "10⁻³"
    assert [trim(value) for value in (-0.01, 1.0, 2.25)] == ["0", "1", "2.2"]


def test_a_table_of_evidence_is_shown_with_its_case_and_a_crooked_one_is_left_out() -> None:
    table = {"case": "a", "title": "Claims", "head": ["Claim", "Yours"], "rows": [["period", HOSTILE]]}
    crooked = {**table, "rows": [["period"]]}
    (shown,) = list_tables({"tables": [table]}, {"a.period": "from 2 rad: period"})
    assert (shown.title, shown.rows) == ("Claims: from 2 rad", [["period", HOSTILE]])
    assert list(list_tables({"tables": [crooked]}, {})) == []
    assert list(list_tables({"tables": [{**table, "rows": []}]}, {})) == []
