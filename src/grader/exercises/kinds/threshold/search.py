"""Names the mistake that the runs of a script show.

The trace is a claim: what is said here explains a verdict and decides nothing.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isnan

from mujoco import mjtWarning

from grader.exercises.kind import Judged
from grader.exercises.kinds.threshold.judge import Bracket, Claim, NoLimit, Unreadable
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.exercises.kinds.threshold.recorded import Run, Search, read_search
from grader.exercises.trace import Trace
from grader.numerics.integrators import BY_CODE

UNSTABLE = {int(getattr(mjtWarning, f"mjWARN_{name}")): name for name in ("BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")}
"""The kinds of warning that make a run unstable, by their places in data.warning."""

CLOSE = 1e-6
"""Relative difference below which two timesteps are the same."""

SHORT = 0.7
"""A run of less than this share of the horizon is too short; right scripts run a little less or much more."""

REPEATED = 3
"""Runs of one step with the same timestep that make a pattern."""

ROUNDED_TO = (2, 3)
"""Decimals of a second to which a rounded answer may be off by more than is allowed."""

FAR = 5.0
"""Runs at more than so many times the longest timestep of the search are runs in another unit."""

WORDS = {
    "actuator_gainprm": "the servo's gain",
    "actuator_biasprm": "the servo's bias (kp and kv)",
    "actuator_gear": "the gear",
    "body_mass": "the mass",
    "body_inertia": "the inertia",
    "body_ipos": "the centre of mass",
    "dof_damping": "the joint's damping",
    "dof_armature": "the armature",
    "jnt_stiffness": "the joint's stiffness",
    "gravity": "gravity",
    "solver": "the constraint solver",
    "disableflags": "what is disabled",
    "autoreset": "the automatic reset",
}


@dataclass(frozen=True)
class Seen:
    """One wrong claim, with what its trial did. `shown` numbers may be told: those of a visible trial."""

    parameters: ThresholdParameters
    cell: Cell
    claim: Claim
    search: Search
    trace: Trace
    shown: bool

    def at(self, seconds: float) -> str:
        """Where a timestep is, for the student; no number of a hidden trial."""
        return f"At {1e3 * seconds:.4g} ms" if self.shown else "At a timestep of a hidden case"

    def figures(self, number: float) -> str:
        """A number of a run, for the student; of a hidden trial to two figures, which the runner lets through."""
        return f"{number:.4g}" if self.shown else f"{number:.2g}"

    @property
    def called_stable(self) -> list[Run]:
        """The runs at timesteps that the claim calls stable, the largest first."""
        runs = self.search.runs
        if isinstance(self.claim, Bracket):
            runs = tuple(run for run in runs if run.timestep_s <= self.claim.low * (1 + CLOSE))
        return sorted(runs, key=lambda run: -run.timestep_s)

    @property
    def called_unstable(self) -> list[Run]:
        """The runs at timesteps that the claim calls unstable, the smallest first."""
        if not isinstance(self.claim, Bracket):
            return []
        found = (run for run in self.search.runs if run.timestep_s >= self.claim.high * (1 - CLOSE))
        return sorted(found, key=lambda run: run.timestep_s)


Rule = Callable[[Seen], str | None]


def printed_only(seen: Seen) -> str | None:
    """The result is printed and not returned."""
    if not isinstance(seen.claim, NoLimit) or seen.trace.printed is None or not seen.search.runs:
        return None
    number = re.search(r"\d+\.\d+", seen.trace.printed)
    if seen.shown and number is None:
        return None
    what = f" ({number[0]})" if number else ""
    return f"Your function prints its result{what} and returns None. Return it: return h_stable, h_unstable."


def never_stepped(seen: Seen) -> str | None:
    """None was returned without a step."""
    if seen.search.total or seen.search.others or not isinstance(seen.claim, NoLimit):
        return None
    if seen.search.created:
        return (
            "Your function returned None without a single step: it makes an MjData, but mj_step is never called. Print "
            "how many steps your loop takes (a run's length divided by the timestep); mj_forward moves nothing."
        )
    return (
        "Your function returned None without a single step. Step the model with mujoco.mj_step (mj_forward moves "
        "nothing) at several timesteps before you answer."
    )


def odd_return(seen: Seen) -> str | None:
    """Something else than two numbers, one number or None was returned."""
    if not isinstance(seen.claim, Unreadable) or not (returned := seen.trace.returned):
        return None
    given = returned[0]
    if given.type in ("tuple", "list") and "NoneType" in given.items:
        return (
            f"Your function returns a {given.type} that holds None: where nothing is unstable return None alone, else "
            "two numbers, (h_stable, h_unstable)."
        )
    many = f" of {given.shape[0]} items" if given.type in ("tuple", "list") and given.shape else ""
    what = f"a value of type {given.type}{many}" if given.type else "something else"
    return f"Your function returns {what}: it must return (h_stable, h_unstable) in seconds, or None."


def far_beyond(seen: Seen) -> str | None:
    """The timesteps that were run are no seconds."""
    longest_s = seen.parameters.search_s[1]
    lowest = min((run.timestep_s for run in seen.search.runs), default=0.0)
    if lowest < FAR * longest_s:
        return None
    first = f", such as {seen.search.runs[0].timestep_s:.4g} s" if seen.shown else ""
    return (
        f"All your runs use timesteps far beyond {1e3 * longest_s:g} ms{first}. model.opt.timestep is in seconds: set "
        "it to the timestep itself, not to a rate (1 / h) or to milliseconds."
    )


def reset_each_step(seen: Seen) -> str | None:
    """The data is created or reset before every step."""
    runs = seen.search.runs
    if len(runs) < REPEATED or seen.search.total == len(runs) or len({run.timestep_s for run in runs}) > 1:
        return None
    if any(run.steps != 1 for run in runs if not run.raised):
        return None
    return (
        "You reset the data before every step, so that each run is one step long and begins again. Reset it and set "
        "the start once, before the loop over the steps."
    )


def actuators_off(seen: Seen) -> str | None:
    """The servo is switched off in every run, and nothing replaces it: then no run warns."""
    runs, differs = seen.search.runs, seen.search.differs
    if not runs or any(run.warned for run in runs):
        return None
    if not all(run.model < len(differs) and "actuation" in differs[run.model] for run in runs):
        return None
    return (
        "The actuators of your model are switched off (mjDSBL_ACTUATION), and without its servo nothing is unstable. "
        "Leave that flag alone; the automatic reset after a warning is mjDSBL_AUTORESET."
    )


def rolled_out(seen: Seen) -> str | None:
    """The runs are those of mujoco.rollout."""
    if seen.search.runs or "rollout" not in seen.search.others:
        return None
    return (
        "Your runs are those of mujoco.rollout, and you found nothing unstable: after a warning MuJoCo resets the "
        "state, so that it never holds nan. Look whether the time, the first number of each state, stops growing."
    )


def linearised(seen: Seen) -> str | None:
    """A step is linearised, and no run made."""
    if seen.search.runs or "mjd_transitionFD" not in seen.search.others:
        return None
    return (
        "You linearise a step with mjd_transitionFD, and found nothing unstable: its eigenvalues are complex, and the "
        "motion grows where the absolute value of one of them passes 1. Compare np.abs(eigenvalues).max() with 1, and "
        "set timestep and integrator before."
    )


def places_in_a_list(seen: Seen) -> str | None:
    """Whole numbers where timesteps of a fraction of a second were run."""
    longest_s = seen.parameters.search_s[1]
    if not isinstance(seen.claim, Bracket) or not seen.search.runs:
        return None
    if any(end != int(end) for end in seen.claim.given) or max(run.timestep_s for run in seen.search.runs) > longest_s:
        return None
    given = f" ({' and '.join(f'{end:g}' for end in seen.claim.given)})" if seen.shown else ""
    return (
        f"Your answer{given} is of whole numbers, but your runs use timesteps of fractions of a second. Return the "
        "timesteps themselves, not their places in a list, nor the number of a run."
    )


def one_timestep(seen: Seen) -> str | None:
    """The timestep that is set never reaches the model that is stepped."""
    runs = seen.search.runs
    if not runs or any(abs(run.timestep_s - runs[0].timestep_s) > CLOSE * runs[0].timestep_s for run in runs):
        return None
    if len(runs) == 1 and runs[0].timestep_s != float(seen.cell.scene.model.opt.timestep):
        return None
    used = "Your only run" if len(runs) == 1 else "Every run"
    return (
        f"{used} used a timestep of {seen.figures(1e3 * runs[0].timestep_s)} ms: the model that you step is not one "
        "whose timestep you set. Set opt.timestep on the very model that you pass to mj_step."
    )


def never_reset(seen: Seen) -> str | None:
    """One data serves all timesteps, and is never reset."""
    runs = seen.search.runs
    if len(runs) != 1 or seen.search.total != 1 or abs(runs[0].last_timestep_s - runs[0].timestep_s) <= CLOSE:
        return None
    if runs[0].raised:
        return (
            "You use one data for every timestep and never reset it. After the first unstable run its warning counters "
            "stay, so that every later run counts as unstable: call mujoco.mj_resetData before each run."
        )
    return (
        "You use one data for every timestep and never reset it, so that each run goes on where the last one ended. "
        "Call mujoco.mj_resetData before each run, and set the start again."
    )


def other_integrator(seen: Seen) -> str | None:
    """The integrator that was asked for is never used."""
    used = {run.integrator for run in seen.search.runs}
    if len(used) != 1 or seen.cell.integrator.code in used or not used <= set(BY_CODE):
        return None
    name = BY_CODE[used.pop()].name
    return (
        f"Your runs used {name} where another integrator was asked for. "
        "Set model.opt.integrator = integrator on the model that you step."
    )


def other_start(seen: Seen) -> str | None:
    """Runs do not begin where they should."""
    if len(seen.parameters.start) != 1 or seen.cell.scene.model.nq != 1 or not seen.search.runs:
        return None
    ((joint, value),) = seen.parameters.start.items()
    runs = seen.search.runs
    wrong = [run for run in runs if abs(run.qpos - value) > 1e-9 or run.qvel != 0]
    if len(wrong) == len(runs) and all((run.qpos, run.qvel) == (0, 0) for run in runs):
        return (
            f"Your runs start with {joint} at 0, where nothing moves, so that nothing can grow. Start with {joint} at "
            f"{value:g} rad: set data.qpos[0] = {value:g} each time you have created or reset the data."
        )
    if len(wrong) == len(runs) and len({(run.qpos, run.qvel) for run in runs}) == 1:
        speed = f" and a speed of {seen.figures(runs[0].qvel)} rad/s" if runs[0].qvel else ""
        return (
            f"Your runs start with {joint} at {seen.figures(runs[0].qpos)} rad{speed}, not at {value:g} rad at rest. "
            f"Set data.qpos[0] = {value:g}, and leave data.qvel at 0."
        )
    if wrong and wrong[0] is not runs[0]:
        return (
            "Only your first run starts as it should; later ones begin elsewhere. Reset the data before each run, and "
            f"set data.qpos[0] = {value:g} after that."
        )
    return None


def other_target(seen: Seen) -> str | None:
    """The servo's target is not the one of the exercise."""
    targets = {run.ctrl for run in seen.search.runs}
    expected = float(seen.cell.scene.start.ctrl[0]) if seen.cell.scene.model.nu else 0.0
    if len(targets) != 1 or expected in targets:
        return None
    return (
        f"Your runs set data.ctrl[0] to {seen.figures(targets.pop())}, which is the servo's target; it should "
        f"stay {expected:g}, so that the servo pulls the joint back from its start."
    )


