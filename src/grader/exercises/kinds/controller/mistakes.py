"""Names the mistake behind a controller that fails: from the law that its controls follow, from what it wrote, and from
which episodes fail."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from math import degrees

import mujoco
import numpy as np

from grader.exercises.episodes.goals import measure_saturation, switches_ends
from grader.exercises.episodes.judge import EpisodeOutcome
from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import Floats, Record, list_widths
from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.controller.laws import (
    ROUGH,
    FittedLaw,
    Laws,
    are_all_known,
    find_dof,
    fit_laws,
    measure_loads,
)
from grader.exercises.kinds.controller.parameters import ControllerParameters
from grader.exercises.kinds.controller.sentences import (
    CONSTANT,
    DEGREES,
    DEGREES_END,
    EXCHANGED,
    GRAVITY_SIGN,
    GRAVITY_TWICE,
    HANGS,
    HARDLY,
    HELD,
    LARGE,
    LITTLE,
    LITTLE_END,
    MISSING,
    MISSING_HERE,
    NO_TARGET,
    NOISE,
    NONE,
    NOTHING,
    ONE_END,
    OWN_LIMIT,
    REMEMBERS,
    RETURNS,
    SATURATES,
    SHARES,
    SIGN,
    STALE,
    STILL,
    SUM_OF_STEPS,
    SUM_SIGN,
    SWAPPED,
    TARGET_DEGREES,
    TRUTH,
    TUNED,
    WIND_UP,
    WRITES,
)
from grader.exercises.trace import get_list

Judged = JudgedTrial[Problem, EpisodeOutcome]

SMALL = 0.02
"""A gain below this share of the least sensible one is as good as none."""

FAR = 5.0
"""A gain that is larger than the largest sensible one by this factor may be one of degrees."""

RECORDS_READ = 3
"""Failed episodes that are looked at."""

REST_PART = 5
"""The last of so many parts of an episode is its end."""

SAME = 1e-6
"""How far constants of one law may be apart, by rounding."""

RESTS = 0.02
"""What an error is of the whole motion at least, and what moves at the end is of the error at most."""

PLAIN = 0.3
"""What a gain moves of the controls at least, where a law fits only roughly: less may make up for what is left out."""

UNUSED = 0.1
"""What the least sensible gain would move of the controls at least, where a rough law tells that there is none."""

NEAR = 0.05
"""How far an aim may be from where the target would be in degrees, relative to that."""

QUICK = 0.1
"""The gain on the sum of errors over that on the error, in control periods: a sum that outgrows the error within ten
periods lacks the period as a factor."""

OWN_GRAVITY = 0.5
"""The share of gravity that a control carries at least if it is in the actuator's own unit."""

READS_JOINTS = frozenset(map(int, (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL)))
"""Types of sensors that read one joint."""

SATURATED = 0.5
"""The share of time at the actuator's limit that counts as most of it."""


def name_the_mistake(parameters: ControllerParameters, judged: Sequence[Judged]) -> str | None:
    """Returns the sentence of the first mistake that explains the failed cases."""
    wrong = [trial for trial in judged if not trial.counts]
    written = [get_list(note.info, "parts") for trial in wrong for note in trial.trace.list_notes("wrote")]
    known = [[part for part in ("qpos", "qvel", "time") if part in parts] for parts in written]
    if state := next(filter(None, known), None):
        return WRITES.format(parts=" and data.".join(state))
    visible = [trial for trial in judged if not trial.hidden]
    is_tuned = bool(visible) and all(trial.counts for trial in visible)
    is_wrong_at_once = any(len(trial.judgement.outcome.records) == 1 for trial in wrong)
    if not is_wrong_at_once and any(is_first_alone(trial) for trial in wrong):
        return REMEMBERS
    records = [(trial, record) for trial in wrong for record in trial.judgement.outcome.list_failed()][:RECORDS_READ]
    sentences = [sentence for trial, record in records for sentence in find_sentences(parameters, trial, record)]
    if is_tuned:  # only what is wrong whatever the case is
        found = next((candidate for candidate in sentences if candidate.endswith((DEGREES_END, LITTLE_END))), None)
        return found or (NO_TARGET if ignores_target(parameters, judged) else TUNED)
    if are_truth_values(judged):
        return TRUTH
    sentence = TARGET_DEGREES if TARGET_DEGREES in sentences else next(iter(sentences), None)
    if sentence in (None, HANGS) and ignores_target(parameters, judged):
        return NO_TARGET
    if sentence == NOTHING and any("ctrl" in parts for parts in written):
        sentence = RETURNS
    elif sentence == NOTHING and returns_none(parameters, wrong):
        sentence = NONE
    return CONSTANT if sentence == NOTHING and not is_always_the_same(judged) else sentence


