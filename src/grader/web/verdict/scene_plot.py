"""A model as its geoms, seen by a fixed camera; the author's beside it, where that may be shown. All geoms but meshes,
of which the bounding box is drawn, are convex: the outline of one is the hull of its points."""

from collections.abc import Iterator, Sequence
from math import cos, pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from grader.web.verdict.evidence import Geom, Model
from grader.web.verdict.svg import Drawing, Point, Sketch

AZIMUTH, ELEVATION = radians(20), radians(15)
"""The camera looks along y, turned by 20 degrees and from 15 above: planar mechanisms turn about y."""

PANEL, TITLE, GAP, MARGIN = 240.0, 24.0, 24.0, 10.0
NARROW = 480.0
AROUND = 24
"""Points of a circle."""

SIZE_MIN, SIZE_MAX = 1e-4, 1e4
"""Extents of a scene that are drawn to scale [m]."""

RIGHT = np.array([cos(AZIMUTH), sin(AZIMUTH), 0.0])
FORWARD = np.array([-sin(AZIMUTH) * cos(ELEVATION), cos(AZIMUTH) * cos(ELEVATION), -sin(ELEVATION)])
UP = np.cross(RIGHT, FORWARD)

Floats = NDArray[np.float64]
Outline = list[Point]


def plot_models(mine: Model, reference: Model | None, title: str, index: int) -> Sketch:
    """Plots the student's model in a case, and the author's if it may be shown."""
    panels = [("your model", list(draw_outlines(mine.geoms)))]
    if reference is not None:
        panels.append(("asked for", list(draw_outlines(reference.geoms))))
    caption = "Where the case begins, seen along y and from above. Planes are left out; a mesh is its bounding box."
    head = ("Model", "Geom", "Type", "Size (m)", "Position (m)")
    shown = [("your model", mine), *([] if reference is None else [("asked for", reference)])]
    rows = tuple(
        (name, str(at), geom.type, write_numbers(geom.size), write_numbers(geom.at))
        for name, model in shown for at, geom in enumerate(model.geoms)
    )  # fmt: skip
    heading = f"{title}: the model" if reference is None else f"{title}: both models"
    return Sketch(f"model-{index}", heading, caption, (head, *rows), lambda width: draw(panels, width))


def write_numbers(numbers: Sequence[float]) -> str:
    """Returns numbers as a table shows them."""
    return " ".join(f"{number:.3g}" for number in numbers)


def draw(panels: Sequence[tuple[str, Sequence[Outline]]], width: float) -> Drawing:
    """Draws the panels side by side, or one below the other on a narrow page, all to one scale."""
    across = 1 if width < NARROW else 2
    down = -(-len(panels) // across)
    panel_width = (width - GAP * (across - 1)) / across
    picture = Drawing(width, down * (TITLE + PANEL))
    points = [point for _, outlines in panels for outline in outlines for point in outline] or [(0.0, 0.0)]
    lows, highs = ([end(point[axis] for point in points) for axis in (0, 1)] for end in (min, max))
    spans = [min(max(high - low, SIZE_MIN), SIZE_MAX) for low, high in zip(lows, highs, strict=True)]
    scale = min((panel_width - 2 * MARGIN) / spans[0], (PANEL - 2 * MARGIN) / spans[1])
    for index, (name, outlines) in enumerate(panels):
        left, top = (index % across) * (panel_width + GAP), (index // across) * (TITLE + PANEL)
        picture.text(name, left, top + 14, "name")
        centre = (left + panel_width / 2, top + TITLE + PANEL / 2)
        inner = Drawing(picture.width, picture.height)
        for outline in outlines:
            placed = [
                (centre[0] + scale * (x - (lows[0] + highs[0]) / 2), centre[1] - scale * (y - (lows[1] + highs[1]) / 2))
                for x, y in outline
            ]
            inner.path("geom", [*placed, placed[0]])
        picture.clipped(left, top + TITLE, panel_width, PANEL, inner)
    return picture


def draw_outlines(geoms: Sequence[Geom]) -> Iterator[Outline]:
    """Yields the outline of each geom in the camera's plane [m], those that are further away first."""
    shown = [geom for geom in geoms if geom.type != "plane" and max(map(abs, (*geom.at, *geom.size))) <= SIZE_MAX]
    for geom in sorted(shown, key=lambda shape: -float(FORWARD @ np.array(shape.at))):
        points = list_points(geom)
        yield find_hull([(float(x), float(y)) for x, y in zip(points @ RIGHT, points @ UP, strict=True)])


def list_points(geom: Geom) -> Floats:
    """Returns points (n, 3) of the surface of a geom, of which the hull is its outline."""
    x, y, z = geom.size
    turned, at = np.array(geom.turned).reshape(3, 3), np.array(geom.at)
    angles = np.linspace(0, 2 * pi, AROUND, endpoint=False)
    disc = np.outer(np.cos(angles), RIGHT) + np.outer(np.sin(angles), UP)
    ends = np.outer((-1, 1), turned[:, 2] * y)
    if geom.type == "sphere":
        return np.asarray(at + x * disc)
    if geom.type == "capsule":
        return np.asarray(at + np.concatenate([end + x * disc for end in ends]))
    if geom.type == "cylinder":
        ring = x * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) @ turned.T
        return np.asarray(at + np.concatenate([end + ring for end in ends]))
    if geom.type == "ellipsoid":
        local = disc @ turned * (x, y, z)  # the directions of the plane, stretched twice: the outline of an ellipsoid
        lengths = np.linalg.norm(local, axis=1, keepdims=True)
        return np.asarray(at + (local * (x, y, z) / np.maximum(lengths, 1e-12)) @ turned.T)
    corners = np.array([[i, j, k] for i in (-x, x) for j in (-y, y) for k in (-z, z)])
    return np.asarray(at + corners @ turned.T)


def find_hull(points: Outline) -> Outline:
    """Returns the convex hull of points. Source: Andrew's monotone chain."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered

    def chain(some: Sequence[Point]) -> Outline:
        hull: Outline = []
        for point in some:
            while len(hull) > 1 and turn(hull[-2], hull[-1], point) <= 0:
                hull.pop()
            hull.append(point)
        return hull[:-1]

    return chain(ordered) + chain(ordered[::-1])


def turn(one: Point, two: Point, three: Point) -> float:
    """Returns the cross product of the steps between three points: positive for a turn to the left."""
    return (two[0] - one[0]) * (three[1] - one[1]) - (two[1] - one[1]) * (three[0] - one[0])
