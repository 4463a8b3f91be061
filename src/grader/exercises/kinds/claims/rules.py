"""The known mistakes of a measurement: each rule yields what a claim is under it, with the sentence for the learner. No
sentence holds a number of the case; `{label}` stands for the name of the claim."""

import re
from collections.abc import Callable, Iterator, Sequence
from math import pi

import numpy as np

from grader.domain.quantities import BASE_UNITS, TIMES
from grader.exercises.kinds.claims.measuring import STEPS_MAX
from grader.exercises.kinds.claims.parameters import Floats
from grader.exercises.kinds.claims.related_numbers import FACTORS, GENERAL, INSTEAD, UNITS
from grader.exercises.kinds.claims.wrong_values import ENERGY, Scene
from grader.experiments.runs import Variant

Rule = Callable[[Scene], "Found"]
Found = Iterator[tuple[str, Floats | None]]
"""Sentences, and what the claim is where they are true; None where that cannot be measured."""

NOT_RESET = (
    "{label} is measured in a run that begins where another one has ended: reset the data, or make a new one, before "
    "each measurement."
)

WAVE = re.compile(r"\b(sin|cos)\(\s*([\d.]+)\s*\*\s*data\.time")
WAVE_IN_HERTZ = re.compile(r"\b(sin|cos)\(\s*2\s*\*\s*Math\.PI\s*\*\s*([\d.]+)\s*\*\s*data\.time")
"""Drives by an angular frequency, and by a frequency."""

RUNS_S = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0)
"""Lengths of runs that people choose [s]."""

LENGTHS = (0.1, 0.5, 2.0, 10.0)
"""Lengths of other runs, over the one that is asked for."""

FROM_START = (
    "{label} is counted from the start of the run, or over one crossing too many: take the time from one crossing to "
    "the next alike."
)

CALL_FORWARD = (
    "data.energy is 0 before the first mj_forward or mj_step, and so is an element of an array that is never filled."
)

COARSER = (0.5, 0.2, 0.1)
FINER = (2.0, 4.0, 10.0, 0.5, 0.1)


def is_formula(scene: Scene) -> Found:
    """The author's formula in place of a measurement, or a measurement of something else that the author names."""
    formula = scene.claim.formula
    if formula is not None and not takes_degrees(scene):
        yield (
            f"{{label}} is what {formula.text} gives. {formula.why}",
            (scene.read_first(formula.expr)),
        )
    for other in scene.claim.instead:
        yield f"{{label}} is {other.what}.", scene.measure_as(scene.claim.quantity, expr=other.expr)


def takes_degrees(scene: Scene) -> bool:
    """Whether the x of a curve are angles that a script, which steps the model, may take for degrees: from angles so
    small the formula of small ones holds."""
    axis = scene.problem.axis
    return scene.steps and axis is not None and axis.unit == "rad" and scene.claim.form == "curve"


def has_x_in_degrees(scene: Scene) -> Found:
    """Angles of the x that are taken for degrees."""
    if takes_degrees(scene):
        yield (
            "{label} is that of runs whose x was taken for degrees: it is in radians already.",
            scene.read(x_scale=pi / 180),
        )


def is_another_claim(scene: Scene) -> Found:
    """The number of another claim."""
    for claim, values in zip(scene.problem.claims, scene.all_right, strict=True):
        if claim.name != scene.claim.name and values.shape == scene.right.shape:
            yield f"{{label}} holds what {claim.label} should be: mind the names, or their order.", values


def is_in_other_unit(scene: Scene) -> Found:
    """Another unit, such as milliseconds for seconds."""
    unit = scene.claim.unit
    for factor, name in UNITS.get(unit, ()):
        asked = f"{unit} is asked for" if unit else "a share is asked for, from 0 to 1"
        yield f"{{label}} is in {name}, and {asked}.", factor * scene.right


def is_related_number(scene: Scene) -> Found:
    """A number that follows from the right one: half a period, a frequency."""
    for change, what in FACTORS.get(scene.claim.quantity, ()):
        with np.errstate(all="ignore"):
            yield f"{{label}} is {what}.", change(scene.right)
    if scene.claim.quantity == "decay_rate":
        yield from is_other_measure_of_damping(scene)
    if scene.claim.quantity in ("period", "frequency"):
        yield from miscounts_periods(scene)


