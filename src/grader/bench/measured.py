"""The pages' tables from the studies' JSON, so that no figure is typed by hand, and the studies run for them.

`<!-- measured:begin NAME -->` ... `<!-- measured:end NAME -->` in a page is filled with the block NAME; a marker
without a name takes the block `summary`. `python -m grader.bench.measured docs README.md docs/measured.md` measures,
resuming where it was stopped, and rewrites; with `--tables-only` it renders the committed JSON again.
"""

import argparse
import json
import re
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from grader.bench import run

STUDIES = ("precision", "stability", "skip")
"""The studies whose results are committed."""

PICTURES = (
    *("precision.png", "precision_peers.png", "skip.png", "stability_stiffness.png", "stability_damping.png"),
    *("stability_oscillator.png", "stability_collisions.png"),
)

MARKED = re.compile(r"(<!-- measured:begin ?(\w*) -->\n).*?(<!-- measured:end ?\2 -->)", re.DOTALL)

SHOWN_ERRORS = ("1e-02", "1e-04", "1e-06", "1e-08")
SUMMARY_WORDS = (
    "The cheapest setting within each position error over 1 s, in brackets its CPU time in runs of MuJoCo's defaults "
    "(Euler at 2 ms); and how much faster a run is than a Python loop when the wheel's timer is off, steps are made in "
    "C and everything is skipped that provably changes no bit. [All of it, with pictures](docs/measured.md)."
)

Results = dict[str, Any]


def load_results(folder: Path) -> Results:
    """The committed JSON of the studies, by name."""
    return {name: json.loads((folder / f"{name}.json").read_text(encoding="utf-8")) for name in STUDIES}


def fill(page: str, results: Results) -> str:
    """The page with every marked block rendered anew. Raises KeyError for a block that does not exist."""
    return MARKED.sub(lambda found: f"{found[1]}{BLOCKS[found[2] or 'summary'](results)}\n{found[3]}", page)


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table."""
    columns = list(head)
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def words(name: str) -> str:
    """The name of a scene for readers."""
    return name.replace("_", " ")


def milliseconds(timestep_s: float) -> str:
    """`2 ms`, `0.0313 ms`."""
    return f"{1e3 * timestep_s:.3g} ms"


def setting(best: Results | None) -> str:
    """`RK4 8 ms (x0.9)`, or a dash where no setting gets there."""
    return f"{best['integrator']} {milliseconds(best['timestep_s'])} (x{best['cost']:.3g})" if best else "-"


def trade(point: Results) -> str:
    """Error and cost of one setting, or that it warned."""
    error = "warned" if point["error"] is None else f"{point['error']:.1e}"
    return f"{error} (x{point['cost']:.2g})"


def order(fit: Results | None) -> str:
    """`4.01 (3.95 to 4.08)`, or a dash where fewer than three points are in the asymptotic range."""
    return f"{fit['order']:.2f} ({fit['interval'][0]:.2f} to {fit['interval'][1]:.2f})" if fit else "-"


def ratio(peer: Results | None, mujoco: Results | None) -> str:
    """`x2.6 (2.5 to 2.8)`; in words where one of the two does not get there."""
    if peer is None:
        return "neither" if mujoco is None else "does not get there"
    if peer["ratio"] is None:
        return "gets there, MuJoCo does not"
    return f"x{peer['ratio']:.2g} ({peer['spread'][0]:.2g} to {peer['spread'][1]:.2g})"


def reset(found: Results | None) -> str:
    """The first warned run, and what its loop reads next."""
    if found is None:
        return "never warned"
    return (
        f"{found['warning']} at t = {found['warned_at_s']:.3g} s (h = {milliseconds(found['timestep_s'])}); "
        f"then time reads {found['time_after_s']:.3g} s and qpos {found['qpos_after']}"
    )


def machine_block(results: Results) -> str:
    """Machine and versions of every study."""
    lines = []
    for name, one in results.items():
        versions = ", ".join(f"{package} {version}" for package, version in one["versions"].items())
        kind = "quick run" if one["quick"] else "whole run"
        lines.append(
            f"- `{name}`: {kind}, {one['measurements']} measurements, {one['machine']['processor']}, "
            f"{one['machine']['cores']} cores, load {one['machine']['load_1min']}; {versions}"
        )
    return "\n".join(lines)


def precision_block(results: Results) -> str:
    """The cheapest setting within each error on each scene."""
    scenes = results["precision"]["scenes"]
    errors = list(next(iter(scenes.values()))["cheapest"])
    rows = [[words(name), *(setting(scene["cheapest"][e]) for e in errors)] for name, scene in scenes.items()]
    return table(["scene", *errors], rows)


def procedure_block(results: Results) -> str:
    """The lesson's start beside RK4 at a quarter and at four times its step."""
    scenes = {name: scene["procedure"] for name, scene in results["precision"]["scenes"].items()}
    kinds = {"start": "implicitfast at 2 ms", "quarter": "RK4 at 0.5 ms", "four_times": "RK4 at 8 ms"}
    rows = [[words(name), *(trade(scene[kind]) for kind in kinds)] for name, scene in scenes.items()]
    return table(["scene", *kinds.values()], rows)


def orders_block(results: Results) -> str:
    """Fitted orders with their 95 % intervals, and the own error of the reference."""
    scenes = results["precision"]["scenes"]
    kinds = list(next(iter(scenes.values()))["orders"])
    rows = [
        [words(name), f"{scene['reference']['own_error']:.0e}", *(order(scene["orders"][kind]) for kind in kinds)]
        for name, scene in scenes.items()
    ]
    return table(["scene", "own error of the reference", *kinds], rows)


