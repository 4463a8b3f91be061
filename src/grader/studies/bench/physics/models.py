"""What skipping saves on well-known models, and what a run costs beside its steps. The models are Gymnasium's, which
come with the package of that name (a dependency of the tests), the course's, and scenes of this study with contacts."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest.mock import patch

import mujoco
import numpy as np
from matplotlib.figure import Figure
from mujoco.rollout import rollout as roll_out

from grader.numerics.integrators import BY_NAME
from grader.numerics.recording import PHYSICS
from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import FULL_STATE, Scene
from grader.numerics.stepping import CHUNK, GROWTH, STEPS_MAX
from grader.numerics.workspace import BARE_AFTER
from grader.settings import Settings
from grader.studies.bench.scenes import load_scene
from grader.studies.bench.study import Measurement, Record, Records, Study, select_kind
from grader.studies.bench.timing import TimeRatio, measure_pairs

COURSE = ("pendulum", "pendulum_servo", "double_pendulum", "tumbling_box")
OURS = ("cube", "pile")
STEPS = 600
CALLS = 2
"""Calls into C of a run of STEPS steps: CHUNK and the rest."""

RECORDED = 8
"""Runs that are recorded together."""

BUDGET_S = {True: 0.05, False: 0.3}
"""CPU time of a comparison [s], by whether the run is quick."""


def find_gymnasium_models() -> dict[str, Path]:
    """Gymnasium's MJCF files by name; none where the package is not installed."""
    spec = find_spec("gymnasium")
    if spec is None or spec.origin is None:
        return {}
    folder = Path(spec.origin).parent / "envs" / "mujoco" / "assets"
    return {f"{path.stem} (Gymnasium)": path for path in sorted(folder.glob("*.xml"))}


@cache
def load_model_scene(name: str) -> Scene:
    """A model by name, after so many steps that runs use it without its visuals. Raises KeyError for an unknown one."""
    if name in OURS:
        scene = load_scene(name)
    else:
        paths = find_gymnasium_models() | {
            f"{model} (course)": Settings().content / "models" / f"{model}.xml" for model in COURSE
        }
        scene = Scene.from_xml(paths[name].read_text(encoding="utf-8"))
    simulate(scene, steps=BARE_AFTER, every=STEPS_MAX)
    return scene


def run_scene(scene: Scene, *, skip: bool) -> Rollout:
    """STEPS steps that keep start and end, with the model's own timestep and integrator."""
    return simulate(scene, steps=STEPS, every=STEPS_MAX, skip=skip)


def are_bits_same(scene: Scene) -> bool:
    """Whether every state of the run is bitwise the same with and without skipping, under each integrator."""
    codes = [integrator.code for integrator in BY_NAME.values()]
    whole, less = (
        [simulate(scene, steps=STEPS, integrator=code, skip=skip).states.tobytes() for code in codes]
        for skip in (False, True)
    )
    return whole == less


def measure_nstep(scene: Scene, budget_s: float) -> TimeRatio:
    """CPU time of one call of mj_step with nstep, after a reset to the start, over that of our run."""
    with scene.borrow(keep=False) as workspace:
        model, data = workspace.model, workspace.data

    def loop() -> None:
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, scene.start_vector, FULL_STATE)
        mujoco.mj_step(model, data, STEPS)

    return measure_pairs(loop, lambda: run_scene(scene, skip=True), budget_s)


def measure_recording(scene: Scene, budget_s: float) -> TimeRatio:
    """CPU time of RECORDED runs that mujoco.rollout records in one call, over that of as many of ours that keep every
    step. All run in the calling thread, from the same start."""
    states = np.empty((RECORDED, STEPS, mujoco.mj_stateSize(scene.model, PHYSICS)))
    with scene.borrow(keep=False) as workspace:
        model, data = workspace.model, workspace.data
        start = np.empty(states.shape[2])
        mujoco.mj_getState(model, data, start, PHYSICS)

    def batch() -> None:
        roll_out(model, data, np.tile(start, (RECORDED, 1)), nstep=STEPS, state=states)

    def ours() -> None:
        for _ in range(RECORDED):
            simulate(scene, steps=STEPS)

    return measure_pairs(batch, ours, budget_s)


