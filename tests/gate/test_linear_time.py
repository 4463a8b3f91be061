"""Every rule that reads a stranger's text takes time linear in its length: 64 KB of the worst against 16 KB.

The list of rules is that of SECURITY.md. `make bench-check` runs it, since it measures CPU time.
"""

import json
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any
from urllib.parse import parse_qs

import pytest
from pydantic import ValidationError
from starlette.requests import HTTPConnection

from grader.api.learning.labs import LabBody
from grader.api.paging import read_cursor
from grader.courses.people.rosters.roster import read_roster
from grader.courses.rules.csv_cells import FORMULA
from grader.domain.lab import LabConfig
from grader.domain.pages.markup import plain_text
from grader.errors import GraderError
from grader.exercises.explaining.places import find_test
from grader.exercises.explaining.script import ParsedScript
from grader.exercises.kinds.model.measuring import remove_comments
from grader.gate.admission import drop_escaped_cookies, read_origin
from grader.grading.pipeline import to_canonical_json
from grader.labs.controls import choose_values
from grader.questions import read_answer
from grader.questions.kinds.choice import ChoiceQuestion
from grader.questions.kinds.number import NumberQuestion
from grader.questions.kinds.text import TextQuestion
from grader.sandbox.cleaning import clean, clean_reason
from grader.web.frame.multipart import parse_multipart, read_boundary
from grader.web.text.prose import safe_html
from grader.web.verdict.reel import compare_scripts

pytestmark = pytest.mark.cost

SMALL, LARGE = 16 * 1024, 64 * 1024
RATIO_MAX, NOISE_S = 6.0, 0.005

Make = Callable[[int], Any]


