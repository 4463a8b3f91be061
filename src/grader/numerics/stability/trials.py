"""Decides by simulation whether a timestep is stable: whether MuJoCo warns within a horizon. This holds for a finite
run from one start; `linear.find_spectral_limit` decides for unlimited time and small amplitudes."""

from dataclasses import dataclass
from enum import StrEnum
from math import inf, isfinite

from mujoco import FatalError, mjtWarning

from grader.numerics.scene import Scene, State
from grader.numerics.stability.growth import measure_growth
from grader.numerics.stepping import STEPS_MAX, advance_coarsely, make_advance_until
from grader.numerics.workspace import Workspace

STEPS_MIN = 16
"""The fewest steps in which a divergence raises a warning; a shorter run is extended to STEPS_EXTENDED."""

STEPS_EXTENDED = 64
"""Growth by 1.44 per step reaches mjMAXVAL = 1e10 within this many steps."""

DECAYED = 1e-10
"""A run in which the motion of every joint decays to this share of the first is stable; linear growth is not checked.
Source: the lesson's damper leaves 1e-14 after 3 s. MuJoCo rejects a start beyond 1e10, so that less than 1 rad/s2 or
m/s2 remains in any case."""


class Criterion(StrEnum):
    """What counts as instability."""

    ANY_WARNING = "any warning, or time running backwards"
    BADQACC = "a BADQACC warning, which is what the lesson's script counts"


class Stability(StrEnum):
    """The result of a run at one timestep."""

    STABLE = "stable"
    UNSTABLE = "unstable"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Trial:
    """One simulated timestep [s], its stability, and the reason in words."""

    timestep_s: float
    stability: Stability
    reason: str


@dataclass(frozen=True)
class BracketCheck:
    """Trials of both ends of a claimed bracket: from `start` for `horizon_s` under `criterion`."""

    low: Trial
    high: Trial
    horizon_s: float
    criterion: Criterion
    start: State

    @property
    def holds(self) -> bool | None:
        """Whether the low end is stable and the high end unstable; None if undecided."""
        if (self.low.stability, self.high.stability) == (Stability.STABLE, Stability.UNSTABLE):
            return True
        decided = self.low.stability is Stability.UNSTABLE or self.high.stability is Stability.STABLE
        return False if decided else None


def check_bracket(
    scene: Scene, low_s: float, high_s: float, horizon_s: float = 3.0, *, integrator: int | None = None,
    criterion: Criterion = Criterion.ANY_WARNING,
) -> BracketCheck:  # fmt: skip
    """Simulate both ends of a claimed bracket. Raises ValueError if `low_s` is not below `high_s`."""
    if 0 < high_s <= low_s < inf:
        raise ValueError(f"a bracket must ascend: {low_s} s is not below {high_s} s")
    low, high = (try_timestep(scene, h, horizon_s, integrator=integrator, criterion=criterion) for h in (low_s, high_s))
    return BracketCheck(low, high, horizon_s, criterion, scene.start)


def try_timestep(
    scene: Scene, timestep_s: float, horizon_s: float, *, integrator: int | None = None,
    criterion: Criterion = Criterion.ANY_WARNING,
) -> Trial:  # fmt: skip
    """Run the scene from its start for `horizon_s` (rounded to whole steps) at `timestep_s`."""
    if not (isfinite(timestep_s) and timestep_s > 0):
        return Trial(timestep_s, Stability.UNDECIDED, "the timestep is not a positive number of seconds")
    if not (isfinite(horizon_s) and horizon_s > 0):
        return Trial(timestep_s, Stability.UNDECIDED, "the horizon is not a positive number of seconds")
    if horizon_s / timestep_s > STEPS_MAX:
        return Trial(timestep_s, Stability.UNDECIDED, f"the horizon takes more than {STEPS_MAX} steps")
    try:
        with scene.borrow(timestep_s=timestep_s, integrator=integrator, skip=True) as workspace:
            stability, reason = _classify_run(scene, workspace, round(horizon_s / timestep_s), criterion)
    except FatalError as error:  # out of memory, or a part of the model that cannot be linearised
        return Trial(timestep_s, Stability.UNDECIDED, f"MuJoCo failed: {error}")
    return Trial(timestep_s, stability, reason)


def _classify_run(scene: Scene, workspace: Workspace, steps: int, criterion: Criterion) -> tuple[Stability, str]:
    any_warning = criterion is Criterion.ANY_WARNING
    advance = advance_coarsely if any_warning else make_advance_until(mjtWarning.mjWARN_BADQACC)
    data = workspace.data
    origin = data.qpos.tobytes()
    if advance(workspace, 1) < 1:
        return Stability.UNDECIDED, "MuJoCo warns of the start itself, at every timestep"
    first = data.qacc.tolist(), data.qvel.tolist()
    if advance(workspace, steps - 1) < steps - 1:
        return Stability.UNSTABLE, f"a warning within {steps} steps"
    if data.qpos.tobytes() == origin and not data.qvel.any():
        return Stability.UNDECIDED, "the run starts at rest in an equilibrium, so that nothing can grow"
    if steps < STEPS_MIN:
        more = STEPS_EXTENDED - max(steps, 1)
        if advance(workspace, more) < more:
            few = f"no warning in the {steps} steps of the horizon, too few to decide"
            return Stability.UNDECIDED, f"{few}: later ones warn"
    silent = f"no warning within {steps} steps"
    timestep_s = float(workspace.option.timestep)
    motion = _measure_motion(*first, timestep_s)
    if not any_warning or _has_decayed(motion, _measure_motion(data.qacc.tolist(), data.qvel.tolist(), timestep_s)):
        return Stability.STABLE, silent
    growth = measure_growth(
        scene,
        timestep_s=timestep_s,
        integrator=int(workspace.option.integrator),
        steps=max(steps, STEPS_EXTENDED if steps < STEPS_MIN else 0),
        motion=max(motion),
    )
    return Stability.UNDECIDED if growth.bounded else Stability.STABLE, silent + growth.clause


def _measure_motion(accelerations: list[float], speeds: list[float], timestep_s: float) -> list[float]:
    """Returns the motion of each joint as an acceleration [rad/s2, m/s2]: its own plus its speed over one timestep."""
    return [abs(a) + abs(v) / timestep_s for a, v in zip(accelerations, speeds, strict=True)]


def _has_decayed(first: list[float], last: list[float]) -> bool:
    """Whether the motion of every joint decayed; one by one, since a large motion would hide a small one."""
    return all(now <= DECAYED * then for then, now in zip(first, last, strict=True))
