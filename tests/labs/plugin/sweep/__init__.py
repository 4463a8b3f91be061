"""The `sweep` kind: a joint is let go under ever more damping, and the curve shows how far it still swings."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import mujoco
import numpy as np
from pydantic import Field

from grader.labs import (
    Bench,
    Lab,
    LabExample,
    LabKind,
    LabRefused,
    LabSettings,
    Limits,
    Positive,
    Real,
    Remark,
    Wish,
)

SAMPLES_MIN, SAMPLES_MAX = 2, 50

PENDULUM = """<mujoco><worldbody><body pos="0 0 1"><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1"/></body></worldbody></mujoco>"""


class SweepLab(Lab):
    """A joint that is let go from an angle within `start`, `damping` swept between its ends [N m s/rad]."""

    kind: Literal["sweep"]
    model: str
    joint: str
    start: tuple[Real, Real]
    angle: Real
    damping: tuple[Real, Real] = (0.0, 1.0)
    samples: int = Field(default=11, ge=SAMPLES_MIN, le=SAMPLES_MAX)
    seconds: Positive = Field(default=4.0, le=20)


class SweepSettings(LabSettings):
    """The angle at the start [rad], and how many values of the damping are tried."""

    angle: float
    samples: int = Field(ge=SAMPLES_MIN, le=SAMPLES_MAX)


class Sweep(LabKind[SweepLab, SweepSettings]):
    """One run for each value of the damping."""

    lab = SweepLab
    settings = SweepSettings
    limits = Limits(steps=100_000, cpu_s=5.0, answer_bytes=64 << 10)

    def faults(self, lab: SweepLab) -> Iterator[Remark]:
        """Yields ranges that are none, and a start that the learner could not choose."""
        for key, (low, high) in (("start", lab.start), ("damping", lab.damping)):
            if not low < high:
                yield Remark(key, f"runs from {low:g} to {high:g}: write the smaller end first")
        if lab.damping[0] < 0:
            yield Remark("damping.0", "is negative: damping is 0 or more")
        if not lab.start[0] <= lab.angle <= lab.start[1]:
            yield Remark("angle", f"is not from {lab.start[0]:g} to {lab.start[1]:g}, as start says")

    def trials(self, lab: SweepLab) -> Sequence[Mapping[str, Wish]]:
        """Returns both ends of the start, and the most values."""
        return [{"angle": angle, "samples": SAMPLES_MAX} for angle in lab.start]

    def view(self, lab: SweepLab) -> dict[str, Any]:
        """Returns what the page says; neither the model nor the joint."""
        return lab.model_dump(mode="json", include={"start", "angle", "damping", "samples", "seconds"})

    def defaults(self, lab: SweepLab) -> Mapping[str, Wish]:
        """Returns the author's angle and number of values."""
        return {"angle": lab.angle, "samples": lab.samples}

    def run(self, lab: SweepLab, settings: SweepSettings, bench: Bench) -> Mapping[str, Any]:
        """Measures the widest swing in the second half of each run; no number where MuJoCo reset the state."""
        low, high = lab.start
        if not low <= settings.angle <= high:
            raise LabRefused(f"angle must be a number from {low:g} to {high:g} rad.")
        damping = np.linspace(*lab.damping, settings.samples)
        swings = [measure_swing(lab, value, settings.angle, bench) for value in damping]
        return {"angle": settings.angle, "damping": damping, "swings": swings}

    def example(self) -> LabExample:
        """Returns a pendulum."""
        return LabExample(
            {
                "kind": "sweep",
                "title": "How much damping stops a pendulum?",
                "model": "pendulum_of_sweep",
                "joint": "hinge",
                "start": [0.1, 1.5],
                "angle": 1,
                "damping": [0.05, 1.25],
                "seconds": 2,
                "note": "Each point is a run of its own.",
            },
            [{"angle": 0.5}, {"angle": 1, "samples": 3}],
            [{"angle": 2}, {"angle": "1"}, {"angle": True}, {"samples": 2.5}, {"samples": 51}, {"mass": 1}],
            {"models/pendulum_of_sweep.xml": PENDULUM},
        )


def measure_swing(lab: SweepLab, damping: float, angle: float, bench: Bench) -> float:
    """Returns the widest angle in the second half of a run [rad]; NaN where MuJoCo warned. Raises LabRefused for a
    joint that the model lacks."""
    model = bench.load(lab.model)
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, lab.joint)
    if joint < 0 or model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
        raise LabRefused(f"The model has no hinge {lab.joint!r}.")
    at = model.jnt_qposadr[joint]
    model.dof_damping[model.jnt_dofadr[joint]] = damping
    data = mujoco.MjData(model)
    data.qpos[at] = angle
    half = max(1, round(lab.seconds / 2 / model.opt.timestep))
    if bench.step(model, data, half):
        return float("nan")
    widest = 0.0
    for _ in range(half):
        if bench.step(model, data):
            return float("nan")
        widest = max(widest, abs(float(data.qpos[at])))
    return widest