def turned_round(seen: Seen) -> str | None:
    """The search goes on upwards from unstable timesteps."""
    runs = seen.search.runs
    pairs = [(one, other) for one, other in pairwise(runs) if one.raised and other.timestep_s != one.timestep_s]
    upwards = sum(other.timestep_s > one.timestep_s for one, other in pairs)
    if upwards < 3 or upwards < len(pairs) - 1 or not isinstance(seen.claim, Bracket):
        return None
    return (
        "After an unstable run your search goes on upwards, so that it ends at the upper end. Where the middle is "
        "unstable it is the new upper end, where it is stable the new lower end."
    )


def too_coarse(seen: Seen) -> str | None:
    """The last stable and the first unstable timestep lie far apart."""
    runs, allowed_s = seen.search.runs, seen.parameters.width_s
    if seen.search.total > len(runs) or not isinstance(seen.claim, Bracket):
        return None
    above = min((run.timestep_s for run in runs if run.raised), default=0.0)
    below = max((run.timestep_s for run in runs if not run.raised and run.timestep_s < above), default=0.0)
    ends = seen.claim.given
    if not below or above - below <= 1.5 * allowed_s or min(ends) < below or max(ends) > above:
        return None
    shown = f" ({1e3 * below:.4g} and {1e3 * above:.4g} ms)" if seen.shown else ""
    return (
        f"Your search is too coarse: its last stable and its first unstable timestep{shown} are more than "
        f"{1e3 * allowed_s:g} ms apart, and the limit lies anywhere between. Go on halving between the two."
    )


