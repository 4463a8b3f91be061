"""`/instructor/class/{quiz}/{question}`: the class at one question, on one axis and by mistake. It needs no script."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import Response

from grader.courses.people.identity import Identity
from grader.courses.reporting.class_answers import ATTEMPTS_MAX, OPTION, ClassAnswers, ClassAttempt
from grader.courses.rules.mistakes import Family, LearnerMistake, find_cure
from grader.domain.axes import ClassAxis, Position
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.questions import Question, kind_of
from grader.questions.forms import FORMS
from grader.web.cohort.axis_plot import ClassPlot, draw_class
from grader.web.cohort.axis_words import describe_near, describe_right, round_position
from grader.web.frame.inputs import Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.reviewing.review_list import PAGE as REVIEW
from grader.web.instructor.statistics import CLASS
from grader.web.learner.pages import show_sign_in
from grader.web.text.questions import list_titles

ALONE = 4
"""So many mistakes of one learner each are shown at once; more are folded."""
NAMES = 60
"""Learners of a mistake that are named."""
FIGURES = 3
"""Wrong answers that agree to so many figures are one."""

router = page_router()

Part = Annotated[str, Query(max_length=200)]


@dataclass(frozen=True)
class Person:
    """A learner in a list: a name, and where the answer is."""

    name: str
    address: str
    is_still: bool = True


@dataclass(frozen=True)
class ListedAnswer:
    """A mistake, or an option, with who is behind its count; `share` is the part of all learners in percent."""

    key: str
    name: str
    sentence: str
    still: int
    was: int
    people: tuple[Person, ...]
    more: int
    is_right: bool = False

    @property
    def learners(self) -> int:
        """How many there are."""
        return self.still + self.was


@dataclass(frozen=True)
class ClassAt:
    """A class at one question, as this instructor may see it."""

    quiz: str
    question: Question
    answers: ClassAnswers
    families: Sequence[Family]
    title: str

    @property
    def path(self) -> str:
        """The address of the page."""
        return f"{CLASS}/{self.quiz}/{self.question.id}"

    @property
    def learners(self) -> int:
        """How many have an attempt."""
        return len(self.answers.by_learner)

    @property
    def shows_scripts(self) -> bool:
        """Whether the answers have lines to read: scripts and models, not files."""
        takes = kind_of(self.question).view(self.question).get("takes")
        return takes is not None and not FORMS[takes].is_file

    def choose_axis(self, wanted: str) -> ClassAxis | None:
        """Returns the axis of this id; without one that on which most learners are wrong, of those with a right value;
        None where there is none."""
        axes = self.answers.axes
        candidates = [axis for axis in axes if axis.id == wanted] or [axis for axis in axes if axis.right] or list(axes)
        return max(candidates, key=lambda axis: len(self.list_wrong(axis)), default=None)

    def list_wrong(self, axis: ClassAxis) -> list[Position]:
        """Returns the newest position of each learner who is wrong on an axis."""
        placed = (
            [attempt.positions[axis.id] for attempt in theirs if axis.id in attempt.positions]
            for theirs in self.answers.by_learner.values()
        )
        return [theirs[-1] for theirs in placed if theirs and not axis.accepts(theirs[-1])]

    def find_family(self, key: str) -> Family | None:
        """Returns the mistake of this key."""
        return next((family for family in self.families if family.key == key), None)


def read_class(services: Services, who: Identity, quiz: str, question: str) -> ClassAt:
    """Reads a class at a question. Raises NotFound."""
    library = services.library_for(who)
    asked = library.question(quiz, question)
    with services.database.read() as session:
        answers = services.classes.read_for(services.desk_of(who.course), session, who, quiz, asked)
    return ClassAt(quiz, asked, answers, answers.families, list_titles(library)[quiz, question])


@router.get(f"{CLASS}/{{quiz_id}}/{{question_id}}")
def show_class(
    request: Request, services: AppServices, who: Visitor, quiz_id: str, question_id: str, *, axis: Part = "",
    said: Annotated[int, Query(ge=0, le=10_000)] = 0,
) -> Response:  # fmt: skip
    """The class at one question; anyone but an instructor is told to sign in. Raises NotFound."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    at = read_class(services, who, quiz_id, question_id)
    chosen = at.choose_axis(axis)
    plot = None if chosen is None else draw_class(at.answers, chosen, address=make_address)
    context: dict[str, Any] = {
        "at": at,
        "axis": chosen,
        "plot": plot,
        "headline": choose_headline(at, chosen, plot),
        "mistakes": [list_family(at, family) for family in at.families],
        "shown": count_shown(at.families),
        "options": list_options(at),
        "advice": advise(at, chosen, plot),
        "shows_scripts": at.shows_scripts,
        "is_cut": at.answers.attempts >= ATTEMPTS_MAX,
        "said": said,
    }
    return page(request, "class.html", who=who, **context)


