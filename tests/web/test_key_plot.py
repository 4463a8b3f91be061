"""The picture of a certificate tells the same as its sentence: where the key lies, and where the measurement."""

import string
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.certify import Certificate
from grader.certify.keys import certify_quizzes
from grader.web.verdict.key_plot import draw_key
from support.content import load_content

ROOT = Path(__file__).parents[2]


def certificates(quiz: str) -> dict[str, dict[str, Any]]:
    library = load_content(quiz)
    certified_keys = certify_quizzes(library, [quiz])
    return {
        certified.question.id: certified.certificate.to_json()
        for certified in certified_keys
        if certified.certificate is not None
    }


def test_a_limit_is_drawn_with_its_bracket() -> None:
    certificate = certificates("1.3-check")["q2"]
    figure = draw_key(certificate)
    assert figure is not None
    assert figure.title == "The limit lies within the key's tolerance"
    assert figure.caption == "Stable at 4.995\u202fms, unstable at 5.005\u202fms."
    assert [row[0] for row in figure.table[1:]] == ["Key", "Limit"]
    refuted = draw_key(certificate | {"expected": 6.0})
    assert refuted is not None and refuted.title == "The limit lies outside the key's tolerance"


@pytest.mark.slow
def test_a_measured_number_is_drawn_at_each_timestep() -> None:
    by_place = certificates("3.1-check")
    figure = draw_key(by_place["sag"])
    assert figure is not None
    assert figure.title == "What is measured lies within the key's tolerance"
    assert [row[0] for row in figure.table] == ["Timestep", "h", "h/1.618", "h/2", "h/4", "h, shifted", "h, shifted"]
    assert {row[1] for row in figure.table[1:]} == {"0.120391"}
    assert draw_key(by_place["damper"]) is None  # options have no number


numbers = st.floats(-1e12, 1e12)
units = st.text(string.ascii_letters + string.punctuation + " µ°", max_size=8) | st.just("<script>")


@given(numbers, st.floats(1e-9, 1e6), st.lists(numbers, min_size=2, max_size=9), units)
def test_every_measurement_gives_a_picture_that_can_be_read(
    key: float, tolerance: float, values: list[float], unit: str
) -> None:
    ladder = {f"h/{2**at}": value for at, value in enumerate(values)} | {"nudged": values[:2], "unit": unit}
    bracket = {"stable at": min(values), "unstable at": max(values), "unit": unit}
    for measured in (ladder, bracket):
        certificate = Certificate("refuted", "", "measurement", values[-1], key, measured, tolerance=tolerance)
        figure = draw_key(certificate.to_json())
        assert figure is not None
        picture = ET.fromstring(f"<div>{figure.pictures}</div>")
        assert len(picture) == 2
        if measured is ladder:
            dots = [element for element in picture[0].iter() if element.get("class", "").startswith("dot")]
            assert len(dots) == len(values) + 2
            assert ("within" in figure.title) == (abs(values[-1] - key) <= tolerance)
