"""Threshold: a stable and an unstable timestep, both simulated, with horizon, criterion and start.

"Stable" here means: no warning within the horizon. It is a statement about a finite run from one start;
`spectral_limit` is the statement about all time and small amplitudes.
"""

from dataclasses import dataclass
from enum import StrEnum
from math import inf, isfinite

from mujoco import FatalError, mjtWarning

from grader.numerics.growth import growth_at_rest
from grader.numerics.scene import Scene, State
from grader.numerics.stepping import STEPS_MAX, advance_coarsely, advance_counting
from grader.numerics.workspace import Workspace

STEPS_MIN = 16
"""With fewer steps in the horizon, a divergence has no time to show; the run then goes on to STEPS_EXTENDED."""

STEPS_EXTENDED = 64
"""Growth of 1.44 a step reaches MuJoCo's limit of 1e10 within this many steps."""

DECAYED = 1e-10
"""A run in which every joint's motion fell below this share of its first one needs no second look.

Source: the lesson's damper leaves 1e-14 after 3 s; MuJoCo takes no start beyond 1e10, so that less than 1 rad/s2 or
m/s2 is left in any case.
"""


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
    """Simulate both ends of the claim that the limit lies between `low_s` and `high_s`; ValueError if reversed."""
    if 0 < high_s <= low_s < inf:
        raise ValueError(f"a bracket goes up: {low_s} s is not below {high_s} s")
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
    try:
        with scene.borrow(timestep_s=timestep_s, integrator=integrator, skip=True) as workspace:
            outcome, reason = _run(scene, workspace, round(horizon_s / timestep_s), criterion)
    except FatalError as error:  # memory that is too small, or a part of the model that cannot be linearised
        return Trial(timestep_s, Outcome.UNDECIDED, f"MuJoCo gives up: {error}")
    return Trial(timestep_s, outcome, reason)


def _run(scene: Scene, workspace: Workspace, steps: int, criterion: Criterion) -> tuple[Outcome, str]:
    any_warning = criterion is Criterion.ANY_WARNING
    advance = advance_coarsely if any_warning else advance_counting(mjtWarning.mjWARN_BADQACC)
    data = workspace.data
    origin = data.qpos.tobytes()
    if advance(workspace, 1) < 1:
        return Outcome.UNDECIDED, "MuJoCo refuses the start itself, which says nothing about the timestep"
    first = data.qacc.tolist(), data.qvel.tolist()
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
    silent = f"no warning within {steps} steps"
    timestep_s = float(workspace.option.timestep)
    motion = _motion(*first, timestep_s)
    if not any_warning or _calm(motion, _motion(data.qacc.tolist(), data.qvel.tolist(), timestep_s)):
        return Outcome.STABLE, silent
    look = growth_at_rest(
        scene,
        timestep_s=timestep_s,
        integrator=int(workspace.option.integrator),
        steps=max(steps, STEPS_EXTENDED if steps < STEPS_MIN else 0),
        motion=max(motion),
    )
    return Outcome.UNDECIDED if look.bounded else Outcome.STABLE, silent + look.words


def _motion(accelerations: list[float], speeds: list[float], timestep_s: float) -> list[float]:
    """How much each joint moves, as an acceleration [rad/s2, m/s2]: its own, and its speed over one step."""
    return [abs(a) + abs(v) / timestep_s for a, v in zip(accelerations, speeds, strict=True)]


def _calm(first: list[float], last: list[float]) -> bool:
    """Joint by joint, for a large motion of one would hide that of another."""
    return all(now <= DECAYED * then for then, now in zip(first, last, strict=True))


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