def rounded_ends(seen: Seen) -> str | None:
    """The answer holds the ends of the search, or their middle, rounded to steps as wide as what is asked for."""
    if not isinstance(seen.claim, Bracket) or seen.search.total > len(seen.search.runs):
        return None
    above = min((run.timestep_s for run in seen.search.runs if run.raised), default=0.0)
    below = max((run.timestep_s for run in seen.search.runs if not run.raised and run.timestep_s < above), default=0.0)
    found = (below, above) if seen.claim.number is None else ((below + above) / 2,)
    if not below or all(abs(one - end) <= CLOSE * end for one, end in zip(found, seen.claim.given, strict=True)):
        return None
    for decimals in ROUNDED_TO:
        if [round(one, decimals) for one in found] == seen.claim.given:
            return (
                f"Your answer is rounded to {decimals} decimals of a second, in steps of {1e3 * 10**-decimals:g} ms: "
                "the timesteps that you ran are finer. Return them as they are, and round only what you print."
            )
    return None


def start_no_number(seen: Seen) -> str | None:
    """The start is nan: None was assigned, or something that is no number."""
    if not any(isnan(run.qpos) or isnan(run.qvel) for run in seen.search.runs):
        return None
    return (
        "A run starts with nan in data.qpos or data.qvel: None, or something that is no number, was assigned to it. "
        "Print what you assign."
    )


