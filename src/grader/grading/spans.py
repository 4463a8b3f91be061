"""Finds the statement of a script that a diagnosis is about: its line, and where it begins and ends."""

import ast
import re

from grader.domain.verdict import Span, Verdict

BAD_SYNTAX = re.compile(r"(?:Syntax|Indentation|Tab)Error: .*\(line (\d{1,5}): ")
NAMED_LINE = re.compile(
    r"\bline (\d{1,5}) of your script\b|^Line (\d{1,5}) raised\b|\bThe loop in line (\d{1,5}) \("
    rf"|^{BAD_SYNTAX.pattern}"
)
"""How the sentences on crashes, on time that ran out, on handled exceptions and on bad syntax name a line."""


def locate_diagnosis(verdict: Verdict, source: str) -> Verdict:
    """Returns a verdict with the line of its diagnosis, and the statement there; without both where the script has no
    such line."""
    line = verdict.line or read_named_line(verdict.diagnosis or "")
    if not 1 <= line <= len(source.splitlines()):
        return verdict.model_copy(update={"line": None}) if verdict.line else verdict
    span = mark_line(source, line) if BAD_SYNTAX.match(verdict.diagnosis or "") else find_span(source, line)
    return verdict.model_copy(update={"line": line, "span": span})


def read_named_line(sentence: str) -> int:
    """Returns the line that a sentence names; 0 where it names none."""
    match = NAMED_LINE.search(sentence)
    return int(next(filter(None, match.groups()))) if match else 0


def mark_line(source: str, line: int) -> Span | None:
    """Returns the span of the text on a line; None for an empty line."""
    text = source.splitlines()[line - 1].rstrip()
    begin = len(text) - len(text.lstrip())
    return Span(line=line, column=begin, end_line=line, end_column=len(text)) if text else None


def find_span(source: str, line: int) -> Span | None:
    """Returns the span of the innermost simple statement on a line, of a compound one its first line; None for a script
    that cannot be parsed or is too long to be read, or a line without a statement."""
    from grader.exercises.explaining.script import ParsedScript  # which a command that grades a choice does not need

    tree = ParsedScript(source).tree
    if tree is None:
        return None
    lines = source.splitlines()
    statements = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno)
    ]
    if not statements:
        return None
    node = max(statements, key=lambda statement: (statement.lineno, -(statement.end_lineno or 0)))
    if hasattr(node, "body"):  # its whole text would be too much to mark
        if node.lineno != line:
            return None
        return Span(line=line, column=node.col_offset, end_line=line, end_column=len(lines[line - 1].rstrip()))
    end_line = node.end_lineno or node.lineno
    return Span(
        line=node.lineno,
        column=count_characters(lines[node.lineno - 1], node.col_offset),
        end_line=end_line,
        end_column=count_characters(lines[end_line - 1], node.end_col_offset or 0),
    )


def count_characters(line: str, offset: int) -> int:
    """Returns a column in characters of one in bytes of UTF-8, as syntax trees have it."""
    return len(line.encode()[:offset].decode(errors="ignore"))
