"""How the pictures look: one colour and marker an integrator, no display needed, the same bytes every time."""

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

COLOURS = {
    "Euler": "#4477aa",
    "RK4": "#ee6677",
    "implicit": "#228833",
    "implicitfast": "#ccbb44",
    "discrete": "#aa3377",
}
"""Source: Paul Tol's bright scheme, told apart by the colour-blind too."""

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


def figure(width: float, height: float) -> Figure:
    """An empty figure [inches] on the Agg canvas."""
    made = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(made)
    return made


def save(made: Figure, out: Path, name: str) -> list[Path]:
    """As SVG and as PNG."""
    paths = [out / f"{name}.svg", out / f"{name}.png"]
    made.savefig(paths[0], metadata={"Date": None})
    made.savefig(paths[1], dpi=130)
    return paths
