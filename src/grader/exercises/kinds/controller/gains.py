"""Which gains of a fitted law are wrong, by the ranges that the author gives, and which of them are exchanged."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from math import degrees

import mujoco
import numpy as np

from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import Floats, list_widths
from grader.exercises.kinds.controller.laws import Laws, find_dof
from grader.exercises.kinds.controller.parameters import ControllerParameters
from grader.exercises.kinds.controller.sentences import DEGREES, LARGE, LITTLE, MISSING, MISSING_HERE, SIGN, SWAPPED

SMALL = 0.02
"""A gain below this share of the least sensible one is as good as none, where another is sensible."""

FAR = 5.0
"""A gain that is larger than the largest sensible one by this factor may be one of degrees."""

PLAIN = 0.3
"""What a gain moves of the controls at least, where a law fits only roughly: less may make up for what is left out."""

OWN_GRAVITY = 0.5
"""The share of gravity that a control carries at least if it is in the actuator's own unit."""

READS_JOINTS = frozenset(map(int, (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL)))
"""Types of sensors that read one joint."""


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
    if MISSING in found.values() and [*found.values()].count(DEGREES) == 1:  # one gain alone is in no unit
        large = {name for name, gain in gains.items() if abs(gain) > max(map(abs, parameters.law[name]))}
        found = {name: LARGE if name in large and what == DEGREES else what for name, what in found.items()}
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
    gains = {name: abs(find_gain(laws, columns[name])[1]) for name in parameters.law}
    least = {name: min(abs(low), abs(high)) for name, (low, high) in parameters.law.items()}
    sizes = [gain / least[name] for name, gain in gains.items() if np.isfinite(gain) and least[name]]
    none = SMALL * min(1.0, max(sizes, default=1.0))  # gains in a unit that is far too large are all small, not missing
    return {name: judge_gain(laws, columns[name], *allowed, none=none) for name, allowed in parameters.law.items()}


def judge_gain(laws: Laws, column: int, low: float, high: float, *, none: float) -> str:
    """Returns the sentence that is true of the gains of every control that follows an observed number a good deal;
    empty if there is none. That it is missing is true where no control follows it; `none` is as in `classify_gain`."""
    gains = np.array([law.gains[column] for law in laws])
    if not np.isfinite(gains).all():
        return ""
    shares = np.abs(gains) / [law.size for law in laws]
    found = [classify_gain(gain, low, high, differentiated=law.differentiates, none=none)
             for gain, law in zip(gains.tolist(), laws, strict=True)]  # fmt: skip
    users = [
        what for what, share in zip(found, shares, strict=True) if share >= PLAIN * shares.max() and what != MISSING
    ]
    told = {*(users or found)}
    return told.pop() if len(told) == 1 else ""


def classify_gain(gain: float, low: float, high: float, *, differentiated: bool, none: float = SMALL) -> str:
    """Returns the sentence of a gain; empty if it is sensible. A gain below the share `none` of the least sensible one
    is missing. A range about 0 says nothing of the sign, and what stayed constant nothing of its gain."""
    if not np.isfinite(gain) or low <= gain <= high or low * high <= 0:
        return ""
    sign = 1.0 if low > 0 else -1.0
    size, least, most = sign * gain, min(abs(low), abs(high)), max(abs(low), abs(high))
    if 0 < size < least / FAR and least <= size * degrees(1) <= most:
        return DEGREES
    if abs(size) <= none * least:
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
