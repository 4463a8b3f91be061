"""Work-precision diagrams, and the summary behind the tables."""

from pathlib import Path
from typing import Any

import matplotlib as mpl

from grader.bench.journal import Record
from grader.bench.precision import SCENES, measure_precision
from grader.bench.report.precision_analysis import Point, pareto, points_of, scene_summary
from grader.bench.report.style import COLOURS, MARKERS, RC, figure, save
from grader.bench.run import Benchmark, Records
from grader.bench.settings_grid import HORIZON_S, INTEGRATORS

PEER_COLOURS = {"Python loop": "#999999", "SciPy": "#0077bb", "Pinocchio": "#cc3311", "Drake": "#009988"}
PEER_SCENES = ("double_pendulum", "spinning_body", "joint_limits")


def summarise(records: Records) -> Record:
    """Per scene: reference, front, cheapest settings, orders, peers."""
    return {
        "horizon_s": HORIZON_S,
        "profiling_timer": records["timer"]["profiling_timer"],
        "scenes": {name: scene_summary(records, name) for name in SCENES},
    }


def rows(records: Records) -> list[Record]:
    """One row a setting."""
    found = []
    for key, record in records.items():
        kind, *names = key.split("/")
        if kind in ("setting", "peer"):
            found.append({"kind": kind, "scene": names[0], "method": names[1], "setting": names[2]} | record)
    return found


def draw(records: Records, summary: Record, out: Path) -> list[Path]:
    """MuJoCo's settings on every scene; beside the peers on three."""
    with mpl.rc_context(RC):
        return draw_settings(records, summary, out) + draw_peers(records, summary, out)


def draw_settings(records: Records, summary: Record, out: Path) -> list[Path]:
    """Error against CPU time, one panel a scene, the Pareto front in black."""
    made = figure(14, 7.4)
    panels = made.subplots(2, 4).flat
    for axes, name in zip(panels, SCENES, strict=False):
        points = points_of(records, "setting", name)
        for kind in INTEGRATORS:
            line = [p for p in points if p.method == kind and p.error]
            plot(axes, line, COLOURS[kind], MARKERS[kind], kind)
        front = pareto(points)
        axes.plot([p.cost for p in front], [p.error for p in front], color="black", lw=4, alpha=0.15, zorder=1)
        mark_reference(axes, summary["scenes"][name], f"{name.replace('_', ' ')}")
    legend_panel(panels[len(SCENES)], summary)
    return save(made, out, "precision")


def plot(axes: Any, points: list[Point], colour: str, marker: str, label: str) -> None:
    """One method's settings, in the order of cost."""
    ordered = sorted(points, key=lambda p: p.cost)
    axes.plot(
        [p.cost for p in ordered], [p.error for p in ordered], color=colour, marker=marker, ms=4, lw=1, label=label
    )


def mark_reference(axes: Any, scene: Record, title: str) -> None:
    """Logarithmic axes, and the level below which the reference itself is not known."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.axhspan(1e-17, scene["reference"]["own_error"], color="#dddddd")
    axes.set_ylim(1e-15, 20)
    axes.set_title(title)
    axes.set_xlabel(f"CPU time / ({1e3 * scene['yardstick_s']:.2f} ms: Euler at 2 ms)")
    axes.set_ylabel("sup-norm error [rad, m]")


def legend_panel(axes: Any, summary: Record) -> None:
    """The last panel explains the others."""
    axes.axis("off")
    for kind in INTEGRATORS:
        axes.plot([], [], color=COLOURS[kind], marker=MARKERS[kind], label=kind)
    axes.plot([], [], color="black", lw=4, alpha=0.15, label="Pareto front")
    axes.fill_between([], [], color="#dddddd", label="own error of the reference")
    axes.legend(loc="upper left", frameon=False)
    axes.text(
        0.02,
        0.02,
        f"{HORIZON_S:g} s simulated, timesteps 16 ms to 31 us by halves\n"
        f"MuJoCo {summary['versions']['mujoco']}, {summary['machine']['processor']}\n"
        "A setting that warned has no point.",
        transform=axes.transAxes,
        fontsize=8,
    )


def draw_peers(records: Records, summary: Record, out: Path) -> list[Path]:
    """MuJoCo's Pareto front beside what a user would pick instead."""
    made = figure(14, 5)
    for axes, name in zip(made.subplots(1, 3), PEER_SCENES, strict=True):
        front = pareto(points_of(records, "setting", name))
        plot(axes, front, "black", "o", "MuJoCo in C, its best settings")
        peers = points_of(records, "peer", name)
        for method in dict.fromkeys(p.method for p in peers):
            family = next(f for f in PEER_COLOURS if method.startswith(f))
            style = {"LSODA": ":", "DOP853": "-", "Euler": ":", "RK4": "-"}
            dash = next((d for word, d in style.items() if word in method), "-")
            marker = "x" if "mj_forward" in method else "."
            ordered = sorted((p for p in peers if p.method == method and p.error), key=lambda p: p.cost)
            xs, ys = [p.cost for p in ordered], [p.error for p in ordered]
            axes.plot(xs, ys, dash, color=PEER_COLOURS[family], marker=marker, ms=5, lw=1, label=method)
        mark_reference(axes, summary["scenes"][name], name.replace("_", " "))
    made.legend(
        *made.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8, frameon=False
    )
    return save(made, out, "precision_peers")


PRECISION = Benchmark(measure_precision, summarise, rows, draw)
