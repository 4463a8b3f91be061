"""Markdown tables from the benchmarks' JSON, written between markers, so that no figure is typed by hand.

`<!-- measured:begin NAME -->` ... `<!-- measured:end NAME -->` in a page is filled with the block NAME; a marker
without a name takes the block `summary`.
"""

import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path

from grader.bench.journal import Record

MARKED = re.compile(r"(<!-- measured:begin ?(\w*) -->\n).*?(<!-- measured:end ?\2 -->)", re.DOTALL)

SHOWN_TOLERANCES = ("1e-02", "1e-04", "1e-06", "1e-08")
SUMMARY_WORDS = (
    "The cheapest setting within each position error over 1 s, in brackets its CPU time in runs of MuJoCo's defaults "
    "(Euler at 2 ms); and how much faster a run is than a Python loop when the wheel's timer is off, steps are made in "
    "C and everything is skipped that provably changes no bit. [All of it, with pictures](docs/measured.md)."
)
BENCHMARKS = ("precision", "stability", "skip")

Results = dict[str, Record]


def load_results(folder: Path) -> Results:
    """The committed JSON of the three benchmarks."""
    return {name: json.loads((folder / f"{name}.json").read_text(encoding="utf-8")) for name in BENCHMARKS}


def fill(page: str, results: Results) -> str:
    """The page with every marked block rendered anew. Raises KeyError for a block that does not exist."""
    return MARKED.sub(lambda found: f"{found[1]}{BLOCKS[found[2] or 'summary'](results)}\n{found[3]}", page)


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table."""
    columns = list(head)
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def words(name: str) -> str:
    """A scene's name for readers."""
    return name.replace("_", " ")


def milliseconds(timestep_s: float) -> str:
    """`2 ms`, `0.0313 ms`."""
    return f"{1e3 * timestep_s:.3g} ms"


def machine_block(results: Results) -> str:
    """Machine and versions of every benchmark."""
    lines = []
    for name in BENCHMARKS:
        one = results[name]
        versions = ", ".join(f"{package} {version}" for package, version in one["versions"].items())
        kind = "quick run" if one["quick"] else "whole run"
        lines.append(
            f"- `{name}`: {kind}, {one['measurements']} measurements, {one['machine']['processor']}, "
            f"{one['machine']['cores']} cores, load {one['machine']['load_1min']}; {versions}"
        )
    return "\n".join(lines)


def precision_block(results: Results) -> str:
    """The cheapest setting for each tolerance on each scene."""
    scenes = results["precision"]["scenes"]
    tolerances = list(next(iter(scenes.values()))["cheapest"])
    rows = [[words(name), *(setting(scene["cheapest"][t]) for t in tolerances)] for name, scene in scenes.items()]
    return table(["scene", *tolerances], rows)


def setting(best: Record | None) -> str:
    """`RK4 8 ms (x0.9)`, or a dash where no setting gets there."""
    if best is None:
        return "-"
    return f"{best['integrator']} {milliseconds(best['timestep_s'])} (x{best['cost']:.3g})"


def procedure_block(results: Results) -> str:
    """The lesson's start beside RK4 at a quarter and at four times its step."""
    rows = []
    for name, scene in results["precision"]["scenes"].items():
        one = scene["procedure"]
        rows.append([words(name), *(trade(one[kind]) for kind in ("start", "quarter", "four_times"))])
    return table(["scene", "implicitfast at 2 ms", "RK4 at 0.5 ms", "RK4 at 8 ms"], rows)


def trade(point: Record) -> str:
    """Error and cost of one setting, or that it warned."""
    error = "warned" if point["error"] is None else f"{point['error']:.1e}"
    return f"{error} (x{point['cost']:.2g})"


def orders_block(results: Results) -> str:
    """Fitted orders with their 95 % intervals, and the own error of the reference."""
    scenes = results["precision"]["scenes"]
    kinds = list(next(iter(scenes.values()))["orders"])
    rows = [
        [words(name), f"{scene['reference']['own_error']:.0e}", *(order(scene["orders"][kind]) for kind in kinds)]
        for name, scene in scenes.items()
    ]
    return table(["scene", "own error of the reference", *kinds], rows)


def order(fit: Record | None) -> str:
    """`4.01 (3.95 to 4.08)`, or a dash where fewer than three points are in the asymptotic range."""
    if fit is None:
        return "-"
    return f"{fit['order']:.2f} ({fit['interval'][0]:.2f} to {fit['interval'][1]:.2f})"


def peers_block(results: Results) -> str:
    """How many times dearer each peer is than MuJoCo's cheapest setting, at three tolerances."""
    rows = []
    for name, scene in results["precision"]["scenes"].items():
        for peer, ratios in scene["peers"].items():
            rows.append([words(name), peer, *(ratio(ratios[t], scene["cheapest"][t]) for t in SHOWN_TOLERANCES)])
    installed = results["precision"]["versions"]
    missing = [name for name in ("pin", "drake") if installed[name] == "not installed"]
    note = f"\n\nNot installed when this was measured: {', '.join(missing)}." if missing else ""
    return table(["scene", "peer", *SHOWN_TOLERANCES], rows) + note


def ratio(peer: Record | None, mujoco: Record | None) -> str:
    """`x2.6 (2.5 to 2.8)`; in words where one of the two does not get there."""
    if peer is None:
        return "neither" if mujoco is None else "does not get there"
    if peer["ratio"] is None:
        return "gets there, MuJoCo does not"
    low, high = peer["spread"]
    return f"x{peer['ratio']:.2g} ({low:.2g} to {high:.2g})"


