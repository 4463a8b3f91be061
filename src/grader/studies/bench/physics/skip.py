"""What skipping saves: per scene and flag, proven or not and why, time saved, and whether the bits stay the same. And
what a repeat saves, where a run has shown that constraints which may act did not."""

import copy
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial, reduce
from operator import or_
from typing import Any

import matplotlib as mpl
import mujoco
import numpy as np
from matplotlib.figure import Figure

from grader.numerics.integrators import BY_NAME
from grader.numerics.needs import Need
from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import FULL_STATE, Scene
from grader.numerics.stepping import STEPS_MAX
from grader.numerics.visuals import remove_visuals
from grader.studies.bench.physics.models import find_gymnasium_models
from grader.studies.bench.physics.peers import Array
from grader.studies.bench.scenes import describe_scene, load_scene, read_scene
from grader.studies.bench.study import Measurement, Record, Records, Study, select_kind
from grader.studies.bench.timing import measure_pairs, restore_timer

SCENES = (
    *("double_pendulum", "drawn_pendulum", "servo", "spinning_body", "eccentric_body"),
    *("sensed_arm", "joint_limits", "cube", "two_bodies"),
)

REPEATED = ("inverted_double_pendulum", "inverted_pendulum", "reacher", "swimmer", "hopper", "half_cheetah")
"""Gymnasium's models of which a run may be free of constraints that the model has."""

TIMESTEP_S = 0.002
STEPS = 500
CHUNK = 50
"""Steps per call into C; divides STEPS."""

TIMER, IN_C, SKIPPING, TOGETHER = STAGES = ("timer off", "steps in C", "skipping", "together")

BUDGET_S = {True: 0.05, False: 0.5}
"""CPU time of a comparison [s], by whether the run is quick."""


