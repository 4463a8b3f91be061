"""Slides about a class at one question, to show in class and to print: they name nobody."""

from collections.abc import Iterator
from dataclasses import dataclass

from fastapi import Request
from fastapi.responses import Response
from markupsafe import Markup

from grader.courses.rules.mistakes import Family, find_cure
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.web.cohort.answers_page import ClassAt, Part, choose_headline, read_class
from grader.web.cohort.axis_plot import ClassPlot, draw_class
from grader.web.frame.inputs import Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.statistics import CLASS
from grader.web.learner.pages import show_sign_in

MISTAKES = 3
"""Slides about mistakes, at most."""
LEARNERS_MIN = 2
"""A mistake of one learner gets no slide: the learner would be known."""

router = page_router()


@dataclass(frozen=True)
class Slide:
    """One slide: what it says, in large letters, and what stands below."""

    title: str
    count: str = ""
    text: str = ""
    picture: Markup | None = None


@router.get(f"{CLASS}/{{quiz_id}}/{{question_id}}/slides")
def show_slides(
    request: Request, services: AppServices, who: Visitor, quiz_id: str, question_id: str, *, axis: Part = ""
) -> Response:
    """The slides; anyone but an instructor is told to sign in. Raises NotFound."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    at = read_class(services, who, quiz_id, question_id)
    chosen = at.choose_axis(axis)
    plot = None if chosen is None else draw_class(at.answers, chosen, named_from=LEARNERS_MIN)
    slides = list(list_slides(at, plot, choose_headline(at, chosen, plot)))
    return page(request, "class_slides.html", who=who, at=at, slides=slides)


def list_slides(at: ClassAt, plot: ClassPlot | None, headline: str) -> Iterator[Slide]:
    """Yields the headline with the picture, then the mistakes that most learners make now."""
    picture = plot.pictures if plot is not None and plot.claims else None
    yield Slide(headline, text=plot.title if plot is not None and picture else at.title, picture=picture)
    common = [family for family in at.families if family.is_named and family.learners >= LEARNERS_MIN]
    for family in sorted(common, key=lambda one: (-len(one.still), -one.learners))[:MISTAKES]:
        yield Slide(family.name, describe_count(at, family), find_cure(family.sentence))


def describe_count(at: ClassAt, family: Family) -> str:
    """Says how many learners a mistake is about."""
    still = len(family.still)
    return f"{family.learners} of {at.learners} met it, {still} still {'does' if still == 1 else 'do'}"
