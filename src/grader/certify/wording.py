"""What the words of a question ask for, a quantity of a run, a moment, a level; what the words of options claim."""

import re
from dataclasses import dataclass
from enum import Enum

from grader.domain.pages.markup import plain_text
from grader.errors import InvalidAnswer
from grader.questions.kinds.number.phrases import LARGEST, SMALLEST
from grader.questions.kinds.number.units import Unit, convert, known_unit

ASKED: dict[str, re.Pattern[str]] = {
    name: re.compile(rf"\b(?:{words})\b", re.I)
    for name, words in {
        "period": r"periods?|how long (?:is|does) (?:a|one) (?:full |whole )?(?:swing|oscillation|turn|cycle)",
        "frequency": r"(?:angular )?frequenc(?:y|ies)|(?:swings|oscillations|cycles) (?:per|a) second",
        "settling": r"settling time|settles? (?:to )?within|(?:how long|when).{0,40}\bsettled?",
        "decay_rate": r"decay rate|rate of decay|(?:amplitude|swing) decays? at",
        "amplitude": r"amplitudes?",
        "peak_to_peak": r"peak.to.peak|from (?:its |the )?(?:lowest|peak) to (?:its |the )?(?:highest|peak)",
        "rms": r"rms|root.mean.square|effective value",
        "mean": r"mean|average|averaged|on average",
        "crossings": r"how many times|how often|number of (?:passes|crossings|times)",
        "crossing": r"at what time|after how (?:long|many seconds)|how long (?:until|before|does it take)|"
                    r"(?:when|at which moment) (?:does|is|will|do)|time (?:to|until|at which)|takes? to (?:reach|fall)",
        "end": r"at the end|finally|in the end|end up|ends at|comes? to rest at|final|afterwards|"
               r"after [0-9.]+ ?(?:s|ms|seconds?)|(?:at )?t = [0-9.]+|[0-9.]+ ?s later",
    }.items()
}  # fmt: skip
"""Words by which a quantity is known to be asked for."""

MAX = re.compile(rf"{LARGEST.pattern}|\b(?:most|peak|top|fastest|farthest|furthest|deepest|biggest|strongest)\b", re.I)
MIN = re.compile(rf"{SMALLEST.pattern}|\b(?:least|slowest|nearest|closest|weakest)\b", re.I)
STABLE_STEP = re.compile(r"\b(?:timestep|time step|step size)s?\b", re.I)
FAR = re.compile(r"\bhow far\b|\bdistance\b|\bdrift\w*|\bby how much\b|\btravels?\b|\bmoved?s?\b|\bchanges?\b", re.I)

UNSIGNED = re.compile(
    r"\b(?:speed|fast(?:est)?|far(?:thest)?|furthest|distance|size|magnitude|sign|deviation|error|drift)\b", re.I
)
"""Words for what has no sign."""

AMOUNT = re.compile(r"(?<![\w.])([-+−]?(?:\d+(?:\.\d+)?|\.\d+)(?:e[-+]?\d+)?) ?((?:[^\W\d]|°|%)[^\s,;:?!()]*)?", re.I)
WITHIN = re.compile(r"(?:within|±|\+/-) ?$", re.I)
COUNTS = {"never": 0, "once": 1, "twice": 2, "one": 1, "two": 2, "three": 3, "four": 4, "five": 5, "six": 6}
COUNT = re.compile(rf"\b({'|'.join(COUNTS)})\b", re.I)


class Way(Enum):
    """How something changes, as an option says."""

    UP = "up"
    DOWN = "down"
    SAME = "same"
    MOVES = "moves"


WAYS: dict[Way, re.Pattern[str]] = {
    way: re.compile(rf"\b(?:{words})\b", re.I)
    for way, words in {
        Way.SAME: r"stays?|remains?|rests?|still|constant|(?:the )?same|unchanged|nothing|no change|holds?|keeps?|"
                  r"equal|conserved|stands?|stuck|sticks?",
        Way.UP: r"rises?|increases?|grows?|gains?|up|upwards?|larger|higher|more|accelerates?|faster|forwards?|right|"
                r"positive|climbs?",
        Way.DOWN: r"falls?|drops?|decreases?|shrinks?|decays?|loses?|down|downwards?|smaller|lower|less|slows?|slower|"
                  r"backwards?|left|negative|sinks?",
        Way.MOVES: r"moves?|swings?|slides?|tips?|topples?|slips?|rolls?|oscillates?|turns?|drifts?|tumbles?|rotates?",
    }.items()
}  # fmt: skip

