"""Mistakes in how a script runs its simulations, as its trace shows them: the model, the start, the length."""

from math import isnan

from grader.exercises.kinds.threshold.seen import CLOSE, Seen
from grader.numerics.integrators import BY_CODE

SHORT = 0.7
"""A run of less than this share of the horizon is too short; right scripts run a little less or much more."""

REPEATED = 3
"""Runs of one step with the same timestep that make a pattern."""

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
