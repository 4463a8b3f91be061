"""The known mistakes of a measurement: each rule yields what a claim is under it, with the sentence for the learner. No
sentence holds a number of the case; `{label}` stands for the name of the claim."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import log, pi

import numpy as np

from grader.domain.quantities import TIMES, QuantityName
from grader.exercises.kinds.claims.parameters import Floats
from grader.exercises.kinds.claims.wrong_values import Scene
from grader.experiments.runs import Variant

Found = Iterator[tuple[str, Floats | None]]
"""Sentences, and what the claim is where they are true; None where that cannot be measured."""

UNITS: Mapping[str, Sequence[tuple[float, str]]] = {
    "s": ((1000, "ms"),), "ms": ((1e-3, "s"),), "m": ((1000, "mm"), (100, "cm")), "mm": ((1e-3, "m"),),
    "cm": ((1e-2, "m"),), "rad": ((180 / pi, "degrees"),), "deg": ((pi / 180, "rad"),), "°": ((pi / 180, "rad"),),
    "rad/s": ((180 / pi, "degrees per second"), (1 / (2 * pi), "Hz")), "Hz": ((2 * pi, "rad/s"), (1000, "mHz")),
    "deg/s": ((pi / 180, "rad/s"),), "m/s": ((1000, "mm/s"),), "%": ((0.01, "parts of one"),), "": ((100, "percent"),),
    "N": ((1e-3, "kN"),), "J": ((1e-3, "kJ"), (1000, "mJ")), "kg": ((1000, "g"),), "W": ((1e-3, "kW"),),
    "1/s": ((1e-3, "1/ms"), (1 / (2 * pi), "Hz")),
}  # fmt: skip
"""Factors between a unit and others that are taken for it, with their names."""

INSTEAD: Mapping[QuantityName, Sequence[tuple[QuantityName, str]]] = {
    "final": (("max", "the largest value of the run, not the one at its end"),
              ("min", "the smallest value of the run, not the one at its end"),
              ("mean", "the mean over the run, not the value at its end")),
    "max": (("min", "the smallest value, not the largest"), ("final", "the value at the end, not the largest"),
            ("peak_to_peak", "the distance from the lowest to the highest value, not the highest"),
            ("amplitude", "half the distance from the lowest to the highest value, not the highest"),
            ("rms", "an effective value (rms), not the largest")),
    "min": (("max", "the largest value, not the smallest"), ("final", "the value at the end, not the smallest")),
    "mean": (("final", "the value at the end, not the mean"), ("max", "the largest value, not the mean"),
             ("rms", "an effective value (rms), not the mean")),
    "rms": (("amplitude", "the amplitude, not the effective value (rms)"), ("max", "the largest value, not the rms"),
            ("mean", "the mean, not the effective value (rms)")),
    "amplitude": (("peak_to_peak", "the distance from peak to peak: the amplitude is half of it"),
                  ("max", "the largest value: the amplitude is measured from the mean, not from 0"),
                  ("rms", "an effective value (rms), not the amplitude")),
    "peak_to_peak": (("amplitude", "the amplitude: from peak to peak is twice as far"),
                     ("max", "the largest value, not the distance from peak to peak")),
    "decay_rate": (),
    "crossing": (),
}  # fmt: skip
"""What is measured in place of a quantity."""

FACTORS: Mapping[QuantityName, Sequence[tuple[Callable[[Floats], Floats], str]]] = {
    "period": (
        (lambda right: right / 2, "half a period: the motion comes by twice in each period, once in either direction"),
        (lambda right: right / 4, "a quarter of a period: from a turning point to the middle"),
        (lambda right: 2 * right, "two periods"),
        (lambda right: 1 / right, "the frequency: the period is one over it"),
        (lambda right: 2 * pi / right, "the angular frequency: the period is 2π over it"),
    ),
    "frequency": (
        (lambda right: 2 * right, "twice the frequency: the motion comes by twice in each period"),
        (lambda right: right / 2, "half the frequency"),
        (lambda right: 1 / right, "the period: the frequency is one over it"),
        (lambda right: 2 * pi * right, "the angular frequency, which is 2π times the frequency"),
    ),
    "decay_rate": (
        (lambda right: 1 / right, "the time constant: the rate is one over it"),
        (lambda right: log(2) / right, "the half-life, not the rate"),
        (lambda right: 2 * right, "twice the rate, as energies decay: the motion itself decays at half of it"),
        (lambda right: right / 2, "half the rate"),
    ),
    "amplitude": ((lambda right: right / 2, "half the amplitude"),),
}  # fmt: skip
"""Numbers that follow from the right one, and what they are."""

GENERAL: Sequence[tuple[Callable[[Floats], Floats], str]] = (
    (lambda right: 2 * right, "{label} is twice what it should be."),
    (lambda right: right / 2, "{label} is half of what it should be."),
    (lambda right: 1 / right, "{label} is one over what it should be."),
)

NOT_RESET = (
    "{label} is measured in a run that begins where another one has ended: reset the data, or make a new one, before "
    "each measurement."
)

COARSER = (0.5, 0.2, 0.1)
FINER = (2.0, 4.0, 10.0, 0.5, 0.1)


def is_formula(scene: Scene) -> Found:
    """The author's formula in place of a measurement."""
    formula = scene.claim.formula
    if formula is not None:
        yield (
            f"{{label}} is what {formula.text} gives. {formula.why}",
            (scene.read_first(formula.expr)),
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


def has_transient(scene: Scene) -> Found:
    """The whole run, where its begin is to be left out."""
    if scene.claim.since > 0:
        yield (
            "{label} is measured from the start: the transient is included. Wait until it has died away.",
            scene.measure_as(scene.claim.quantity, since=0.0),
        )


def is_other_quantity(scene: Scene) -> Found:
    """Another quantity of the same run."""
    for name, what in INSTEAD.get(scene.claim.quantity, ()):
        yield f"{{label}} is {what}.", scene.measure_as(name)
    if scene.claim.quantity == "settling" and scene.claim.level is not None:
        for direction in ("down", "up"):
            level, band = scene.claim.level, scene.claim.band or 0.0
            edge = level + band if direction == "down" else level - band
            yield (
                "{label} is the first time within the band: the motion leaves it again. Take the last time outside.",
                scene.measure_as("crossing", level=edge, direction=direction, count=1),
            )
    if scene.claim.quantity != "trace":
        yield "{label} is the value at the start: nothing was simulated.", scene.read_first(scene.claim.expr)


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
        yield f"{{label}} is what the integrator {name} gives, which is not that of the experiment.", values


def has_other_timestep(scene: Scene) -> Found:
    """Another timestep than the claim is about."""
    if scene.claim.timestep == "given":
        for finer in FINER:
            yield (
                "{label} is what another timestep gives: it is asked for at the timestep of the model.",
                scene.read(variant=Variant(finer=finer)),
            )
        return
    coarse = "{label} is what a timestep gives that is too long: shorten it until the number no longer changes."
    yield coarse, scene.measured.own
    for finer in COARSER:
        yield coarse, scene.read(variant=Variant(finer=finer))


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


RULES: Sequence[Callable[[Scene], Found]] = (
    is_formula, has_other_integrator, is_another_claim, is_in_other_unit, is_related_number, has_transient,
    is_other_quantity, has_wrong_sign, is_mixed_up, is_other_crossing, counts_steps, has_other_start, misses_reset,
    reads_other_sensor, has_other_timestep, is_one_step_off, is_multiple,
)  # fmt: skip
"""In this order: what is most likely and most telling first."""
