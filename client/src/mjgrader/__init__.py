"""Check and hand in the exercises of a MuJoCo course, from a notebook.

import mjgrader as g
g.sign_in("https://grader.example.edu")
g.start("servo-threshold")
g.check(largest_stable_timestep)
g.submit(largest_stable_timestep)
"""

from mjgrader.errors import NotRunning, Offline, Refusal, Sentence, SignInAgain
from mjgrader.notebook import (
    check,
    load_ipython_extension,
    progress,
    result,
    sign_in,
    sign_out,
    start,
    submit,
    sync,
)
from mjgrader.sources import find_shell

__all__ = [
    "NotRunning", "Offline", "Refusal", "Sentence", "SignInAgain", "check", "load_ipython_extension", "progress",
    "result", "sign_in", "sign_out", "start", "submit", "sync",
]  # fmt: skip

if (_shell := find_shell()) is not None:
    load_ipython_extension(_shell)
