"""Mistakes of a class by family: sentences that differ in a line, a name or a number are one mistake. Pure."""

import hashlib
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from grader.courses.rules.statistics import CRASHED, group_crash
from grader.domain.verdict import Status

CLAUSE = re.compile(
    r"[:;(]\s|\.(?:\s|$)|, (?:although|which|where|in line \d)|(?<! rightly)(?<! should)(?<! fast)(?<! order), but"
)
"""Where the first clause of a sentence ends: what follows explains or mends. Behind praise it tells what is wrong."""

HANGING = re.compile(r", (?:although|which|where|in line \d)")
"""Where a clause begins that is no sentence without the one before."""

PLACE = re.compile(
    r"(?![A-Z])(?:(?!\. )[^:\n]){1,120}: (?=[A-Z]|\w+\.\w+\()"
    r"|(?:(?!\. )[^:\n]){1,120}: (?=(?:your|each) number\b)|[a-z_]\w*: "
)
"""Where a mistake was made, before the sentence on it: a case's title, a function's name, the label of a number."""

COUNTED = re.compile(r"[A-Z]\w{2,9} things are wrong\. First: ")
"""What begins a sentence on several mistakes: its family is that of the first."""

VARYING = re.compile(r"\b\d[\d.,]*\b|'[^']{1,80}'|`[^`]{1,80}`|\b\w*_\w+\b")
"""What two sentences on one mistake may differ in: numbers, quoted text, names of variables."""

OF_ONE_SCRIPT = re.compile(
    r"^(?:[^:\n]{1,200}: )?[A-Z]\w{0,60}(?:Error|Exception)\b|\b[Ll]ine \d|cannot compile the model|\(\d+ more\)"
)
"""A sentence that quotes a script: its error, a line, or the first of all that differs."""

WORD = re.compile(r"(?:a|[a-z]{2,})(?=[\s,:;.]|$)(?!\.\w)")
"""A word at the beginning, rather than code: `k3`, `data.act`, `q`."""

ENDS = {
    Status.CRASHED: "Ended with an error",
    Status.TIMED_OUT: "Ran out of time",
    Status.OUT_OF_MEMORY: "Ran out of memory",
    Status.OUTPUT_TOO_LARGE: "Printed too much",
    Status.FORBIDDEN: "Used what is not allowed",
}
OTHER = "Another mistake"
"""The name where the grader has no sentence."""


@dataclass(frozen=True)
class Mistake:
    """One wrong attempt: the family's `key`, its name, and the whole sentence, which is empty where there is none."""

    key: str
    name: str
    sentence: str


@dataclass(frozen=True)
class LearnerMistake:
    """A learner's mistake: the last attempt that ended in it, by the id of the submission."""

    learner: str
    submission: str


@dataclass(frozen=True)
class Family:
    """A mistake of several learners: in `still` it is their newest verdict, in `was` only an earlier one."""

    key: str
    name: str
    sentence: str
    still: tuple[LearnerMistake, ...]
    was: tuple[LearnerMistake, ...]

    @property
    def learners(self) -> int:
        """How many have made it."""
        return len(self.still) + len(self.was)

    @property
    def is_named(self) -> bool:
        """Whether it is one mistake, and not all for which the grader has no sentence."""
        return self.name != OTHER


def name_mistake(status: str, diagnosis: str | None) -> Mistake | None:
    """Returns the mistake behind a verdict; None where it is right, or waits for a person."""
    if status in (Status.CORRECT, Status.NEEDS_REVIEW):
        return None
    return name_family(diagnosis) if diagnosis else make_mistake(ENDS.get(Status(status), OTHER), "")


def name_family(sentence: str) -> Mistake:
    """Returns the mistake that a sentence is about; an exception may have been grouped before."""
    grouped = group_crash(sentence)
    is_crash = grouped != sentence or sentence.startswith(CRASHED)
    name = grouped if is_crash else CLAUSE.split(drop_place(sentence), maxsplit=1)[0].strip()
    return make_mistake(name or OTHER, sentence)


def drop_place(sentence: str) -> str:
    """Returns a sentence without where the mistake was made, and how many there are."""
    match = COUNTED.match(sentence) or PLACE.match(sentence)
    rest = sentence[match.end() :] if match else sentence
    return rest[:1].upper() + rest[1:] if rest.startswith(("your ", "each ")) else rest


def make_mistake(name: str, sentence: str) -> Mistake:
    """Returns a mistake with the key of its family."""
    key = hashlib.sha256(VARYING.sub("#", name).casefold().encode()).hexdigest()[:12]
    return Mistake(key, name, sentence)


def group_mistakes(attempts: Mapping[str, Sequence[tuple[str, Mistake | None]]]) -> list[Family]:
    """Returns the families of a class, those of most learners first. `attempts` are a learner's attempts in the order
    of time: the submission's id, and its mistake."""
    still: dict[str, list[LearnerMistake]] = {}
    was: dict[str, list[LearnerMistake]] = {}
    sentences: dict[str, Counter[tuple[str, str]]] = {}
    for learner, theirs in attempts.items():
        last = {mistake.key: (submission, mistake) for submission, mistake in theirs if mistake is not None}
        newest = theirs[-1][1] if theirs else None
        for key, (submission, mistake) in last.items():
            sentences.setdefault(key, Counter())[mistake.name, mistake.sentence] += 1
            place = still if newest is not None and newest.key == key else was
            place.setdefault(key, []).append(LearnerMistake(learner, submission))
    families = [
        Family(key, *counted.most_common(1)[0][0], tuple(still.get(key, ())), tuple(was.get(key, ())))
        for key, counted in sentences.items()
    ]
    return sorted(families, key=lambda family: (-family.learners, -len(family.still), family.name))


def find_cure(sentence: str) -> str:
    """Returns what a sentence on a mistake says after its first clause, in whole sentences: how it is mended. Empty
    where it ends there, and for an error, whose sentence is about the words of one script."""
    text = drop_place(sentence)
    match = None if OF_ONE_SCRIPT.search(sentence) else CLAUSE.search(text)
    while match is not None and HANGING.match(match[0]):
        match = CLAUSE.search(text, match.end())
    rest = "" if match is None else text[match.end() :].strip()
    if len(rest) <= 1:
        return ""
    return rest[:1].upper() + rest[1:] if WORD.match(rest) else rest
