"""Labs: the small simulations that authors write in JSON. Each is of a kind, which is a plug-in and imports from here
alone; the server runs it with the MuJoCo that grades, and the page draws what comes back."""

from grader.domain.lab import Lab
from grader.domain.numbers import Positive, Real
from grader.domain.plugins import Remark
from grader.errors import LabRefused
from grader.labs.bench import Bench, Limits
from grader.labs.controls import Wish
from grader.labs.kind import LabAnswer, LabExample, LabKind, LabRequest, LabSettings
from grader.labs.lengths import choose_length_s
from grader.labs.programs import compile_lab, list_missing_elements
from grader.labs.pulls import PULLS_MAX, Pull
from grader.labs.record import LabRun, format_readout
from grader.labs.registry import (
    DEFAULT,
    GROUP,
    AnyLab,
    AnyLabKind,
    lab_adapter,
    lab_kind_of,
    lab_kinds,
    name_lab_kind,
    script_of,
    template_of,
)
from grader.labs.runs import SAME, Variant, build_lab_scene, run_lab
from grader.labs.trials import check_lab
from grader.labs.watching import TIMESTEP, find_timestep_limit, watch_lab
from grader.numerics.stepping import MujocoWarning

__all__ = [
    "DEFAULT", "GROUP", "PULLS_MAX", "SAME", "TIMESTEP", "AnyLab", "AnyLabKind", "Bench", "Lab", "LabAnswer",
    "LabExample", "LabKind", "LabRefused", "LabRequest", "LabRun", "LabSettings", "Limits", "MujocoWarning", "Positive",
    "Pull", "Real", "Remark", "Variant", "Wish", "build_lab_scene", "check_lab", "choose_length_s", "compile_lab",
    "find_timestep_limit", "format_readout", "lab_adapter", "lab_kind_of", "lab_kinds", "list_missing_elements",
    "name_lab_kind", "run_lab", "script_of", "template_of", "watch_lab",
]  # fmt: skip
