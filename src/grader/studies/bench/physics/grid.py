"""Maps of classes over two logarithmic axes: stored as digits, refined where the class changes, drawn as cells."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from numpy.typing import NDArray

Grid = NDArray[np.int8]

UNKNOWN = -1


def to_rows(grid: Iterable[Iterable[Any]]) -> list[str]:
    """Returns one string of digits a row: compact in JSON, readable in a pager."""
    return ["".join(str(int(cell)) for cell in row) for row in grid]


def to_grid(rows: list[str]) -> Grid:
    """Rows of digits as an array again."""
    return np.array([[int(digit) for digit in row] for row in rows], dtype=np.int8)


@dataclass(frozen=True, kw_only=True)
class Plane:
    """A parameter of a scene and the timestep [s], both on logarithmic axes."""

    scene: str
    parameter: str
    span: tuple[float, float]
    timestep_span_s: tuple[float, float]

    def ticks(self, size: int) -> tuple[list[float], list[float]]:
        """Returns the timesteps [s] and the parameter's values of a size x size grid, ascending."""
        return np.geomspace(*self.timestep_span_s, size).tolist(), np.geomspace(*self.span, size).tolist()

    def draw(self, axes: Any, grid: Grid, colours: Iterable[str], scale: float = 1e3) -> None:
        """Draw the classes, numbered as the colours, as cells; timesteps are multiplied by `scale`."""
        listed = list(colours)
        y, x = (compute_borders(values) for values in self.ticks(len(grid)))
        y *= scale
        norm = BoundaryNorm(range(len(listed) + 1), len(listed))
        axes.pcolormesh(x, y, grid, cmap=ListedColormap(listed), norm=norm, rasterized=True)
        axes.set(xscale="log", yscale="log", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), xlabel=self.parameter)
        axes.grid(visible=False)


def compute_borders(values: list[float]) -> NDArray[np.float64]:
    """Cell borders around logarithmically spaced values, one more than there are values."""
    ratio = np.sqrt(values[1] / values[0])
    return np.append(np.array(values) / ratio, values[-1] * ratio)


def refine_map(levels: int, coarse: int, classify: Callable[[int, int], int]) -> tuple[Grid, Grid]:
    """A grid of 2^levels + 1 points a side, from cells of 2^coarse points on: cells are split where corners differ.

    A cell beside a split one is split too, so that an edge which only grazes a cell is followed into it. A region
    that lies wholly between the points of the coarsest grid is missed; compare with the full grid to know. Returns the
    classes at every point, filled in where not evaluated, and 1 where evaluated, both (2^levels + 1, 2^levels + 1).
    """
    size = 2**levels + 1
    classes = np.full((size, size), UNKNOWN, dtype=np.int8)

    def at(row: int, column: int) -> int:
        if classes[row, column] == UNKNOWN:
            classes[row, column] = classify(row, column)
        return int(classes[row, column])

    width = 2**coarse
    cells = {(row, column) for row in range(0, size - 1, width) for column in range(0, size - 1, width)}
    fills: list[tuple[int, int, int, int]] = []
    while cells:
        mixed = {cell for cell in cells if len({at(*point) for point in list_around(cell, 0, width)}) > 1}
        split = {cell for cell in cells if not mixed.isdisjoint(list_around(cell, -width, 0, width))}
        fills += [(*cell, width, at(*cell)) for cell in cells - split]
        if width == 1:
            break
        width //= 2
        cells = {part for cell in split for part in list_around(cell, 0, width)}
    evaluated = (classes != UNKNOWN).astype(np.int8)
    for row, column, side, kind in fills:
        patch = classes[row : row + side + 1, column : column + side + 1]
        patch[patch == UNKNOWN] = kind
    return classes, evaluated


def list_around(cell: tuple[int, int], *offsets: int) -> Iterator[tuple[int, int]]:
    """Yields the points at these offsets from a cell's first corner, in both directions."""
    return product((cell[0] + offset for offset in offsets), (cell[1] + offset for offset in offsets))
