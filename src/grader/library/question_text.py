"""The text of one question in the file of a quiz, as its author wrote it, and where it stands."""

import json
import re
from collections.abc import Iterator

from grader.errors import NotFound
from grader.library.quiz_files import is_markdown, name_question, parse_quiz

SPACE = re.compile(r"[\s,]*")


def find_question(text: str, question: str, file: str) -> tuple[int, int]:
    """Returns where the source of a question begins and ends in the text of a quiz, by its name. Raises NotFound, also
    for a text that cannot be read up to there."""
    for name, start, end in list_places(text, file):
        if name == question:
            return start, end
    raise NotFound(f"The file holds no question {question!r} that can be read.")


def find_name(text: str, start: int, file: str) -> str | None:
    """Returns the name of the question whose source begins here; None where there is none that can be read."""
    try:
        return next((name for name, begin, _ in list_places(text, file) if begin == start), None)
    except NotFound:
        return None


def list_places(text: str, file: str) -> Iterator[tuple[str, int, int]]:
    """Yields name, begin and end of every question of a quiz; of JSON up to the first that cannot be read. Raises
    NotFound."""
    names: set[str] = set()
    for number, id_, start, end in list_sections(text, file) if is_markdown(file) else list_objects(text):
        name = name_question(number, id_, names)
        names.add(name)
        yield name, start, end


def list_sections(text: str, file: str) -> Iterator[tuple[int, str, int, int]]:
    """Yields place, id, begin and end of every question of Markdown: from its heading to the next."""
    questions = parse_quiz(text, file).questions
    lines = re.split(r"(?<=\n)", text)  # `splitlines` knows ends that Markdown does not
    ends = [*(line - 1 for _, line in questions[1:]), len(lines)]
    for number, ((id_, line), end) in enumerate(zip(questions, ends, strict=False), 1):
        before = "".join(lines[: line - 1])
        yield number, id_, len(before), len(before) + len("".join(lines[line - 1 : end]).rstrip())


def list_objects(text: str) -> Iterator[tuple[int, str, int, int]]:
    """Yields place, id, begin and end of every question of JSON, up to the first that cannot be read. Raises
    NotFound."""
    decoder, position = json.JSONDecoder(), find_list(text)
    for number in range(1, len(text)):
        position = SPACE.match(text, position).end()  # type: ignore[union-attr]
        try:
            value, end = decoder.raw_decode(text, position)
        except json.JSONDecodeError:
            return
        if isinstance(value, dict):
            yield number, str(value.get("id", f"q{number}")), position, end
        position = end


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