def peers_block(results: Results) -> str:
    """The cost of each peer over that of MuJoCo's cheapest setting within four errors."""
    rows = [
        [words(name), peer, *(ratio(ratios[e], scene["cheapest"][e]) for e in SHOWN_ERRORS)]
        for name, scene in results["precision"]["scenes"].items()
        for peer, ratios in scene["peers"].items()
    ]
    missing = [name for name in ("pin", "drake") if results["precision"]["versions"][name] == "not installed"]
    note = f"\n\nNot installed when this was measured: {', '.join(missing)}." if missing else ""
    return table(["scene", "peer", *SHOWN_ERRORS], rows) + note


def stability_block(results: Results) -> str:
    """Per map: what it cost, whether the full grid agrees, and how far closed form, radius and simulation are apart."""
    rows = []
    for chart, maps in results["stability"]["maps"].items():
        for integrator, one in maps.items():
            spectral, simulated = one["edges"]["spectral_to_closed"], one["edges"]["simulated_to_closed"]
            cost = f"{one['evaluated']} of {one['points']} (x{one['saving']:.1f})"
            by_radius = "no limit" if spectral is None else f"{spectral:.0e}"
            by_simulation = "no limit"
            if simulated is not None:
                by_simulation = f"{100 * simulated[0]:+.2f} to {100 * simulated[1]:+.1f} %"
            differing = f"{one['disagreeing']} of {one['full_points']}"
            rows.append([chart, integrator, cost, differing, by_radius, by_simulation])
    head = ["map", "integrator", "points evaluated", "points that the full grid has otherwise"]
    return table([*head, "spectral radius to closed form", "3 s simulated to closed form"], rows)


WINDOWS = {
    "slow": "no warning in 3 s, radius above 1",
    "window": "warned, but never with BADQACC",
    "fragile": "warned, radius at most 1",
}


def windows_block(results: Results) -> str:
    """Where `no warning` misleads."""
    rows = []
    for chart, kinds in results["stability"]["windows"].items():
        for integrator, windows in kinds.items():
            for window in windows:
                share = window["share_of_unstable"]
                shown = "-" if share is None else f"{100 * share:.1f} %"
                span = " to ".join(milliseconds(h) for h in window["timesteps_s"])
                rows.append([chart, integrator, WINDOWS[window["kind"]], shown, span])
    return table(["map", "integrator", "what", "share of the unstable points", "timesteps"], rows)


def cases_block(results: Results) -> str:
    """What collisions end in, and what the warning and reset do."""
    rows = []
    for case, kinds in results["stability"]["cases"].items():
        for integrator, one in kinds.items():
            shares = ", ".join(f"{name} {100 * share:.0f} %" for name, share in one["shares"].items() if share)
            rows.append([case, integrator, shares, reset(one["reset"])])
    return table(["case", "integrator", "outcomes over the grid", "first warning, at the smallest timestep"], rows)


def skip_block(results: Results) -> str:
    """The cumulative ladder: timer off, steps in C, all that is not needed."""
    rows = []
    for name, scene in results["skip"]["scenes"].items():
        first, second, last = scene["ladder"][0], scene["ladder"][1], scene["ladder"][-1]
        total = f"**x{last['ratio']:.2f}** ({last['spread'][0]:.2f} to {last['spread'][1]:.2f})"
        needed = ", ".join(flag["part"] for flag in scene["flags"] if not flag["proven"]) or "none"
        stages = (f"x{first['ratio']:.2f}", f"x{second['ratio']:.2f}", total)
        rows.append([words(name), *stages, "yes" if scene["bitwise"] else "NO", needed])
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
    skipped, totals = results["skip"]["scenes"], results["stability"]["totals"]
    rows = []
    for name, scene in results["precision"]["scenes"].items():
        saved = f"x{skipped[name]['ladder'][-1]['ratio']:.1f}" if name in skipped else "-"
        rows.append([words(name), *(setting(scene["cheapest"][e]) for e in SHOWN_ERRORS), saved])
    maps = (
        f"Stability maps: {totals['evaluated']} of {totals['grid_points']} points evaluated "
        f"({100 * totals['evaluated'] / totals['grid_points']:.0f} %), {totals['disagreeing']} of "
        f"{totals['compared']} compared points differ from the full grid; spectral radius and closed form agree to "
        f"{totals['largest_spectral_to_closed']:.0e}."
    )
    head = ["scene", *(f"error {e}" for e in SHOWN_ERRORS), "skipping saves"]
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


def main() -> None:
    """Measure, copy what is committed, fill the pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("docs", type=Path, help="folder that holds measured/")
    parser.add_argument("pages", type=Path, nargs="+", help="pages with markers")
    parser.add_argument("--work", type=Path, default=Path(".data/bench"), help="folder of the runs")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--tables-only", action="store_true")
    given = parser.parse_args()
    kept = given.docs / "measured"
    if not given.tables_only:
        for name in STUDIES:
            run(name, given.work, given.quick)
        kept.mkdir(parents=True, exist_ok=True)
        for name in (*(f"{study}.json" for study in STUDIES), *PICTURES):
            shutil.copyfile(given.work / name, kept / name)
    results = load_results(kept)
    for page in given.pages:
        page.write_text(fill(page.read_text(encoding="utf-8"), results), encoding="utf-8")


if __name__ == "__main__":
    main()
