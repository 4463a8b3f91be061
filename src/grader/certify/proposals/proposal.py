"""Proposal: a `verify` that an author may paste, and whether the key holds under it."""

import json
from dataclasses import dataclass
from typing import Any

from grader.domain.numbers import WHOLE_MAX
from grader.domain.verify import Verify

NOT_CONFIRMED = "no simulation confirms this key"


@dataclass(frozen=True)
class Proposal:
    """The JSON of a `verify`, whether simulation certifies the key under it, and what was measured, in sentences.

    `gives` is what the simulation gives, `says` what the key says, both as people read them. `compared` counts the
    quantities that were compared with the key.
    """

    verify: dict[str, Any]
    holds: bool
    what: str
    gives: str
    says: str
    compared: int
    caution: str = ""

    @property
    def paste(self) -> str:
        """The text to paste into the question, beside its `answer`."""
        return f'"verify": {json.dumps(self.verify, ensure_ascii=False)}'

    @property
    def verdict(self) -> str:
        """Whether the key holds, in a sentence without the text to paste."""
        several = f"of {self.compared} quantities compared" if self.compared > 1 else "the one quantity compared"
        if self.holds:
            agreement = (
                "as the key says" if self.gives == self.says else f"and the key {self.says} is within its tolerance"
            )
            return f"the key holds: {self.what} is {self.gives}, {agreement} ({several}){self.caution}"
        where = f"the nearest {several}" if self.compared > 1 else several
        return (
            f"the simulation gives {self.gives} where the key says {self.says} ({self.what}, {where}){self.caution}: "
            "check the key, and whether the question asks for this"
        )

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {"verify": self.verify, "paste": self.paste, "holds": self.holds, "verdict": self.verdict}

    def __str__(self) -> str:
        """The remark of a check: the verdict and the text to paste."""
        if self.holds:
            return f"{NOT_CONFIRMED} yet. Proposed: {self.paste}. {self.verdict[:1].upper()}{self.verdict[1:]}"
        return f"{NOT_CONFIRMED}, and no quantity tried agrees: {self.verdict}. It would be {self.paste}"


def write_verify(verify: Verify) -> dict[str, Any]:
    """Returns a `verify` as JSON with what is not its default alone, `by` first."""
    written = verify.model_dump(mode="json", exclude_defaults=True)
    shortened: dict[str, Any] = shorten({"by": verify.by} | written)
    return shortened


def shorten(value: Any) -> Any:
    """Returns JSON with whole numbers as such: 8 in place of 8.0."""
    if isinstance(value, dict):
        return {key: shorten(part) for key, part in value.items()}
    if isinstance(value, list):
        return [shorten(item) for item in value]
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < WHOLE_MAX else value