def too_short(seen: Seen) -> str | None:
    """Runs that are called stable end before the horizon."""
    horizon_s = seen.parameters.horizon_s
    calm = [run for run in seen.called_stable if not run.raised and run.steps > 0]
    if not calm or calm[0].lasted_s >= SHORT * horizon_s:
        return None
    whole = [run for run in seen.search.runs if not run.raised]
    if all(run.steps == 1 for run in whole):
        return (
            f"Each of your runs ends after its first step: a return that stands inside the loop over the steps ends "
            f"it. Step until data.time reaches {horizon_s:g} s, and return after the loop."
        )
    reach = f"Step until data.time reaches {horizon_s:g} s."
    if len({run.timestep_s for run in whole}) > 1 and len({run.steps for run in whole}) == 1:
        example = f", {calm[0].lasted_s:.2g} s at {1e3 * calm[0].timestep_s:.4g} ms" if seen.shown else ""
        return f"Your runs are too short: each takes {calm[0].steps} steps{example}, not {horizon_s:g} s. {reach}"
    example = f", {calm[0].steps} steps at {1e3 * calm[0].timestep_s:.4g} ms" if seen.shown else ""
    length = f"{calm[0].lasted_s:.2g} s{example}"
    return f"Your runs are too short: {length}, where a slow divergence does not show yet. {reach}"


def overlooked(seen: Seen) -> str | None:
    """A run with a warning counts as stable."""
    missed = next((run for run in seen.called_stable if any(run.warned >> bit & 1 for bit in UNSTABLE)), None)
    if missed is None:
        return None
    kinds = " and ".join(name for bit, name in UNSTABLE.items() if missed.warned >> bit & 1)
    at, differs = seen.at(missed.timestep_s), seen.search.differs
    if seen.search.cleared:
        return (
            f"{at} MuJoCo raised {kinds}, and your answer calls that timestep stable. Your script resets the data "
            "after the run, which sets data.warning back to 0: read the numbers of BADQPOS, BADQVEL and BADQACC before."
        )
    if missed.model < len(differs) and "autoreset" in differs[missed.model]:
        return (
            f"{at} MuJoCo raised {kinds}, and your answer calls that timestep stable. You switched the automatic reset "
            "off, so that data.time never falls back: look at data.warning[...].number of BADQPOS, BADQVEL and BADQACC."
        )
    return (
        f"{at} MuJoCo raised {kinds} and reset the state, and your answer calls that "
        "timestep stable. After the steps, look at data.warning[...].number of BADQPOS, BADQVEL and BADQACC, or at "
        "data.time falling back."
    )


