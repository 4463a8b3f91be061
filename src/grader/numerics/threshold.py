"""Threshold: a stable and an unstable timestep, both simulated, with horizon, criterion and start.

"Stable" here means: no warning within the horizon. It is a statement about a finite run from one start;
`spectral_limit` is the statement about all time and small amplitudes.
"""

from dataclasses import dataclass
from enum import StrEnum
from math import isfinite, log

from mujoco import mjtWarning

from grader.numerics.linear import RADIUS_NOISE, equilibrium, spectral_radius
from grader.numerics.scene import Scene, State, Vector
from grader.numerics.stepping import STEPS_MAX, advance_coarsely, advance_counting
from grader.numerics.workspace import Workspace

STEPS_MIN = 16
"""With fewer steps in the horizon, a divergence has no time to show; the run then goes on to STEPS_EXTENDED."""

STEPS_EXTENDED = 64
"""Growth of 1.44 a step reaches MuJoCo's limit of 1e10 within this many steps."""

BAD_VALUE = 1e10
"""Source: mjMAXVAL, above which MuJoCo warns."""

DECAYED = 1e-3
"""A run whose accelerations and speeds fell below this share of the first ones needs no second look."""

CLEAR_GROWTH = 1.05
"""Growth a step above which a run without a warning is not called stable. Source: the lesson's servo, which gravity
bounds between 19.983 and 20.009 ms, grows by less than 1.01 there and is stable by the criterion."""

CLEARLY = 2.0
"""And only where linear growth was this many times enough to be noticed in time, on a log scale."""


class Criterion(StrEnum):
    """What ends stability."""

    ANY_WARNING = "any warning, or time running backwards"
    BADQACC = "a BADQACC warning, as the lesson's own script tests it"


class Outcome(StrEnum):
    """What a run at one timestep showed."""

    STABLE = "stable"
    UNSTABLE = "unstable"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Trial:
    """One simulated timestep [s], its outcome, and the reason in words."""

    timestep_s: float
    outcome: Outcome
    reason: str


@dataclass(frozen=True)
class Certificate:
    """Two trials of a claimed bracket: from `start` for `horizon_s` under `criterion`."""

    low: Trial
    high: Trial
    horizon_s: float
    criterion: Criterion
    start: State

    @property
    def holds(self) -> bool | None:
        """Stable at the low end and unstable at the high end; None where either could not be decided."""
        outcomes = (self.low.outcome, self.high.outcome)
        if outcomes == (Outcome.STABLE, Outcome.UNSTABLE):
            return True
        decided = self.low.outcome is Outcome.UNSTABLE or self.high.outcome is Outcome.STABLE
        return False if decided else None


def certify(
    scene: Scene,
    low_s: float,
    high_s: float,
    horizon_s: float = 3.0,
    *,
    integrator: int | None = None,
    criterion: Criterion = Criterion.ANY_WARNING,
) -> Certificate:
    """Simulate both ends of the claim that the limit lies between `low_s` and `high_s`."""
    low, high = (try_timestep(scene, h, horizon_s, integrator=integrator, criterion=criterion) for h in (low_s, high_s))
    return Certificate(low, high, horizon_s, criterion, scene.start)


def try_timestep(
    scene: Scene,
    timestep_s: float,
    horizon_s: float,
    *,
    integrator: int | None = None,
    criterion: Criterion = Criterion.ANY_WARNING,
) -> Trial:
    """Run the scene from its start for `horizon_s` (rounded to whole steps) at `timestep_s`."""
    if not (isfinite(timestep_s) and timestep_s > 0):
        return Trial(timestep_s, Outcome.UNDECIDED, "the timestep is not a positive number of seconds")
    if not (isfinite(horizon_s) and horizon_s > 0):
        return Trial(timestep_s, Outcome.UNDECIDED, "the horizon is not a positive number of seconds")
    if horizon_s / timestep_s > STEPS_MAX:
        return Trial(timestep_s, Outcome.UNDECIDED, f"the horizon takes more than {STEPS_MAX} steps")
    with scene.borrow(timestep_s=timestep_s, integrator=integrator, skip=True) as workspace:
        outcome, reason = _run(scene, workspace, round(horizon_s / timestep_s), criterion)
    return Trial(timestep_s, outcome, reason)