def measure_overhead(scene: Scene, budget_s: float) -> TimeRatio:
    """CPU time of a reset to the start over that of a run whose steps do nothing but advance the clock. Both call that
    step as often. The difference of the times is what a run costs beside its steps and the reset."""
    assert CHUNK < STEPS <= CHUNK + GROWTH * CHUNK, "the run is of two chunks"
    with scene.borrow(keep=False) as workspace:
        model, data = workspace.model, workspace.data

    def tick(_model: mujoco.MjModel, data: mujoco.MjData, _nstep: int = 1) -> None:
        data.time += 1.0

    def reset() -> None:
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, scene.start_vector, FULL_STATE)
        for _ in range(CALLS):
            tick(model, data)

    with patch.object(mujoco, "mj_step", tick):
        return measure_pairs(reset, lambda: run_scene(scene, skip=True), budget_s)


@dataclass(frozen=True)
class Model(Measurement):
    """One model."""

    model: str

    def measure(self, quick: bool, done: Records) -> Record:
        """What is needed, whether the bits stay, and the times of skipping, of loops in C and beside the steps."""
        scene, budget_s = load_model_scene(self.model), BUDGET_S[quick]
        skipping = measure_pairs(lambda: run_scene(scene, skip=False), lambda: run_scene(scene, skip=True), budget_s)
        fixed = measure_overhead(scene, budget_s)
        return {
            "degrees": int(scene.model.nv),
            "needed": [need.part for need in scene.needs if need.needed and need.flag],
            "bitwise": are_bits_same(scene),
            "diverged_at_step": run_scene(scene, skip=True).diverged_at_step,
            "skipping": asdict(skipping),
            "nstep": asdict(measure_nstep(scene, budget_s)),
            "recording": asdict(measure_recording(scene, budget_s)),
            "fixed_us": 1e6 * (fixed.yardstick_s - fixed.seconds),
            "reset_us": 1e6 * fixed.seconds,
        }


def plan(_quick: bool) -> Sequence[Measurement]:
    """Returns every model that is here."""
    return [Model(name) for name in (*find_gymnasium_models(), *(f"{model} (course)" for model in COURSE), *OURS)]


def summarise(records: Records) -> Record:
    """Per model what the table needs, and the medians with and without constraints."""
    models = {key.model: summarise_model(record) for key, record in select_kind(records, Model).items()}
    groups: dict[bool, list[float]] = {True: [], False: []}
    for model in models.values():
        groups["constraints" in model["needed"]].append(model["skipping"]["ratio"])
    return {
        "steps": STEPS,
        "models": models,
        "median_constrained": float(np.median(groups[True])),
        "median_free": float(np.median(groups[False])),
    }


def summarise_model(record: Record) -> Record:
    """Returns the record, of its times only ratios and their confidence intervals."""
    ratios = ("skipping", "nstep", "recording")
    apart = {name: {"ratio": record[name]["ratio"], "interval": record[name]["interval"]} for name in ratios}
    kept = ("degrees", "needed", "bitwise", "diverged_at_step", "fixed_us", "reset_us")
    return {name: record[name] for name in kept} | apart


def draw(_records: Records, summary: Record) -> Figure:
    """How many times faster skipping makes a run, with its interval; models with constraints in another colour."""
    figure = Figure(figsize=(9, 5.6))
    axes: Any = figure.subplots()
    ordered = sorted(summary["models"].items(), key=lambda item: item[1]["skipping"]["ratio"])
    for row, (_, record) in enumerate(ordered):
        ratio, (low, high) = record["skipping"]["ratio"], record["skipping"]["interval"]
        colour = "#bb5566" if "constraints" in record["needed"] else "#335599"
        axes.errorbar(ratio, row, xerr=[[ratio - low], [high - ratio]], fmt="o", color=colour, ms=4)
    axes.axvline(1, color="black", lw=0.8)
    axes.set_yticks(range(len(ordered)), [name for name, _ in ordered])
    axes.set_xlabel("times faster by skipping, 95 % interval of the median (red: constraints are needed)")
    return figure


STUDY = Study("models", plan, summarise, {"models": draw})