def of_none(rule: Rule) -> Rule:
    """Restricts a rule to the claim that nothing is unstable."""
    return lambda seen: rule(seen) if isinstance(seen.claim, NoLimit) else None


def own_criterion(seen: Seen) -> str | None:
    """A run without a warning counts as unstable."""
    calm = next((run for run in seen.called_unstable if not run.raised), None)
    if calm is None:
        return None
    horizon_s = seen.parameters.horizon_s
    early = calm.lasted_s < 0.9 * horizon_s and seen.shown
    when = f" within {calm.lasted_s:.2g} s, where you ended it" if early else f" within {horizon_s:g} s"
    return (
        f"{seen.at(calm.timestep_s)} your run raised no warning{when}, and you call it unstable. Here a run is "
        "unstable when MuJoCo raises a warning, not when the motion is large or inaccurate."
    )


def counters_stood(seen: Seen) -> str | None:
    """Warnings of an earlier run are counted again."""
    if not any(run.stood for run in seen.called_unstable):
        return None
    return (
        "Warnings of an earlier run still stood in data.warning when a run began, so that it counts as unstable. "
        "Call mujoco.mj_resetData before each run: it clears them."
    )


def never_lowered(seen: Seen) -> str | None:
    """Once a run was unstable, all smaller timesteps count as unstable, down to the shortest."""
    runs, parameters = seen.search.runs, seen.parameters
    first = next((index for index, run in enumerate(runs) if run.raised), len(runs))
    calm = [run for run in runs[first:] if not run.raised]
    if not isinstance(seen.claim, Bracket) or len(calm) < REPEATED or seen.search.total > len(runs):
        return None
    if any(run.lasted_s < 0.9 * parameters.horizon_s for run in calm):
        return None
    falls = all(after.timestep_s < before.timestep_s for before, after in pairwise(runs[first:]))
    if not falls or seen.claim.high > calm[-1].timestep_s * (1 + CLOSE):
        return None
    return (
        "After your first unstable run every later one counts as unstable, although MuJoCo raised no warning in most "
        "of them. What remembers a warning, a flag or a counter, must be set back at the start of each run."
    )


def value_and_uncertainty(seen: Seen) -> str | None:
    """A timestep and a number that is smaller than any timestep of a run."""
    if not isinstance(seen.claim, Bracket) or seen.claim.number is not None or not seen.search.runs:
        return None
    tried = [run.timestep_s for run in seen.search.runs]
    if not 0 <= seen.claim.high < min(*tried, seen.parameters.width_s) <= seen.claim.low <= max(tried):
        return None
    return (
        "Your second number is smaller than every timestep that you ran: it seems to be the uncertainty of the first. "
        "Return the two ends of the bracket, (h_stable, h_unstable)."
    )


def edge_of_search(seen: Seen) -> str | None:
    """The search does not reach as far as it should."""
    runs = seen.search.runs
    if len(runs) < (1 if isinstance(seen.claim, NoLimit) else 2):
        return None
    lowest, highest = (find(run.timestep_s for run in runs) for find in (min, max))
    shortest_s, longest_s = seen.parameters.search_s
    if seen.search.total > len(runs):
        return None
    top = highest < 0.95 * longest_s and not any(run.raised for run in runs if run.timestep_s == highest)
    if top and (isinstance(seen.claim, NoLimit) or (seen.called_stable and len(seen.called_unstable) < 2)):
        return (
            f"Your search ends at {seen.figures(1e3 * highest)} ms, where nothing is unstable yet. "
            f"Search up to {1e3 * longest_s:g} ms."
        )
    bottom = lowest > 1.05 * shortest_s and all(run.raised for run in runs if run.timestep_s == lowest)
    if bottom and isinstance(seen.claim, Bracket) and seen.claim.low <= lowest * (1 + CLOSE):
        return (
            f"Your search begins at {seen.figures(1e3 * lowest)} ms, which is unstable already. "
            f"Begin at {1e3 * shortest_s:g} ms."
        )
    return None


def other_model(seen: Seen) -> str | None:
    """The model that is stepped is not the given one."""
    used = {run.model for run in seen.search.runs}
    if len(used) != 1 or not (index := used.pop()) < len(seen.search.differs) or not seen.search.differs[index]:
        return None
    names = [WORDS.get(name, name) for name in seen.search.differs[index]][:3]
    return (
        f"The model that you step is not the one you were given: {' and '.join(names)} "
        f"{'differs' if len(names) == 1 else 'differ'}. Change nothing but the timestep and the integrator."
    )