def make_address(attempt: ClassAttempt) -> str:
    """Returns where an instructor reads an answer."""
    return f"{REVIEW}/{attempt.id}?which=submissions"


def list_family(at: ClassAt, family: Family) -> ListedAnswer:
    """Returns a mistake with its learners: those who still make it first."""
    people = [
        find_person(at, mistake, is_still=is_still)
        for is_still, some in ((True, family.still), (False, family.was))
        for mistake in some
    ]
    return ListedAnswer(
        family.key, family.name, family.sentence, len(family.still), len(family.was), tuple(people[:NAMES]),
        max(0, len(people) - NAMES),
    )  # fmt: skip


def count_shown(families: Sequence[Family]) -> int:
    """Returns how many mistakes are shown at once: those of several learners, and a few of one."""
    several = sum(family.learners > 1 for family in families)
    return len(families) if len(families) <= several + ALONE else max(several, ALONE)


def find_person(at: ClassAt, mistake: LearnerMistake, *, is_still: bool) -> Person:
    """Returns who made a mistake, and the answer in which they did."""
    attempt = at.answers.find(mistake.submission)
    assert attempt is not None
    return Person(attempt.name, make_address(attempt), is_still)


def list_options(at: ClassAt) -> list[ListedAnswer]:
    """Returns the options of a question with who chose each at the first attempt; none where there are no options."""
    options = kind_of(at.question).options(at.question)
    firsts = [theirs[0] for theirs in at.answers.by_learner.values()]
    listed = []
    for place, option in enumerate(options):
        chose = [Person(attempt.name, make_address(attempt)) for attempt in firsts if place in attempt.options]
        if chose or len(options) <= NAMES:
            rest = max(0, len(chose) - NAMES)
            key = f"option-{place}"
            listed.append(
                ListedAnswer(key, option.text, "", len(chose), 0, tuple(chose[:NAMES]), rest, option.is_right)
            )
    return listed


def choose_headline(at: ClassAt, axis: ClassAxis | None, plot: ClassPlot | None) -> str:
    """Says what is to be seen of the class, from the numbers alone."""
    solved, learners = len(at.answers.solved), at.learners
    if not learners:
        return "Nobody has answered yet"
    solve = f"{solved} of {learners} {'has' if learners == 1 else 'have'} solved it"
    if plot is not None and axis is not None and axis.right is not None and plot.near > solved:
        return f"{plot.near} of {plot.claims} {describe_near(axis)}, yet only {solve}"
    still = [family for family in at.families if family.still and family.is_named]
    if still and len(still[0].still) > 1:
        return f"{solve}; {len(still[0].still)} still end in one mistake"
    return solve


def advise(at: ClassAt, axis: ClassAxis | None, plot: ClassPlot | None) -> list[str]:
    """Returns what to say to the class: at most two sentences, from the numbers; none where there is nothing to say."""
    sentences = []
    several = [family for family in at.families if family.learners > 1 and family.is_named]
    first = min(several, key=lambda family: (-len(family.still), -family.learners), default=None)
    other = next((family for family in several if family is not first), None)
    if first is not None:
        cure = find_cure(first.sentence)
        mended = f", {len(first.was)} no longer" if first.was else ""
        still = "answer so" if first.key.startswith(OPTION) else "get this verdict"
        count = f"{len(first.still)} of {at.learners} learners still {still}{mended}"
        sentences.append(f"{count}: “{first.name}.”" + (f" Say: {cure}" if cure else ""))
    wrong = find_wrong_pile(at, axis)
    if axis is not None and plot is not None and wrong is not None:
        shared, value = wrong
        same = f"{shared} learners have the same {axis.measure}, {value}" if axis.measure else ""
        common = same or f"The commonest wrong answer is {value} ({shared} learners)"
        sentences.append(f"{common}; {describe_right(axis)}.")
    elif other is not None:
        sentences.append(f"{other.learners} learners met “{other.name}”; {len(other.was)} got past it.")
    elif axis is not None and plot is not None and axis.right is not None and plot.claims:
        sentences.append(f"{plot.near} of {plot.claims} answers are right here; {describe_right(axis)}.")
    return sentences


def find_wrong_pile(at: ClassAt, axis: ClassAxis | None) -> tuple[int, str] | None:
    """Returns how many learners share the commonest wrong answer, and the answer; None where no two share one."""
    if axis is None:
        return None
    wrong = Counter(round_position(position, FIGURES, axis) for position in at.list_wrong(axis))
    sentence, count = max(wrong.items(), key=lambda pair: pair[1], default=("", 0))
    return (count, sentence) if count > 1 else None
