"""The results of a check of content."""

from dataclasses import dataclass, field
from typing import Any

from grader.errors import Fault


@dataclass
class Report:
    """The results of a check; it passed if there are no `faults`, and no keys that are `undecided` by simulation.
    `chances` are sentences on the luck at exercises, `proposals` what authors may
    paste for keys that no simulation confirms."""

    faults: list[Fault] = field(default_factory=list)
    undecided: list[Fault] = field(default_factory=list)
    warnings: list[Fault] = field(default_factory=list)
    chances: list[str] = field(default_factory=list)
    certificates: list[dict[str, Any]] = field(default_factory=list)
    proposals: list[dict[str, Any]] = field(default_factory=list)
    references: list[dict[str, Any]] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON, faults as {"file", "key", "why"}."""
        return {
            "ok": not self.faults and not self.undecided,
            "faults": [vars(fault) for fault in self.faults],
            "undecided": [vars(fault) for fault in self.undecided],
            "warnings": [vars(fault) for fault in self.warnings],
            "certificates": self.certificates,
            "proposals": self.proposals,
            "references": self.references,
        }
