"""Give each text of one list its partner in another."""

from grader.questions.kinds.match.kind import Match, MatchQuestion

__all__ = ["Match", "MatchQuestion"]
