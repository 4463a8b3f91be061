"""An example for every response of the API: what OpenAPI shows, and what a test compares with the schemas.

A new route needs one for each of its successes; its refusals have theirs already, by status.
"""

from typing import Any

LEARNER, TEACHER, SUBMISSION = ("7c9a0d3e41b52f68a7d0c4e19b3f5a26", "ba9fc2466f276dff59d0838ebcd1d8dd",
                                "01a1ff35e07f077699dac398f9ec199e")  # fmt: skip
AT, LATER = "2026-10-05T09:30:00Z", "2026-10-19T09:30:00Z"
DIGEST = "9eadd8e1fc42997e6009e32bdfe39827597594d125664a67012e8fc36eac3acb"

PROBLEMS: dict[int, dict[str, Any]] = {
    401: {"detail": "Send a valid token as `Authorization: Bearer ...`, or sign in."},
    403: {"detail": "This is for the role instructor; yours is student."},
    404: {"detail": "There is no such submission."},
    409: {"detail": "No attempt is left."},
    412: {"detail": "The submission has changed since you saw it; look at it again."},
    413: {"detail": "At most 2048 KB are taken."},
    422: {
        "detail": "body.quiz: Field required",
        "errors": [{"at": ["body", "quiz"], "why": "Field required"}],
    },
    428: {"detail": "Send If-Match with the ETag of the submission that you review."},
    429: {"detail": "Too many requests at once."},
    503: {"detail": "The service cannot reach or write its data now. Try again."},
}
"""By status, what a problem says."""

FINDING = {
    "id": "number", "title": "Your number", "passed": False, "points": 0.0, "max_points": 1.0,
    "message": "5000 ms is too high, by more than a factor of ten.", "direction": "5000 ms is too high.",
    "measured": 5000.0, "expected": None,
}  # fmt: skip
VERDICT = {
    "status": "incorrect", "points": 0.0, "max_points": 1.0, "findings": [FINDING],
    "diagnosis": "Your number would be right in milliseconds (ms), but you wrote seconds (s).",
    "read_as": "5000 ms", "explain": None, "evidence": {"value": 5000.0, "unit": "ms"}, "stdout": "", "stderr": "",
    "timing_ms": {"total": 1.2},
    "environment": {"mujoco": "3.14.0", "numpy": "2.4.6", "python": "3.12.3", "machine": "Linux x86_64"},
    "content_digest": DIGEST, "submission_digest": "fca799690e9a08a6c94669547ff249552476c145550d0b7198ccb707e0048e26",
}  # fmt: skip
LISTED = {
    "id": SUBMISSION, "quiz": "1.3-check", "question": "q2", "learner": LEARNER, "user": "ada", "status": "graded",
    "attempt": 1, "created_at": AT, "revision": 1, "verdict": VERDICT, "withheld": None,
}  # fmt: skip
LMS = "https://moodle.example.org"
PLATFORM = {
    "id": 1, "name": "Moodle", "issuer": LMS, "client_id": "7QeqkUdFHNNvY3P", "login_url": f"{LMS}/mod/lti/auth.php",
    "token_url": f"{LMS}/mod/lti/token.php", "keys_url": f"{LMS}/mod/lti/certs.php", "origins": [LMS],
    "approved": True, "deployments": [{"deployment_id": "1", "approved": True}],
}  # fmt: skip
LTI_CONTEXT = {
    "id": 1, "platform": "Moodle", "title": "Robotics", "course": "robotics", "wanted": None, "wanted_by": None,
    "has_roster": True,
}  # fmt: skip
GRADED = LISTED | {"answer": "5 s", "seed": None}
QUEUED = GRADED | {
    "quiz": "1.3-exercises", "question": "rk4-step", "status": "queued", "revision": 0, "verdict": None,
    "answer": {"source": "def rk4_step(model, data): ..."},
}  # fmt: skip
STOPPED = QUEUED | {
    "status": "graded", "revision": 1,
    "verdict": VERDICT | {
        "status": "invalid_answer", "findings": [], "evidence": {}, "timing_ms": {}, "environment": {}, "read_as": None,
        "diagnosis": "You stopped this script before it ran. No attempt was used.", "submission_digest": "",
    },
}  # fmt: skip
WAITING = LISTED | {"question": "q6", "status": "needs_review", "verdict": VERDICT | {"status": "needs_review"}}
CLAIM = {"by": "tina", "expires_at": "2026-10-05T09:45:00Z"}
COMMENT = {
    "id": "5f0c8e1d5a424a2c9d1f8f3f0a2b4c6d", "quiz": "1.3-check", "question": "q6", "text": "Name the damping.",
    "saved_by": "tina", "saved_at": AT,
}  # fmt: skip
FOR_REVIEW = WAITING | {
    "user": "learner-mfzgcy3d", "answer": "because", "seed": None, "claim": CLAIM, "reference": None,
    "rubric": [{"id": "damping", "title": "Names the damping", "points": 1.0, "group": None}], "comments": [COMMENT],
}  # fmt: skip
DISAGREEMENT = WAITING | {
    "seed": None, "first": {"by": "tina", "points": 1.0},
    "second": {"by": "otto", "points": 0.0, "comment": "No reason given.", "rubric": []},
}  # fmt: skip

