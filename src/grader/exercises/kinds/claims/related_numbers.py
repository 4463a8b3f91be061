"""Numbers that stand in the place of a claim: in units that are taken for its own, of quantities that are measured in
place of its own, and what follows from the right one."""

from collections.abc import Callable, Mapping, Sequence
from math import log, pi

from grader.domain.quantities import QuantityName
from grader.exercises.kinds.claims.parameters import Floats

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
            ("rms", "an effective value (rms), not the largest"), ("mean", "the mean over the run, not the largest")),
    "min": (("max", "the largest value, not the smallest"), ("final", "the value at the end, not the smallest"),
            ("mean", "the mean over the run, not the smallest")),
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
        (lambda right: right / log(10), "computed with logarithms to the base 10: take the natural one, `np.log`"),
    ),
    "amplitude": ((lambda right: right / 2, "half the amplitude"),),
}  # fmt: skip
"""Numbers that follow from the right one, and what they are."""

GENERAL: Sequence[tuple[Callable[[Floats], Floats], str]] = (
    (lambda right: 2 * right, "{label} is twice what it should be."),
    (lambda right: right / 2, "{label} is half of what it should be."),
    (lambda right: 1 / right, "{label} is one over what it should be."),
)