class Run:
    """Called, it runs a scene for STEPS steps at 2 ms from its start, with these disable bits set. `bare` is a model
    that moves alike and is stepped in place of the scene's own."""

    def __init__(
        self, scene: Scene, integrator: str = "Euler", bits: int = 0, chunk: int = CHUNK,
        bare: mujoco.MjModel | None = None,
    ) -> None:  # fmt: skip
        self.start, self.chunk = scene.start_vector, chunk
        self.model = copy.copy(bare or scene.model)
        self.model.opt.timestep, self.model.opt.integrator = TIMESTEP_S, BY_NAME[integrator].code
        self.model.opt.disableflags |= bits
        self.data = mujoco.MjData(self.model)

    def reset(self) -> None:
        """Back to the start."""
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, self.start, FULL_STATE)

    def __call__(self) -> None:
        """All steps, in chunks."""
        self.reset()
        model, data, chunk = self.model, self.data, self.chunk
        if chunk == 1:
            for _ in range(STEPS):
                mujoco.mj_step(model, data)
        else:
            for _ in range(STEPS // chunk):
                mujoco.mj_step(model, data, nstep=chunk)

    def state(self) -> Array:
        """qpos and qvel now, shape (nq + nv,)."""
        return np.concatenate([self.data.qpos, self.data.qvel])

    def trajectory(self) -> Array:
        """qpos and qvel after every step, shape (STEPS, nq + nv)."""
        self.reset()
        rows = np.empty((STEPS, self.model.nq + self.model.nv))
        for row in rows:
            mujoco.mj_step(self.model, self.data)
            row[:] = self.state()
        return rows


def find_largest_difference(scene: Scene, bits: int, bare: mujoco.MjModel | None = None) -> float:
    """Returns the largest difference of any state over the run under any integrator; 0 only if bitwise equal."""
    largest = 0.0
    for integrator in BY_NAME:
        whole, less = Run(scene, integrator).trajectory(), Run(scene, integrator, bits, bare=bare).trajectory()
        if whole.tobytes() != less.tobytes():
            largest = max(largest, float(np.abs(whole - less).max()), 5e-324)
    return largest


def is_proven(need: Need) -> bool:
    """Whether skipping provably does not change the motion. Sensors never do; they are skipped where unread."""
    return not need.needed or (need.part == "sensors" and "read" in need.reason)


@dataclass(frozen=True)
class Flag(Measurement):
    """One part of the engine on one scene: the proof, the bits, and the time without it."""

    scene: str
    part: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Compare runs with and without the part."""
        scene = load_scene(self.scene)
        need = next(need for need in scene.needs if need.part == self.part)
        difference = find_largest_difference(scene, need.flag)
        return {
            "part": need.part,
            "proven": is_proven(need),
            "reason": need.reason,
            "bitwise": difference == 0,
            "largest_difference": difference,
            **asdict(measure_pairs(Run(scene), Run(scene, bits=need.flag), BUDGET_S[quick])),
        }


@dataclass(frozen=True)
class Savings(Measurement):
    """The savings of one scene, apart and together."""

    scene: str

    def measure(self, quick: bool, done: Records) -> Record:
        """From a Python loop as the wheel comes: timer off, then steps in C, then nothing that is not needed."""
        scene, loop = load_scene(self.scene), Run(load_scene(self.scene), chunk=1)
        bits = reduce(or_, (need.flag for need in scene.needs if is_proven(need)), 0)
        bare = remove_visuals(read_scene(self.scene), scene.model, scene.needs)
        first, in_c, last = restore_timer()(loop), Run(scene), Run(scene, bits=bits, bare=bare)
        stages = {TIMER: (first, loop), IN_C: (loop, in_c), SKIPPING: (in_c, last), TOGETHER: (first, last)}
        timed = {name: asdict(measure_pairs(*works, BUDGET_S[quick])) for name, works in stages.items()}
        return {"stages": timed, "bitwise": find_largest_difference(scene, bits, bare) == 0, "bits": bits}

    def rows(self, record: Record) -> list[Record]:
        """Returns one row a stage."""
        return [{"stage": name, "ratio": stage["ratio"]} for name, stage in record["stages"].items()]


@dataclass(frozen=True)
class Repeat(Measurement):
    """A foreign model from its own start: a repeat of its longest run without a constraint, beside that run."""

    model: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Halve the run until no constraint acted in it, and repeat that one."""
        path = find_gymnasium_models()[f"{self.model} (Gymnasium)"]
        scene = Scene.from_xml(path.read_text(encoding="utf-8"))
        may_act = any(need.needed for need in scene.needs if need.part == "constraints")
        steps = STEPS
        while steps and not self._run(scene, steps).unconstrained:
            steps //= 2
        record: Record = {"steps": steps, "may_act": may_act, "bitwise": True, "ratio": None, "interval": None}
        if not steps:
            return record
        first, again = (self._run(scene, steps, repeat=repeat).states.tobytes() for repeat in (False, True))
        work, yardstick = (partial(self._run, scene, steps, repeat=repeat) for repeat in (False, True))
        return record | {"bitwise": first == again, **asdict(measure_pairs(work, yardstick, BUDGET_S[quick]))}

    def _run(self, scene: Scene, steps: int, *, repeat: bool = False) -> Rollout:
        return simulate(scene, steps=steps, timestep_s=TIMESTEP_S, every=STEPS_MAX, repeat=repeat)


def plan(_quick: bool) -> Sequence[Measurement]:
    """Returns every part with a flag on every scene, the savings of each scene, and the repeats."""
    measurements: list[Measurement] = []
    for name in SCENES:
        measurements += [Flag(name, need.part) for need in load_scene(name).needs if need.flag]
        measurements.append(Savings(name))
    return [*measurements, *map(Repeat, REPEATED)]


def summarise(records: Records) -> Record:
    """Per scene the flags and the savings, per foreign model the repeat; `broken_proofs`, which must be empty: proven
    flags that changed a bit."""
    flags = select_kind(records, Flag)
    scenes = {
        key.scene: {
            "flags": [
                {name: record[name] for name in ("part", "proven", "reason", "bitwise", "largest_difference")}
                | summarise_ratio(record)
                for flag, record in flags.items()
                if flag.scene == key.scene
            ],
            "savings": {stage: summarise_ratio(timed) for stage, timed in saved["stages"].items()},
            "bitwise": saved["bitwise"],
        }
        for key, saved in select_kind(records, Savings).items()
    }
    broken = [key.row() for key, record in flags.items() if record["proven"] and not record["bitwise"]]
    repeats = {
        key.model: {name: record[name] for name in ("steps", "may_act", "bitwise", "ratio", "interval")}
        for key, record in select_kind(records, Repeat).items()
    }
    broken += [key.row() for key, record in select_kind(records, Repeat).items() if not record["bitwise"]]
    return {"scenes": scenes, "repeats": repeats, "broken_proofs": broken}


def summarise_ratio(timed: Record) -> Record:
    """Returns a ratio and its 95 % confidence interval."""
    return {name: timed[name] for name in ("ratio", "interval")}


def draw(records: Records, _summary: Record) -> Figure:
    """Left: the cumulative speed-up. Right: each flag alone, proven or not."""
    figure = Figure(figsize=(12.5, 5.2))
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.25])
    draw_savings(left, records)
    draw_flags(right, records)
    figure.align_labels()
    return figure


