"""Words a question for the templates: its text as safe HTML, what it is worth, and what a script may use."""

import re
import textwrap
from functools import lru_cache
from pathlib import Path
from typing import Any

from markupsafe import Markup

from grader.domain.pages.markup import FORMULA, plain_text, spell_formula, spoken_text
from grader.library import Library
from grader.questions import FORMS, Question, Quiz, kind_of, question_view
from grader.questions.drawing import Drawable, is_drawn
from grader.web.text.lab_box import describe_lab
from grader.web.text.numbers import NARROW, keep_unbroken
from grader.web.text.prose import cached_prose

DANGLING = re.compile(r"(?:\s*+\([^)]*+|\s++[\d.]++|[\s.,;:=+-])++$")
ASIDE = re.compile(r"(?<=[^\W\d_]{2}) \([^()]*\)")
"""Brackets behind a word; behind a number or a letter they are a factor."""
SHORT = 44
"""Characters of a question in the list of questions."""

BLOCK = re.compile(r"\s*<(p|div|ul|ol|pre|table|figure|h[1-6]|blockquote)\b", re.IGNORECASE)
FIRST_PARAGRAPH = re.compile(r"\s*<p>.*?</p>", re.DOTALL)


def describe_quiz(library: Library, quiz: Quiz) -> dict[str, Any]:
    """Returns the quiz as a learner may see it, as the template's variables."""
    return {
        "id": quiz.id,
        "title": plain_text(quiz.title),
        "questions": [present_question(library, quiz.id, question) for question in quiz.questions],
        "labs": [describe_lab(lab) | {"title": plain_text(lab.title or "")} for lab in quiz.labs],
    }


def describe_unopened(quiz: Quiz, opens: str) -> dict[str, Any]:
    """Returns a quiz before it opens, as the template's variables; `opens` says when."""
    return {"id": quiz.id, "title": plain_text(quiz.title), "opens": opens, "questions": [], "labs": []}


def present_question(library: Library, quiz_id: str, question: Question) -> dict[str, Any]:
    """One question: its text as safe HTML, its points, attempts and limits as sentences, and its kind's template."""
    kind, view = kind_of(question), question_view(question)
    form = FORMS[view.get("takes", "python")]
    return view | {
        "heading": keep_unbroken(spoken_text(question.title or question.label or kind.heading(question))),
        "short": shorten_title(question.title or question.label, question.q),
        "prompt": render_prompt(question.q),
        "opening": render_opening(question.q),
        "numbers": describe_numbers(question),
        "worth": describe_worth(question.points, question.attempts),
        "allowance": describe_limits(view["limits"]) if view.get("takes") == "python" else "",
        "starter": library.starter(question),
        "form": form,
        "starter_suffix": Path(kind.starter(question) or "").suffix,
        "path": f"/quizzes/{quiz_id}/{question.id}",
        "file": f"{question.id.replace('-', '_')}{form.suffix}",
        "is_script": kind.is_script,
        "template": f"kinds/{question.kind}.html",
    }


def describe_numbers(question: Question) -> str:
    """Says whose the numbers of a question are; empty where they are the same for all."""
    if isinstance(question, Drawable) and question.is_posed:
        return "These numbers are yours: each learner has their own."
    return "Each learner has numbers of their own; these are in the middle." if is_drawn(question) else ""


def render_prompt(text: str) -> Markup:
    """Returns the prompt as safe HTML, wrapped in a paragraph unless it begins with a block element."""
    return cached_prose(text if BLOCK.match(text) else f"<p>{text}</p>")


def render_opening(text: str) -> Markup:
    """Returns the first paragraph of the prompt."""
    first = FIRST_PARAGRAPH.match(text)
    return render_prompt(text if first is None else first[0])


@lru_cache(maxsize=2048)
def shorten_title(title: str | None, text: str) -> str:
    """Returns the title of a question, or the first words of its text. Kept, since parsing HTML takes long: most pages
    name every question."""
    return keep_unbroken(spoken_text(title or "") or shorten_text(plain_text(text)))


def list_titles(library: Library) -> dict[tuple[str, str], str]:
    """Returns the titles of all questions, or their first words, by (quiz, question)."""
    return {
        (quiz.id, question.id): shorten_title(question.title or question.label, question.q)
        for quiz in library.quizzes.values()
        for question in quiz.questions
    }


def shorten_text(text: str) -> str:
    """Returns the first words of a question that has no title, for the list of questions. They end neither in an open
    bracket nor with a number whose unit is left out; what stands in brackets gives way to what follows it."""
    words = " ".join(FORMULA.sub(spell_formula, text).split())
    if len(words) <= SHORT:
        return words
    head = textwrap.shorten(ASIDE.sub("", words), SHORT, placeholder="")
    return (DANGLING.sub("", head) or head) + "…"


def describe_worth(points: float, attempts: int | None) -> str:
    """For example `2 points, 3 attempts`."""
    parts = [format_count(points, "point")]
    if attempts is not None:
        parts.append(format_count(attempts, "attempt"))
    return ", ".join(parts)


def describe_limits(limits: dict[str, float]) -> str:
    """Returns the limits of a script as a sentence."""
    return (
        f"A script may use {limits['cpu_s']:g}{NARROW}s of processor time, {limits['memory_mb']:g}{NARROW}MB of memory "
        f"and {limits['output_kb']:g}{NARROW}KB of output. It has no network and no files but its own."
    )


def format_count(number: float, noun: str) -> str:
    """`1 point`, `2.5 points`."""
    return f"{number:g} {noun}{'' if number == 1 else 's'}"