def is_always_the_same(judged: Sequence[Judged]) -> bool:
    """Whether the controls are the same in every step of every episode."""
    asked = [record.asked for each in judged for record in each.judgement.outcome.records if len(record.asked)]
    return not asked or bool(np.ptp(np.vstack(asked), axis=0).max() == 0)


def returns_none(parameters: ControllerParameters, judged: Sequence[Judged]) -> bool:
    """Whether a function that may leave its controls in the data returned None."""
    values = [value for each in judged for value in each.trace.returned_values]
    return parameters.form == "control" and bool(values) and all(value.type == "NoneType" for value in values)


def are_truth_values(judged: Sequence[Judged]) -> bool:
    """Whether every control is 0 or 1, both occur, and no actuator has these limits."""
    asked = [record.asked for each in judged for record in each.judgement.outcome.records if len(record.asked)]
    ranges = [episode.scene.model.actuator_ctrlrange for each in judged for episode in each.problem.episodes]
    is_switch = any(np.array_equal(limits, (0, 1)) for each in ranges for limits in each)
    return not is_switch and {0.0, 1.0} == {value for each in asked for value in np.unique(each).tolist()}


def ignores_target(parameters: ControllerParameters, judged: Sequence[Judged]) -> bool:
    """Whether one law with the same constant holds in episodes with different targets, each of which stays as it is."""
    if not parameters.has_target:
        return False
    track = find_columns(parameters, judged[0].trial.problem)[parameters.track]
    by_target: dict[float, list[float]] = {}
    for trial, record in ((each, record) for each in judged for record in each.judgement.outcome.records):
        if record.fault or np.ptp(record.target) > 0:
            continue
        laws = fit_laws(
            record, track=track, has_target=True, loads=measure_loads(trial.problem, record, of_others=False)
        )
        if are_all_known(laws) and not any(law.integral or law.differentiates for law in laws):
            by_target[float(record.target[0])] = [law.constant for law in laws]
    constants = np.array([*by_target.values()])
    return len(by_target) > 1 and bool(np.all(np.ptp(constants, axis=0) <= SAME * np.abs(constants).max(axis=0)))


def is_first_alone(judged: Judged) -> bool:
    """Whether the first of several episodes succeeded, and no other."""
    failed = judged.judgement.outcome.failed
    return len(failed) > 2 and not failed[0] and all(failed[1:])


def find_sentences(parameters: ControllerParameters, judged: Judged, record: Record) -> Iterator[str]:
    """Yields the sentences that hold of an episode, the most telling first."""
    limited = measure_saturation(judged.problem, record)
    if np.ptp(record.asked, axis=0).max() == 0 and len(record.time_s) > 1:
        yield HELD if limited else NOTHING
        return
    track = find_columns(parameters, judged.problem)[parameters.track]
    loads = measure_loads(judged.problem, record, of_others=True)
    laws = fit_laws(record, track=track, has_target=parameters.has_target, loads=loads)
    exact, rough = laws if are_all_known(laws) else None, fit_roughly(parameters, record, track, laws)
    if aims_in_degrees(parameters, judged.problem, record, rough):
        yield TARGET_DEGREES
    if exact is not None:
        yield from find_in_law(parameters, judged.problem, record, exact)
    else:
        yield from find_wrong_load([law for law in laws if law is not None])
        if rough is not None:
            yield from find_in_rough_law(parameters, judged.problem, record, rough)
    if limited > SATURATED:
        is_sensible = rough is not None and not any(find_wrong_gains(parameters, judged.problem, rough))
        yield SATURATES if switches_ends(judged.problem, record) and not is_sensible else ONE_END
    if any(stays_within_limits(judged.problem, record, index) for index, law in enumerate(laws) if law is None):
        yield OWN_LIMIT
    if exact is not None and not any(law.integral for law in exact) and rests_beside_target(record):
        yield HANGS
    still = np.flatnonzero(np.ptp(record.asked, axis=0) == 0).tolist()
    if len(record.time_s) > 1:
        yield from (STILL.format(name=name_actuator(judged.problem.model, index)) for index in still)


