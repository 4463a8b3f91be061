"""Names the mistake behind a controller that fails: from the law that its controls follow, from what it wrote, and from
which episodes fail."""

from collections.abc import Iterator, Sequence

import numpy as np

from grader.exercises.episodes.goals import measure_saturation, switches_ends
from grader.exercises.episodes.judge import EpisodeOutcome
from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import Floats, Record
from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.controller.gains import (
    PLAIN,
    are_exchanged,
    are_shares,
    classify_gain,
    find_columns,
    find_gain,
    find_swapped,
    find_wrong_gains,
    name_actuator,
)
from grader.exercises.kinds.controller.laws import (
    ROUGH,
    FittedLaw,
    Laws,
    are_all_known,
    fit_laws,
    measure_loads,
)
from grader.exercises.kinds.controller.parameters import ControllerParameters
from grader.exercises.kinds.controller.sentences import (
    CONSTANT,
    DEGREES_END,
    EXCHANGED,
    GRAVITY_SIGN,
    GRAVITY_TWICE,
    HANGS,
    HARDLY,
    HELD,
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
    TARGET_DEGREES,
    TRUTH,
    TUNED,
    WIND_UP,
    WRITES,
)
from grader.exercises.trace import get_list

Judged = JudgedTrial[Problem, EpisodeOutcome]

RECORDS_READ = 3
"""Failed episodes that are looked at."""

REST_PART = 5
"""The last of so many parts of an episode is its end."""

SAME = 1e-6
"""How far constants of one law may be apart, by rounding."""

RESTS = 0.02
"""What an error is of the whole motion at least, and what moves at the end is of the error at most."""

UNUSED = 0.1
"""What the least sensible gain would move of the controls at least, where a rough law tells that there is none."""

NEAR = 0.05
"""How far an aim may be from where the target would be in degrees, relative to that."""

QUICK = 0.1
"""The gain on the sum of errors over that on the error, in control periods: a sum that outgrows the error within ten
periods lacks the period as a factor."""

HALF = 0.5
"""How far what is kept up may be from what holds the model, relative to that."""

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
        yield GRAVITY_SIGN if pulls_down(parameters, judged.problem, record, exact) else HANGS
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


def pulls_down(parameters: ControllerParameters, problem: Problem, record: Record, laws: Laws) -> bool:
    """Whether what a control keeps up at the target is about what holds the model there, with the wrong sign."""
    track = find_columns(parameters, problem)[parameters.track]
    control, gain = find_gain(laws, track)
    loads = measure_loads(problem, record, of_others=False)[control]
    if not loads or not np.isfinite(gain) or not loads[0][-1]:
        return False
    law, target = laws[control], float(record.target[-1])
    of_target = float(np.nan_to_num(law.gains[-1])) if parameters.has_target and track != len(law.gains) - 1 else 0.0
    kept = law.constant + (gain + of_target) * target
    return bool(-1 - HALF < kept / loads[0][-1] < -1 + HALF)


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
