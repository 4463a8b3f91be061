"""Who takes part in a demo course, and when each learner hands in: the same for the same seed. Pure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from random import Random
from typing import Any

from grader.library import Library
from grader.questions import Question, Quiz
from grader.service.demo.answers import AnswerPool

NAMES = (
    "Ada Lindqvist", "Amara Okafor", "Anna Nowak", "Arjun Mehta", "Aylin Demir", "Beatriz Almeida", "Chen Wei",
    "Clara Hoffmann", "Daniel Osei", "Elif Yılmaz", "Émile Laurent", "Farah Haddad", "Giulia Conti", "Grace Kim",
    "Hana Suzuki", "Igor Petrov", "Ingrid Dahl", "Jonas Weber", "Kofi Mensah", "Leila Rahimi", "Lucas Moreau",
    "Maya Goldberg", "Mei Lin", "Noah Fischer", "Olga Ivanova", "Priya Nair", "Rafael Torres", "Sofia Rossi",
    "Tomás Hernández", "Yusuf Kaya", "Zoë Jansen", "Zuri Wanjiru",
)  # fmt: skip

BEGAN = timedelta(days=24)
"""How long before now the first answers came in."""

LAST = timedelta(minutes=20)
"""How long before now the newest one came in."""

DUE = (timedelta(days=-5), timedelta(days=2))
"""The due dates, from now: the last quiz with questions gets the later one, all others the earlier one."""

TAKES_OPEN, TAKES_SCRIPT = 0.75, 0.85
"""The chances that a learner who takes part answers an open question, and tries an exercise."""

ATTEMPTS_MAX = 4

EASE, EASE_SCRIPT = 0.7, 0.28
"""What a first attempt is right with, as a factor of the learner's skill; each further one is a little easier."""

PAUSES_MIN = (3, 7, 15, 40, 90, 600, 1500)
"""Pauses between two attempts at one question [min]."""


@dataclass(frozen=True)
class DemoLearner:
    """A learner who does not exist: `skill` is the chance that an attempt is right."""

    name: str
    member_id: str
    skill: float
    effort: float
    """The share of the questions that the learner gets to."""


@dataclass(frozen=True)
class PlannedAnswer:
    """What a learner hands in at a question, and when."""

    learner: DemoLearner
    quiz: str
    question: str
    answer: Any
    at: datetime


def draw_learners(rng: Random, count: int) -> list[DemoLearner]:
    """Returns so many learners by name; after the names of the list with a number. Two do nothing yet."""
    names = [NAMES[place] if place < len(NAMES) else f"Learner {place + 1}" for place in range(count)]
    learners = [
        DemoLearner(name, f"{rng.getrandbits(128):032x}", rng.uniform(0.25, 0.85), min(1.0, rng.uniform(0.5, 1.4)))
        for name in names
    ]
    idle = set(rng.sample(range(count), min(2, count // 10)))
    return [
        DemoLearner(learner.name, learner.member_id, learner.skill, 0.0 if place in idle else learner.effort)
        for place, learner in enumerate(learners)
    ]


def choose_due_dates(quizzes: Sequence[Quiz], now: datetime) -> dict[str, datetime]:
    """Returns when each quiz with questions is due: one lies just ahead, the others just behind."""
    quiz_ids = [quiz.id for quiz in quizzes if quiz.questions]
    at = now.replace(minute=0, second=0, microsecond=0)
    return {quiz: at + DUE[quiz == quiz_ids[-1]] for quiz in quiz_ids}


def plan_answers(
    rng: Random, library: Library, learners: Sequence[DemoLearner], pools: Mapping[tuple[str, str], AnswerPool],
    now: datetime,
) -> list[PlannedAnswer]:  # fmt: skip
    """Returns every answer of a demo course in the order of time, for the questions that have a pool of answers."""
    planned: list[PlannedAnswer] = []
    due = choose_due_dates(list(library.quizzes.values()), now)
    for quiz in library.quizzes.values():
        for place, question in enumerate(quiz.questions):
            pool = pools.get((quiz.id, question.id))
            if pool is None:
                continue
            ends = min(now - LAST, due[quiz.id] + timedelta(hours=20))
            for learner in learners:
                far = (place + 1) / (len(quiz.questions) + 1)
                if takes_part(rng, learner, pool, far):
                    planned += plan_attempts(rng, learner, (quiz.id, question), pool, (now - BEGAN, ends))
    return sorted(planned, key=lambda answer: (answer.at, answer.learner.name, answer.question))


def takes_part(rng: Random, learner: DemoLearner, pool: AnswerPool, far: float) -> bool:
    """Says whether a learner gets to a question that lies so `far` in its quiz, from 0 to 1."""
    chance = TAKES_SCRIPT if pool.is_script else TAKES_OPEN if pool.is_open else 1.0
    return rng.random() < chance and far <= learner.effort


def plan_attempts(
    rng: Random, learner: DemoLearner, at: tuple[str, Question], pool: AnswerPool, span: tuple[datetime, datetime]
) -> Iterator[PlannedAnswer]:
    """Yields a learner's attempts at a question: until one is right, or the learner gives up."""
    quiz, question = at
    began, ends = span
    # most begin late: the square root puts the middle of the class at 70 % of the time
    moment = began + (ends - began) * rng.random() ** 0.5 * 0.98
    used: list[Any] = []
    for attempt in range(1 if pool.is_open else ATTEMPTS_MAX):
        if moment > ends or (attempt and rng.random() > 0.45 + 0.5 * learner.skill):
            return
        ease = EASE_SCRIPT if pool.is_script else EASE
        is_right = rng.random() < learner.skill * (ease + 0.12 * attempt)
        answer = pool.draw(rng, is_right=is_right, used=used)
        used.append(answer)
        moment = moment.replace(microsecond=1000 * rng.randrange(1000))
        yield PlannedAnswer(learner, quiz, question.id, answer, moment)
        if is_right:
            return
        moment += timedelta(minutes=rng.choice(PAUSES_MIN), seconds=rng.randrange(60))
