"""`/instructor/dates`: the dates and rules of a quiz in this course, with what the content says. It needs no script."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from fastapi import Query, Request
from fastapi.responses import Response

from grader.courses.answering.policies import CoursePolicy, change_policy, read_course_policy
from grader.courses.people.identity import Identity
from grader.domain.policy import Policy
from grader.errors import Outdated, Unprocessable, WrongMoments
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.web.frame.inputs import Form, Instructor, Visitor
from grader.web.frame.rendering import PRIVATE, page
from grader.web.instructor.quiz_choice import choose_quiz
from grader.web.learner.pages import show_sign_in
from grader.web.text.moments import format_day
from grader.web.text.zones import convert_moments, write_moment

PAGE = "/instructor/dates"

NOT_LIMITED, NONE = "any number", "none"

CHOICES: Mapping[str, Mapping[str, str]] = {
    "counts": {"best": "the best attempt", "latest": "the latest attempt", "average": "the average of all attempts"},
    "feedback": {
        "immediate": "at once",
        "after_due": "once the learner can hand in no more",
        "after_publish": "once you publish it, on the page Extensions",
    },
    "solutions": {
        "when_right_or_spent": "to those who are right, have no attempt left, or can hand in no more",
        "with_feedback": "with the feedback",
        "after_due": "once the learner can hand in no more",
        "never": "never",
    },
}

LATE = {"until": "late_until", "per_day": "late_per_day", "floor": "late_floor"}
"""The fields of the form that are one key of the policy, by their keys in it."""

MOMENTS = {"opens": "Opens", "due": "Due", "late_until": "Late answers until"}
"""The fields of the form that are moments, with their labels."""

router = page_router()


@dataclass(frozen=True)
class Rule:
    """A key of the policy on the page: its fields with what they hold, and what holds and what the content says in
    words."""

    key: str
    label: str
    kind: Literal["moment", "late", "number", "choice"]
    fields: Mapping[str, str]
    in_force: str
    default: str
    is_changed: bool


LABELS: Mapping[str, tuple[str, Literal["moment", "late", "number", "choice"]]] = {
    "opens": ("Opens", "moment"),
    "due": ("Due", "moment"),
    "late": ("Late answers", "late"),
    "attempts": ("Attempts at each question", "number"),
    "counts": ("What counts", "choice"),
    "feedback": ("Learners see how they were graded", "choice"),
    "solutions": ("Learners see the right answer", "choice"),
}


@router.get(PAGE)
def show(
    request: Request, services: AppServices, who: Visitor, quiz: Annotated[str, Query(max_length=64)] = ""
) -> Response:
    """The dates and rules of a quiz; to anyone but an instructor, how to sign in. Raises NotFound."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    return render(request, services, who, quiz)


def render(
    request: Request, services: Services, who: Identity, quiz: str, *, status: int = 200,
    typed: Mapping[str, str] | None = None, **more: Any,
) -> Response:  # fmt: skip
    """Renders the page of a quiz, see `choose_quiz`, with the outcome of a form and what was typed."""
    library = services.library_for(who)
    quizzes = library.list_asking()
    if not quizzes:
        return page(request, "dates.html", status, PRIVATE, who=who, quizzes=[])
    chosen = choose_quiz(services, who, quizzes, quiz)
    with services.database.read() as session:
        policies = {
            candidate.id: read_course_policy(session, candidate, who.course) for candidate in (*quizzes, chosen)
        }
    context = {
        "quizzes": [
            (candidate, describe(policies[candidate.id].in_force), bool(policies[candidate.id].changes))
            for candidate in quizzes
        ],
        "quiz": chosen,
        "policy": policies[chosen.id],
        "changed_at": (at := policies[chosen.id].changed_at) and format_day(at),
        "rules": list_rules(policies[chosen.id], typed or {}),
        "choices": CHOICES,
        "moments": MOMENTS,
        "typed": typed or {},
        "own_attempts": {
            question.id: question.attempts for question in chosen.questions if question.attempts is not None
        },
    }
    return page(request, "dates.html", status, PRIVATE, who=who, **(context | more))