AFFIRMED, DENIED = re.compile(r"^(?:yes|true)\b", re.I), re.compile(r"^(?:no|false)\b", re.I)
NEGATION = re.compile(r"\b(?:not|never|n't|no longer)\b", re.I)


@dataclass(frozen=True)
class Amount:
    """A number of a text with its unit, None where it is not known; `is_width` says that it follows `within`."""

    value: float
    unit: Unit | None
    is_width: bool = False

    def to(self, unit: str) -> float | None:
        """Returns the number in another unit, or None."""
        wanted = known_unit(unit)
        if self.unit is None or wanted is None:
            return None
        try:
            return convert(self.value, self.unit, wanted)
        except InvalidAnswer:
            return None


@dataclass(frozen=True)
class AskedQuantities:
    """What a question asks for: the names of quantities, none where its words name none; the moments [s] that it names,
    and all of its numbers with a unit; and words by which labels are recognised."""

    quantities: tuple[str, ...]
    moments_s: tuple[float, ...]
    amounts: tuple[Amount, ...]
    words: frozenset[str]
    is_timestep: bool
    is_far: bool
    is_unsigned: bool


def read_question(text: str) -> AskedQuantities:
    """Returns what the text of a question, HTML, asks for."""
    plain = plain_text(text)
    quantities = [name for name, words in ASKED.items() if words.search(plain)]
    if not set(quantities) - {"end"}:  # the largest within 2 s is no value at 2 s
        extremes = [name for name, words in (("max", MAX), ("min", MIN)) if words.search(plain)]
        quantities = extremes or quantities
    amounts = tuple(list_amounts(plain))
    moments = [value for amount in amounts if (value := amount.to("s")) is not None and value > 0]
    return AskedQuantities(
        tuple(quantities), tuple(dict.fromkeys(moments)), amounts, read_words(plain), bool(STABLE_STEP.search(plain)),
        bool(FAR.search(plain)), bool(UNSIGNED.search(plain)),
    )  # fmt: skip


def read_words(text: str) -> frozenset[str]:
    """Returns the words of a text of three letters and more, in small letters and without a plural s."""
    return frozenset(word.casefold().removesuffix("s") for word in re.findall(r"[^\W\d_]{3,}", text))


def list_amounts(plain: str) -> list[Amount]:
    """Returns the numbers of a text, with the units that follow them."""
    amounts = []
    for match in AMOUNT.finditer(plain):
        unit = known_unit(match[2].rstrip(".")) if match[2] else None
        is_width = bool(WITHIN.search(plain[: match.start()]))
        amounts.append(Amount(float(match[1].replace("−", "-")), unit, is_width))
    return amounts


def read_amount(option: str) -> Amount | None:
    """Returns the one number of an option, also one in words; None where it has none or several."""
    plain = plain_text(option)
    amounts = list_amounts(plain)
    if not amounts and (count := COUNT.search(plain)):
        return Amount(COUNTS[count[1].casefold()], None)
    return amounts[0] if len(amounts) == 1 else None


def read_way(text: str) -> Way | None:
    """Returns what a text says of a change; None where it says nothing, or more than one thing."""
    plain = plain_text(text)
    ways = [way for way, words in WAYS.items() if words.search(plain)]
    if len(ways) != 1:
        return None
    if NEGATION.search(plain):
        return Way.SAME if ways[0] is not Way.SAME else Way.MOVES
    return ways[0]


def read_ways(question: str, options: tuple[str, ...]) -> list[Way] | None:
    """Returns what each option says of a change, all different; yes and no are read beside the question."""
    plain = [plain_text(option) for option in options]
    if len(plain) == 2 and sorted((bool(AFFIRMED.match(option)), bool(DENIED.match(option))) for option in plain) == [
        (False, True), (True, False),
    ]:  # fmt: skip
        asked_way = read_way(question)
        other = {Way.SAME: Way.MOVES}.get(asked_way, Way.SAME) if asked_way is not None else None
        if asked_way is None or other is None:
            return None
        return [asked_way if AFFIRMED.match(option) else other for option in plain]
    ways = [read_way(option) for option in options]
    known = [way for way in ways if way is not None]
    return known if len(known) == len(ways) == len(set(known)) else None
