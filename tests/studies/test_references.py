"""References across constraints, the time until which they can tell, the survey of foreign models, and the page."""

import json
import re
from concurrent.futures import ThreadPoolExecutor
from html.parser import HTMLParser
from pathlib import Path
from typing import Literal

import gymnasium
import numpy as np
import pytest
from playwright.sync_api import Request

from grader.commands.main import main
from grader.numerics.accuracy import reference
from grader.numerics.accuracy.reference import Adaptive, list_sample_times, solve_adaptively
from grader.numerics.integrators import INTEGRATORS, Integrator
from grader.numerics.scene import Scene
from grader.studies.advise.meter import SAMPLE_S, Meter
from grader.studies.advise.page import draw_page
from grader.studies.advise.references import REFERENCE_S, References
from grader.studies.advise.report import RunStart, advise
from grader.studies.advise.survey import main as survey
from numerics.models import hinge
from web.browsing import chromium, findings

pytestmark = pytest.mark.slow

SCREENS: tuple[tuple[int, Literal["light", "dark"]], ...] = ((1280, "light"), (390, "dark"))

FOREIGN = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"

# A point mass above a floor of soft contact: x'' = -g, and with the contact open again the same.
BALL = """<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="5 5 .1"/>
  <body pos="0 0 0.3"><joint type="slide" axis="0 0 1"/><geom size=".1" mass="1"/></body></worldbody></mujoco>"""


def test_adaptive_methods_of_different_order_agree_through_impacts() -> None:
    times = np.asarray(list_sample_times(1.0, SAMPLE_S))
    scene = Scene.from_xml(BALL)
    methods: tuple[tuple[Adaptive, float], ...] = (("RK23", 1e-7), ("RK45", 1e-8), ("DOP853", 1e-9))
    low, high, eighth = (solve_adaptively(scene, times, method, rtol=rtol)[0] for method, rtol in methods)
    assert len(low.time) == len(high.time) == len(eighth.time) == len(times)
    assert np.abs(low.qpos - eighth.qpos).max() < 1e-6
    assert np.abs(high.qpos - eighth.qpos).max() < 1e-6
    # Source: free fall up to the impact after sqrt(2 * 0.2 / 9.81) = 0.202 s.
    falling = times < 0.2
    assert high.qpos[falling, 0] == pytest.approx(-9.81 / 2 * times[falling] ** 2, abs=1e-7)
    assert high.qpos[-1, 0] == pytest.approx(-0.2, abs=0.02)


def test_an_adaptive_method_that_runs_out_of_time_ends_there() -> None:
    times, scene = np.asarray(list_sample_times(1.0, SAMPLE_S)), Scene.from_xml(BALL)
    (late,) = solve_adaptively(scene, times, "RK45", rtol=1e-8, until=0.0)
    assert len(late.time) == 0
    assert Meter(scene, 1.0, None).distances(late, late, times).tolist() == [np.inf] * len(times)


def test_the_survey_holds_choices_against_another_method_and_goes_on(tmp_path: Path) -> None:
    out, models = tmp_path / "advice.json", [FOREIGN / f"{name}.xml" for name in ("hopper", "swimmer")]
    survey(out, models[:1])
    first = json.loads(out.read_text())["models"]
    survey(out, models)
    both = json.loads(out.read_text())["models"]
    assert both["hopper (Gymnasium)"] == first["hopper (Gymnasium)"]
    by = {name: (row["reference"], row["independent"]) for name, row in both.items()}
    assert by == {
        "hopper (Gymnasium)": ("RK45 across constraints", "DOP853"),
        "swimmer (Gymnasium)": ("DOP853", "LSODA"),
    }
    for row in both.values():
        assert row["verdict"] == "choice"
        assert row["independent_error"] <= 1e-3
        assert row["choice"]["error"] == pytest.approx(row["independent_error"], abs=row["doubt"] + 1e-9)
        assert row["independent_doubt"] < 1e-5


def test_adaptive_methods_go_no_further_than_the_one_that_is_stuck(monkeypatch: pytest.MonkeyPatch) -> None:
    """Together they solve what each solves alone, up to where the first of them gets stuck."""
    times, scene = np.asarray(list_sample_times(1.0, SAMPLE_S)), Scene.from_xml(BALL)
    monkeypatch.setattr(reference, "STUCK", 200)
    alone = [solve_adaptively(scene, times, method, rtol=1e-6)[0] for method in ("RK23", "RK45")]
    low, high = solve_adaptively(scene, times, "RK23", "RK45", rtol=1e-6)
    lengths = [len(one.time) for one in alone]
    assert 0 < min(lengths) < max(lengths)
    assert len(low.time) == len(high.time) == min(lengths)
    for one, both in zip(alone, (low, high), strict=True):
        assert one.qpos[: len(both.qpos)].tobytes() == both.qpos.tobytes()
        assert one.qvel[: len(both.qvel)].tobytes() == both.qvel.tobytes()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_beginning_of_a_run_is_the_shorter_run(integrator: Integrator) -> None:
    """Also where the run diverges, before the shorter one ends and after."""
    ends = set[bool | None]()
    settings = [(rate, timestep_s) for rate in (0, 12, 60) for timestep_s in (0.0025, 0.02, 0.007)]
    for rate, timestep_s in settings:
        pushed = f"<actuator><velocity joint='hinge' kv='{-rate}'/></actuator>"
        scene = Scene.from_xml(hinge(rest=pushed if rate else "")).at(qvel=[1.0])
        whole, short = Meter(scene, 1.0, None), Meter(scene, 0.3, None)
        cut = short.cut(whole.run((integrator, timestep_s))).rollout
        run, long = (meter.run((integrator, timestep_s)).rollout for meter in (short, whole))
        ends.add(None if long.diverged_at_step is None else run.diverged_at_step is None)
        assert cut.states.tobytes() == run.states.tobytes()
        assert cut.step.tolist() == run.step.tolist()
        kept = (cut.steps, cut.diverged_at_step, cut.warning, cut.timestep_s, cut.integrator)
        assert kept == (run.steps, run.diverged_at_step, run.warning, run.timestep_s, run.integrator)
    assert ends == {None, False, True}