def is_other_measure_of_damping(scene: Scene) -> Found:
    """The decay from one peak to the next, or the damping ratio, in place of a rate."""
    frequency = scene.measure_as("frequency")
    if frequency is not None:
        sentence = "{label} is the decay from one peak to the next: divide it by the time between them."
        yield sentence, scene.right / frequency
        yield sentence, scene.right / frequency / 2
        turning = np.hypot(2 * pi * frequency, scene.right)
        yield "{label} is the damping ratio: multiply it by the natural frequency, in rad/s.", scene.right / turning


def miscounts_periods(scene: Scene) -> Found:
    """The time of all periods over the number of crossings, which is one more, in runs of usual lengths; or the moment
    of a crossing, counted from the start."""
    is_period = scene.claim.quantity == "period"
    for direction in ("up", "down"):
        for count in (1, 2):
            moment = scene.measure_as("crossing", direction=direction, count=count)
            if moment is not None:
                yield FROM_START, moment if is_period else scene.claim.scale**2 / moment
    every = scene.list_crossings(max(RUNS_S))
    for seconds in RUNS_S if every is not None else ():
        counts = np.array([np.sum(moments <= seconds) for moments in every or ()])
        if counts.min() > 1:
            share = (counts - 1) / counts
            right = scene.right * share if is_period else scene.right / share
            # Naming the length, it must be one in all cases: with a length for each, some count fits by chance.
            sentence = f"{{label}} counts one period too many in a run of {seconds:g} s: between n crossings lie n - 1."
            yield sentence, right


def has_transient(scene: Scene) -> Found:
    """The whole run, where its begin is to be left out."""
    if scene.claim.since > 0:
        sentence = "{label} is measured from the start: the transient is included. Wait until it has died away."
        for name in (scene.claim.quantity, *(other for other, _ in INSTEAD.get(scene.claim.quantity, ()))):
            yield sentence, scene.measure_as(name, since=0.0)
        if scene.claim.quantity == "amplitude":
            yield sentence, scene.measure_as("max", since=0.0, expr=f"Math.abs({scene.claim.expr})")


def counts_a_zero(scene: Scene) -> Found:
    """A range that reaches to 0, where the run does not."""
    if scene.claim.quantity != "peak_to_peak" or not scene.subtracts:
        return
    highest, lowest = scene.measure_as("max"), scene.measure_as("min")
    if highest is not None and lowest is not None:
        cure = CALL_FORWARD if ENERGY.search(scene.claim.expr) else "Fill every element of your array."
        yield (
            f"{{label}} includes a 0 that the run does not have. {cure}",
            np.maximum(highest, 0) - np.minimum(lowest, 0),
        )


def is_other_quantity(scene: Scene) -> Found:
    """Another quantity of the same run."""
    for name, what in INSTEAD.get(scene.claim.quantity, ()):
        values = scene.measure_as(name)
        if values is None or not np.allclose(values, scene.right / 2):  # which is said below
            yield f"{{label}} is {what}.", values
    if scene.claim.quantity == "settling" and (level := find_level(scene)) is not None:
        yield from settles_otherwise(scene, level)
        for direction in ("down", "up"):
            band = scene.claim.band or 0.0
            edge = level + band if direction == "down" else level - band
            yield (
                "{label} is the first time within the band: the motion leaves it again. Take the last time outside.",
                scene.measure_as("crossing", level=edge, direction=direction, count=1),
            )
    if scene.claim.quantity != "trace":
        yield "{label} is the value at the start: nothing was simulated.", scene.read_first(scene.claim.expr)


