"""No figure on a page is typed by hand: every marked block is the rendering of the committed JSON."""

from pathlib import Path

import pytest

from grader.bench.measured import BLOCKS, MARKED, PICTURE, STUDIES, fill, load_results

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "measured"
PAGES = ("README.md", "docs/measured.md")


@pytest.mark.parametrize("page", PAGES)
def test_the_page_is_the_rendering_of_the_results(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert MARKED.search(text), f"{page} has no <!-- measured:begin --> ... <!-- measured:end -->"
    assert fill(text, load_results(RESULTS)) == text, "run: make measured-tables"


def test_the_pages_use_every_block_and_picture() -> None:
    text = "".join((ROOT / page).read_text(encoding="utf-8") for page in PAGES)
    assert {found[1] for found in MARKED.findall(text)} == set(BLOCKS)
    pictures = {path.name: path.stat().st_size for path in RESULTS.glob("*.png")}
    assert set(PICTURE.findall(text)) == set(pictures)
    assert min(pictures.values()) > 10_000


def test_the_results_are_of_whole_runs_and_no_proof_was_broken() -> None:
    results = load_results(RESULTS)
    assert not any(results[name]["quick"] for name in STUDIES)
    assert results["skip"]["broken_proofs"] == []
    assert all(scene["bitwise"] for scene in results["skip"]["scenes"].values())
    assert results["precision"]["profiling_timer"] is True


def test_another_figure_is_noticed() -> None:
    page = "<!-- measured:begin skip -->\nold\n<!-- measured:end skip -->\n"
    filled = fill(page, load_results(RESULTS))
    assert "old" not in filled
    assert fill(filled, load_results(RESULTS)) == filled


def test_the_three_findings_hold_in_the_results() -> None:
    results = load_results(RESULTS)
    scenes, stability = results["precision"]["scenes"], results["stability"]
    for name in ("joint_limits", "cube"):
        assert scenes[name]["cheapest"]["1e-05"] is None
        assert scenes[name]["peers"]["SciPy LSODA, mj_forward"]["1e-07"] is not None
        assert 0.5 < scenes[name]["orders"]["RK4"]["order"] < 1.5
    assert scenes["servo"]["orders"]["RK4"]["order"] == pytest.approx(4, abs=0.1)
    assert scenes["spinning_body"]["orders"]["RK4"]["order"] == pytest.approx(2, abs=0.05)
    kinds = {window["kind"] for window in stability["windows"]["oscillator"]["RK4"]}
    assert kinds == {"slow", "window"}
    assert all(one["shares"]["warned"] == 0 for one in stability["cases"]["box"].values())
    for name in ("double_pendulum", "servo", "spinning_body", "eccentric_body"):
        procedure = scenes[name]["procedure"]
        assert 6 < procedure["quarter"]["cost"] < 17
        assert procedure["four_times"]["cost"] < 1.1
        assert procedure["start"]["error"] > 10 * procedure["four_times"]["error"]
