"""Graded: a verdict with the question that it is about, as every report needs them."""

from collections.abc import Iterator
from dataclasses import dataclass

from grader.domain.pages.markup import plain_text
from grader.domain.verdict import Finding, Status, Verdict, format_points
from grader.questions import Question, Quiz, kind_of


@dataclass(frozen=True)
class GradedAnswer:
    """A verdict on an answer to a question of a quiz; `seed` drew the hidden cases."""

    quiz: Quiz
    question: Question
    verdict: Verdict
    seed: int | None = None

    @property
    def title(self) -> str:
        """The question's title, in plain text."""
        return plain_text(self.question.title or self.question.label or self.question.id)

    @property
    def summary(self) -> str:
        """Status and points, and what was understood of a typed answer."""
        verdict = self.verdict
        read_as = f", read as {verdict.read_as}" if verdict.read_as else ""
        return f"{verdict.status}: {verdict.points:g} of {format_points(verdict.max_points)}{read_as}"

    @property
    def shows_solution(self) -> bool:
        """Whether the author lets a learner see what was expected; attempts and dates are not known here."""
        if kind_of(self.question).reveal(self.question) == "value":
            return True
        solutions = self.quiz.default_policy.solutions
        is_right = solutions == "when_right_or_spent" and self.verdict.status is Status.CORRECT
        return solutions == "with_feedback" or is_right

    @property
    def findings(self) -> Iterator[tuple[str, Finding]]:
        """Each finding with a name that no other one has: readers of reports drop the second of two equal names."""
        taken: set[str] = set()
        for number, finding in enumerate(self.verdict.findings, 1):
            name = finding.title if finding.title not in taken else f"{finding.title} [{number}]"
            taken.add(name)
            yield name, finding

    def describe(self, finding: Finding) -> str:
        """Returns the message of a finding with what was measured, and with what was expected if the learner may see
        that. The finding of a hidden case has neither."""
        names = ("measured", "expected") if self.shows_solution else ("measured",)
        values = [f"{name}: {value}" for name in names if (value := getattr(finding, name)) is not None]
        return "\n".join([*([finding.message] if finding.message else []), *values])
