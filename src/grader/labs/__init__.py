"""Labs: the small simulations that authors write in JSON, run on the server by the same MuJoCo that grades."""

from grader.labs.comparison import IntegratorsRun, run_integrators
from grader.labs.programs import lab_programs
from grader.labs.record import LabRun
from grader.labs.runs import SAME, Variant, lab_scene, run_lab
from grader.labs.trials import check_integrators, check_lab

__all__ = [
    "SAME",
    "IntegratorsRun",
    "LabRun",
    "Variant",
    "check_integrators",
    "check_lab",
    "lab_programs",
    "lab_scene",
    "run_integrators",
    "run_lab",
]