@router.post(PAGE)
def save(request: Request, services: AppServices, who: Instructor, form: Form) -> Response:
    """Sets the rules that a form changes; with `back`, one rule follows the content again. Shows the page again, with
    what was typed if it is refused. Raises Unauthorized, Forbidden, NotFound."""
    library = services.library_for(who)
    quiz = library.quiz(form.get("quiz", ""))
    with services.database.read() as session:
        seen = read_course_policy(session, quiz, who.course)
    try:
        change_policy(
            services.database, library, who, quiz, read_changes(seen, read_moments(seen.in_force, form)),
            is_current=lambda now: form.get("version", now.version) == now.version,
        )  # fmt: skip
    except WrongMoments as error:
        return render(request, services, who, quiz.id, status=422, typed=form, trouble=str(error).splitlines())
    except Unprocessable as error:
        return render(request, services, who, quiz.id, status=422, typed=form, trouble=explain(str(error)))
    except Outdated as error:
        return render(request, services, who, quiz.id, status=412, trouble=[str(error)])
    return render(request, services, who, quiz.id, done=True)


def explain(faults: str) -> list[str]:
    """Says faults of a policy with the labels of the page in place of its keys."""
    troubles = []
    for line in faults.splitlines():
        key, _, why = line.partition(": ")
        label, _ = LABELS[key.partition(".")[0]]
        troubles.append(f"{label}: {why}" if key in LABELS else f"{label} ({key}): {why}")
    return troubles


def read_moments(shown: Policy, form: Mapping[str, str]) -> dict[str, str]:
    """Returns a form with its moments in UTC, as `write_fields` writes them. Raises WrongMoments."""
    until = None if shown.late is None else shown.late.until
    return convert_moments(form, MOMENTS, {"opens": shown.opens, "due": shown.due, "late_until": until})


def read_changes(seen: CoursePolicy, form: Mapping[str, str]) -> dict[str, Any]:
    """Returns the values that the course has after a form. A rule whose fields are as the page showed them stays what
    it is; one that is as in the content follows the content."""
    if (back := form.get("back")) is not None:
        return {key: value for key, value in seen.changes.items() if key != back}
    shown, content = write_fields(seen.in_force), write_fields(seen.default)
    wanted = dict(seen.changes)
    for key, before in shown.items():
        typed = {name: form.get(name, before[name]).strip() for name in before}
        if typed == before:
            continue
        wanted.pop(key, None)
        if typed != content[key]:
            wanted[key] = read_value(key, typed)
    return wanted


def write_fields(policy: Policy) -> dict[str, dict[str, str]]:
    """Returns what the fields of every key hold; moments in UTC."""
    late = policy.late
    values = {
        "until": "" if late is None else write_moment(late.until),
        "per_day": "" if late is None else f"{late.per_day:g}",
        "floor": "" if late is None else f"{late.floor:g}",
    }
    return {
        "opens": {"opens": write_moment(policy.opens)},
        "due": {"due": write_moment(policy.due)},
        "late": {field: values[key] for key, field in LATE.items()},
        "attempts": {"attempts": "" if policy.attempts is None else str(policy.attempts)},
        **{key: {key: getattr(policy, key)} for key in CHOICES},
    }


def read_value(key: str, typed: Mapping[str, str]) -> Any:
    """Returns what was typed as the plain JSON of a key. What is no number stays text, which the policy refuses."""
    match LABELS[key][1]:
        case "moment":
            return f"{typed[key]}Z" if typed[key] else None
        case "number":
            return read_number(typed[key], int) if typed[key] else None
        case "late":
            texts = {name: typed[field] for name, field in LATE.items() if typed[field]}
            return {name: f"{value}Z" if name == "until" else read_number(value, float)
                    for name, value in texts.items()} or None  # fmt: skip
        case _:
            return typed[key]


def read_number(text: str, kind: type[int] | type[float]) -> Any:
    """Returns the number that a text is, else the text."""
    with suppress(ValueError):
        return kind(text)
    return text


def list_rules(policy: CoursePolicy, typed: Mapping[str, str]) -> list[Rule]:
    """Returns every rule of a quiz; its fields hold what was typed, if anything was."""
    in_force, default = describe(policy.in_force), describe(policy.default)
    shown = write_fields(policy.in_force)
    return [
        Rule(key, label, kind, {name: typed.get(name, text) for name, text in shown[key].items()},
             in_force[key], default[key], key in policy.changes)
        for key, (label, kind) in LABELS.items()
    ]  # fmt: skip


def describe(policy: Policy) -> dict[str, str]:
    """Says every rule in words."""
    moments = {"opens": policy.opens, "due": policy.due}
    late = policy.late
    return {
        **{name: NONE if moment is None else format_day(moment) for name, moment in moments.items()},
        "late": NONE if late is None else (
            f"until {format_day(late.until)}, {late.per_day:.0%} of the points kept for each day begun, "
            f"at least {late.floor:.0%}"
        ),
        "attempts": NOT_LIMITED if policy.attempts is None else str(policy.attempts),
        **{key: words[getattr(policy, key)] for key, words in CHOICES.items()},
    }  # fmt: skip
