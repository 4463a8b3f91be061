"""Labs: the small simulations that authors write in JSON, run on the server by the same MuJoCo that grades."""

from grader.labs.comparison import IntegratorsRun as IntegratorsRun
from grader.labs.comparison import run_integrators as run_integrators
from grader.labs.programs import lab_programs as lab_programs
from grader.labs.record import LabRun as LabRun
from grader.labs.record import readout_text as readout_text
from grader.labs.runs import SAME as SAME
from grader.labs.runs import Variant as Variant
from grader.labs.runs import lab_scene as lab_scene
from grader.labs.runs import length_s as length_s
from grader.labs.runs import run_lab as run_lab
from grader.labs.trials import check_integrators as check_integrators
from grader.labs.trials import check_lab as check_lab
from grader.labs.watching import TIMESTEP as TIMESTEP
from grader.labs.watching import timestep_limit as timestep_limit
from grader.labs.watching import watch_lab as watch_lab
