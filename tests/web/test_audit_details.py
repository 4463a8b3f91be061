"""Entries of the audit log say what they changed."""

import json
from typing import Any

import pytest

from grader.courses.people.audit import Action
from grader.web.text.audit_details import describe_detail


@pytest.mark.parametrize(
    ("action", "detail", "told"),
    [
        (Action.EXTENDED, {"member": "m", "name": "ann", "due": None, "until": None, "attempts": 0}, "taken back"),
        (
            Action.POLICY_CHANGED,
            {
                "before": {},
                "after": {"due": "2190-12-24T18:00:00Z", "late": {"per_day": 0.8}, "feedback": "after_publish"},
            },
            "due 24 Dec 2190, 18:00 UTC, late (per day 0.8), feedback after publish",
        ),
        (Action.POLICY_CHANGED, {"before": {"attempts": 3}, "after": {}}, "as the content says"),
        (Action.REGRADED, {"quiz": "q", "question": None, "dry_run": True, "submissions": 1}, "a trial with 1 answer"),
        (Action.REGRADED, {"quiz": "q", "question": None, "dry_run": False, "submissions": 7}, "7 answers"),
        (Action.EXTENDED, {}, ""),
        (Action.RENAMED, {"member": "m"}, ""),
    ],
)
def test_an_entry_says_what_it_changed(action: Action, detail: dict[str, Any], told: str) -> None:
    assert describe_detail(action, json.dumps(detail)) == told
