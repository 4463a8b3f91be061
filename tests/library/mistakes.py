"""Mistakes that authors make: a letter that is missing in a key, a formula without its brace, a unit that does not fit.

`python tests/library/mistakes.py --draw 300` draws some in all content, and prints those that are not told.
"""

import argparse
import json
import os
import random
import re
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from typing import Any, NamedTuple

from grader.certify.keys import build_fault, certify_quizzes
from grader.errors import ContentError, Fault
from grader.library import PassedChecks, load
from library.mutations import Way, contents, list_values

TEXTS = ("q", "explain", "reference", "note")
"""Keys of long texts, in which authors write HTML and TeX."""

UNITS = {"ms": "mm", "s": "m", "rad": "deg", "deg": "mm", "m/s": "rad/s", "rad/s": "m", "m": "mm", "N": "N m", "J": "W"}
"""Units, and those that are taken for them."""


NUMBERS = ("answer", "tol", "points", "attempts", "seconds", "min", "max", "step", "timestep_s", "horizon_s", "steps")
"""Keys of numbers."""

NAMED = (("set",), ("numbers",), ("controls",), ("start",))
"""Objects whose keys are names of the author's own."""

CHOSEN = ("key", "kind", "by", "integrator", "when", "accept", "entry", "starter", "program", "counts", "feedback")
"""Keys of names that must be one of several."""

PROGRAMS = ("expr", "setup", "controller", "run", "apply", "set", "stopAt", "criterion")
"""Keys of expressions."""


PASSED = PassedChecks(Path(gettempdir()) / f"grader-mistakes-{os.getuid()}")
"""What has passed in one mistake is not run again in the next."""


class Mistake(NamedTuple):
    """Files of some content as an author left them. `file` and `key` is where it must be told; None as a text: the file
    is gone."""

    content: int
    name: str
    file: str
    key: str
    files: dict[str, str | None]

    def __str__(self) -> str:
        return f"{self.content} {self.file}: {self.key}: {self.name}"


class Place(NamedTuple):
    """A value inside a quiz file; `put(value)` returns the text of the file with another value there."""

    content: int
    file: str
    way: Way
    value: Any
    quiz: Any

    @property
    def name(self) -> Any:
        """The last key."""
        return self.way[-1]

    @property
    def owner(self) -> Any:
        """The object or list that holds the value."""
        return get_value(self.quiz, self.way[:-1])

    @property
    def key(self) -> str:
        """The key as a fault names it: the id of the question or lab, then the keys inside."""
        if len(self.way) < 2 or self.way[0] not in ("questions", "labs"):
            return ".".join(map(str, self.way))
        part = self.quiz[self.way[0]][self.way[1]]
        position = f"q{self.way[1] + 1}" if self.way[0] == "questions" else f"labs.{self.way[1]}"
        return ".".join(map(str, (part.get("id", position), *self.way[2:])))

    def mistake(self, name: str, value: Any, key: str | None = None) -> Mistake:
        """The mistake of this value in place of the author's."""
        quiz = json.loads(json.dumps(self.quiz))
        get_value(quiz, self.way[:-1])[self.name] = value
        return self.text_mistake(name, json.dumps(quiz, ensure_ascii=False), key)

    def rename(self, name: str, key: str) -> Mistake:
        """The mistake of another key for this value."""
        quiz = json.loads(json.dumps(self.quiz))
        owner = get_value(quiz, self.way[:-1])
        owner[key] = owner.pop(self.name)
        return self.text_mistake(name, json.dumps(quiz, ensure_ascii=False), self.key.rpartition(".")[0])

    def text_mistake(self, name: str, text: str, key: str | None = None) -> Mistake:
        """The mistake of this text of the file."""
        return Mistake(self.content, name, self.file, self.key if key is None else key, {self.file: text})


def get_value(quiz: Any, way: Way) -> Any:
    """The value at a way."""
    for step in way:
        quiz = quiz[step]
    return quiz


