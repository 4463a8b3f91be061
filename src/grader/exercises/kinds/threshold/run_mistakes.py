"""Mistakes in how a script runs its simulations, as its trace shows them: the model, the start, the length."""

import ast
from math import isnan

from grader.exercises.explaining.script import ParsedScript, writes_field
from grader.exercises.kinds.threshold.observation import CLOSE, Observation
from grader.numerics.integrators import BY_CODE

SHORT_SHARE = 0.7
"""A run of less than this share of the horizon is too short; right scripts run a little less or much more."""

REPEATED_MIN = 3
"""Runs of one step with the same timestep that make a pattern."""

FAR_FACTOR = 5.0
"""Runs at more than so many times the longest timestep of the search are runs in another unit."""

FIELD_NAMES = {
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


def explain_far_timesteps(observed: Observation) -> str | None:
    """Returns the sentence where the timesteps that were run are no seconds."""
    longest_s = observed.parameters.search_s[1]
    if min((run.timestep_s for run in observed.search.runs), default=0.0) < FAR_FACTOR * longest_s:
        return None
    first = f", such as {observed.search.runs[0].timestep_s:.4g} s" if observed.may_tell_numbers else ""
    return (
        f"All your runs use timesteps far beyond {1e3 * longest_s:g} ms{first}. model.opt.timestep is in seconds: set "
        "it to the timestep itself, not to a rate (1 / h) or to milliseconds."
    )


def explain_reset_each_step(observed: Observation) -> str | None:
    """Returns the sentence where the data is created or reset before every step."""
    runs = observed.search.runs
    if len(runs) < REPEATED_MIN or observed.search.total == len(runs) or len({run.timestep_s for run in runs}) > 1:
        return None
    if any(run.steps != 1 for run in runs if not run.warnings):
        return None
    return (
        "You reset the data before every step, so that each run is one step long and begins again. Reset it and set "
        "the start once, before the loop over the steps."
    )


def explain_actuators_off(observed: Observation) -> str | None:
    """Returns the sentence where the servo is switched off in every run, and nothing replaces it: then no run warns."""
    runs, differs = observed.search.runs, observed.search.differing_fields
    if not runs or any(run.new_warnings for run in runs):
        return None
    if not all(run.model < len(differs) and "actuation" in differs[run.model] for run in runs):
        return None
    return (
        "The actuators of your model are switched off (mjDSBL_ACTUATION), and without its servo nothing is unstable. "
        "Leave that flag alone; the automatic reset after a warning is mjDSBL_AUTORESET."
    )


def explain_rollout(observed: Observation) -> str | None:
    """Returns the sentence where the runs are those of mujoco.rollout."""
    if observed.search.runs or "rollout" not in observed.search.other_functions:
        return None
    return (
        "Your runs are those of mujoco.rollout, and you found nothing unstable: after a warning MuJoCo resets the "
        "state, so that it never holds nan. Look whether the time, the first number of each state, stops growing."
    )


def explain_linearisation(observed: Observation) -> str | None:
    """Returns the sentence where a step is linearised, and no run made."""
    if observed.search.runs or "mjd_transitionFD" not in observed.search.other_functions:
        return None
    return (
        "You linearise a step with mjd_transitionFD, and found nothing unstable: its eigenvalues are complex, and the "
        "motion grows where the absolute value of one of them passes 1. Compare np.abs(eigenvalues).max() with 1, and "
        "set timestep and integrator before."
    )


def explain_single_timestep(observed: Observation) -> str | None:
    """Returns the sentence where the timestep that is set never reaches the model that is stepped."""
    runs = observed.search.runs
    if not runs or any(abs(run.timestep_s - runs[0].timestep_s) > CLOSE * runs[0].timestep_s for run in runs):
        return None
    if len(runs) == 1 and runs[0].timestep_s != float(observed.cell.scene.model.opt.timestep):
        return None
    used = "Your only run" if len(runs) == 1 else "Every run"
    seen = f"{used} used a timestep of {observed.format_number(1e3 * runs[0].timestep_s)} ms"
    is_set_later = abs(observed.search.set_s - runs[0].timestep_s) > CLOSE * runs[0].timestep_s
    if is_set_later and all(run.model == observed.search.given for run in runs):
        return f"{seen}: opt.timestep of the model gets another value only after it. Set it before the first step."
    if sets_one_number(observed.script):
        return (
            f"{seen}: your script sets opt.timestep to one number alone. Set it to the timestep that you try, before "
            "each run."
        )
    return (
        f"{seen}: the model that you step is "
        "not one whose timestep you set. Set opt.timestep on the very model that you pass to mj_step."
    )


def sets_one_number(script: ParsedScript) -> bool:
    """Whether all that a script gives opt.timestep is one number that is written down."""
    values = [node.value for node in script.nodes if isinstance(node, ast.Assign) and writes_field(node, "timestep")]
    numbers = {value.value for value in values if isinstance(value, ast.Constant)}
    return len(numbers) == 1 and all(isinstance(value, ast.Constant) for value in values)


def explain_missing_reset(observed: Observation) -> str | None:
    """Returns the sentence where one data serves all timesteps, and is never reset."""
    runs = observed.search.runs
    if len(runs) != 1 or observed.search.total != 1 or abs(runs[0].last_timestep_s - runs[0].timestep_s) <= CLOSE:
        return None
    if runs[0].warnings:
        return (
            "You use one data for every timestep and never reset it. After the first unstable run its warning counters "
            "stay, so that every later run counts as unstable: call mujoco.mj_resetData before each run."
        )
    return (
        "You use one data for every timestep and never reset it, so that each run goes on where the last one ended. "
        "Call mujoco.mj_resetData before each run, and set the start again."
    )


def explain_other_integrator(observed: Observation) -> str | None:
    """Returns the sentence where the integrator that was asked for is never used."""
    used = {run.integrator for run in observed.search.runs}
    if len(used) != 1 or observed.cell.integrator.code in used or not used <= set(BY_CODE):
        return None
    return (
        f"Your runs used {BY_CODE[used.pop()].name} where another integrator was asked for. "
        "Set model.opt.integrator = integrator on the model that you step."
    )


def explain_other_start(observed: Observation) -> str | None:
    """Returns the sentence where runs do not begin where they should."""
    if len(observed.parameters.start) != 1 or observed.cell.scene.model.nq != 1 or not observed.search.runs:
        return None
    ((joint, value),) = observed.parameters.start.items()
    runs = observed.search.runs
    wrong = [run for run in runs if abs(run.qpos - value) > 1e-9 or run.qvel != 0]
    if len(wrong) == len(runs) and all((run.qpos, run.qvel) == (0, 0) for run in runs):
        return (
            f"Your runs start with {joint} at 0, where nothing moves, so that nothing can grow. Start with {joint} at "
            f"{value:g} rad: set data.qpos[0] = {value:g} each time you have created or reset the data."
        )
    if len(wrong) == len(runs) and len({(run.qpos, run.qvel) for run in runs}) == 1:
        speed = f" and a speed of {observed.format_number(runs[0].qvel)} rad/s" if runs[0].qvel else ""
        return (
            f"Your runs start with {joint} at {observed.format_number(runs[0].qpos)} rad{speed}, not at {value:g} rad "
            f"at rest. Set data.qpos[0] = {value:g}, and leave data.qvel at 0."
        )
    if wrong and wrong[0] is not runs[0]:
        return (
            "Only your first run starts as it should; later ones begin elsewhere. Reset the data before each run, and "
            f"set data.qpos[0] = {value:g} after that."
        )
    return None


def explain_other_target(observed: Observation) -> str | None:
    """Returns the sentence where the servo's target is not the one of the exercise."""
    targets = {run.ctrl for run in observed.search.runs}
    expected = float(observed.cell.scene.start.ctrl[0]) if observed.cell.scene.model.nu else 0.0
    if len(targets) != 1 or expected in targets:
        return None
    return (
        f"Your runs set data.ctrl[0] to {observed.format_number(targets.pop())}, which is the servo's target; it "
        f"should stay {expected:g}, so that the servo pulls the joint back from its start."
    )


def explain_nan_start(observed: Observation) -> str | None:
    """Returns the sentence where the start is nan: None was assigned, or something that is no number."""
    if not any(isnan(run.qpos) or isnan(run.qvel) for run in observed.search.runs):
        return None
    return (
        "A run starts with nan in data.qpos or data.qvel: None, or something that is no number, was assigned to it. "
        "Print what you assign."
    )


def explain_short_runs(observed: Observation) -> str | None:
    """Returns the sentence where runs that are called stable end before the horizon."""
    horizon_s = observed.parameters.horizon_s
    calm = [run for run in observed.stable_runs if not run.warnings and run.steps > 0]
    if not calm or calm[0].duration_s >= SHORT_SHARE * horizon_s:
        return None
    whole = [run for run in observed.search.runs if not run.warnings]
    if all(run.steps == 1 for run in whole):
        return (
            f"Each of your runs ends after its first step: a return that stands inside the loop over the steps ends "
            f"it. Step until data.time reaches {horizon_s:g} s, and return after the loop."
        )
    reach = f"Step until data.time reaches {horizon_s:g} s."
    if len({run.timestep_s for run in whole}) > 1 and len({run.steps for run in whole}) == 1:
        example = (
            f", {calm[0].duration_s:.2g} s at {1e3 * calm[0].timestep_s:.4g} ms" if observed.may_tell_numbers else ""
        )
        return f"Your runs are too short: each takes {calm[0].steps} steps{example}, not {horizon_s:g} s. {reach}"
    example = f", {calm[0].steps} steps at {1e3 * calm[0].timestep_s:.4g} ms" if observed.may_tell_numbers else ""
    length = f"{calm[0].duration_s:.2g} s{example}"
    return f"Your runs are too short: {length}, where a slow divergence does not show yet. {reach}"


def explain_other_model(observed: Observation) -> str | None:
    """Returns the sentence where the model that is stepped is not the given one, and some run ends otherwise for it."""
    used = {run.model for run in observed.search.runs}
    if observed.runs_end_as_ours:
        return None
    if (
        len(used) != 1
        or not (index := used.pop()) < len(observed.search.differing_fields)
        or not observed.search.differing_fields[index]
    ):
        return None
    names = [FIELD_NAMES.get(name, name) for name in observed.search.differing_fields[index]][:3]
    return (
        f"The model that you step is not the one you were given: {' and '.join(names)} "
        f"{'differs' if len(names) == 1 else 'differ'}. Change nothing but the timestep and the integrator."
    )