def fit_roughly(
    parameters: ControllerParameters, record: Record, track: int, laws: Sequence[FittedLaw | None]
) -> Laws | None:
    """Returns the laws, and in place of those that are not known some that fit roughly; None where one has none."""
    if None not in laws:
        rough = tuple(laws)
    else:
        fitted = fit_laws(record, track=track, has_target=parameters.has_target, fits=ROUGH)
        rough = tuple(law or other for law, other in zip(laws, fitted, strict=True))
    return rough if are_all_known(rough) else None


def find_in_law(parameters: ControllerParameters, problem: Problem, record: Record, laws: Laws) -> Iterator[str]:
    """Yields what is wrong with laws that fit to rounding."""
    track = find_columns(parameters, problem)[parameters.track]
    if any(law.stale for law in laws):
        yield STALE
    if any(law.differentiates for law in laws) and any(record.episode.noise.values()):
        yield NOISE
    yield from find_wrong_load(laws)
    if are_shares(parameters, problem, laws):
        yield SHARES
    if are_exchanged(parameters, problem, laws):
        yield EXCHANGED.format(names=", ".join(name_actuator(problem.model, i) for i in range(len(laws))))
    yield from find_swapped(parameters, problem, laws)
    yield from find_wrong_gains(parameters, problem, laws)
    main = laws[find_gain(laws, track)[0]]
    if main.integral * main.gains[track] > 0 and measure_shares(record, main)[track] > SAME:
        yield SUM_SIGN
    if sums_steps(parameters, record, main, track):
        yield SUM_OF_STEPS
    if any(law.integral and find_beyond(problem, record, index) > 0.05 for index, law in enumerate(laws)):
        yield WIND_UP


def sums_steps(parameters: ControllerParameters, record: Record, law: FittedLaw, track: int) -> bool:
    """Whether a sum of errors outgrows a sensible gain on the error within a few control periods."""
    allowed, gain = parameters.law.get(parameters.track), float(law.gains[track])
    if allowed is None or classify_gain(gain, *allowed, differentiated=law.differentiates) or not np.isfinite(gain):
        return False
    return bool(abs(law.integral) * (record.time_s[1] - record.time_s[0]) > QUICK * abs(gain))


def find_wrong_load(laws: Sequence[FittedLaw]) -> Iterator[str]:
    """Yields what is wrong with the terms that carry gravity."""
    if any(law.gravity < 0 for law in laws):
        yield GRAVITY_SIGN
    elif any(law.gravity > 1.5 for law in laws):
        yield GRAVITY_TWICE


def are_exchanged(parameters: ControllerParameters, problem: Problem, laws: Laws) -> bool:
    """Whether each control follows the joints of other actuators, and not its own. It is asked of two joints or more
    whose readings are used: one alone may be meant to act on another, as a cart does on its pole."""
    columns, model = find_columns(parameters, problem), problem.model
    dofs = [find_dof(model, actuator) for actuator in range(model.nu)]
    owners: set[int] = set()
    for name in parameters.observe:
        sensor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, name)
        if sensor < 0 or model.sensor_type[sensor] not in READS_JOINTS:
            continue
        dof = int(model.jnt_dofadr[model.sensor_objid[sensor]])
        user, gain = find_gain(laws, columns[name])
        if dofs.count(dof) != 1 or not gain or not np.isfinite(gain):
            continue
        owner = dofs.index(dof)
        own = abs(laws[owner].gains[columns[name]]) / laws[owner].size
        if owner == user or own > PLAIN * abs(gain) / laws[user].size:
            return False
        owners.add(owner)
    return len(owners) > 1


def name_actuator(model: mujoco.MjModel, actuator: int) -> str:
    """Returns the name of an actuator, or its place where it has none."""
    return model.actuator(actuator).name or f"actuator {actuator}"


def find_swapped(parameters: ControllerParameters, problem: Problem, laws: Laws) -> Iterator[str]:
    """Yields the two observed numbers whose gains are both wrong, and all sensible were the one the other. One wrong
    gain alone is too large, too small or of the wrong sign, also where the other one could have it."""
    columns = find_columns(parameters, problem)
    wrong = [name for name, what in classify_gains(parameters, problem, laws).items() if what]
    for one, other in combinations(wrong, 2):
        pair = [columns[one], columns[other]]
        changed = tuple(replace(law, gains=exchange(law.gains, pair)) for law in laws)
        are_known = all(np.isfinite(law.gains[pair]).all() for law in laws)
        if are_known and not any(find_wrong_gains(parameters, problem, changed)):
            yield SWAPPED.format(one=one, other=other)


