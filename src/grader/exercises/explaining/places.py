"""Finds the line of a script that a sentence is about, by its text: what is written, called or returned there."""

import ast
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from grader.exercises.explaining.script import ParsedScript, walk_within

Find = Callable[[ParsedScript, "re.Match[str]"], int | None]


@dataclass(frozen=True)
class Landmark:
    """How to find the line that sentences are about which match `pattern`."""

    pattern: re.Pattern[str]
    find: Find


def build_landmarks(table: Sequence[tuple[str, Find]]) -> tuple[Landmark, ...]:
    """Returns the landmarks of a table of patterns."""
    return tuple(Landmark(re.compile(pattern), find) for pattern, find in table)


def write_of(*fields: str) -> Find:
    """Returns what finds the last statement that writes one of these attributes."""
    return lambda script, _: next((line for field in fields if (line := script.find_write(field))), None)


def call_of(*names: str) -> Find:
    """Returns what finds the last call of one of these functions."""
    return lambda script, _: script.find_call(*names)


def find_named_field(script: ParsedScript, match: "re.Match[str]") -> int | None:
    """Returns the line of the last statement that writes the field in the first group, such as model.opt.timestep."""
    return script.find_write(match[1].rpartition(".")[2])


def find_middle(script: ParsedScript, _: object) -> int | None:
    """Returns the line that computes the middle of a bisection; None where there is none, or several."""
    lines = {*script.find_middles().values()}
    return lines.pop() if len(lines) == 1 else None


def find_test(script: ParsedScript, _: object) -> int | None:
    """Returns the line of the condition by which a bisection moves its ends; None where there is none, or several."""
    lines = {test for _, test in script.find_updates() if test}
    return lines.pop() if len(lines) == 1 else None


def find_free_update(script: ParsedScript, _: object) -> int | None:
    """Returns the line that moves an end of a bisection outside of any condition; None where there is none, or
    several."""
    lines = {line for line, test in script.find_updates() if not test}
    return lines.pop() if len(lines) == 1 else None


def find_result(script: ParsedScript, _: object) -> int | None:
    """Returns the line of the last `return` of the one function that the script itself never names; None where there
    are several such functions."""
    named = {node.id for node in script.nodes if isinstance(node, ast.Name)}
    body = script.tree.body if script.tree else []
    entries = [node for node in body if isinstance(node, ast.FunctionDef) and node.name not in named]
    if len(entries) != 1:
        return None
    returns = [node for node in walk_within(entries[0]) if isinstance(node, ast.Return)]
    filled = [node for node in returns if node.value is not None and not isinstance(node.value, ast.Constant)]
    return max((node.lineno for node in filled or returns), default=None)


def find_landmark(sentence: str, script: ParsedScript, landmarks: Sequence[Landmark]) -> int | None:
    """Returns the line that a sentence is about; None where it is about none, or the script has no such line."""
    for landmark in landmarks:
        match = landmark.pattern.search(sentence)
        if match and (line := landmark.find(script, match)) is not None:
            return line
    return None
