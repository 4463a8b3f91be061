"""`/instructor/statistics`: how hard each question is, what it tells apart, and what goes wrong. It needs no script."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import Response
from markupsafe import Markup

from grader.courses.rules.mistakes import name_family
from grader.courses.rules.statistics import Cluster, Estimate, QuestionStatistics
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.questions import CountedNumber, Question, kind_of
from grader.web.frame.inputs import Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.quiz_choice import choose_quiz
from grader.web.instructor.statistics_plots import draw_bar, plot_estimates
from grader.web.learner.pages import show_sign_in
from grader.web.text.numbers import NARROW, write_number, write_quantity
from grader.web.text.questions import list_titles
from grader.web.verdict.plots import draw_both

PAGE = "/instructor/statistics"
CLASS = "/instructor/class"
OF_POINTS, AT_ONCE, TELLS = "Share of the points", "Right at the first attempt", "Discrimination"
ALL_OPTIONS_MAX = 10
"""Up to so many options are all shown, also those without an answer."""
HALF_WIDTH = 520.0
"""Width of a plot that stands beside another."""

router = page_router()


@dataclass(frozen=True)
class Bar:
    """How many learners did something: what, in words, their number, and a bar as long."""

    words: str
    learners: int
    picture: Markup
    address: str
    """Where the learners are named."""
    is_right: bool = False


@dataclass(frozen=True)
class QuestionRow:
    """One question: what is seen of it at once, its estimates in words, and what was answered."""

    id: str
    title: str
    share: str
    """Of its points that learners have."""
    picture: Markup
    learners: int
    commonest: str
    """The mistake that most learners were told of, else the wrong option or number; empty where no two share one."""
    path: str
    """The page of the class at this question."""
    estimates: tuple[tuple[str, str], ...]
    options: tuple[Bar, ...]
    clusters: tuple[Bar, ...]
    mistakes: tuple[Bar, ...]
    rare: tuple[Bar, ...]
    """Mistakes of one learner each."""


@router.get(PAGE)
def statistics(
    request: Request, services: AppServices, who: Visitor, quiz: Annotated[str, Query(max_length=64)] = ""
) -> Response:
    """The statistics of one quiz, the last answered by default; anyone but an instructor is told to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    library = services.library_for(who)
    quizzes = library.list_asking()
    if not quizzes:
        return page(request, "statistics.html", who=who, quizzes=[])
    chosen = choose_quiz(services, who, quizzes, quiz)
    computed = services.statistics.compute(services.statistics.version(library, chosen.id, who))
    titles = {question: title for (quiz_id, question), title in list_titles(library).items() if quiz_id == chosen.id}
    by_id = {question.id: question for question in chosen.questions}
    hardest_first = sorted(computed.questions, key=lambda question: question.difficulty.value)
    context: dict[str, Any] = {
        "quizzes": quizzes,
        "quiz": chosen,
        "learners": computed.learners,
        "figures": [draw_both(sketch, HALF_WIDTH) for sketch in plot_estimates(hardest_first, titles)],
        "questions": [
            describe_question(question, by_id[question.question], titles[question.question], chosen.id)
            for question in hardest_first
        ],
        "silent": [
            titles[question] for question in titles if question not in {each.question for each in computed.questions}
        ],
    }
    return page(request, "statistics.html", who=who, **context)


def describe_question(measured: QuestionStatistics, question: Question, title: str, quiz: str) -> QuestionRow:
    """Returns one question for the template."""
    of, path = measured.difficulty.n, f"{CLASS}/{quiz}/{question.id}"
    options = count_options(measured, question, path)
    clusters = tuple(
        Bar(describe_value(each, question), each.learners, draw_bar(each.learners, of), f"{path}#axis")
        for each in measured.clusters
    )
    mistakes = [
        Bar(words, count, draw_bar(count, of), f"{path}#m-{name_family(words).key}")
        for words, count in measured.mistakes.items()
    ]
    shared = tuple(bar for bar in mistakes if bar.learners > 1)
    return QuestionRow(
        question.id,
        title,
        f"{100 * measured.difficulty.value:.0f}{NARROW}%",
        draw_bar(measured.difficulty.value, 1),
        of,
        describe_commonest(shared, options, clusters),
        path,
        (
            (OF_POINTS, describe_share(measured.difficulty)),
            (AT_ONCE, describe_share(measured.right_at_once)),
            (TELLS, describe_correlation(measured.discrimination)),
        ),
        options,
        clusters,
        shared,
        tuple(bar for bar in mistakes if bar.learners == 1),
    )


def describe_commonest(mistakes: Sequence[Bar], options: Sequence[Bar], clusters: Sequence[Bar]) -> str:
    """Says what most learners got wrong in one way, and how many; empty where no two did."""
    wrong = max((bar for bar in options if not bar.is_right), key=lambda bar: bar.learners, default=None)
    told, given = (mistakes[0] if mistakes else None), (clusters[0] if clusters else None)
    for kind, bar in (
        ("Told most often", told and replace(told, words=name_family(told.words).name)),
        ("Wrong option chosen most", wrong),
        ("Wrong number given most", given),
    ):
        if bar is not None and bar.learners > 1:
            return f"{kind}: {bar.words} ({bar.learners})"
    return ""


def count_options(measured: QuestionStatistics, question: Question, path: str) -> tuple[Bar, ...]:
    """Says how many learners chose each option first; none without any answer. Of many options, wrong ones
    without an answer are left out."""
    if not measured.options:
        return ()
    of = measured.difficulty.n
    options = kind_of(question).options(question)
    counted = [(place, option, measured.options.get(place, 0)) for place, option in enumerate(options)]
    if len(options) > ALL_OPTIONS_MAX:
        counted = [(place, option, count) for place, option, count in counted if option.is_right or count]
    return tuple(
        Bar(option.text, count, draw_bar(count, of), f"{path}#option-{place}", option.is_right)
        for place, option, count in counted
    )


def describe_value(cluster: Cluster, question: Question) -> str:
    """Returns the number that several learners gave, with its unit, and of several numbers with its name."""
    numbers = kind_of(question).numbers(question)
    counted = numbers[cluster.number] if cluster.number < len(numbers) else CountedNumber()
    value = write_quantity(cluster.value, counted.unit) if counted.unit else write_number(cluster.value)
    return f"{counted.text}: {value}" if counted.text else value


def describe_share(estimate: Estimate) -> str:
    """Returns a share with its interval: `62 % (48 to 74 %, n = 42)`."""
    value, low, high = (f"{100 * part:.0f}" for part in (estimate.value, estimate.low, estimate.high))
    return f"{value}{NARROW}% ({low} to {high}{NARROW}%, n = {estimate.n})"


def describe_correlation(estimate: Estimate | None) -> str:
    """Returns a correlation with its interval; where there is none, why."""
    if estimate is None:
        return "unknown: too few learners, or all alike"
    value, low, high = (write_number(part, 2) for part in (estimate.value, estimate.low, estimate.high))
    return f"{value} ({low} to {high}, n = {estimate.n})"
