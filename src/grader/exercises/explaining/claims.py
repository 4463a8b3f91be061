"""What the sentences on a mistake claim of a script, and when each claim is true. A sentence with a claim that is not
true is never shown, whatever rule made it."""

import ast
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from grader.exercises.explaining.script import ParsedScript
from grader.exercises.trace import Trace

RESETS = frozenset({"mj_resetData", "mj_resetDataKeyframe", "mj_resetDataDebug"})


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a claim is held against: the script, and the traces of the trials, failed ones apart."""

    script: ParsedScript
    traces: Sequence[Trace]
    failed: Sequence[Trace]


Condition = Callable[[Evidence, "re.Match[str]"], bool]


@dataclass(frozen=True)
class SentenceClaim:
    """What sentences claim that match `pattern`, and whether it is true. Where it is not, `weaker` stands in its place,
    which is true all the same; None: the sentence is not shown. Where the text of the script is unknown, what is
    claimed of it is taken for true, and so with what no trace tells of."""

    pattern: re.Pattern[str]
    is_true: Condition
    weaker: str | None = None


def of_script(is_true: Callable[[ParsedScript], Any]) -> Condition:
    """Returns the condition that the text of the script must meet."""
    return lambda evidence, _: evidence.script.tree is None or bool(is_true(evidence.script))


def uses(*names: str) -> Condition:
    """Returns the condition that one of these names is in the script."""
    return of_script(lambda script: script.names & {*names} or any(name in script.source for name in names))


def has_statement(evidence: Evidence, match: "re.Match[str]") -> bool:
    """Whether the line that is named holds a statement, or a part of one."""
    line = int(match[1])
    return evidence.script.tree is None or any(
        isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno)
        for node in evidence.script.nodes
    )


def has_clause(evidence: Evidence, match: "re.Match[str]") -> bool:
    """Whether the line that is named begins an `except` clause."""
    return evidence.script.tree is None or any(
        isinstance(node, ast.ExceptHandler) and node.lineno == int(match[1]) for node in evidence.script.nodes
    )


def returns_none(evidence: Evidence, _: object) -> bool:
    """Whether None was returned in a failed trial, if the traces say what was."""
    types = [value.type for trace in evidence.failed for value in trace.returned_values]
    return not types or "NoneType" in types


def has_printed(evidence: Evidence, _: object) -> bool:
    """Whether a failed trial printed anything."""
    return any(trace.printed_text is not None for trace in evidence.failed) or "print" in evidence.script.names


def has_caught(evidence: Evidence, _: object) -> bool:
    """Whether a clause caught an exception."""
    return any(trace.handled_exceptions for trace in evidence.failed)


def build_claims(table: Sequence[tuple[str, Condition] | tuple[str, Condition, str]]) -> tuple[SentenceClaim, ...]:
    """Returns the claims of a table: patterns, conditions, and weaker words where there are any."""
    return tuple(SentenceClaim(re.compile(pattern), is_true, *weaker) for pattern, is_true, *weaker in table)


CLAIMS = build_claims([
    (r"\b[Ll]ine (\d+)\b", has_statement),
    (r"`except` in line (\d+)", has_clause),
    (r"`except` in line", has_caught),
    (r"[Yy]our loop", of_script(lambda script: script.has_loop)),
    (r"[Yy]our function prints", has_printed),
    (r"[Yy]our function returns? None|function returned None", returns_none),
    (r"outside of the function", of_script(lambda script: script.keeps_values_outside)),
    (r"resets the data", of_script(lambda script: script.names & RESETS or "MjData" in script.names)),
    (r"makes an MjData", uses("MjData")),
    (r"Your step calls mj_forwardSkip", uses("mj_forwardSkip")),
    (r"Your step is taken by scipy", uses("scipy")),
])  # fmt: skip
"""The claims that sentences of any kind may make."""


def find_untrue(sentence: str, evidence: Evidence, claims: Sequence[SentenceClaim] = CLAIMS) -> Iterator[str]:
    """Yields each part of a sentence that is not true."""
    for claim in claims:
        for match in claim.pattern.finditer(sentence):
            if not claim.is_true(evidence, match):
                yield match[0]


def correct_sentence(sentence: str, evidence: Evidence, claims: Sequence[SentenceClaim] = CLAIMS) -> str | None:
    """Returns a sentence whose untrue parts are in weaker words; None where there are none for one of them."""
    for claim in claims:
        match = claim.pattern.search(sentence)
        if match and not claim.is_true(evidence, match):
            if claim.weaker is None:
                return None
            sentence = claim.pattern.sub(claim.weaker, sentence)
    return sentence
