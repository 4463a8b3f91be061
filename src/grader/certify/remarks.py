"""What `grader check` remarks on a question beside its certificate: keys without one, and the chance of luck."""

from dataclasses import dataclass

from grader.exercises import compute_chance_of_luck
from grader.exercises.kind import TextOf
from grader.questions import AnswerKey, ModelXml, NumberKey, Question

UNVERIFIED = "no simulation confirms this key: add a `verify` (docs/authoring.md)"


def is_decidable(key: AnswerKey) -> bool:
    """Whether a `verify` could derive the key again: a number, or an option with a lab to run."""
    return isinstance(key, NumberKey) or key.lab is not None


@dataclass(frozen=True)
class Luck:
    """A bound of the chance that a fixed answer passes an exercise, and the largest chance that is allowed."""

    chance: float
    allowed: float

    @property
    def why(self) -> str | None:
        """Why it is too likely, with the cure; None where it is not."""
        if self.chance <= self.allowed:
            return None
        why = f"a fixed answer is right in every case with a chance of {self.chance:.1e}; {self.allowed:g} is allowed"
        if self.chance == 1:
            why += (
                "; no case draws a number, a program draws without its `rng`, a tolerance holds all that is drawn, or "
                "the kind does not say what is right"
            )
        cure = (
            "draw more numbers, from wider ranges, in more hidden cases, narrow the tolerance, or raise `luck` and say "
            "why in `x-luck`"
        )
        return f"{why}: {cure}"


def estimate_luck(question: Question, model_xml: ModelXml, text_of: TextOf) -> Luck:
    """Returns the chance of luck at an exercise. Draws every case 200 times: seconds where judging one is slow."""
    return Luck(*compute_chance_of_luck(question, model_xml, text_of))
