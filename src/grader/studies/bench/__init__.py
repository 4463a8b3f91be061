"""Benchmarks that anyone can repeat: run time against error, stability, what skipping saves, and the service itself.
The service never imports this package. Only the pictures need matplotlib, the extra `bench`."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from grader.errors import Unprocessable

PHYSICS = ("precision", "stability", "regions", "energy", "adaptive", "skip", "models", "batches")
ERRORS = ("impacts", "quantities")
SERVICE = ("service", "script", "deadline")
ROOMS = dict.fromkeys(PHYSICS, "physics") | dict.fromkeys(ERRORS, "errors") | dict.fromkeys(SERVICE, "service")
STUDIES = (*ROOMS,)
"""Each study's name, and the folder of its module."""


def run(name: str, out: Path, quick: bool) -> None:
    """Run a study into the folder `out`; see Study.run. Raises Unprocessable for an unknown name, and where matplotlib
    is not installed."""
    if name not in STUDIES:
        raise Unprocessable(f"there is no benchmark {name!r}; there are {', '.join(STUDIES)}")
    if find_spec("matplotlib") is None:
        raise Unprocessable("the pictures need matplotlib: run make install, or pip install 'mujoco-grader[bench]'")
    import_module(f"grader.studies.bench.{ROOMS[name]}.{name}").STUDY.run(out, quick)
