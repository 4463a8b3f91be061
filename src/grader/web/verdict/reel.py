"""A reel: one attempt of several at a question, with what has changed since the one before."""

import difflib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from grader.errors import NotFound
from grader.questions import Question, show_answer
from grader.web.verdict.card import Card, build_card
from grader.web.verdict.work import GivenAnswer

REEL_MAX = 30
"""Attempts of a reel, the newest ones."""

LINES_MAX = 2000
"""Longer scripts are not compared."""

REPEATED = 20
"""A line that is there more often is only found beside others: to try every pair takes cubic time."""

AROUND = 3
"""Lines that stay on either side of a change."""

NO_ATTEMPT = "There is no such attempt."


@dataclass(frozen=True)
class LineChange:
    """A line of a script beside the one before: `same`, `new` or `gone`; `skipped` says how many equal lines are left
    out here. `number` is its place in the script that has it."""

    kind: str
    number: int
    text: str


@dataclass(frozen=True)
class Stop:
    """An attempt in the row: its id, its number, and its state in words."""

    id: str
    attempt: int
    words: str


@dataclass(frozen=True)
class Reel:
    """What reel.html shows: the attempts, oldest first, the place of the one that is shown, and that one. `answer` is
    one that is no script, in words. `changes` is None for a first script and for one too long to compare."""

    stops: Sequence[Stop]
    at: int
    given: GivenAnswer
    card: Card | None
    answer: str
    changes: Sequence[LineChange] | None

    @property
    def before(self) -> Stop | None:
        """The attempt before."""
        return self.stops[self.at - 1] if self.at else None

    @property
    def after(self) -> Stop | None:
        """The attempt after."""
        return self.stops[self.at + 1] if self.at + 1 < len(self.stops) else None


def build_reel(attempts: Sequence[GivenAnswer], question: Question | None, chosen: str | None) -> Reel:
    """Returns the reel of some attempts, newest first, at the chosen one, else at the newest. Raises NotFound."""
    row = [*reversed(attempts)]
    at = next((at for at, attempt in enumerate(row) if attempt.id == chosen), len(row) - 1 if chosen is None else -1)
    if at < 0:
        raise NotFound(NO_ATTEMPT)
    given = row[at]
    answer = "" if given.is_script else given.text if question is None else show_answer(question, given.answer)
    changes = compare_scripts(row[at - 1].text, given.text) if at and given.is_script else None
    stops = [Stop(attempt.id, attempt.attempt, attempt.badge.word) for attempt in row]
    return Reel(stops, at, given, build_card(given), answer, changes)


def compare_scripts(before: str, after: str) -> list[LineChange] | None:
    """Returns the lines that have changed with those around them; None where the scripts are too long to compare."""
    olds, news = before.splitlines(), after.splitlines()
    if len(olds) + len(news) > LINES_MAX:
        return None
    changes: list[LineChange] = []
    shown = 0
    repeated = {line for line, count in Counter(news).items() if count > REPEATED}
    for group in difflib.SequenceMatcher(repeated.__contains__, olds, news).get_grouped_opcodes(AROUND):
        if (skipped := group[0][3] - shown) > 0:
            changes.append(LineChange("skipped", skipped, ""))
        for tag, a, b, c, d in group:
            if tag == "equal":
                changes += [LineChange("same", number, news[number - 1]) for number in range(c + 1, d + 1)]
                continue
            changes += [LineChange("gone", number, olds[number - 1]) for number in range(a + 1, b + 1)]
            changes += [LineChange("new", number, news[number - 1]) for number in range(c + 1, d + 1)]
        shown = group[-1][4]
    if changes and len(news) > shown:
        changes.append(LineChange("skipped", len(news) - shown, ""))
    return changes