def exchange(gains: Floats, pair: list[int]) -> Floats:
    """Returns the gains with two of them exchanged."""
    changed = gains.copy()
    changed[pair] = changed[pair[::-1]]
    return changed


def find_in_rough_law(
    parameters: ControllerParameters, problem: Problem, record: Record, laws: Laws
) -> Iterator[str]:  # fmt: skip
    """Yields the wrong signs of laws that fit only roughly, and what they do not use although it moves a lot."""
    if any(law.differentiates for law in laws):  # a gain on changes makes up for one on values
        return
    columns, certain, most = find_columns(parameters, problem), list[str](), record.asked.std(axis=0).max()
    for name, allowed in parameters.law.items():
        column = columns[name]
        if measure_shares(record, laws[find_gain(laws, column)[0]])[column] > PLAIN:
            certain.append(SIGN.format(name=name))
        least = min(abs(allowed.low), abs(allowed.high)) * record.observed[:, column].std()
        if least > UNUSED * most:
            certain += [MISSING.format(name=name), MISSING_HERE.format(name=name)]
    hardly = {MISSING.format(name=name): HARDLY.format(name=name) for name in parameters.law}
    for sentence in find_wrong_gains(parameters, problem, laws):
        if sentence in certain:
            yield hardly.get(sentence, sentence)


def aims_in_degrees(
    parameters: ControllerParameters, problem: Problem, record: Record, laws: Laws | None
) -> bool:  # fmt: skip
    """Whether a law with sensible gains on what is observed vanishes at rest where the target would be, were its number
    one of degrees, or turned into radians once more."""
    if laws is None or not parameters.has_target:
        return False
    index, gain = find_gain(laws, find_columns(parameters, problem)[parameters.track])
    if not gain or any(find_wrong_gains(parameters, problem, laws)):
        return False
    law = laws[index]
    aims = -(law.constant + np.nan_to_num(law.gains[-1]) * record.target) / gain
    return any(
        bool(np.all(np.abs(aims - wanted) <= NEAR * np.abs(wanted)))
        for wanted in (np.degrees(record.target), np.radians(record.target))
    )


def measure_shares(record: Record, law: FittedLaw) -> Floats:
    """Returns how much of a control each observed number moves, by standard deviations."""
    return np.asarray(record.observed.std(axis=0) * np.nan_to_num(np.abs(law.gains)) / law.size)


