"""AnswerKey: a number or an option that the author says is right, for `certify` to derive again by simulation."""

from dataclasses import dataclass

from grader.domain.lab import LabConfig
from grader.domain.verify import Verify


@dataclass(frozen=True, kw_only=True)
class KeyPart:
    """What every key has. `kind` is that of the question, `text` its wording and `explain` its explanation. `verify`
    says how the key is derived again; without it the text may. `lab` is the simulation that the question is about.
    `place` is the key of the question below which `answer` and `verify` are found in the author's JSON, such as
    `numbers.0`; empty for the question itself."""

    kind: str
    text: str
    explain: str = ""
    verify: Verify | None = None
    lab: LabConfig | None = None
    place: str = ""


@dataclass(frozen=True, kw_only=True)
class NumberKey(KeyPart):
    """A number in `unit`, right within the absolute `tolerance` in that unit."""

    answer: float
    tolerance: float
    unit: str | None = None


@dataclass(frozen=True, kw_only=True)
class OptionKey(KeyPart):
    """The 0-based index of the right one of the `options`."""

    answer: int
    options: tuple[str, ...]


AnswerKey = NumberKey | OptionKey
