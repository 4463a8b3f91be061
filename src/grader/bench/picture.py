"""How the pictures look: one colour and marker an integrator, no display needed, the same bytes every time."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

COLOURS = {
    "Euler": "#4477aa",
    "RK4": "#ee6677",
    "implicit": "#228833",
    "implicitfast": "#ccbb44",
    "discrete": "#aa3377",
}
"""Source: Paul Tol's bright scheme, which colour-blind readers can tell apart."""

MARKERS = {"Euler": "o", "RK4": "s", "implicit": "^", "implicitfast": "v", "discrete": "D"}

RC: Any = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "grader",
    "figure.dpi": 110,
    "savefig.facecolor": "white",
}


def style() -> AbstractContextManager[None]:
    """The settings that figures are made and saved under."""
    return mpl.rc_context(RC)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure [inches] on the Agg canvas."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, stem: Path) -> list[Path]:
    """Write `<stem>.svg` and `<stem>.png`."""
    paths = [stem.with_name(f"{stem.name}.svg"), stem.with_name(f"{stem.name}.png")]
    figure.savefig(paths[0], metadata={"Date": None})
    figure.savefig(paths[1], dpi=130)
    return paths


def words(name: str) -> str:
    """The name of a scene for readers."""
    return name.replace("_", " ")
