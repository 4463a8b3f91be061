"""Words around a typed number: a bound, where the question asks for the largest or smallest, and remarks behind it."""

import re
from enum import Enum

from grader.questions.kinds.number.units import known_unit


class AskedBound(Enum):
    """Which bound of a quantity a question asks for: an answer such as `at most 5 ms` then is one number."""

    LARGEST = "largest"
    SMALLEST = "smallest"


LARGEST = re.compile(
    r"\b(?:largest|maximum|maximal|max|highest|longest|greatest|upper (?:limit|bound)|at most|größte\w*|höchste\w*)\b",
    re.I,
)
SMALLEST = re.compile(
    r"\b(?:smallest|minimum|minimal|min|lowest|shortest|fewest|lower (?:limit|bound)|at least|kleinste\w*)\b", re.I
)

SUBJECT = (
    r"(?:(?:the |my )?(?!(?:no|not|never|at|up) )[^\W\d]\w{0,15}(?: step)?'? )?"
    r"(?:(?:is|are|must be|should be|has to be|can be|may be) )?"
)
"""What may precede a bound: `h must be`, `the timestep is`."""

LESS = r"(?:less|smaller|lower|shorter)"
MORE = r"(?:more|larger|greater|higher|longer)"
NOT = r"(?:no|not|never)"
THAN = r"(?:(?:than )?or equal(?: to)?|than)"
JUST = r"(?:(?:just|strictly|anything|everything|always) )?"
BEFORE_NUMBER = r"(?: ?: ?| ?(?=[0-9.,(])| (?=about |approx))"

BOUNDS = {
    AskedBound.LARGEST: rf"at most|up to|max(?:imum|imal)?(?: of|\.)?|{NOT} {MORE} than|{LESS} {THAN}|below|under"
    r"|höchstens|bis zu|≤|<=|=<|<",
    AskedBound.SMALLEST: rf"at least|from|min(?:imum|imal)?(?: of|\.)?|{NOT} {LESS} than|{MORE} {THAN}|above|over"
    r"|mindestens|≥|>=|=>|>",
}
BEFORE = {asks: re.compile(rf"{SUBJECT}{JUST}(?:{words}){BEFORE_NUMBER}", re.I) for asks, words in BOUNDS.items()}
BEHIND = {
    AskedBound.LARGEST: re.compile(rf",? (?:or (?:{LESS}|below|under)|max(?:imum)?|at most)[.! ]*$", re.I),
    AskedBound.SMALLEST: re.compile(rf",? (?:or (?:{MORE}|above|over)|min(?:imum)?|at least)[.! ]*$", re.I),
}
OTHER = re.compile(r"\b(?:or|and|to|not|between)\b", re.I)
"""Words after which a bound is not one number: `less than 5 or more than 7`."""

REMARK = re.compile(
    r",? (?:because|since|weil|due to|for stability|or so|I (?:believe|think|guess)|probably|approx\w*)\b[. ]*(.*)$",
    re.I,
)
"""A reason or a hedge behind an answer; what stands before it is the answer."""

IN_PARENTHESES = re.compile(r"^(.*[\w%°.]) ?\(([^\W\d_]+(?: [^\W\d_]+)*)\)$")
"""Words without a number in parentheses behind an answer: `5 ms (rounded)`, `5 ms (milliseconds)`."""

HARMLESS = re.compile(r"rounded|approx(?:imately)?|about|exact(?:ly)?|calculated|measured|simulated|I think", re.I)
"""Words in parentheses that change no answer, beside units; `5 ms (wrong)` is no answer."""

NON_BREAKING = re.compile(r"(?<=[0-9]) ?~ ?(?=[^\W\d]|$)")
"""TeX's space between a number and its unit, typed without the rest of TeX."""


def find_asked_bound(question: str) -> AskedBound | None:
    """Returns which bound a question asks for, by its words; None if by none, or by both."""
    bounds = [
        asks
        for asks, words in ((AskedBound.LARGEST, LARGEST), (AskedBound.SMALLEST, SMALLEST))
        if words.search(question)
    ]
    return bounds[0] if len(bounds) == 1 else None


def drop_bound(text: str, asks: AskedBound) -> str:
    """Returns an answer without the words that make it the bound that is asked for; others are left as they are."""
    match = BEFORE[asks].match(text)
    rest = text[match.end() :] if match else text
    if not match:
        rest = BEHIND[asks].sub("", text)
    return text if rest == text or OTHER.search(rest) else rest


def split_remark(text: str) -> tuple[str, str]:
    """Returns an answer, and a remark behind it that is left out; empty if there is none."""
    match = REMARK.search(text)
    if match and re.search(r"[0-9]", text[: match.start()]):
        if match[0].strip(" ,").lower() in {"because", "since", "weil", "due to"}:
            return text, ""  # the sentence breaks off
        return text[: match.start()].rstrip(" ,"), text[match.start() :].strip(" ,")
    match = IN_PARENTHESES.match(text)
    if match and (HARMLESS.fullmatch(match[2]) or known_unit(match[2])):
        return match[1], match[2]
    return text, ""