def list_places() -> Iterator[Place]:
    """Every value of every quiz of every content."""
    for index, files in enumerate(contents()):
        for file in sorted(name for name in files if name.startswith("quizzes/") and name.endswith(".json")):
            quiz = json.loads(files[file])
            for way, value in list_values(quiz):
                yield Place(index, file, way, value, quiz)


def swap(word: str) -> str:
    """A word with two letters swapped, or one missing."""
    for i in range(1, len(word) - 1):
        if word[i] != word[i + 1] and word[i : i + 2].isalpha():
            return word[:i] + word[i + 1] + word[i] + word[i + 2 :]
    return f"{word}{word[-1:] or 'x'}"


def is_text(place: Place) -> bool:
    """Whether a value is a text with HTML and TeX."""
    return isinstance(place.value, str) and place.name in TEXTS and "simlab" not in place.way


def mistake_keys(place: Place) -> Iterator[Mistake]:
    """Keys: misspelt, missing, twice, in capitals."""
    if isinstance(place.name, str) and isinstance(place.owner, dict) and place.way[-2:-1] not in NAMED:
        if len(place.name) > 2:
            yield place.rename("misspelt key", swap(place.name))
        if place.name in ("options", "answer", "entry", "kind", "check", "cases", "expr", "label", "id"):
            yield place.rename("key in capitals", place.name.title())
    if place.name in ("answer", "options", "q", "entry", "expr", "model", "items", "pairs") and len(place.way) == 3:
        quiz = json.loads(json.dumps(place.quiz))
        del get_value(quiz, place.way[:-1])[place.name]
        yield place.text_mistake("missing key", json.dumps(quiz))


def mistake_types(place: Place) -> Iterator[Mistake]:
    """Values of another type: a number in quotes, an answer by its text, one text for a list."""
    if place.name in NUMBERS and type(place.value) in (int, float):
        yield place.mistake("number in quotes", str(place.value))
        yield place.mistake("number with a comma", f"{place.value:g}".replace(".", ",") + ",0")
    if place.name == "answer" and isinstance(place.owner.get("options"), list) and isinstance(place.value, int):
        yield place.mistake("answer by its text", place.owner["options"][place.value])
        yield place.mistake("answer counted from 1", len(place.owner["options"]))
    if place.name in ("options", "items", "whys", "cases", "controls") and isinstance(place.value, list):
        yield place.mistake("one value for a list", place.value[0])
    if place.name == "whys":
        yield place.mistake("a sentence missing", place.value[:-1])


def mistake_numbers(place: Place) -> Iterator[Mistake]:
    """Numbers that cannot be: negative points, a range from high to low, limits that exclude the value."""
    if place.name in ("points", "tol", "attempts", "horizon_s", "steps") and type(place.value) in (int, float):
        yield place.mistake("negative", -place.value)
    if isinstance(place.value, list) and len(place.value) == 2 and place.name in ("search_s",):
        yield place.mistake("range reversed", place.value[::-1])
    if place.name == "min" and isinstance(place.owner, dict) and "max" in place.owner:
        yield place.mistake("min above max", place.owner["max"] + 1)
    if place.name == "value" and isinstance(place.owner, dict) and "max" in place.owner:
        yield place.mistake("value above max", place.owner["max"] * 10 + 1)


def mistake_answers(place: Place) -> Iterator[Mistake]:
    """Keys that physics refutes: another option, a factor of ten."""
    verify = isinstance(place.owner, dict) and place.owner.get("verify")
    if place.name == "answer" and verify and "accept" not in verify:
        if isinstance(place.owner.get("options"), list) and type(place.value) is int:
            yield place.mistake("another option", (place.value + 1) % len(place.owner["options"]))
        elif type(place.value) in (int, float):
            yield place.mistake("ten times the answer", place.value * 10)
    if place.name == "unit" and verify and place.value in UNITS and verify.get("scale") is None:
        yield place.mistake("another unit", UNITS[place.value])


def mistake_units(place: Place) -> Iterator[Mistake]:
    """Units that are unknown."""
    if place.name == "unit" and len(place.value or "") > 2 and "answer" in place.owner:
        yield place.mistake("misspelt unit", swap(place.value))


