"""QuizSource: what the file of a quiz says, before it is validated."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from grader.errors import Fault


@dataclass(frozen=True)
class QuizSource:
    """The JSON of a quiz, None where the file has `faults`. Of a file in Markdown also `lines` by key, `questions`, the
    id of each and the line at which it begins, and the `starters` that stand in the file itself, by path."""

    raw: Any | None
    faults: tuple[Fault, ...] = ()
    lines: Mapping[str, int] = field(default_factory=dict)
    questions: tuple[tuple[str, int], ...] = ()
    starters: Mapping[str, str] = field(default_factory=dict)

    def add_line(self, fault: Fault) -> Fault:
        """Returns a fault of the quiz with the line of its key, where lines are known, at the head of its reason."""
        if not self.lines or fault.key.startswith("line "):
            return fault
        steps = fault.key.split(".")
        keys = (".".join(steps[:count]) for count in range(len(steps), 0, -1))
        line = next((self.lines[key] for key in keys if key in self.lines), 1)
        return Fault(fault.file, fault.key, f"line {line}: {fault.why}")