def test_stepped_runs_end_where_no_halving_that_is_left_can_help() -> None:
    """Source: 0.4 of a tolerance of 1e-3 is accepted, and five halvings of the six timesteps reduce 32 times."""
    times = np.asarray(list_sample_times(0.4, SAMPLE_S))
    with ThreadPoolExecutor(1) as pool:
        search = References(
            Meter(Scene.from_xml(BALL), 0.4, None), 1e-3, frozenset(INTEGRATORS),
            first=[], until=np.inf, evaluation_s=1e-6, progress=lambda _: None, pool=pool,
        )  # fmt: skip
        doubts = np.where(times < 0.25, 1e-3, 0.5)
        assert search.count_hopeful(doubts, times, REFERENCE_S[0]) == np.sum(times < 0.25)
        assert search.count_hopeful(np.full(len(times), 4e-4 * 63.9), times, REFERENCE_S[0]) == len(times)
        assert search.count_hopeful(np.full(len(times), 4e-4 * 64.1), times, REFERENCE_S[0]) == 5  # UNTIL_MIN_S
        assert search.count_hopeful(np.full(len(times), np.inf), times, REFERENCE_S[0]) == len(times)
        whole = search.run_pair(REFERENCE_S[0], times)
        search.pairs.clear()
        part = search.run_pair(REFERENCE_S[0], times[:5])
    assert whole is not None
    assert part is not None
    for long, short in zip(whole, part, strict=True):
        assert short.time[-1] == pytest.approx(0.1, abs=1e-3)
        assert long.states[: len(short.states)].tobytes() == short.states.tobytes()


class Page(HTMLParser):
    """Counts elements, and collects what would be loaded."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.loaded += [value or "" for name, value in attrs if name in ("src", "href", "srcset")]


def test_the_page_has_every_setting_as_a_mark_and_a_row_and_loads_nothing() -> None:
    advice = advise(hinge(), tol=1e-3, seconds=0.2, start=RunStart(qpos=[1.0]))
    text = draw_page(advice, "<arm> & hand")
    page = Page(text)
    assert (page.loaded, page.tags.count("script"), "url(" in text, "@import" in text) == ([], 0, False, False)
    assert "&lt;arm&gt; &amp; hand" in text
    assert "<arm>" not in text
    assert "prefers-color-scheme: dark" in text
    count = len(advice.selection.candidates)
    assert count > 10
    assert text.count("<tr") == count + 1
    assert text.count('<g tabindex="0"><title>') == count
    assert {f">{integrator.name}</text>" in text for integrator in INTEGRATORS} == {True}
    assert f"tolerance {advice.selection.tolerance:.2g}" in text
    assert "uncertainty of the reference" in text
    points = re.search(r'class="front" points="([^"]+)"', text)
    assert points is not None
    assert len(points[1].split()) == len(advice.selection.front)
    drawn = [tuple(map(float, point.split(","))) for point in points[1].split()]
    assert [x for x, _ in drawn] == sorted(x for x, _ in drawn)
    assert [y for _, y in drawn] == sorted(y for _, y in drawn)  # downwards: smaller errors cost more


OVERLAPS = """() => {
  const boxes = [...document.querySelectorAll('svg text')].map(one => [one.textContent, one.getBoundingClientRect()]);
  const before = (a, b) => a.right <= b.left + 3 || a.bottom <= b.top + 3;
  const meets = (a, b) => !before(a, b) && !before(b, a);
  return boxes.filter(([_, a], i) => a.height < 12 || boxes.slice(i + 1).some(([_, b]) => meets(a, b)));
}"""
"""Texts of the diagram that are less than 12 pixels high, or overlap another by more than their halo."""


class Requests:
    """Collects what a page asks for."""

    def __init__(self) -> None:
        self.seen: list[Request] = []

    def add(self, request: Request) -> None:
        self.seen.append(request)


def test_the_page_shows_the_front_in_a_browser_without_a_network(tmp_path: Path) -> None:
    advice = advise(hinge(), tol=1e-3, seconds=0.2, start=RunStart(qpos=[1.0]))
    path = tmp_path / "page.html"
    path.write_text(draw_page(advice, "a_name_without_a_place_to_break_it_at_" * 3), encoding="utf-8")
    with chromium() as browser:
        for width, scheme in SCREENS:
            context = browser.new_context(color_scheme=scheme, offline=True, viewport={"width": width, "height": 800})
            page = context.new_page()
            loaded = Requests()
            page.on("request", loaded.add)
            page.goto(path.as_uri())
            front = page.locator("polyline.front")
            assert front.evaluate("line => line.points.numberOfItems") == len(advice.selection.front)
            assert page.locator("circle.choice").is_visible()
            assert page.evaluate("document.documentElement.scrollWidth") == width
            assert page.evaluate(OVERLAPS) == []
            assert [request.url for request in loaded.seen] == [path.as_uri()]
        assert findings(page) == []


def test_a_page_is_written_where_nothing_can_be_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model, page = tmp_path / "hinge.xml", tmp_path / "page.html"
    model.write_text(hinge())
    options = ["--qpos", "1", "--seconds", "0.2", "--budget", "0", "--page", str(page)]
    monkeypatch.setattr("sys.argv", ["grader", "advise", str(model), *options])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 1
    assert "cannot tell" in page.read_text()
    assert "<svg" not in page.read_text()