def mistake_tex(place: Place) -> Iterator[Mistake]:
    """Formulas: a brace is missing, a command is misspelt, a dollar is missing, a slash is single."""
    if not is_text(place):
        return
    for match in [*re.finditer(r"\$[^$]+\$", place.value)][:2]:
        before, after = place.value[: match.start()], place.value[match.end() :]
        yield place.mistake("dollar missing", before + match[0][:-1] + after)
        if "{" in match[0]:
            yield place.mistake("brace missing", before + match[0].replace("}", "", 1) + after)
        if command := re.search(r"\\([a-z]{4,})", match[0]):
            yield place.mistake("misspelt TeX", before + match[0].replace(command[1], swap(command[1]), 1) + after)
    yield place.mistake("formula without brace", f"{place.value} $\\frac{{1}}{{2$")
    yield place.mistake("formula with an unknown command", f"{place.value} $\\sqr{{2}}$")


def mistake_html(place: Place) -> Iterator[Mistake]:
    """HTML: a tag is misspelt, not closed, or unknown; Markdown; pictures that are not there."""
    if not is_text(place):
        return
    if match := re.search(r"<(code|b|em|strong|ul|ol|sub|sup|pre)>", place.value):
        end = f"</{match[1]}>"
        if end in place.value:
            yield place.mistake("tag not closed", place.value.replace(end, "", 1))
            yield place.mistake("tag misspelt", place.value.replace(match[0], f"<{match[1]}x>", 1))
    yield place.mistake("code not closed", f"{place.value} The field <code>qpos.")
    yield place.mistake("unknown tag", f"{place.value} <centre>Look</centre>")
    yield place.mistake("Markdown bold", f"{place.value} This is **important**.")
    yield place.mistake("Markdown code", f"{place.value} Read `data.qpos`.")
    yield place.mistake("Markdown link", f"{place.value} See [the manual](https://example.org).")
    yield place.mistake("picture not there", f'{place.value} <img src="pictures/servo.png">')


def mistake_options(place: Place) -> Iterator[Mistake]:
    """Two options that are equal."""
    texts = place.value if place.name in ("options", "items") and isinstance(place.value, list) else []
    if texts and all(isinstance(text, str) for text in texts):
        yield place.mistake("two equal", [texts[0], texts[0], *texts[2:]])


def mistake_names(place: Place) -> Iterator[Mistake]:
    """Names: of models, keyframes, kinds, integrators, programs, starters, functions."""
    text = place.value
    if not isinstance(text, str) or not text:
        return
    if place.name == "model":
        yield place.mistake("misspelt model", swap(text))
        yield place.mistake("model with .xml", f"{text}.xml")
    if place.name in CHOSEN and " " not in text and (place.name != "entry" or "starter" in place.owner):
        key = place.key.removesuffix("entry") + "starter" if place.name == "entry" else None
        yield place.mistake(f"misspelt {place.name}", swap(text), key)
    if place.name == "id" and len(place.way) == 3 and len(place.quiz[place.way[0]]) > 1:
        other = place.quiz[place.way[0]][place.way[1] - 1].get("id")
        if other:
            yield place.mistake("id twice", other, f"{other}.id")
    if place.name == "id" and place.way[-3:-2] == ("cases",) and place.way[-2] > 0:
        first = get_value(place.quiz, place.way[:-2])[0]["id"]
        yield place.mistake("id of a case twice", first, place.key.rpartition(".cases")[0])


def mistake_expressions(place: Place) -> Iterator[Mistake]:
    """Expressions: misspelt fields and functions, elements that are not there, a bracket too few."""
    text = place.value
    if not isinstance(text, str) or not re.search(r"\b(?:data|model|lib|Math)\.", text) or is_text(place):
        return
    if place.name not in PROGRAMS and "claims" not in place.way:
        return
    for match in [*re.finditer(r"\b(?:data|model|lib|Math)\.(\w+)", text)][:2]:
        if len(match[1]) > 3:
            wrong = text[: match.start(1)] + swap(match[1]) + text[match.end(1) :]
            yield place.mistake("misspelt field", wrong)
    if element := re.search(r"\b(data|model)\.\w+\[\d+\]", text):
        yield place.mistake("element not there", text.replace(element[0], re.sub(r"\[\d+\]", "[70]", element[0]), 1))
    if named := re.search(r"lib\.\w+\((['\"])(\w+)", text):
        yield place.mistake("name not there", text.replace(named[2], f"{named[2]}x", 1))
    if ")" in text:
        yield place.mistake("bracket missing", text[::-1].replace(")", "", 1)[::-1])


