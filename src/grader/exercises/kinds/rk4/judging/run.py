"""The runs of a trial: model, start, timestep, and the force that only mj_forward adds."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from grader.numerics.scene import Scene

Floats = tuple[float, ...]
Matrix = tuple[Floats, ...]


@dataclass(frozen=True)
class Force:
    """The hidden force a sin(P q + V v + w t + p); see driver.py."""

    amplitude: Floats
    position: Matrix
    velocity: Matrix
    phase: Floats
    rate: float


@dataclass(frozen=True)
class Probe:
    """Single steps after the runs of the first case, under a strong force; see driver.py. `starts`: of each step
    `timestep_s`, `time` [s], `qpos`, `qvel`, `act` and `ctrl`."""

    force: Force
    starts: tuple[Mapping[str, Any], ...]


@dataclass(frozen=True)
class Run:
    """One run of the student's step; hashable, so that our own simulation of it is cached."""

    xml: str
    qpos: Floats
    qvel: Floats
    act: Floats
    ctrl: Floats
    timestep_s: float
    steps: int
    force: Force

    def scene(self) -> Scene:
        """Returns the run's scene at its start."""
        return Scene.from_xml(self.xml).at(qpos=self.qpos, qvel=self.qvel, act=self.act, ctrl=self.ctrl)


@dataclass(frozen=True)
class OrderMeasurement:
    """How the order is measured: at which timesteps [s], and how far it may be from the fourth."""

    timesteps_s: Floats
    tolerance: float


@dataclass(frozen=True)
class Problem:
    """The problem of one trial: the run of a case, or, if `asks_order`, its runs at several timesteps. `case` is its
    id, `tolerance` the largest distance from MuJoCo's method; `time_matters`: data.time is checked too. `order` and
    `order_runs` belong to the first case alone. `accepts_other_methods`: any method of fourth order is right."""

    case: str
    run: Run
    tolerance: float
    time_matters: bool
    accepts_other_methods: bool
    order: OrderMeasurement | None = None
    order_runs: tuple[Run, ...] = ()
    asks_order: bool = False
    probe: Probe | None = None

    @property
    def runs(self) -> tuple[Run, ...]:
        """The runs of this trial."""
        return self.order_runs if self.asks_order else (self.run,)

    def inputs(self) -> dict[str, Any]:
        """Returns the inputs of the driver."""
        probe = {"force": vars(self.probe.force), "starts": list(self.probe.starts)} if self.probe else None
        return ({"probe": probe} if probe and not self.asks_order else {}) | {
            "taped": not self.asks_order,
            "model": self.run.xml,
            "start": {name: list(getattr(self.run, name)) for name in ("qpos", "qvel", "act", "ctrl")},
            "force": vars(self.run.force),
            "runs": [{"timestep_s": run.timestep_s, "steps": run.steps} for run in self.runs],
        }


def with_timestep(run: Run, timestep_s: float, steps: int) -> Run:
    """Returns the same run at another timestep."""
    return replace(run, timestep_s=timestep_s, steps=steps)
