"""The text of one question in the file of a quiz, as its author wrote it, and with another in its place."""

import json
import re

from grader.errors import NotFound
from grader.library.quiz_files import is_markdown, parse_quiz

SPACE = re.compile(r"[\s,]*")


def find_question(text: str, question: str, file: str) -> tuple[int, int]:
    """Returns where the source of a question begins and ends in the text of a quiz. Raises NotFound, also for a text
    that is no JSON up to there."""
    return (find_section if is_markdown(file) else find_object)(text, question, file)


def find_section(text: str, question: str, file: str) -> tuple[int, int]:
    """Returns where a question of Markdown begins and ends: from its heading to the next. Raises NotFound."""
    starts = parse_quiz(text, file).questions
    if question not in starts:
        raise NotFound(f"The file holds no question {question!r}.")
    lines = text.splitlines(keepends=True)
    begin = starts[question] - 1
    end = min((start - 1 for start in starts.values() if start - 1 > begin), default=len(lines))
    before = "".join(lines[:begin])
    return len(before), len(before) + len("".join(lines[begin:end]).rstrip())


def find_object(text: str, question: str, _file: str) -> tuple[int, int]:
    """Returns where the JSON of a question begins and ends. Raises NotFound."""
    decoder, position = json.JSONDecoder(), find_list(text)
    for number in range(1, len(text)):
        position = SPACE.match(text, position).end()  # type: ignore[union-attr]
        try:
            value, end = decoder.raw_decode(text, position)
        except json.JSONDecodeError:
            break
        if isinstance(value, dict) and value.get("id", f"q{number}") == question:
            return position, end
        position = end
    raise NotFound(f"The file holds no question {question!r} that can be read.")


def find_list(text: str) -> int:
    """Returns where the first question of a quiz begins. Raises NotFound."""
    decoder = json.JSONDecoder()
    opening = re.match(r"\s*\{", text)
    position = opening.end() if opening else len(text)
    while name := re.compile(r'[\s,]*("(?:[^"\\]|\\.)*")\s*:\s*').match(text, position):
        if json.loads(name[1]) == "questions" and text[name.end() : name.end() + 1] == "[":
            return name.end() + 1
        try:
            _, position = decoder.raw_decode(text, name.end())
        except json.JSONDecodeError:
            break
    raise NotFound("The file holds no list of questions that can be read.")


def replace_question(text: str, question: str, source: str, file: str) -> str:
    """Returns the text of a quiz with another source of a question. Raises NotFound."""
    start, end = find_question(text, question, file)
    return text[:start] + source.strip() + text[end:]