def _run(scene: Scene, workspace: Workspace, steps: int, criterion: Criterion) -> tuple[Outcome, str]:
    any_warning = criterion is Criterion.ANY_WARNING
    advance = advance_coarsely if any_warning else advance_counting(mjtWarning.mjWARN_BADQACC)
    data = workspace.data
    origin = data.qpos.tobytes()
    if advance(workspace, 1) < 1:
        return Outcome.UNDECIDED, "MuJoCo refuses the start itself, which says nothing about the timestep"
    acceleration = _sup(data.qacc)
    if advance(workspace, steps - 1) < steps - 1:
        return Outcome.UNSTABLE, f"a warning within {steps} steps"
    if data.qpos.tobytes() == origin and not data.qvel.any():
        return Outcome.UNDECIDED, "the run starts at rest in an equilibrium, so nothing can grow"
    if steps < STEPS_MIN:
        more = STEPS_EXTENDED - max(steps, 1)
        if advance(workspace, more) < more:
            return (
                Outcome.UNDECIDED,
                f"no warning in the {steps} steps of the horizon, too few to tell: later ones warn",
            )
    if any_warning and _in_motion(workspace, DECAYED * acceleration):
        return _second_look(scene, workspace, steps, acceleration)
    return Outcome.STABLE, f"no warning within {steps} steps"


def _second_look(scene: Scene, workspace: Workspace, steps: int, acceleration: float) -> tuple[Outcome, str]:
    """A run that neither warned nor decayed: do small motions grow, so that something bounds large ones?

    A soft servo under gravity does that: beyond its limit it whirls about for ever, and MuJoCo never warns. Growth
    that MuJoCo could not have noticed within the horizon is no contradiction, nor is that of an equilibrium which
    is unstable in truth, and so at a fraction of the timestep too.
    """
    silent = f"no warning within {steps} steps"
    resting = equilibrium(scene)
    if resting is None:
        return Outcome.STABLE, silent
    timestep_s, integrator = float(workspace.option.timestep), int(workspace.option.integrator)
    radius = spectral_radius(resting, timestep_s=timestep_s, integrator=integrator)
    if radius <= 1 + RADIUS_NOISE:
        return Outcome.STABLE, silent
    reason = f"{silent}, but small motions grow {radius:.6g} times a step"
    growth = max(steps, STEPS_EXTENDED if steps < STEPS_MIN else 0) * log(radius)
    if radius <= CLEAR_GROWTH or growth <= CLEARLY * log(max(BAD_VALUE / acceleration, 1.0)):
        return Outcome.STABLE, reason
    if spectral_radius(resting, timestep_s=timestep_s / 16, integrator=integrator) > 1 + RADIUS_NOISE:
        return Outcome.STABLE, f"{reason}, as they do in truth"
    return Outcome.UNDECIDED, f"{reason}: large ones are bounded"


def _in_motion(workspace: Workspace, acceleration: float) -> bool:
    speed = acceleration * float(workspace.option.timestep)
    return acceleration > 0 and (_sup(workspace.data.qacc) > acceleration or _sup(workspace.data.qvel) > speed)


def _sup(values: Vector) -> float:
    return max(map(abs, values.tolist()), default=0.0)


class Found(StrEnum):
    """What a search came to."""

    BRACKET = "a stable timestep with an unstable one above it"
    ALL_STABLE = "stable over the whole range"
    NONE_STABLE = "unstable from the lower end on"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Window:
    """Timesteps above the threshold that look stable again: the first and last that were found stable [s]."""

    low_s: float
    high_s: float


@dataclass(frozen=True)
class Threshold:
    """The lowest stable/unstable bracket found, and under what it holds; every end was simulated.

    `low` is stable and `high` unstable, both None unless `found` is BRACKET; `reason` says it in words.
    `windows` are seen only if wider than `scan_step_s`. `simulations` counts the runs that the search cost.
    """

    low: Trial | None
    high: Trial | None
    windows: tuple[Window, ...]
    found: Found
    reason: str
    horizon_s: float
    criterion: Criterion
    start: State
    integrator: int
    scan_step_s: float
    simulations: int

    @property
    def bracket_s(self) -> tuple[float, float] | None:
        """(stable, unstable) [s], or None."""
        return (self.low.timestep_s, self.high.timestep_s) if self.low and self.high else None
