"""The refined map is the full map, for a fraction of the points."""

import numpy as np
import pytest

from grader.studies.bench.physics.grid import refine_map


def line(row: int, column: int) -> int:
    """Three regions with straight and curved edges."""
    return int(row + column > 70) + int((row - 90) ** 2 + (column - 60) ** 2 < 900)


def test_it_agrees_with_the_full_grid_and_costs_a_fraction() -> None:
    calls: list[tuple[int, int]] = []

    def classify(row: int, column: int) -> int:
        calls.append((row, column))
        return line(row, column)

    classes, evaluated = refine_map(levels=7, coarse=4, classify=classify)
    full = np.array([[line(row, column) for column in range(129)] for row in range(129)])
    assert (classes == full).all()
    assert len(calls) == len(set(calls)) == evaluated.sum()
    assert evaluated.mean() < 0.35


def test_one_class_costs_the_coarse_grid_alone() -> None:
    classes, evaluated = refine_map(levels=6, coarse=3, classify=lambda _row, _column: 2)
    assert (classes == 2).all()
    assert evaluated.sum() == 9 * 9


@pytest.mark.parametrize(("place", "found"), [((8, 8), True), ((11, 11), False)])
def test_a_single_point_is_seen_only_on_the_coarse_grid(place: tuple[int, int], found: bool) -> None:
    classes, _ = refine_map(levels=5, coarse=3, classify=lambda row, column: int((row, column) == place))
    assert bool((classes == 1).any()) is found
    assert not found or classes[place] == 1