def settles_otherwise(scene: Scene, level: float) -> Found:
    """A settling time into another band, about another place, or on one side alone."""
    claim, end_s = scene.claim, scene.claim.seconds or scene.problem.seconds
    if level:
        about_zero = scene.measure_as("settling", level=0.0)
        sentence = "{label} is measured about 0: the band lies about the place where the motion comes to rest."
        yield sentence, np.array([end_s * claim.scale]) if about_zero is None else about_zero
    first = scene.read_first(claim.expr)
    for share in (0.02, 0.05) if first is not None and len(first) == 1 else ():
        band = share * abs(level - float(first[0]))  # type: ignore[index]
        if band > 0:
            sentence = f"{{label}} is that into a band of {100 * share:g} % of the way: the task asks for another band."
            yield sentence, scene.measure_as("settling", band=band)
    for side in ("max", "min"):
        yield (
            "{label} looks at one side alone: take the size of the distance, by abs.",
            scene.measure_as("settling", level=level, expr=f"Math.{side}({claim.expr}, {level!r})"),
        )


def is_other_width(scene: Scene) -> Found:
    """Another measure of how far a motion spreads."""
    claim = scene.claim
    if claim.quantity not in ("amplitude", "peak_to_peak"):
        return
    rms, mean = scene.measure_as("rms"), scene.measure_as("mean")
    if rms is not None and mean is not None:
        yield "{label} is the standard deviation of the values.", np.sqrt(np.maximum(rms**2 - mean**2, 0.0))
    first, last = scene.read_first(claim.expr), scene.measure_as("final", since=0.0)
    if first is not None and last is not None:
        yield (
            "{label} is the difference between the first value and the last: the extremes lie between.",
            np.abs(last - claim.scale * first),
        )


def find_level(scene: Scene) -> float | None:
    """Returns the level about which a motion settles: that of the claim, or where its only run ends."""
    if scene.claim.level is not None:
        return scene.claim.level
    last = scene.measure_as("final")
    return float(last[0]) / scene.claim.scale if last is not None and len(last) == 1 else None


def is_relative(scene: Scene) -> Found:
    """A share of the first value, or the change since then."""
    first = scene.read_first(scene.claim.expr)
    if first is None or scene.claim.quantity in BASE_UNITS or scene.claim.quantity == "trace":
        return
    first = scene.claim.scale * first
    with np.errstate(all="ignore"):
        yield (
            "{label} is relative to the first value: it is asked for as it is, in its unit.",
            scene.right / np.abs(first),
        )
    if scene.claim.quantity != "peak_to_peak":
        sentence = "{label} is the change since the start: the value itself is asked for."
        yield sentence, scene.right - first
        yield sentence, np.abs(scene.right - first)


def is_of_another_length(scene: Scene) -> Found:
    """A run that is shorter or longer than the one that is asked for."""
    claim = scene.claim
    seconds = claim.seconds or scene.problem.seconds
    steps = seconds / scene.timestep_s * len(scene.right)
    for length in LENGTHS:
        if claim.quantity != "trace" and claim.since < length * seconds and length * steps <= STEPS_MAX:
            size = "longer" if length > 1 else "shorter"
            yield (
                f"{{label}} is what a run gives that is {size} than asked: count its steps.",
                scene.measure_as(claim.quantity, until=None, seconds=length * seconds),
            )


def has_other_drive(scene: Scene) -> Found:
    """A drive whose angular frequency was taken for a frequency, or the other way round."""
    drive = scene.claim.controller or ""
    if WAVE_IN_HERTZ.search(drive):
        yield (
            "{label} is that of a drive without the 2π: its frequency is in Hz, and the sine wants radians.",
            scene.read(controller=WAVE_IN_HERTZ.sub(r"\1(\2 * data.time", drive)),
        )
    elif WAVE.search(drive):
        yield (
            "{label} is that of a drive with a 2π too many: the number beside the time is in rad/s already.",
            scene.read(controller=WAVE.sub(r"\1(2 * Math.PI * \2 * data.time", drive)),
        )


def has_wrong_sign(scene: Scene) -> Found:
    """The sign."""
    yield "{label} has the wrong sign.", -scene.right


def is_other_crossing(scene: Scene) -> Found:
    """Another crossing of the same level."""
    claim = scene.claim
    if claim.quantity != "crossing":
        return
    other = {"up": "down", "down": "up", "either": "either"}[claim.direction]
    if other != claim.direction:
        yield (
            "{label} is when the level is crossed in the other direction.",
            scene.measure_as("crossing", direction=other),
        )
    for count in {1, claim.count - 1, claim.count + 1, claim.count + 2} - {0, claim.count}:
        yield "{label} is another crossing of the same level: count them.", scene.measure_as("crossing", count=count)


