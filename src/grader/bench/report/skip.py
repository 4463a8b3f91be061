"""What skipping saves, in figures and a picture."""

from pathlib import Path

import matplotlib as mpl
import numpy as np

from grader.bench.journal import Record
from grader.bench.report.style import RC, figure, save
from grader.bench.run import Benchmark, Do, Records
from grader.bench.skip import SCENES, skip_tasks

TIMED = ("ratio", "low", "high", "seconds", "yardstick_s", "pairs")


def measure(quick: bool, do: Do) -> Records:
    """All flags and ladders."""
    return do(skip_tasks(quick))


def summarise(records: Records) -> Record:
    """Per scene: the flags with proof, bits and ratio; and the cumulative ladder."""
    scenes = {}
    for name in SCENES:
        flags = [record for key, record in records.items() if key.startswith(f"flag/{name}/")]
        ladder = records[f"ladder/{name}"]
        scenes[name] = {
            "flags": [
                {
                    "part": flag["part"],
                    "proven": flag["proven"],
                    "reason": flag["reason"],
                    "bitwise": flag["bitwise"],
                    "largest_difference": flag["largest_difference"],
                    "ratio": flag["ratio"],
                    "spread": [flag["low"], flag["high"]],
                }
                for flag in flags
            ],
            "ladder": [
                {"rung": rung["rung"], "ratio": rung["ratio"], "spread": [rung["low"], rung["high"]]}
                for rung in ladder["rungs"]
            ],
            "bitwise": ladder["bitwise"],
        }
    return {"scenes": scenes, "broken_proofs": broken_proofs(records)}


def broken_proofs(records: Records) -> list[str]:
    """Flags that are called proven and yet changed a bit: must be empty."""
    return [key for key, record in records.items() if record.get("proven") and not record["bitwise"]]


def rows(records: Records) -> list[Record]:
    """One row a flag and a rung."""
    found: list[Record] = []
    for key, record in records.items():
        kind, scene = key.split("/")[:2]
        if kind == "flag":
            found.append({"kind": kind, "scene": scene} | record)
        else:
            found += [{"kind": kind, "scene": scene, "part": rung["rung"]} | rung for rung in record["rungs"]]
    for row in found:
        row.pop("rung", None)
    return found


def draw(records: Records, _summary: Record, out: Path) -> list[Path]:
    """Left: the cumulative speed-up. Right: each flag alone, proven or not."""
    with mpl.rc_context(RC):
        made = figure(12.5, 5.2)
        left, right = made.subplots(1, 2, width_ratios=[1, 1.25])
        draw_ladders(left, records)
        draw_flags(right, records, made)
        return save(made, out, "skip")


def draw_ladders(axes: "mpl.axes.Axes", records: Records) -> None:
    """Stacked by stage: timer off, steps in C, all that is not needed."""
    stages = {"timer off": "#bbccee", "steps in C": "#88aadd", "what is not needed": "#335599"}
    for row, name in enumerate(reversed(SCENES)):
        rungs = records[f"ladder/{name}"]["rungs"]
        reached = [rungs[0]["ratio"], rungs[1]["ratio"], rungs[-1]["ratio"]]
        left = 1.0
        for colour, ratio in zip(stages.values(), reached, strict=True):
            axes.barh(row, max(ratio - left, 0), left=left, color=colour, height=0.6)
            left = max(ratio, left)
        last = rungs[-1]
        axes.errorbar(
            last["ratio"],
            row,
            xerr=[[last["ratio"] - last["low"]], [last["high"] - last["ratio"]]],
            color="black",
            lw=1,
        )
        axes.text(max(last["high"], left) + 0.05, row, f"x{last['ratio']:.2f}", va="center")
    axes.set_yticks(range(len(SCENES)), [name.replace("_", " ") for name in reversed(SCENES)])
    axes.set_xlim(1, 4.6)
    axes.set_xlabel("times faster than a Python loop as the wheel comes")
    axes.set_title("Cumulative, all of it bitwise the same")
    axes.legend([mpl.patches.Patch(color=colour) for colour in stages.values()], stages, loc="lower right")
    axes.grid(axis="y", visible=False)


def draw_flags(axes: "mpl.axes.Axes", records: Records, made: "mpl.figure.Figure") -> None:
    """A table of ratios, coloured; a cross where the flag changes the motion."""
    parts = list(dict.fromkeys(key.split("/")[2] for key in records if key.startswith("flag/")))
    ratios = np.array([[records[f"flag/{name}/{part}"]["ratio"] for part in parts] for name in SCENES])
    axes.imshow(np.log(ratios), cmap="Blues", vmin=0, vmax=np.log(2.5), aspect="auto")
    for row, name in enumerate(SCENES):
        for column, part in enumerate(parts):
            record = records[f"flag/{name}/{part}"]
            text = f"{record['ratio']:.2f}" if record["proven"] else f"needed\n({record['largest_difference']:.0e})"
            dark = record["ratio"] > 1.7
            colour = "white" if dark else "black"
            axes.text(column, row, text, ha="center", va="center", color=colour, fontsize=7.5)
    axes.set_xticks(range(len(parts)), parts, rotation=30, ha="right")
    axes.set_yticks(range(len(SCENES)), [name.replace("_", " ") for name in SCENES])
    axes.set_title("Each flag alone: times faster (needed: what it would change)")
    axes.grid(visible=False)
    made.align_labels()


SKIP = Benchmark(measure, summarise, rows, draw)
