"""Checks a lab when content is loaded: its programs are compiled, and it is tried."""

from grader.domain.lab import LabConfig
from grader.errors import ContentError, Fault, LabError, LabRefused
from grader.labs.controls import Given, control_faults, extreme_values, settable
from grader.labs.programs import lab_programs
from grader.labs.runs import Event, run_lab

SECONDS_AT_EXTREMES = 0.2


def check_lab(config: LabConfig, xml: str, where: str) -> list[Fault]:
    """Everything that is wrong with a lab, with keys that begin with `where`; the caller adds the file's name.

    Its programs are compiled; then it is run whole with the author's values, briefly at both ends of every slider and
    with every option, and each button is pressed, so that what can only fail in a run fails when content is loaded.
    """
    faults = list(control_faults(config, where))
    try:
        programs = lab_programs(config, where)
    except ContentError as error:
        return [*faults, *error.faults]
    if faults:
        return faults
    whole = _trial(config, xml, where, controls={}, events=[], seconds=None)
    if whole is not None:
        return [whole]
    trials: list[tuple[dict[str, Given], list[Event]]] = [
        ({control.label: value}, []) for control in settable(config) for value in extreme_values(control)
    ]
    trials += [({}, [(0.0, label)]) for label in programs.buttons]
    for controls, events in trials:
        fault = _trial(config, xml, where, controls=controls, events=events, seconds=SECONDS_AT_EXTREMES)
        if fault is not None and fault not in faults:
            faults.append(fault)
    return faults


def _trial(
    config: LabConfig,
    xml: str,
    where: str,
    *,
    controls: dict[str, Given],
    events: list[Event],
    seconds: float | None,
) -> Fault | None:
    """The first thing that goes wrong in a run, if anything does."""
    try:
        run_lab(config, xml, controls, events, seconds, where=where)
    except LabError as error:
        return Fault("", error.key, f"{error.why}{_with(controls, events)}")
    except LabRefused as error:
        return Fault("", where, f"{error}{_with(controls, events)}")
    except KeyError as error:
        return Fault("", f"{where}.key", str(error.args[0]))
    except ValueError as error:
        return Fault("", f"{where}.xml", "does not compile: " + " ".join(str(error).split()))
    return None


def _with(controls: dict[str, Given], events: list[Event]) -> str:
    """Under which setting a run failed."""
    settings = [f"{label} = {value}" for label, value in controls.items()] + [f"{label} pressed" for _, label in events]
    return f" (with {', '.join(settings)})" if settings else ""
