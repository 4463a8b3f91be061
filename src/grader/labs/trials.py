"""Checks a lab when content is loaded: its programs are compiled, and it is tried."""

from collections.abc import Callable
from functools import partial
from time import thread_time
from typing import Any

from grader.domain.lab import LabConfig
from grader.errors import ContentError, Fault, LabError, LabRefused
from grader.labs.controls import Wish, find_control_faults, list_extremes, list_settable
from grader.labs.programs import LabPrograms, compile_lab, list_missing_elements
from grader.labs.record import LabRun
from grader.labs.runs import Event, run_lab

SECONDS_AT_EXTREMES = 0.2

NEITHER_MODEL = "give either model, a name in models/, or xml, the model itself"

CPU_S_MAX = 60.0
"""Most CPU time of all trials of a lab [s]."""


def check_lab(config: LabConfig, xml: str, where: str) -> list[Fault]:
    """Everything that is wrong with a lab, with keys that begin with `where`; the caller adds the file's name. Its
    programs are compiled; then it is run whole with the author's values, briefly at both ends of every slider and with
    every option, and each button is pressed, so that what can only fail in a run fails when content is loaded."""
    faults = list(find_control_faults(config, where))
    try:
        programs = compile_lab(config, where)
    except ContentError as error:
        return [*faults, *error.faults]
    faults += _try_elements(programs, xml)
    if faults:
        return faults
    runs: list[LabRun] = []

    def try_setting(*settings: Any, setting: str = "") -> list[Fault]:
        run = partial(run_lab, config, xml, *settings, where=where)
        return try_run(lambda: runs.append(run()), where, refused=".seconds", setting=setting)

    last = thread_time() + CPU_S_MAX
    whole = try_setting()
    if whole:
        return whole
    trials: list[tuple[str, dict[str, Wish], list[Event]]] = [
        (f"{control.label} = {value}", {control.label: value}, [])
        for control in list_settable(config)
        for value in list_extremes(control)
    ]
    trials += [(f"{label} pressed", {}, [(0.0, label)]) for label in programs.buttons]
    for setting, controls, events in trials:
        if thread_time() > last:
            why = f"the runs at the ends of all controls take more than {CPU_S_MAX:g} s of computing"
            return [*faults, Fault("", f"{where}.controls", f"{why}: give fewer controls, or a smaller model")]
        setting_faults = try_setting(controls, events, SECONDS_AT_EXTREMES, setting=f" (with {setting})")
        faults += [fault for fault in setting_faults if fault not in faults]
    return [*faults, *_find_never_shown(runs)]


def _try_elements(programs: LabPrograms, xml: str) -> list[Fault]:
    """Returns the elements of fields that are named and that the model does not have."""
    try:
        return list_missing_elements(programs, xml)
    except ValueError:  # which the first run tells
        return []


def _find_never_shown(runs: list[LabRun]) -> list[Fault]:
    """Says what is shown in the lab and cannot be computed in any frame of any run."""
    first, *others = runs
    return [
        Fault("", error.key, error.why)
        for index, (error, _) in first.failed.items()
        if all(run.always_failed(index) for run in (first, *others))
    ]


def try_run(
    run: Callable[[], object], where: str, *, refused: str = "", model: str = ".xml", setting: str = ""
) -> list[Fault]:
    """Returns the first thing that goes wrong in a run, if anything does; `refused` and `model` complete the key."""
    try:
        run()
    except LabError as error:
        return [Fault("", error.key, f"{error.why}{setting}")]
    except LabRefused as error:
        return [Fault("", where + refused, f"{error}{setting}")]
    except KeyError as error:
        return [Fault("", f"{where}.key", str(error.args[0]))]
    except ValueError as error:
        return [Fault("", where + model, "does not compile: " + " ".join(str(error).split()))]
    return []