REGRADE = {
    "id": "0c5b6d0f8d3c4be79a7b7b7a0f6d9f3e", "quiz": "1.3-check", "question": "q2", "scope": "best", "dry_run": True,
    "status": "done", "reason": None, "content_digest": DIGEST, "created_by": "tina", "created_at": AT,
    "finished_at": AT, "progress": {"total": 55, "done": 55, "outcomes": {"changed": 12, "same": 43}},
}  # fmt: skip
DIFFERENCE = {
    "place": 1, "learner": LEARNER, "user": "ada", "question": "q2", "before": 0.0, "after": 1.0, "difference": 1.0,
    "submissions": [{
        "submission_id": SUBMISSION, "outcome": "changed", "old": {"status": "incorrect", "points": 0.0},
        "new": {"status": "correct", "points": 1.0},
    }],
}  # fmt: skip

QUESTION = {
    "id": "q2", "kind": "numeric", "label": None, "title": None, "q": "How long is the step?", "points": 1.0,
    "attempts": 2, "unit": "ms", "attempts_used": 1, "attempts_left": 1, "may_answer": True, "multiplier": 1.0,
    "due": None, "closes": None, "result": None, "notice": "1 of 2 attempts left; the best one counts.",
}  # fmt: skip
QUIZ = {
    "id": "1.3-check", "title": "Knowledge check",
    "policy": {"attempts": None, "opens": None, "due": None, "late": None, "counts": "best", "feedback": "immediate",
               "solutions": "when_right_or_spent"},
    "questions": [QUESTION], "labs": [],
}  # fmt: skip
SUMMARY = {"id": "1.3-check", "title": "Knowledge check", "questions": 7, "points": 7.0, "opens": None, "due": LATER}