def rests_beside_target(record: Record) -> bool:
    """Whether the tracked sensor hardly moves at the end of an episode, and is not at its target."""
    if record.is_over or record.lost_at_s is not None:
        return False
    tracked, target = (values[-max(1, len(values) // REST_PART) :] for values in (record.tracked, record.target))
    error = float(np.abs(target - tracked).min())
    way = float(np.ptp(record.tracked))
    return bool(np.ptp(target) == 0 and error > RESTS * way and np.ptp(tracked) < RESTS * error)


def stays_within_limits(problem: Problem, record: Record, control: int) -> bool:
    """Whether a control is most of the time at one of its extremes, which is within the actuator's limits."""
    low, high = problem.model.actuator_ctrlrange[control]
    asked = record.asked[:, control]
    ends = [end for end in (asked.min(), asked.max()) if low < end < high]
    is_limited = bool(problem.model.actuator_ctrllimited[control])
    return is_limited and any(np.mean(asked == end) > SATURATED for end in ends)


def find_beyond(problem: Problem, record: Record, control: int) -> float:
    """Returns the share of time in which a control is beyond its actuator's limit. A law with a sum that fits these
    moments too has not stopped the sum there; of a script that clips its own controls this is not known."""
    low, high = problem.model.actuator_ctrlrange[control]
    asked = record.asked[:, control]
    is_limited = bool(problem.model.actuator_ctrllimited[control])
    return float(np.mean((asked > high) | (asked < low))) if is_limited else 0.0


def find_gain(laws: Laws, column: int) -> tuple[int, float]:
    """Returns the control that follows an observed number most, as a share of what moves it, and its gain; nan where
    that number stayed constant for one of them."""
    gains = np.array([law.gains[column] for law in laws])
    user = int(np.nan_to_num(np.abs(gains) / [law.size for law in laws]).argmax())
    return user, float(gains[user]) if np.isfinite(gains).all() else np.nan


def find_wrong_gains(parameters: ControllerParameters, problem: Problem, laws: Laws) -> Iterator[str]:
    """Yields what is wrong with the gains, by the ranges of the author's `law`."""
    columns = find_columns(parameters, problem)
    gains = {name: find_gain(laws, columns[name])[1] for name in parameters.law}
    found = classify_gains(parameters, problem, laws)
    if sum(not what for what in found.values()) < 2:  # small gains alone are no angles in radians
        small = {name for name, gain in gains.items() if abs(gain) < min(map(abs, parameters.law[name]))}
        found = {name: LITTLE if name in small and what == DEGREES else what for name, what in found.items()}
    is_summed = any(law.integral for law in laws)
    for template in (SIGN, DEGREES, MISSING, LARGE, LITTLE):
        for name, what in found.items():
            if template == MISSING and is_summed and name == parameters.track:  # its error is summed
                continue
            if what == template:
                is_limited = template == MISSING and name == parameters.track and parameters.has_target
                yield (MISSING_HERE if is_limited else template).format(name=name)


def are_shares(parameters: ControllerParameters, problem: Problem, laws: Laws) -> bool:
    """Whether several gains are far too small, and sensible times the largest control of the actuator; and what
    carries gravity is not in its unit already."""
    columns, model = find_columns(parameters, problem), problem.model
    gains = {name: find_gain(laws, columns[name]) for name in parameters.law if name != "target"}
    known = {name: (user, gain) for name, (user, gain) in gains.items() if np.isfinite(gain)}
    most = np.abs(model.actuator_ctrlrange).max(axis=1)
    for user, _ in known.values():
        if not model.actuator_ctrllimited[user] or most[user] <= FAR or laws[user].gravity > OWN_GRAVITY:
            return False
    small = [name for name, (_, gain) in known.items() if abs(gain) < min(map(abs, parameters.law[name]))]
    return len(small) > 1 and not any(
        classify_gain(most[user] * gain, *parameters.law[name], differentiated=laws[user].differentiates)
        for name, (user, gain) in known.items()
    )


def classify_gains(parameters: ControllerParameters, problem: Problem, laws: Laws) -> dict[str, str]:
    """Returns the sentence of each gain, as `judge_gain`, by the ranges of the author's `law`."""
    columns = find_columns(parameters, problem)
    return {name: judge_gain(laws, columns[name], *allowed) for name, allowed in parameters.law.items()}


def judge_gain(laws: Laws, column: int, low: float, high: float) -> str:
    """Returns the sentence that is true of the gains of every control that follows an observed number a good deal;
    empty if there is none. That it is missing is true where no control follows it."""
    gains = np.array([law.gains[column] for law in laws])
    if not np.isfinite(gains).all():
        return ""
    shares = np.abs(gains) / [law.size for law in laws]
    found = [classify_gain(gain, low, high, differentiated=law.differentiates)
             for gain, law in zip(gains.tolist(), laws, strict=True)]  # fmt: skip
    users = [
        what for what, share in zip(found, shares, strict=True) if share >= PLAIN * shares.max() and what != MISSING
    ]
    told = {*(users or found)}
    return told.pop() if len(told) == 1 else ""


def classify_gain(gain: float, low: float, high: float, *, differentiated: bool) -> str:
    """Returns the sentence of a gain; empty if it is sensible. A range about 0 says nothing of the sign, and what
    stayed constant nothing of its gain."""
    if not np.isfinite(gain) or low <= gain <= high or low * high <= 0:
        return ""
    sign = 1.0 if low > 0 else -1.0
    size, least, most = sign * gain, min(abs(low), abs(high)), max(abs(low), abs(high))
    if 0 < size < least / FAR and least <= size * degrees(1) <= most:
        return DEGREES
    if abs(size) < SMALL * least:
        return "" if differentiated else MISSING
    if size > FAR * most and least <= size / degrees(1) <= most:
        return DEGREES
    if size < 0:
        return SIGN
    return LARGE if size > most else LITTLE


def find_columns(parameters: ControllerParameters, problem: Problem) -> dict[str, int]:
    """Returns the first column of each observed name, and of the target."""
    columns, at = {}, 0
    for name, width in list_widths(parameters, problem).items():
        columns[name] = at
        at += width
    return columns
