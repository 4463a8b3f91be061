"""The picture of a class on one axis, of every shape: which part of the axis it shows, where dots stand, and that no
text lies on anything, in the browser."""

import math
import random
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st
from playwright.sync_api import Page

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.courses.reporting.class_answers import ClassAnswers, ClassAttempt
from grader.courses.rules.mistakes import name_family
from grader.domain.axes import ClassAxis, Position, place_number
from grader.questions.kinds.text import TextQuestion
from grader.service.accounts import in_database
from grader.web.cohort.answers_page import ClassAt
from grader.web.cohort.axis_plot import draw_class
from grader.web.cohort.axis_range import choose_range
from grader.web.cohort.axis_words import describe_right, name_line, write_position
from web.browsing import LYING_ON_OTHERS, Chromium, service, settings_in

QUESTION = TextQuestion(id="q", kind="open", q="Why?")
NOW = datetime(2026, 1, 5, tzinfo=UTC)
MISTAKES = (
    "You report the bound: it ignores the damper.",
    "The state is not restored between the stages: set it back.",
    "This is explicit Euler.",
    "Your limits are those of a pendulum with the joint's damping in place of the servo's kv: read it.",
    "TypeError: no",
    "The controls do not depend on rate.",
)
AXES = {
    "bracket": ClassAxis("a", "kp = 2", "ms", (19.98, 20.1), True, (("the limit without damping", 22.4),)),
    "number": ClassAxis("a", "The answer", "ms", (4.5, 5.5)),
    "zero": ClassAxis("a", "The answer", "rad", (-0.1, 0.1)),
    "negative": ClassAxis("a", "The answer", "", (-5.2, -4.8)),
    "distance": ClassAxis("a", "pendulum", "", (0, 1e-10), measure="distance", line="tolerance", is_log=True),
    "tolerances": ClassAxis("a", "level", "tolerances", (0, 1), measure="deviation", line="tolerance", is_log=True),
    "at most": ClassAxis("a", "up: settling time", "s", (-inf, 1.2), none="never settled"),
    "at least": ClassAxis("a", "up: return", "", (300, inf), none="did not finish"),
    "goals": ClassAxis("a", "Goals met", "goals", (9, inf), line="all 9", is_whole=True),
    "episodes": ClassAxis("a", "drawn: episodes", "episodes", (18, inf), line="18 of 20 episodes", is_whole=True),
    "no limit": ClassAxis("a", "kp = 2", "ms", None, True),
}  # fmt: skip


def make_answers(positions: list[tuple[Position, Position]], seed: int = 1) -> ClassAnswers:
    """A class of learners, each with a first position and a newest one."""
    chance = random.Random(seed)
    by_learner = {}
    for place, both in enumerate(positions):
        is_right = [chance.random() < 0.3 for _ in both]
        mistakes = [None if right else name_family(chance.choice(MISTAKES)) for right in is_right]
        by_learner[str(place)] = [
            ClassAttempt(
                f"{place}.{number}", str(place), f"Learner {place}", number, NOW, right, mistake, None, {"a": one}
            )
            for number, (one, right, mistake) in enumerate(zip(both, is_right, mistakes, strict=True), 1)
        ]
    return ClassAnswers((AXES["number"],), by_learner)


def draw_positions(axis: ClassAxis, seed: int, count: int = 24) -> list[tuple[Position, Position]]:
    """Positions about the limit, some far off, some of them shared, and some without a number."""
    chance = random.Random(seed)
    limit = axis.limit if axis.limit is not None else 20.0
    shared = [chance.uniform(0.3, 3) for _ in range(3)]

    def draw() -> Position:
        if chance.random() < 0.1 and not axis.is_whole:
            return place_number(None)
        if axis.is_whole:
            return place_number(float(chance.randint(0, int(limit) + (limit > 10) * 2)))
        if axis.is_log:
            return place_number(chance.choice((0.0, limit * 10 ** chance.uniform(-8, 14), limit * 1e9)))
        factor = chance.choice((1.0, chance.uniform(0.5, 2), chance.uniform(-30, 30), *shared))
        return place_number(limit * factor if limit else factor - 1)

    return [(draw(), draw()) for _ in range(count)]


def test_a_page_opens_at_the_axis_on_which_most_are_wrong() -> None:
    axes = (ClassAxis("limits", "", "", (0, 1)), ClassAxis("settling", "", "s", (0, 1)), ClassAxis("open", "", ""))
    placed = {"a": (0.5, 2.0), "b": (0.5, 3.0), "c": (2.0, 0.5), "d": (0.5, 0.5)}
    by_learner = {
        who: [
            ClassAttempt(
                f"{who}1", who, who, 1, NOW, False, None, None,
                {"limits": place_number(value), "settling": place_number(other), "open": place_number(9.0)},
            )
        ]
        for who, (value, other) in placed.items()
    }  # fmt: skip
    at = ClassAt("quiz", QUESTION, ClassAnswers(axes, by_learner), (), "")
    assert [axis.id for axis in (at.choose_axis(""), at.choose_axis("open"), at.choose_axis("no")) if axis] == [
        "settling", "open", "settling",
    ]  # fmt: skip
    assert at.list_wrong(axes[0]) == [place_number(2.0)]


