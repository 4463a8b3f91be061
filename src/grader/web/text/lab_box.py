"""A lab as the page's skeleton: every part of it has its place and its final size before a script runs."""

from typing import Any

from grader.domain.lab import Lab, LabConfig, UnknownLab
from grader.labs import lab_kind_of, name_lab_kind
from grader.questions import lab_view
from grader.web.text.prose import cached_prose


def describe_lab(lab: Lab | LabConfig | UnknownLab) -> dict[str, Any]:
    """Returns the variables of lab.html. Its texts are the author's and not safe; `note` is safe HTML. `form` is the
    kind of the lab, whose template and script are known by it."""
    view = lab_view(lab)
    if isinstance(lab, UnknownLab):
        return {"form": "unknown", **view}
    form = name_lab_kind(lab)
    note = cached_prose(lab.note) if lab.note else ""
    return view | lab_kind_of(lab).skeleton(lab) | {"form": form, "template": f"labs/{form}.html", "note": note}
