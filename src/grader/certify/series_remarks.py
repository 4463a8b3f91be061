"""Remarks on what a measured series shows: a sign that no words ask for, half a period, an angle that wraps."""

import re
from collections.abc import Callable, Iterator, Sequence
from math import isclose, tau

import mujoco
import numpy as np

from grader.certify.certificate import Certificate
from grader.domain.pages.markup import plain_text
from grader.domain.quantities import BASE_UNITS
from grader.domain.verify import ByMeasurement
from grader.experiments.quantities import Floats, cut, find_crossings, measure
from grader.experiments.runs import LabRun, to_numbers
from grader.questions import NumberKey
from grader.questions.kinds.number.dimensions import find_unit_dimension

SIZE = re.compile(r"\bMath\.(?:abs|hypot)\(|\bMath\.pow\([^()]*,\s*2\s*\)|\*\*\s*2\b")
"""What makes a size or a square of what it gets."""

SPEED = re.compile(r"\b(?:how fast|fastest|speed(?! of \d))\b", re.I)
DISTANCE = re.compile(r"\b(?:how far|farthest|furthest|distance(?! of \d))\b", re.I)
"""Words for what has no sign, where no number follows that is given."""

DIRECTED = re.compile(
    r"\b(?:up|down|left|right|(?:up|down|for|back|to|in|out)wards?|above|below|beyond|past|overshoot\w*|back|side|"
    r"direction|positive|negative|signed|sign)\b",
    re.I,
)
"""Words for one of the two directions of a motion."""

SAME_PERIOD = 0.03
"""The share by which two periods of a motion that decays may differ."""

WRAPS = re.compile(r"\batan2\b|%")
"""What may make an angle jump by a whole turn."""

WRAP = 0.05
"""The share of a turn by which an angle may move on between two samples while it wraps."""

SWINGING = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))


def remark_series(
    certificate: Certificate, key: NumberKey, verify: ByMeasurement, xml: str, read: Callable[[Sequence[str]], LabRun]
) -> Certificate:
    """Remarks on what the series shows of a certified number. `read` runs it at every step with other readouts, too."""
    if not certificate.ok or (verify.when == "end" and key.answer != 0):
        return certificate
    run = read(_list_joints(xml) if verify.when in ("period", "frequency") else ())
    times, (values, *joints) = np.array(run.times), map(to_numbers, run.readouts)
    for remark in (
        *_list_wide(key, verify, values),
        *_list_signs(key, verify, times, values),
        *_list_halves(verify, times, values, joints),
        *_list_wraps(verify, times, values),
    ):
        certificate = certificate.with_remark(remark)
    return certificate


def _list_wide(key: NumberKey, verify: ByMeasurement, values: Floats) -> Iterator[str]:
    """Yields that a tolerance about 0 holds all that the run comes by: nothing else tells how wide it is."""
    largest = float(np.max(np.abs(values)))
    if key.answer == 0 and verify.when not in BASE_UNITS and largest <= key.tolerance:
        yield f"In the whole run the size is at most {largest:.3g}, within tol = {key.tolerance:g}: give a smaller one."


def _list_signs(key: NumberKey, verify: ByMeasurement, times: Floats, values: Floats) -> Iterator[str]:
    """Yields that the words ask for a speed or a distance, and the number changes with the sign of what is measured."""
    if verify.when not in ("max", "min", "mean") or not asks_for_size(key.text, key.unit):
        return
    signed, unsigned = (measure(verify.when, times, series, verify) for series in (values, np.abs(values)))
    if abs(signed - unsigned) > key.tolerance:
        yield (
            f"The words ask for a size, and verify.expr has a sign: the {verify.when} of its size is {unsigned:.6g}, "
            f"not {signed:.6g}. Write Math.abs(...), unless one direction is meant."
        )


def asks_for_size(text: str, unit: str | None) -> bool:
    """Whether a question, HTML, asks for a speed in a unit of speeds, or a distance in one of lengths or angles, and
    names no direction. The unit tells what is asked for from what is given."""
    plain, dimension = plain_text(text), find_unit_dimension(unit or "")
    if dimension is None or DIRECTED.search(plain):
        return False
    words = {(1, -1): SPEED, (0, -1): SPEED, (1, 0): DISTANCE, (0, 0): DISTANCE}
    length, mass, time = dimension.powers
    asked = words.get((int(length), int(time))) if mass == 0 else None
    return asked is not None and asked.search(plain) is not None


def _list_halves(verify: ByMeasurement, times: Floats, values: Floats, joints: list[Floats]) -> Iterator[str]:
    """Yields that a period is that of a size, or of what else comes by twice while a joint swings once."""
    if verify.when not in ("period", "frequency"):
        return
    if SIZE.search(verify.expr) or _is_half(verify, times, values, joints):
        yield (
            f"The {verify.when} is that of a size or a square, which comes by twice while the motion comes by once: "
            "measure the motion itself, unless that is meant."
        )


def _is_half(verify: ByMeasurement, times: Floats, values: Floats, joints: list[Floats]) -> bool:
    """Whether a joint swings with twice the period of a series, and none with the same."""
    own = measure("period", times, values, verify)
    window = verify.model_copy(update={"level": None})
    periods = [measure("period", times, joint, window) for joint in joints]
    return any(isclose(period, 2 * own, rel_tol=SAME_PERIOD) for period in periods) and not any(
        isclose(period, own, rel_tol=SAME_PERIOD) for period in periods
    )


def _list_joints(xml: str) -> list[str]:
    """Returns the expressions of the positions of slides and hinges."""
    model = mujoco.MjModel.from_xml_string(xml)
    return [f"data.qpos[{at}]" for at in model.jnt_qposadr[np.isin(model.jnt_type, SWINGING)]]


def _list_wraps(verify: ByMeasurement, times: Floats, values: Floats) -> Iterator[str]:
    """Yields that an angle that wraps crosses the level by a jump."""
    if verify.when not in ("crossing", "crossings") or not WRAPS.search(verify.expr):
        return
    times, values = cut(times, values, verify)
    jumps = np.abs(np.diff(values))
    for turn, name in ((tau, "2π"), (360.0, "360")):
        at = np.flatnonzero(np.abs(jumps - turn) <= WRAP * turn)
        level = verify.level or 0.0
        crossed = sum(len(find_crossings(times[i : i + 2], values[i : i + 2], level, verify.direction)) for i in at)
        if crossed:
            yield (
                f"The angle jumps by {name} where it wraps, which counts as a crossing of the level ({crossed} of "
                "them): measure an angle that goes on, such as data.qpos[0], or its sine."
            )