def mistake_dates(place: Place) -> Iterator[Mistake]:
    """Dates: in words, without an offset, in the wrong order."""
    if place.name in ("opens", "due", "until") and isinstance(place.value, str):
        yield place.mistake("date in words", "19 October 2026, 18:00")
        yield place.mistake("date without offset", place.value[:16])
        yield place.mistake("date with a space", place.value.replace("T", " ")[:16])
        yield place.mistake("date of another country", "19.10.2026 18:00")
    if place.name == "due" and "opens" in place.owner:
        yield place.mistake("closes before it opens", "2020-01-01T00:00Z")


LISTERS: tuple[Callable[[Place], Iterator[Mistake]], ...] = (
    mistake_keys, mistake_types, mistake_numbers, mistake_answers, mistake_units, mistake_tex, mistake_html,
    mistake_options, mistake_names, mistake_expressions, mistake_dates,
)  # fmt: skip


def mistake_files(content: int, files: dict[str, str]) -> Iterator[Mistake]:
    """Whole files: broken JSON and XML, names that are not read."""
    for file, text in files.items():
        if re.fullmatch(r"quizzes/[^/]+\.json", file):
            yield Mistake(content, "comma missing", file, "line", {file: re.sub(r'",(\s*")', r'"\1', text, count=1)})
            yield Mistake(content, "comma too many", file, "line", {file: re.sub(r"\](\s*\}\s*)$", r",]\1", text)})
            yield Mistake(content, "quotes of a word processor", file, "line", {file: text.replace('"', "“", 2)})
            yield Mistake(content, "comment in JSON", file, "line", {file: f"// A quiz\n{text}"})
            yield Mistake(content, "bracket missing", file, "line", {file: text.rstrip().removesuffix("}")})
            wrong = file.replace(".json", ".jsn")
            yield Mistake(content, "quiz with another ending", wrong, "", {file: None, wrong: text})
        elif re.fullmatch(r"models/[^/]+\.xml", file):
            yield Mistake(content, "XML not closed", file, "model", {file: text.replace("</worldbody>", "", 1)})
            yield Mistake(content, "misspelt attribute", file, "model", {file: text.replace("type=", "tpye=", 1)})
            yield Mistake(content, "misspelt element", file, "model", {file: text.replace("<geom", "<goem", 1)})
            wrong = file.replace(".xml", ".mjcf")
            yield Mistake(content, "model with another ending", wrong, "", {file: None, wrong: text})
        elif file.startswith("quizzes/starters/"):
            yield Mistake(content, "starter that is no Python", file, "line", {file: f"{text}\ndef x(:\n"})
        elif file.startswith("programs/"):
            yield Mistake(content, "program that is gone", "", "", {file: None})
            yield Mistake(content, "program that is no Python", "", "", {file: f"{text}\ndef x(:\n"})


def list_mistakes() -> dict[str, list[Mistake]]:
    """Every mistake in every content, by name."""
    by_name: dict[str, list[Mistake]] = {}
    for place in list_places():
        for lister in LISTERS:
            for mistake in lister(place):
                by_name.setdefault(mistake.name, []).append(mistake)
    for index, files in enumerate(contents()):
        for mistake in mistake_files(index, files):
            if any(files.get(file) != text for file, text in mistake.files.items()):
                by_name.setdefault(mistake.name, []).append(mistake)
    return by_name


