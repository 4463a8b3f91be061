"""Labs: the small simulations that authors write in JSON. The server runs them with the MuJoCo that grades, and records
the frames that the page plays."""

from grader.labs.comparison import IntegratorsRun, run_integrators
from grader.labs.programs import compile_lab, list_missing_elements
from grader.labs.record import LabRun, format_readout
from grader.labs.runs import SAME, Variant, build_lab_scene, choose_length_s, run_lab
from grader.labs.trials import check_integrators, check_lab
from grader.labs.watching import TIMESTEP, find_timestep_limit, watch_lab

__all__ = [
    "SAME", "TIMESTEP", "IntegratorsRun", "LabRun", "Variant", "build_lab_scene", "check_integrators", "check_lab",
    "choose_length_s", "compile_lab", "find_timestep_limit", "format_readout", "list_missing_elements",
    "run_integrators", "run_lab", "watch_lab",
]  # fmt: skip