@pytest.fixture(scope="module")
def desk(browser: Chromium, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """An instructor's page, whose styles a picture of a class has."""
    settings = settings_in(tmp_path_factory.mktemp("plots"))
    with service(settings) as origin:
        page = browser.new_context(base_url=origin).new_page()
        code = in_database(settings, lambda session: create_sign_in_code(session, "tina", Role.INSTRUCTOR))
        page.goto(f"/signin?code={code}")
        page.get_by_role("button", name="Sign in").click()
        page.goto("/instructor/statistics")
        yield page


@pytest.mark.browser
@pytest.mark.slow
@pytest.mark.parametrize("shape", AXES)
def test_no_text_of_a_picture_lies_on_anything(desk: Page, shape: str) -> None:
    axis = AXES[shape]
    for seed in range(6):
        plot = draw_class(
            make_answers(draw_positions(axis, seed), seed), axis, address=lambda attempt: f"/{attempt.id}"
        )
        desk.evaluate(
            "main => document.querySelector('main').innerHTML = main",
            f"<figure class='plot-card'>{plot.pictures}</figure>",
        )
        for width, kind in ((1280, ".wide-plot"), (390, ".narrow-plot")):
            desk.set_viewport_size({"width": width, "height": 900})
            picture = desk.locator(kind)
            assert picture.evaluate(LYING_ON_OTHERS) == [], (shape, seed, width)
            assert picture.locator("a").count() == 24
            assert desk.evaluate("document.documentElement.scrollWidth") == width


numbers = st.floats(-1e6, 1e6) | st.floats(1e-300, 1e300)


@given(st.sampled_from(list(AXES.values())), st.lists(numbers, max_size=12))
def test_the_part_that_is_shown_holds_the_limit_and_every_dot_a_pile(axis: ClassAxis, values: list[float]) -> None:
    positions = [place_number(value) for value in values]
    low, high = choose_range(positions, axis)
    assert math.isfinite(low) and math.isfinite(high) and low < high
    assert axis.limit is None or low <= axis.limit <= high
    plot = draw_class(make_answers([(position, position) for position in positions]), axis)
    assert len(re.findall("<circle", plot.pictures)) == 2 * len(values) == 2 * len(plot.table)
    assert "nan" not in plot.pictures and "inf" not in plot.pictures


@given(st.sampled_from([name for name in AXES if name not in ("no limit", "bracket")]), st.lists(numbers, min_size=1))
def test_dots_stand_on_the_side_of_the_limit_where_their_numbers_are(name: str, values: list[float]) -> None:
    axis = AXES[name]
    values = [abs(value) if axis.is_log else value for value in values]
    plot = draw_class(make_answers([(place_number(value), place_number(value)) for value in sorted(values)]), axis)
    wide = plot.pictures.partition("narrow-plot")[0]
    match = re.search(r'class="limit" d="m([\d.]+) ', wide)
    assert match is not None
    right = sum(axis.accepts(place_number(value)) for value in values)
    assert plot.near == right
    if axis.is_at_most or (axis.is_at_least and not axis.is_whole):
        across = sorted(float(x) for x in re.findall(r'cx="([\d.-]+)"', wide))
        before = sum(x < float(match[1]) for x in across)
        assert before == (right if axis.is_at_most else len(values) - right)


def test_without_addresses_nothing_tells_whose_a_dot_is() -> None:
    axis = AXES["distance"]
    plot = draw_class(make_answers(draw_positions(axis, 1)), axis, named_from=100)
    assert not re.search(r"<a |<title|Learner|move|You ", plot.pictures)


def test_the_limit_and_what_is_right_are_said_in_words() -> None:
    assert {name: name_line(axis) for name, axis in AXES.items()} == {
        "bracket": "limit 19.98\u202fms", "number": "right 5\u202fms", "zero": "right 0\u202frad",
        "negative": "right −5", "distance": "tolerance 10⁻¹⁰", "tolerances": "tolerance",
        "at most": "at most 1.2\u202fs",
        "at least": "at least 300", "goals": "all 9", "episodes": "18 of 20 episodes", "no limit": "",
    }  # fmt: skip
    assert describe_right(AXES["tolerances"]) == "one tolerance is allowed"
    assert describe_right(AXES["distance"]) == "the tolerance is 10⁻¹⁰"
    assert describe_right(AXES["at least"]) == "at least 300 is asked for"
    assert describe_right(AXES["goals"]) == "all 9 are asked for"
    assert write_position(place_number(None), AXES["at most"]) == "never settled"
    assert write_position(Position(19, 21), AXES["bracket"]) == "19 to 21\u202fms"