def nothing_simulated(seen: Seen) -> str | None:
    """Answers without a step, some of them numbers."""
    if seen.search.total or seen.search.others or isinstance(seen.claim, Unreadable):
        return None
    return (
        "Nothing was simulated: your answer comes from a formula or was written down. "
        "Step the model at several timesteps, and narrow the bracket down."
    )


def ends_untried(seen: Seen) -> str | None:
    """An end of the bracket at which nothing was run."""
    if not isinstance(seen.claim, Bracket) or seen.claim.number is not None or not seen.search.runs:
        return None
    only = seen.search.runs[0]
    if seen.search.total > len(seen.search.runs):
        return None
    if len(seen.search.runs) == 1 and only.last_timestep_s != only.timestep_s:
        return None
    tried = [run.timestep_s for run in seen.search.runs]
    for what, end in (("stable", seen.claim.low), ("unstable", seen.claim.high)):
        if not any(abs(h - end) <= 1e-3 * end for h in tried):
            if any(abs(1e3 * h - end) <= 1e-3 * end for h in tried):
                return (
                    f"The {what} end of your bracket is a thousand times one of your timesteps: it is in milliseconds. "
                    "Return both ends in seconds."
                )
            place = f"{1e3 * end:.4g} ms" if seen.shown else "a timestep"
            found = any(run.raised for run in seen.search.runs)
            more = (
                ". Return the last timesteps that you found stable and unstable."
                if found
                else f", and none of your runs was unstable. Run {1e3 * seen.parameters.search_s[1]:g} ms first, and "
                "return None where that is stable."
            )
            return f"You report {place} as {what}, but never ran it{more}"
    return None


def wrong_way_round(seen: Sequence[Seen]) -> str | None:
    """Runs with a warning count as stable in some trials, and runs without one as unstable in all others."""
    nothing = [one for one in seen if isinstance(one.claim, NoLimit)]
    numbers = [one for one in seen if one not in nothing]
    if not nothing or not numbers or not all(one.search.runs for one in seen):
        return None
    if not all(run.raised for one in nothing for run in one.search.runs):
        return None
    if any(run.raised for one in numbers for run in one.search.runs) or not all(one.called_unstable for one in numbers):
        return None
    return (
        "Your test is the wrong way round: a run in which MuJoCo raised a warning counts as stable, and one without a "
        "warning as unstable. Turn the condition round that your function returns."
    )


CERTAIN: tuple[Rule, ...] = (
    printed_only,
    never_stepped,
    odd_return,
    far_beyond,
    reset_each_step,
    actuators_off,
    one_timestep,
    never_reset,
    other_integrator,
    start_no_number,
    other_start,
    other_target,
    too_short,
    rounded_ends,
    of_none(rolled_out),
    of_none(linearised),
    of_none(overlooked),
    of_none(edge_of_search),
)
"""What the runs show without doubt; the first that explains every wrong claim is told."""

FALLBACK: tuple[Rule, ...] = (
    value_and_uncertainty,
    places_in_a_list,
    turned_round,
    edge_of_search,
    too_coarse,
    overlooked,
    counters_stood,
    other_model,
    never_lowered,
    own_criterion,
    nothing_simulated,
    ends_untried,
)
"""What is told where no wrong method is recognised by its claims."""


def explain(parameters: ThresholdParameters, wrong: Sequence[Judged[Cell, Claim]], rules: Sequence[Rule]) -> str | None:
    """Returns the sentence of the first rule that explains every wrong claim of the visible trials.

    If all visible claims are right, it must explain those of the hidden trials, of whose runs only the first are known.
    """
    told = [one for one in wrong if not one.trial.hidden] or wrong
    seen = [
        Seen(parameters, one.trial.problem, one.judgement.outcome, search, one.trace, not one.trial.hidden)
        for one in told
        if (search := read_search(one.trace)) is not None
    ]
    if not seen or len(seen) < len(told):
        return None
    if (turned := wrong_way_round(seen)) is not None:
        return turned
    for rule in rules:
        sentences = [rule(one) for one in seen]
        if all(sentences):
            return sentences[0]
    return None