def draw_mistakes(count: int, seed: int) -> list[Mistake]:
    """Draws mistakes: first the sort, so that each is as frequent, then one of it."""
    random_ = random.Random(seed)
    sorts = list_mistakes()
    names = sorted(sorts)
    return [random_.choice(sorts[names[i % len(names)]]) for i in range(count)]


def is_quiz(path: str) -> bool:
    """Whether a file is a quiz."""
    return path.startswith("quizzes/") and path.endswith(".json")


def list_remarks(mistake: Mistake) -> Sequence[Fault]:
    """What a check remarks of the content with the mistake. Raises ContentError where it does not load."""
    files = {**contents()[mistake.content], **mistake.files}
    # The quizzes of this repository stand alone; those of the guide are named by its course.
    if mistake.content == 0 and is_quiz(mistake.file):
        files = {path: text for path, text in files.items() if path == mistake.file or not is_quiz(path)}
    with TemporaryDirectory(prefix="grader-mistake-") as name:
        root = Path(name)
        for path, text in files.items():
            if text is not None:
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text, encoding="utf-8")
        return check_folder(root, mistake.file)


def check_folder(root: Path, file: str) -> list[Fault]:
    """What `grader check` remarks of a folder, but for the runs of programs; keys of the quiz in `file` alone. Raises
    ContentError where the folder does not load."""
    library = load(root, passed=PASSED)
    said = list(library.warnings)
    for certified in certify_quizzes(library, [quiz for quiz in library.quizzes if library.file(quiz) == file], PASSED):
        if certified.certificate is not None and not certified.certificate.is_publishable:
            said.append(build_fault(library, certified.quiz, certified.question, certified.certificate))
        elif certified.certificate is not None:
            place = ".".join(filter(None, (certified.question.id, certified.key.place, "answer")))
            said += [Fault(file, place, why) for why in certified.certificate.remarks]
    return said


def is_said(fault: Fault, mistake: Mistake) -> bool:
    """Whether a fault names the file, the question and the key of a mistake, and a cure or reason."""
    key, where = fault.key.split("."), mistake.key.split(".")
    same = key[: len(where)] == where or where[: len(key)] == key or fault.key.startswith(mistake.key)
    if mistake.name in ("another option", "ten times the answer", "another unit", "misspelt unit", "element not there"):
        same = same or key[0] == where[0]
    if "x-" in fault.why and "verify" in mistake.key:
        same = same or key[0] == where[0]
    return (not mistake.file or fault.file == mistake.file) and same and len(fault.why) > 5


def judge_mistake(mistake: Mistake) -> str | None:
    """Returns what is wrong with what is said of a mistake; None where it is told."""
    try:
        said: Sequence[Fault] = list_remarks(mistake)
    except ContentError as error:
        said, right = error.faults, tuple[Fault, ...]()  # The right content loads, and so has none of them.
    except Exception:
        return traceback.format_exc()
    else:
        right = remarks_of(mistake.content, mistake.file)
    if any("Traceback" in fault.why for fault in said):
        return f"a traceback: {said}"
    new = [fault for fault in said if fault not in right]
    return None if any(is_said(fault, mistake) for fault in new) else f"not told; said: {[*map(str, new)]}"


@cache
def remarks_of(content: int, file: str) -> tuple[Fault, ...]:
    """What is said of content without a mistake."""
    return tuple(list_remarks(Mistake(content, "", file, "", {})))


def main(arguments: Sequence[str] | None = None) -> int:
    """Draws mistakes and prints those that are not told."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draw", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    options = parser.parse_args(arguments)
    drawn = [mistake for mistake in draw_mistakes(options.draw, options.seed) if re.search(options.only, mistake.name)]
    with ProcessPoolExecutor(2) as pool:
        results = [*zip(drawn, pool.map(judge_mistake, drawn, chunksize=4), strict=True)]
    silent = Counter(one.name for one, why in results if why is not None)
    for one, why in results:
        if why is not None:
            print(f"--- {one}\n    {why[-400:]}")
    print(f"{len(drawn)} mistakes, {len(drawn) - silent.total()} told; not told: {dict(silent)}")
    return 1 if silent else 0


if __name__ == "__main__":
    sys.exit(main())