def repeated(unit: str, before: str = "", after: str = "") -> Make:
    """A text of n characters."""
    return lambda n: before + (unit * (n // len(unit) + 1))[: n - len(before) - len(after)] + after


def cookies(value: bytes) -> Any:
    scope: Any = {"type": "http", "headers": [(b"cookie", value)]}
    drop_escaped_cookies(scope)
    return HTTPConnection(scope).cookies


CHOICE = ChoiceQuestion(kind="mcq", id="q1", q="?", options=("a", "b"), answer=0)
NUMBER = NumberQuestion(kind="numeric", id="q1", q="?", answer=5, tol=0.1, unit="ms")
OPEN = TextQuestion(kind="open", id="q1", q="?")
LAB = LabConfig.model_validate(
    {"model": "m", "controls": [{"label": "s", "set": "data.qpos[0]", "min": 0, "max": 1, "step": 1, "value": 0}]}
)

TAGS = ["<code>", "<code>$", "</code ", "<pre", "<!--", "<!-", "<a ", "<", "<a href=x>", "<div>", "<p>", "<b><p>"]
TAGS += ["<li><ul>", "<table><td>", "<table><b>", "<math><mi>", "<i><b><u>", "<a 1><", "</p>", "&#1", "&", "<svg><p>"]
TEX = [
    "$",
    "$$",
    "$x",
    "$x$ ",
    "$$x$$ ",
    "$x\\$",
    "\\$",
    "\\",
    "$\\",
    r"$\text{<b/a>}$ ",
    "$^$",
    "${$",
    r"$\newcommand",
]
TYPED = [
    "1",
    "1 ",
    "(",
    "1,000",
    "1/",
    "<b>",
    "<b><p>",
    "1e",
    "\\frac{",
    "²",
    "½",
    "π",
    "- ",
    "= ",
    "<li><ul>",
    "\u00b7",
]
PRINTED = ["\x1b[", "\x1b[0", "\x1b]", "\x9b0", "\x1b", "\r", "\x1b[ ", "\x1b ", "\u202e", "x"]


def write_chain(middles: int, branches: int) -> str:
    """A script with a long chain of `elif` around many middles."""
    chain = "\n".join(f"elif a == {i}: pass" for i in range(branches))
    return f"if a: pass\n{chain}\nelse:\n" + "".join(f"  m{i} = b / 2\n  c = m{i}\n" for i in range(middles))


def write_lines(count: int, name: str) -> str:
    """A script of which every second line is the same."""
    return "\n".join("#" if i % 2 else f"{name}{i}" for i in range(count))


RULES: dict[str, tuple[Callable[[Any], Any], dict[str, Make]]] = {
    "prose": (
        safe_html,
        {unit: repeated(unit) for unit in TAGS + TEX}
        | {
            "one formula": repeated("x", "$", "$"),
            "digits": repeated("1", "$&#", ";$"),
            "one tag": repeated("a=1 ", "<a ", ">"),
            "attributes": lambda n: "<a " + " ".join(f"a{i:x}" for i in range(n // 6)) + ">",
            "names": lambda n: "".join(f"<q{i:x}>" for i in range(n // 6)),
            "formats": lambda n: "".join(f"<b a{i:x}>" for i in range(n // 16)) + "<p>x" * (n // 8),
            "depth": lambda n: "<div>" * (n // 10) + "</b>" * (n // 8),
        },
    ),
    "plain text": (plain_text, {"pictures": repeated("<img "), "descriptions": repeated("alt='", "<img ")}),
    "choice": (lambda text: read_answer(CHOICE, text), {unit: repeated(unit) for unit in TYPED + TAGS}),
    "number": (lambda text: read_answer(NUMBER, text), {unit: repeated(unit) for unit in TYPED}),
    "open": (lambda text: read_answer(OPEN, text), {unit: repeated(unit) for unit in TYPED}),
    "answer": (
        to_canonical_json,
        {
            "deep": lambda n: [[[n * "x"]]],
            "wide": lambda n: {f"k{i}": [i] for i in range(n // 8)},
            "text": repeated("é"),
        },
    ),
    "json": (
        json.loads,
        {
            "deep": lambda n: "[" * (n // 2) + "]" * (n // 2),
            "digits": repeated("9"),
            "quotes": repeated('\\"', '"', '"'),
        },
    ),
    "lab body": (
        LabBody.model_validate,
        {
            "controls": lambda n: {"quiz": "q", "lab": "l", "controls": {f"c{i}": 1 for i in range(n // 10)}},
            "events": lambda n: {"quiz": "q", "lab": "l", "events": [[0, "x"]] * (n // 8)},
            "unknown": lambda n: {f"k{i}": 1 for i in range(n // 8)},
        },
    ),
    "controls": (
        lambda given: choose_values(LAB, given),
        {"label": lambda n: {"x" * n: 1}, "text": lambda n: {"s": "1" * n}, "integer": lambda n: {"s": 10**n}},
    ),
    "cookies": (
        lambda text: cookies(text.encode("latin-1")),
        {unit: repeated(unit, 'a="', '"') for unit in ["\\", "\\1", "\\012", ";", "=", ";a=", '"', " "]},
    ),
    "origin": (
        read_origin,
        {unit: repeated(unit, "http://") for unit in ["a", ":", "[", "1:", "@", "[::", "/", "%", "é"]},
    ),
    "form": (parse_qs, {unit: repeated(unit) for unit in ["a=1&", "&", "%", "%41", "=", "a=+"]}),
    "cursor": (read_cursor, {unit: repeated(unit) for unit in ["a", "=", "/", "é"]}),
    "output": (lambda text: clean(text.encode(), LARGE), {unit: repeated(unit) for unit in PRINTED}),
    "reason": (clean_reason, {unit: repeated(unit) for unit in PRINTED}),
    "roster": (
        read_roster,
        {
            "columns": repeated(",a", "name"),
            "cells": repeated(",", "name\n"),
            "people": repeated("a\n", "name\n"),
            "faults": repeated("a,b\n", "name\n"),
            "quotes": repeated('"', "name\n"),
            "address": repeated("@a", "name,email\na,"),
            "id": repeated("'=", "name,external_id\na,"),
        },
    ),
    "multipart": (read_boundary, {unit: repeated(unit, 'multipart/form-data; a="') for unit in [";", "\\", '";a="']}),
    "multipart body": (
        lambda text: parse_multipart(text.encode(), b"X", 1000),
        {
            "header": repeated(";", '--X\r\nContent-Disposition: form-data; a="', "\r\n\r\n\r\n--X--"),
            "parts": repeated('--X\r\nContent-Disposition: form-data; name="a"\r\n\r\n\r\n', after="--X--"),
        },
    ),
    "comments of XML": (
        remove_comments,
        {unit: repeated(unit, "<!-- <include -->") for unit in ["<!--", "-->", "<!-- -->"]},
    ),
    "updates of a script": (
        lambda text: find_test(ParsedScript(text), None),
        {
            "elif": lambda n: write_chain(n // 120, n // 40),
            "middles": lambda n: write_chain(n // 40, n // 120),
        },
    ),
    "changed lines": (
        lambda pair: compare_scripts(*pair),
        {
            "every second alike": lambda n: tuple(write_lines(n // 128, name) for name in "uv"),
            "a short one": lambda n: (write_lines(min(n // 40, 1700), "u"), write_lines(199, "v")),
        },
    ),
    "spreadsheet cell": (FORMULA.match, {unit: repeated(unit) for unit in ["'", " ", "' ", "=", "'\t"]}),
}

CASES = [(rule, name) for rule, (_, worst) in RULES.items() for name in worst]


def cpu_s(read: Callable[[Any], Any], text: Any) -> float:
    """The CPU time of one reading; a refusal is an answer too."""
    began = time.thread_time()
    with suppress(GraderError, ValidationError, ValueError, RecursionError):
        read(text)
    return time.thread_time() - began


@pytest.mark.parametrize(("rule", "name"), CASES, ids=lambda text: ascii(text)[1:-1])
def test_four_times_the_text_takes_about_four_times_the_time(rule: str, name: str) -> None:
    """Both lengths are read in turns, so that a core that slows down slows down both; the least of each counts."""
    read, worst = RULES[rule]
    texts = [worst[name](SMALL), worst[name](LARGE)]
    taken = [[cpu_s(read, text) for text in texts] for _ in range(5)]
    small, large = map(min, zip(*taken, strict=True))
    assert large <= RATIO_MAX * small + NOISE_S, f"{1000 * small:.1f} ms, then {1000 * large:.1f} ms"
    assert large < 2.0
