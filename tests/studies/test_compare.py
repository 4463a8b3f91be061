"""A second machine's results are held against the committed ones: ratios, other numbers, and the page's sentences."""

import json
from pathlib import Path
from typing import Any

import pytest

from grader.studies.bench.published.compare import compare, list_ratios, main
from grader.studies.bench.published.measured import load_results

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def theirs() -> Any:
    """The committed skip study on another processor, its ratios of one scene doubled."""
    results = load_results(DOCS / "measured")["skip"]
    results["machine"] |= {"processor": "Another", "cores": 8}
    for saving in results["scenes"]["cube"]["savings"].values():
        saving["ratio"] *= 2
        saving["interval"] = [2 * end for end in saving["interval"]]
    return results


def test_ratios_that_lie_apart_are_counted_and_the_furthest_is_named(theirs: Any) -> None:
    ours = load_results(DOCS / "measured")["skip"]
    every = len(list(list_ratios(ours)))
    head, ratios, others = compare(ours, theirs)
    assert head.endswith("beside Another with 8 cores")
    assert f"  {every} ratios: theirs over ours 1.00 at the median" in ratios
    assert f"{every - 4} of {every} intervals overlap; furthest apart 2.00: scenes, cube, savings" in ratios
    assert others.endswith(" 0 differ")


def test_another_number_is_named(theirs: Any) -> None:
    theirs["scenes"]["two_bodies"]["flags"][5]["largest_difference"] = 1e-3
    *_, others = compare(load_results(DOCS / "measured")["skip"], theirs)
    assert " 1 differ, furthest " in others
    assert others.endswith("beside 0.001: scenes, two_bodies, flags, 5, largest_difference")


def test_rows_are_found_where_a_machine_has_fewer_of_them() -> None:
    ours, theirs = (load_results(DOCS / "measured")["service"] for _ in range(2))
    theirs["loads"] = [row for row in theirs["loads"] if row.get("backend") != "postgresql"]
    _, ratios, _ = compare(ours, theirs)
    assert ratios.startswith(f"  {len(list(list_ratios(theirs)))} ratios: theirs over ours 1.00 at the median")
    assert "1.00 to 1.00 in the middle 80 %" in ratios
    assert "furthest apart 1.00" in ratios


def test_the_command_names_the_sentences_that_the_second_machine_denies(
    theirs: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "skip.json").write_text(json.dumps(theirs))
    with pytest.raises(SystemExit) as end:
        main(DOCS, tmp_path)
    assert str(end.value).startswith("constrained: the page says: skipping saves next to nothing")
    assert capsys.readouterr().out.startswith("skip: ")


def test_a_folder_without_results_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="no results"):
        main(DOCS, tmp_path)