COLOURS = dict(zip(STAGES, ("#bbccee", "#88aadd", "#335599"), strict=False))


def draw_savings(axes: Any, records: Records) -> None:
    """Stacked by stage, each as many times faster as it makes what stands before it."""
    for row, name in enumerate(reversed(SCENES)):
        stages, left = records[Savings(name)]["stages"], 1.0
        for stage, colour in COLOURS.items():
            axes.barh(row, max(left * stages[stage]["ratio"] - left, 0), left=left, color=colour, height=0.6)
            left *= max(stages[stage]["ratio"], 1)
        ratio, (low, high) = stages[TOGETHER]["ratio"], stages[TOGETHER]["interval"]
        axes.errorbar(ratio, row, xerr=[[ratio - low], [high - ratio]], color="black", lw=1)
        axes.text(max(high, left) + 0.05, row, f"x{ratio:.2f}", va="center")
    axes.set_yticks(range(len(SCENES)), [describe_scene(name) for name in reversed(SCENES)])
    axes.set_xlim(1, 4.6)
    axes.set_xlabel("times faster than a Python loop as the wheel comes")
    axes.set_title("Together (line: 95 % interval), all of it bitwise the same")
    axes.legend([mpl.patches.Patch(color=colour) for colour in COLOURS.values()], COLOURS, loc="lower right")
    axes.grid(axis="y", visible=False)


def draw_flags(axes: Any, records: Records) -> None:
    """A table of ratios, coloured; what a needed flag would change in its place."""
    flags = select_kind(records, Flag)
    parts = list(dict.fromkeys(key.part for key in flags))
    ratios = np.array([[flags[Flag(name, part)]["ratio"] for part in parts] for name in SCENES])
    axes.imshow(np.log(ratios), cmap="Blues", vmin=0, vmax=np.log(2.5), aspect="auto")
    for key, record in flags.items():
        text = f"{record['ratio']:.2f}" if record["proven"] else f"needed\n({record['largest_difference']:.0e})"
        colour = "white" if record["ratio"] > 1.7 else "black"
        column, row = parts.index(key.part), SCENES.index(key.scene)
        axes.text(column, row, text, ha="center", va="center", color=colour, fontsize=7.5)
    axes.set_xticks(range(len(parts)), parts, rotation=30, ha="right")
    axes.set_yticks(range(len(SCENES)), [describe_scene(name) for name in SCENES])
    axes.set_title("Each flag alone: times faster (needed: what it would change)")
    axes.grid(visible=False)


STUDY = Study("skip", plan, summarise, {"skip": draw})