def counts_steps(scene: Scene) -> Found:
    """Steps in place of seconds."""
    if scene.claim.quantity in TIMES:
        yield "{label} is a number of steps: multiply it by the timestep.", scene.right / scene.timestep_s


def misses_reset(scene: Scene) -> Found:
    """A run that begins where another one has ended."""
    for values in scene.read_without_reset():
        yield NOT_RESET, values


def has_other_start(scene: Scene) -> Found:
    """A run from another start, of another model, or without what acts."""
    claim, problem = scene.claim, scene.problem
    yield (
        "{label} is that of a run from the model's own start: begin with the data that you are given.",
        scene.read(setup=claim.setup or "", key=None),
    )
    if problem.xml_as_written != problem.xml:
        yield (
            "{label} is that of the model as it stands in the file: measure on the model that you are given.",
            scene.read(xml=problem.xml_as_written),
        )
    if claim.controller is not None:
        yield "{label} is that of a run in which nothing acts on the model.", scene.read(controller=None)


def reads_other_sensor(scene: Scene) -> Found:
    """Another joint, sensor or axis."""
    for what, values in scene.list_others():
        yield f"{{label}} is measured of {what}, not of what is asked for.", values


def has_other_integrator(scene: Scene) -> Found:
    """Another integrator than the model's."""
    for name, values in scene.list_integrators():
        yield f"{{label}} is what the integrator {name}, which is not that of the experiment.", values


def has_other_timestep(scene: Scene) -> Found:
    """Another timestep than the claim is about."""
    if scene.claim.timestep == "given":
        for finer in FINER:
            yield (
                "{label} is what another timestep gives: it is asked for at the timestep of the model.",
                scene.read(variant=Variant(finer=finer)),
            )
        yield from has_steps_of_another_size(scene)
        return
    coarse = "{label} is what a timestep gives that is too long: shorten it until the number no longer changes."
    yield coarse, scene.measured.own
    for finer in COARSER:
        yield coarse, scene.read(variant=Variant(finer=finer))


def has_steps_of_another_size(scene: Scene) -> Found:
    """As many steps as are asked for, of another timestep."""
    seconds = scene.claim.seconds or scene.problem.seconds
    for finer in FINER if scene.claim.since == 0 else ():
        changed = scene.claim.model_copy(update={"seconds": seconds / finer, "until": None})
        if finer >= 1 or seconds / finer / scene.timestep_s * len(scene.right) <= STEPS_MAX:
            yield (
                "{label} is what as many steps of another timestep give: it is asked for at the timestep of the model.",
                scene.read(changed, Variant(finer=finer)),
            )


def is_one_step_off(scene: Scene) -> Found:
    """One timestep too early or too late."""
    claim, step_s = scene.claim, scene.timestep_s
    sentence = "{label} is off by one timestep: is it read before or after the step that it belongs to?"
    for shift in (-step_s, step_s):
        if claim.quantity in TIMES:
            yield sentence, scene.right + claim.scale * shift
        elif claim.quantity == "final":
            seconds = (claim.seconds or scene.problem.seconds) + shift
            yield sentence, scene.measure_as("final", until=None, seconds=seconds)


def is_mixed_up(scene: Scene) -> Found:
    """A curve in the opposite order."""
    if len(scene.right) > 1:
        yield "{label} is in the opposite order: the first number belongs to the first x.", scene.right[::-1]


def is_multiple(scene: Scene) -> Found:
    """A factor of two, or the reciprocal."""
    for change, sentence in GENERAL:
        with np.errstate(all="ignore"):
            yield sentence, change(scene.right)


RULES: Sequence[Rule] = (
    has_x_in_degrees, is_formula, has_other_integrator, is_another_claim, is_in_other_unit, is_related_number,
    has_transient, counts_a_zero, is_other_quantity, is_other_width, has_wrong_sign, is_mixed_up, is_other_crossing,
    counts_steps, has_other_start, misses_reset, reads_other_sensor, has_other_drive, is_relative, has_other_timestep,
    is_one_step_off, is_of_another_length, is_multiple,
)  # fmt: skip
"""In this order: what is most likely and most telling first."""
