"""The scope that a request needs of a restricted token: the one place that knows it."""

import re

from grader.courses.people.identity import Scope

RULES = (
    (r"GET", r"/results|/gradebook\.csv|/quizzes/[^/]+/statistics", Scope.RESULTS),
    (r".*", r"/quizzes/[^/]+/(extensions|policy|publication|results:recount)", Scope.REVIEW),
    (
        r"GET",
        r"/me|/quizzes(/[^/]+(/questions/[^/]+/kit)?)?|/submissions(/[^/]+(/(comments|events|films))?)?",
        Scope.READ,
    ),
    (r"POST", r"/submissions|/submissions/[^/]+:stop|/answers:validate|/labs:run", Scope.ANSWER),
    (r".*", r"/reviews.*|/submissions/[^/]+/(review|comments).*", Scope.REVIEW),
    (r".*", r"/regrades.*", Scope.REGRADE),
    (r".*", r"/lms/.*|/(webhooks|deliveries)([:/].*)?", Scope.LMS),
    (r".*", r"/content[:/].*", Scope.CONTENT),
    (r"PATCH", r"/members/.*", None),  # a role is more than any scope
    (r".*", r"/courses", None),  # whoever makes a course is its instructor
    (r".*", r"/(members|invitations|tokens|course|audit|roster)([.:/].*)?", Scope.PEOPLE),
)
"""Method, path below the prefix, and scope; the first rule that matches both decides."""

COMPILED = tuple((re.compile(method), re.compile(path), scope) for method, path, scope in RULES)


def find_scope(method: str, path: str) -> Scope | None:
    """The scope for a path below the API's prefix; None where only a token without restriction will do."""
    read = "GET" if method == "HEAD" else method
    for methods, paths, scope in COMPILED:
        if methods.fullmatch(read) and paths.fullmatch(path):
            return scope
    return None