EXTENSION = {"learner": LEARNER, "user": "ada", "due": LATER, "until": None, "attempts": 1, "granted_by": "tina"}
EXTERNAL = {"namespace": "school", "id": "s1815"}
MEMBER = {
    "id": LEARNER,
    "name": "ada",
    "role": "student",
    "way_in": "lms",
    "created_at": AT,
    "learner": EXTERNAL,
    "email": "ada@school.example",
    "platforms": [],
    "same_email": [],
}
INVITATION = {
    "id": "a47870f6d857398a", "name": "ada", "member": LEARNER, "role": "student",
    "url": "https://grader.example/signin?code=gri_a47870f6d857398a_...", "expires_at": LATER,
}  # fmt: skip
CREDENTIAL = {
    "id": "c578da88891b2057", "name": "ada", "member": LEARNER, "role": "student", "scopes": None, "created_at": AT,
    "created_by": "tina", "expires_at": LATER, "last_used_at": None,
}  # fmt: skip
COURSE = {"course": "robots", "join_url": "https://grader.example/join?code=gWKqrpy2khsLc4fQW9fdYQ"}
AUDIT = {
    "id": "7", "at": AT, "actor": TEACHER, "name": "tina", "action": "token created", "subject": "lms",
    "detail": {"role": "service", "scopes": ["results"]},
}  # fmt: skip
RESULT = {
    "user": "ada", "submission_id": SUBMISSION, "learner": EXTERNAL, "member": LEARNER, "quiz": "1.3-check",
    "question": "q2", "attempt": 1, "points": 0.0, "max_points": 1.0,
    "is_late": False, "is_final": True, "revision": 1, "created_at": AT,
}  # fmt: skip
WEBHOOK = {
    "id": "01a1ff35e07f5d1f0ec1a0b6c3e7d482", "url": "https://lms.example/hooks/grader", "created_by": "tina",
    "created_at": AT, "old_secret_until": None, "disabled_at": None, "why_disabled": None,
}  # fmt: skip
NEW_SECRET = WEBHOOK | {"secret": "whsec_c2hvd24gb25jZSwgYW5kIHNvIG5vdCBoZXJlIQ=="}
DELIVERY = {
    "id": "17", "kind": "webhook", "destination": WEBHOOK["id"], "learner": LEARNER, "quiz": "1.3-check",
    "question": "q2", "state": "dead", "attempts": 9, "error": "The receiver answered 500.", "noted_at": AT,
    "next_at": None, "sent_at": None,
}  # fmt: skip
ESTIMATE = {"value": 0.62, "low": 0.49, "high": 0.74, "n": 55}
STATISTICS = {
    "quiz": "1.3-check", "learners": 55,
    "questions": [{"question": "q2", "difficulty": ESTIMATE, "right_at_once": ESTIMATE, "discrimination": ESTIMATE,
                   "options": [], "clusters": [{"value": 5000.0, "low": 5000.0, "high": 5000.0, "learners": 9}],
                   "mistakes": [{"diagnosis": VERDICT["diagnosis"], "learners": 9}]}],
}  # fmt: skip
LAB_RUN = {
    "seconds": 0.02, "duration": 0.02, "steps": 2, "controls": {"step": 0.01}, "times": [0.0, 0.02],
    "geoms": [{"type": "sphere", "size": [0.1, 0.0, 0.0], "rgba": [0.5, 0.5, 0.5, 1.0]}],
    "frames": [[[1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]], [[0.98, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]],
    "readouts": [{"label": "angle", "unit": "rad", "texts": ["1.000", "0.980"], "values": [1.0, 0.98],
                  "final": {"text": "0.980", "value": 0.98}}],
    "plots": [], "trail": None, "overlays": {}, "warnings": [{"kind": "BADQACC", "time": 0.02}], "stable": False,
    "limit": {"control": "step", "timestep_s": 0.0048},
    "timing_ms": {"simulate": 0.4},
}  # fmt: skip

CHECKS = {
    "database": {"ok": True, "backend": "sqlite"},
    "content": {"ok": True, "quizzes": {"1.3-check": DIGEST}},
    "jail": {"ok": True, "tier": "T1", "self_test": "passed", "integrators": "removable", "workers": 2},
    "worker": {"ok": True, "alive": 1},
}
NO_WORKER = "No worker lives: set GRADER_WORKERS to 1 or more, or start `grader worker` on PostgreSQL."
METRICS = """\
# HELP grader_queue_jobs Jobs that are not done.
# TYPE grader_queue_jobs gauge
grader_queue_jobs{state="waiting",topic="grade"} 3.0
"""
GRADEBOOK = "user,name,email,1.3-check/q1,1.3-check/q2,points,max_points\r\nada,,,1,0,1,2\r\n"
ROSTER = "name,email,role,namespace,external_id\r\nada,ada@school.example,student,school,s1815\r\n"
EVENT = {"event": "running", "id": "2", "data": f'{{"id": "{SUBMISSION}", "status": "running"}}'}


def page(item: dict[str, Any], cursor: str | None = None) -> dict[str, Any]:
    """A page of a list with one item."""
    return {"items": [item], "next_cursor": cursor}


EXAMPLES: dict[str, dict[int, Any]] = {
    "GET /quizzes": {200: page(SUMMARY)},
    "GET /quizzes/{quiz_id}": {200: QUIZ},
    "POST /content:reload": {200: {"quizzes": [{"id": "1.3-check", "digest": DIGEST}]}},
    "POST /submissions": {201: GRADED, 202: QUEUED},
    "POST /lms/submissions": {201: GRADED, 202: QUEUED},
    "GET /lms/submissions/{submission_id}": {200: GRADED},
    "GET /submissions": {200: page(LISTED, "YXQ6MDFhMWZmMzVlMDdm")},
    "GET /submissions/{submission_id}": {200: GRADED},
    "GET /submissions/{submission_id}/events": {200: EVENT},
    "POST /answers:validate": {200: {"valid": True, "read_as": "5000 ms", "message": None}},
    "POST /labs:run": {200: LAB_RUN},
    "GET /reviews": {200: page(WAITING | {"seed": None, "claim": CLAIM})},
    "GET /reviews/disagreements": {200: page(DISAGREEMENT)},
    "POST /reviews:claim": {200: FOR_REVIEW},
    "POST /reviews:heartbeat": {200: CLAIM},
    "POST /reviews:recompute": {200: {"changed": 3}},
    "GET /reviews/comments": {200: page(COMMENT)},
    "POST /reviews/comments": {201: COMMENT},
    "PUT /reviews/comments/{comment_id}": {200: COMMENT},
    "POST /submissions/{submission_id}:stop": {200: STOPPED},
    "GET /submissions/{submission_id}/review": {200: FOR_REVIEW},
    "PUT /submissions/{submission_id}/review": {200: GRADED | {"revision": 2}},
    "PUT /submissions/{submission_id}/review/second": {
        200: {"submission_id": SUBMISSION, "points": 0.0, "comment": "No reason given.", "agrees": False}
    },
    "POST /regrades": {202: REGRADE | {"status": "queued", "finished_at": None}},
    "GET /regrades": {200: page(REGRADE)},
    "GET /regrades/{regrade_id}": {200: REGRADE | page(DIFFERENCE)},
    "POST /regrades/{regrade_id}:cancel": {200: REGRADE | {"status": "cancelled"}},
    "POST /webhooks": {201: NEW_SECRET},
    "GET /webhooks": {200: page(WEBHOOK)},
    "GET /webhooks/{webhook_id}": {200: WEBHOOK},
    "POST /webhooks/{webhook_id}:rotate": {200: NEW_SECRET | {"old_secret_until": LATER}},
    "POST /webhooks/{webhook_id}:enable": {200: WEBHOOK},
    "POST /webhooks/{webhook_id}:replay": {200: {"replayed": 3}},
    "GET /deliveries": {200: page(DELIVERY)},
    "POST /deliveries/{delivery_id}:replay": {200: DELIVERY | {"state": "waiting", "attempts": 0, "error": None}},
    "GET /lti/platforms": {200: page(PLATFORM)},
    "POST /lti/platforms": {201: PLATFORM | {"approved": False}},
    "POST /lti/platforms/{platform_id}:approve": {200: PLATFORM},
    "POST /lti/registrations": {201: {"url": "https://grader.example.org/lti/register?token=KU2VCraiIDY..."}},
    "GET /lti/contexts": {200: page(LTI_CONTEXT)},
    "POST /lti/contexts/{context_id}:roster": {200: {"members": 55, "removed": 0}},
    "GET /members": {200: page(MEMBER)},
    "PATCH /members/{member_id}": {200: MEMBER},
    "GET /invitations": {200: page(CREDENTIAL)},
    "POST /invitations": {201: page(INVITATION)},
    "GET /tokens": {200: page(CREDENTIAL)},
    "POST /tokens": {201: {"token": "grt_c578da88891b2057_..."}},
    "GET /course": {200: COURSE},
    "PUT /course/link": {200: COURSE},
    "GET /audit": {200: page(AUDIT)},
    "POST /roster:import": {
        200: {"dry_run": True, "created": 54, "changed": 1, "unchanged": 0, "left_out": 0},
    },
    "GET /roster.csv": {200: ROSTER},
    "GET /roster.zip": {200: "PK..."},
    "GET /results": {200: page(RESULT, "YXQ6NA")},
    "GET /gradebook.csv": {200: GRADEBOOK},
    "GET /quizzes/{quiz_id}/statistics": {200: STATISTICS},
    "GET /quizzes/{quiz_id}/extensions": {200: page(EXTENSION | {"created_at": AT})},
    "PUT /quizzes/{quiz_id}/extensions": {200: EXTENSION},
    "POST /quizzes/{quiz_id}/results:recount": {200: {"recounted": 55}},
    "GET /healthz": {200: {"status": "ok"}},
    "GET /readyz": {
        200: {"status": "ready", "checks": CHECKS},
        503: {"detail": f"worker: {NO_WORKER}", "checks": CHECKS | {"worker": {"ok": False, "why": NO_WORKER}}},
    },
    "GET /metrics": {200: METRICS},
}
"""By method and path (below /api/v1) and status; of a problem, only the members that differ from `PROBLEMS`."""
