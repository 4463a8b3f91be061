"""A map of classes on a grid, evaluated only where the class changes: quadtree refinement of the edges."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Classify = Callable[[int, int], int]
Grid = NDArray[np.int8]

UNKNOWN = -1


@dataclass(frozen=True)
class Refined:
    """`classes` (n, n) at every grid point, filled in where not evaluated; `evaluated` (n, n) says which were."""

    classes: Grid
    evaluated: NDArray[np.bool_]

    @property
    def share(self) -> float:
        """The share of the full grid that was evaluated."""
        return float(self.evaluated.mean())


def refined_map(levels: int, coarse: int, classify: Classify) -> Refined:
    """A grid of 2^levels + 1 points a side, from cells of 2^coarse points on: cells are split where corners differ.

    A cell beside a split one is split too, so that an edge which only grazes a cell is followed into it. A region
    that lies wholly between the points of the coarsest grid is missed; compare with the full grid to know.
    """
    size = 2**levels + 1
    found = np.full((size, size), UNKNOWN, dtype=np.int8)

    def at(row: int, column: int) -> int:
        if found[row, column] == UNKNOWN:
            found[row, column] = classify(row, column)
        return int(found[row, column])

    width = 2**coarse
    cells = {(row, column) for row in range(0, size - 1, width) for column in range(0, size - 1, width)}
    fills: list[tuple[int, int, int, int]] = []
    while cells:
        mixed = {cell for cell in cells if len({at(*corner) for corner in corners(cell, width)}) > 1}
        split = {cell for cell in cells if mixed & neighbours(cell, width)}
        fills += [(*cell, width, at(*cell)) for cell in cells - split]
        if width == 1:
            break
        width //= 2
        cells = {(row + i, column + j) for row, column in split for i in (0, width) for j in (0, width)}
    evaluated = found != UNKNOWN
    for row, column, side, kind in fills:
        patch = found[row : row + side + 1, column : column + side + 1]
        patch[patch == UNKNOWN] = kind
    return Refined(found, evaluated)


def corners(cell: tuple[int, int], width: int) -> list[tuple[int, int]]:
    """The four corners of a cell."""
    row, column = cell
    return [(row + i, column + j) for i in (0, width) for j in (0, width)]


def neighbours(cell: tuple[int, int], width: int) -> set[tuple[int, int]]:
    """The cell and the eight of its size around it."""
    row, column = cell
    return {(row + i, column + j) for i in (-width, 0, width) for j in (-width, 0, width)}
