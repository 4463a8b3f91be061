"""Energy drift over ten minutes: five integrators on scenes that neither lose nor gain energy."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from matplotlib.figure import Figure

from grader.numerics.accuracy.drift import measure_drift
from grader.numerics.integrators import BY_NAME
from grader.numerics.scene import Scene
from grader.studies.bench.scenes import describe_scene, load_scene
from grader.studies.bench.study import COLOURS, Measurement, Record, Records, Study, select_kind

SCENES = ("double_pendulum", "spinning_body")
TIMESTEPS_S = (0.004, 0.002, 0.001)
MINUTES = {True: 0.5, False: 10.0}
"""Simulated time [min], by whether the run is quick."""

PER_MINUTE = 60
"""Samples of the energy in a minute."""


def compute_depth(scene: Scene) -> float:
    """Returns the energy of the scene's start above that of rest at qpos0 [J], to which errors are relative."""
    with scene.borrow(keep=False) as workspace:
        model, data = workspace.model, workspace.data
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        mujoco.mj_forward(model, data)
        start = float(data.energy.sum())
        mujoco.mj_resetData(model, data)
        mujoco.mj_forward(model, data)
        return start - float(data.energy.sum())


@dataclass(frozen=True)
class Long(Measurement):
    """One run of a scene by an integrator at a timestep [s]."""

    timed = False
    scene: str
    integrator: str
    timestep_s: float

    def measure(self, quick: bool, done: Records) -> Record:
        """Measures the relative error of the energy at every second, up to the first warning and its reset."""
        scene, seconds = load_scene(self.scene), 60 * MINUTES[quick]
        steps = round(seconds / self.timestep_s)
        samples = round(PER_MINUTE * MINUTES[quick])
        run = measure_drift(scene, BY_NAME[self.integrator], self.timestep_s, steps, samples)
        errors = (run.energy_j - run.energy_j[0]) / compute_depth(scene)
        warning = run.warnings[0] if run.warnings else None
        before = run.time_s <= warning.time_s if warning else slice(None)  # what follows is another motion
        return {
            "time_s": run.time_s[before].tolist(),
            "errors": errors[before].tolist(),
            "warning": [warning.kind, warning.time_s] if warning else None,
        }

    def rows(self, record: Record) -> list[Record]:
        """Returns one row a minute."""
        errors = enumerate(find_largest_by_minute(record), 1)
        return [{"minute": minute, "largest_error": error} for minute, error in errors]


def find_largest_by_minute(record: Record) -> list[float]:
    """Returns the largest relative error of the energy in each minute."""
    sizes = np.abs(record["errors"][1:])
    return [float(part.max()) for part in np.array_split(sizes, max(1, round(record["time_s"][-1] / 60)))]


def plan(_quick: bool) -> Sequence[Measurement]:
    """Returns every integrator at every timestep on every scene."""
    return [Long(name, kind, h) for name in SCENES for kind in BY_NAME for h in TIMESTEPS_S]


def summarise(records: Records) -> Record:
    """Per scene, integrator and timestep: errors of the first minute and at the end, and the drift by least squares."""
    scenes: Record = {name: {kind: {} for kind in BY_NAME} for name in SCENES}
    for key, record in select_kind(records, Long).items():
        scenes[key.scene][key.integrator][f"{1e3 * key.timestep_s:g} ms"] = summarise_run(record)
    return {
        "minutes": max(record["time_s"][-1] for record in select_kind(records, Long).values()) / 60,
        "scenes": scenes,
    }


def summarise_run(record: Record) -> Record:
    """`per_minute` is the slope of the relative error, `spread` the standard deviation about that line."""
    minutes, errors = np.array(record["time_s"]) / 60, np.array(record["errors"])
    slope, offset = np.polyfit(minutes, errors, 1).tolist()
    largest = find_largest_by_minute(record)
    return {
        "first_minute": largest[0],
        "largest": max(largest),
        "last": float(errors[-1]),
        "per_minute": slope,
        "spread": float(np.std(errors - slope * minutes - offset)),
        "warning": record["warning"],
    }


def draw(records: Records, _summary: Record) -> Figure:
    """Draws the size of the relative error over time at 2 ms; RK4 at the other timesteps too, dotted."""
    figure = Figure(figsize=(12, 4.6))
    for axes, name in zip(figure.subplots(1, len(SCENES)), SCENES, strict=True):
        for key, record in select_kind(records, Long).items():
            if key.scene != name or (key.timestep_s != 0.002 and key.integrator != "RK4"):
                continue
            minutes, sizes = np.array(record["time_s"][1:]) / 60, np.abs(record["errors"][1:])
            dash = "-" if key.timestep_s == 0.002 else ":"
            label = f"{key.integrator}, {1e3 * key.timestep_s:g} ms"
            axes.plot(minutes, np.maximum(sizes, 1e-16), dash, color=COLOURS[key.integrator], lw=1, label=label)
        labels = {"xlabel": "simulated time [min]", "ylabel": "relative error of the energy"}
        axes.set(yscale="log", title=describe_scene(name), **labels)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=7, frameon=False)
    return figure


STUDY = Study("energy", plan, summarise, {"energy": draw})
