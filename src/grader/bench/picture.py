"""How the pictures look: one colour and marker an integrator, no display needed, the same bytes every time."""

from pathlib import Path
from typing import Any

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

LOOK: Any = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "grader",
    "figure.dpi": 110,
    "savefig.facecolor": "white",
}
"""The settings that figures are made and saved under."""


def save(figure: Figure, stem: Path) -> list[Path]:
    """Write `<stem>.svg` and `<stem>.png`."""
    paths = [stem.with_name(f"{stem.name}.svg"), stem.with_name(f"{stem.name}.png")]
    figure.savefig(paths[0], metadata={"Date": None})
    figure.savefig(paths[1], dpi=130)
    return paths
