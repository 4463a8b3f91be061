"""What an entry of the audit log changed, in words."""

import json
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from grader.courses.people.audit import Action
from grader.courses.rules.policy import format_moment
from grader.web.text.questions import format_count


def describe_detail(action: str, detail: str) -> str:
    """Returns the values that an entry with this detail (JSON) has set; empty where it has none to show, as that of an
    erased learner."""
    values = json.loads(detail)
    if not values:
        return ""
    match action:
        case Action.EXTENDED:
            given = {key: values.get(key) for key in ("due", "until", "attempts")}
            return list_values({key: value for key, value in given.items() if value}) or "taken back"
        case Action.POLICY_CHANGED:
            return list_values(values.get("after", {})) or "as the content says"
        case Action.REGRADED:
            trial = "a trial with " if values.get("dry_run") else ""
            return f"{trial}{format_count(values.get('submissions', 0), 'answer')}"
    return ""


def list_values(values: Mapping[str, Any]) -> str:
    """Returns values by their names, dates in words."""
    return ", ".join(f"{key.replace('_', ' ')} {write_value(value)}" for key, value in values.items())


def write_value(value: Any) -> str:
    """Returns a value of a policy or an extension."""
    if isinstance(value, Mapping):
        return f"({list_values(value)})"
    try:
        return format_moment(datetime.fromisoformat(value))
    except (TypeError, ValueError):
        return "none" if value is None else str(value).replace("_", " ")