def stability_block(results: Results) -> str:
    """Per map: what it cost, whether the full grid agrees, and how far closed form, radius and simulation are apart."""
    rows = []
    for chart, maps in results["stability"]["maps"].items():
        for integrator, one in maps.items():
            edges = one["edges"]
            simulated = edges["simulated_to_closed"]
            rows.append(
                [
                    chart,
                    integrator,
                    f"{one['evaluated']} of {one['points']} (x{one['saving']:.1f})",
                    f"{one['disagreeing']} of {one['full_points']}",
                    "no limit" if edges["spectral_to_closed"] is None else f"{edges['spectral_to_closed']:.0e}",
                    "no limit" if simulated is None else f"{100 * simulated[0]:+.2f} to {100 * simulated[1]:+.1f} %",
                ]
            )
    head = ["map", "integrator", "points evaluated", "points that the full grid has otherwise"]
    return table([*head, "spectral radius to closed form", "3 s simulated to closed form"], rows)


def windows_block(results: Results) -> str:
    """Where `no warning` lies."""
    meaning = {
        "slow": "no warning in 3 s, radius above 1",
        "window": "warned, but never with BADQACC",
        "fragile": "warned, radius at most 1",
    }
    rows = [
        [
            chart,
            integrator,
            meaning[window["kind"]],
            "-" if window["share_of_unstable"] is None else f"{100 * window['share_of_unstable']:.1f} %",
            " to ".join(milliseconds(h) for h in window["timesteps_s"]),
        ]
        for chart, kinds in results["stability"]["windows"].items()
        for integrator, windows in kinds.items()
        for window in windows
    ]
    return table(["map", "integrator", "what", "share of the unstable points", "timesteps"], rows)


def cases_block(results: Results) -> str:
    """What collisions end in, and what the warning and reset do."""
    rows = []
    for case, kinds in results["stability"]["cases"].items():
        for integrator, one in kinds.items():
            shares = ", ".join(f"{name} {100 * share:.0f} %" for name, share in one["shares"].items() if share)
            rows.append([case, integrator, shares, reset(one["reset"])])
    return table(["case", "integrator", "outcomes over the grid", "first warning, at the smallest timestep"], rows)


def reset(found: Record | None) -> str:
    """What a warned run's loop reads next."""
    if found is None:
        return "never warned"
    return (
        f"{found['warning']} at t = {found['warned_at_s']:.3g} s (h = {milliseconds(found['timestep_s'])}); "
        f"then time reads {found['time_after_s']:.3g} s and qpos {found['qpos_after']}"
    )


def skip_block(results: Results) -> str:
    """The cumulative ladder: timer off, steps in C, all that is not needed."""
    rows = []
    for name, scene in results["skip"]["scenes"].items():
        first, second, last = scene["ladder"][0], scene["ladder"][1], scene["ladder"][-1]
        bits = "yes" if scene["bitwise"] else "NO"
        spread = f"{last['spread'][0]:.2f} to {last['spread'][1]:.2f}"
        needed = [flag["part"] for flag in scene["flags"] if not flag["proven"]]
        rows.append(
            [
                words(name),
                *(f"x{rung['ratio']:.2f}" for rung in (first, second)),
                f"**x{last['ratio']:.2f}** ({spread})",
                bits,
                ", ".join(needed) or "none",
            ]
        )
    return table(["scene", "timer off", "steps in C", "and skipping", "bitwise equal", "needed, so kept"], rows)


def flags_block(results: Results) -> str:
    """Every flag on every scene: proof, bits, time."""
    rows = [
        [
            words(name),
            flag["part"],
            "proven" if flag["proven"] else "needed",
            flag["reason"],
            "yes" if flag["bitwise"] else f"no, {flag['largest_difference']:.0e}",
            f"x{flag['ratio']:.2f} ({flag['spread'][0]:.2f} to {flag['spread'][1]:.2f})",
        ]
        for name, scene in results["skip"]["scenes"].items()
        for flag in scene["flags"]
    ]
    return table(["scene", "flag", "", "why", "bitwise equal", "time saved"], rows)


def summary_block(results: Results) -> str:
    """For the README: one line a scene, and the totals of the maps."""
    scenes, skipped = results["precision"]["scenes"], results["skip"]["scenes"]
    rows = [
        [
            words(name),
            *(setting(scene["cheapest"][t]) for t in SHOWN_TOLERANCES),
            f"x{skipped[name]['ladder'][-1]['ratio']:.1f}" if name in skipped else "-",
        ]
        for name, scene in scenes.items()
    ]
    totals = results["stability"]["totals"]
    maps = (
        f"Stability maps: {totals['evaluated']} of {totals['grid_points']} points evaluated "
        f"({100 * totals['evaluated'] / totals['grid_points']:.0f} %), {totals['disagreeing']} of "
        f"{totals['compared']} compared points differ from the full grid; spectral radius and closed form agree to "
        f"{totals['largest_spectral_to_closed']:.0e}."
    )
    head = ["scene", *(f"error {t}" for t in SHOWN_TOLERANCES), "skipping saves"]
    return "\n\n".join((SUMMARY_WORDS, table(head, rows), maps))


BLOCKS: dict[str, Callable[[Results], str]] = {
    "summary": summary_block,
    "machine": machine_block,
    "precision": precision_block,
    "procedure": procedure_block,
    "orders": orders_block,
    "peers": peers_block,
    "stability": stability_block,
    "windows": windows_block,
    "cases": cases_block,
    "skip": skip_block,
    "flags": flags_block,
}
