"""Compares the words of a question with what its `verify` measures: a key can be certified of something else."""

import re
from collections.abc import Callable, Iterator, Sequence
from math import isclose, pi

from mujoco import MjModel

from grader.certify.wording import read_question
from grader.domain.pages.markup import plain_text
from grader.domain.verify import ByExpression, ByMeasurement, ByStage, ByThreshold
from grader.experiments.runs import DATA_FIELDS
from grader.numerics.integrators import BY_CODE

COMPARED = {
    "max": "largest",
    "min": "smallest",
    "mean": "mean",
    "amplitude": "amplitude",
    "peak_to_peak": "peak to peak",
    "rms": "root mean square",
    "end": "value at the end",
}
"""Quantities that are not taken for each other, and their words."""

ENDS = re.compile(
    r"\b(?:finally|in the end|ends? (?:up|at)|final (?:angle|position|place|height|distance|speed|velocity|rate|value|"
    r"energy|displacement|deflection|state|force|torque))\b|\bat the end(?! of (?!the (?:run|motion|simulation)\b))",
    re.I,
)
"""Words for the value at the end of a run, and for nothing else."""

NUMERALS = ("one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
WORDED_NUMBERS = {word: number for number, word in enumerate(NUMERALS, 1)}
MOMENT = rf"([0-9]+(?:\.[0-9]+)?|{'|'.join(NUMERALS)}) ?(ms|milliseconds?|s|secs?|seconds?)\b"
AT = re.compile(rf"(?:\bafter |\bat (?:time )?|\bt ?= ?){MOMENT}|\b{MOMENT} (?:later|after)\b", re.I)
NAMED = re.compile(r"\b(?i:under|with|using|integrator) (Euler|RK4|implicitfast)\b")
NAMES = re.compile(r"\b(?:Euler|RK4|implicitfast)\b", re.I)
"""The integrators whose names mean nothing else."""

PLACE = re.compile(r"\bat (?:its |the )?(?:lowest|highest|nearest|closest|farthest) \w+", re.I)
"""A moment of a motion, in words that ask for no extreme."""

SET = re.compile(r"data\.(?:qpos|qvel)\[\d+\] *= *(-?[0-9.]+) *(?:;|\n|$)")
ANGLE = re.compile(r"Math\.(?:sin|cos|tan)\( *(-?[0-9.]+) *\)")


FIELDS = re.compile(rf"\b(?:{'|'.join(sorted(DATA_FIELDS - {'act', 'energy'}))})\b")
"""The arrays of mjData whose names mean nothing else."""

WORDED = (ByMeasurement, ByExpression, ByThreshold, ByStage)
"""The ways to derive a key that words can contradict."""


def list_contradictions(
    text: str, verify: ByMeasurement | ByExpression | ByThreshold | ByStage, read_model: Callable[[], MjModel]
) -> Iterator[str]:
    """Yields what the text of a question, HTML, says otherwise than its `verify`."""
    if isinstance(verify, ByThreshold):
        names = find_integrator(plain_text(text))
        if len(names) == 1 and verify.integrator not in names:
            yield f"The words name the integrator {names.pop()}, and verify.integrator is {verify.integrator}."
        return
    if isinstance(verify, ByStage):
        fields = set(FIELDS.findall(plain_text(text)))
        if len(fields) == 1 and verify.fills not in fields:
            yield f"The words name data.{fields.pop()}, and verify.fills is {verify.fills}."
        return
    for number in ANGLE.findall(verify.expr):
        if abs(float(number)) > 2 * pi:
            yield f"JavaScript takes angles in radians: write {number} * Math.PI / 180 in verify.expr for {number}°."
    if isinstance(verify, ByMeasurement):
        yield from _compare_measurement(plain_text(text), verify, read_model)


def find_integrator(text: str) -> set[str]:
    """Returns the integrator that a text names as that of its runs; none where it names several."""
    return set(NAMED.findall(text)) if len({*NAMES.findall(text)}) == 1 else set()


def find_moments(text: str, times_s: Sequence[float]) -> set[float]:
    """Returns the moments that a text names [s], without the start: `2 s later` is one where no other of the `times_s`
    of the text may be the time from which it counts."""
    moments = set[float]()
    for at, at_unit, later, later_unit in AT.findall(text):
        number = float(WORDED_NUMBERS.get((at or later).casefold(), at or later))
        moment = number / (1000 if (at_unit or later_unit).casefold().startswith("m") else 1)
        if at or set(times_s) <= {moment}:
            moments.add(moment)
    return moments - {0.0}


def _compare_measurement(text: str, verify: ByMeasurement, read_model: Callable[[], MjModel]) -> Iterator[str]:
    asked = read_question(PLACE.sub("", text))
    words, measured = asked.quantities, COMPARED.get(verify.when)
    if words == ("rms", "mean"):  # the root of the mean square
        words = ("rms",)
    if words == ("end",) and not ENDS.search(text):
        words = ()
    if (
        len(words) == 1 and words[0] in COMPARED and verify.when not in ("end", *words) and measured
        and "-" not in verify.expr
    ):  # fmt: skip
        yield f"The words ask for the {COMPARED[words[0]]}, and verify.when measures the {measured}."
    moments = find_moments(text, asked.moments_s)
    if (
        verify.when == "end"
        and len(moments) == 1
        and not isclose(moment := moments.pop(), verify.seconds, rel_tol=1e-6)
    ):
        yield f"The words name {moment:g} s, and verify.seconds ends the run at {verify.seconds:g} s."
    names = find_integrator(text)
    if len(names) == 1 and "integrator" not in (verify.setup or ""):
        name, own = names.pop(), BY_CODE[int(read_model().opt.integrator)].name
        if name != own:
            yield f"The words name the integrator {name}, and the model's is {own}: set model.opt.integrator in setup."
    for number in SET.findall(verify.setup or ""):
        if abs(float(number)) > 2 * pi and f"{number}°" in text.replace(" ", ""):
            yield f"Angles of the data are in radians: write {number} * Math.PI / 180 in verify.setup for {number}°."
