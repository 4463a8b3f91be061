"""Certifies numbers that are measured in a run, or given by a closed form."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any

import mujoco

from grader.certify.certificate import UNCERTAINTY_SHARE, Certificate, certify_number, refuse
from grader.certify.experiments import (
    NUDGED,
    PROBES,
    SAME,
    LabRun,
    Variant,
    evaluate,
    read_xml,
    run_experiment,
    to_number,
)
from grader.certify.ladder import Ladder
from grader.certify.regime import Regime, Unresolved, check_regime, describe_reset
from grader.domain.lab import LabConfig, Readout
from grader.domain.verify import ByExpression, ByMeasurement
from grader.questions import ModelXml, NumberKey

EMPTY = "<mujoco/>"

WHOLE = 1e-6
"""Distance from a whole number at which a run counts as that many steps: rounding of the sum of the timesteps."""

Measure = Callable[[Variant], tuple[LabRun, float]]


def certify_measurement(key: NumberKey, verify: ByMeasurement, model_xml: ModelXml) -> Certificate:
    """Measure the value at the given timestep, or its limit as the timestep goes to zero, and from nudged starts."""
    config = LabConfig(
        model=verify.model,
        xml=verify.xml,
        key=verify.key,
        setup=verify.setup,
        controller=verify.controller,
        readouts=(Readout(label="value", expr=verify.expr),),
    )
    xml = read_xml(verify.model, verify.xml, model_xml)
    keys = {part: f"verify.{part}" for part in ("setup", "controller", "key")} | {"readouts": "verify.expr"}

    def measure(variant: Variant) -> tuple[LabRun, float]:
        variant = replace(variant, every_step=verify.when != "end")
        run = run_experiment(config, xml, seconds=verify.seconds, variant=variant, keys=keys)
        if run.warnings:
            raise Unresolved("no reset", describe_reset(run))
        value = _summarise([to_number(v) for v in run.readouts[0]], verify.when)
        if not isfinite(value):
            raise Unresolved("finite", f"the measured value is {value}")
        return run, value

    try:
        return (_certify_run if verify.timestep == "given" else _certify_motion)(key, verify, measure)
    except Unresolved as error:
        at = "verify.expr" if error.condition == "finite" else "verify"
        return refuse("measurement", key.answer, str(error), key=at, failed=error.condition)


def _certify_run(key: NumberKey, verify: ByMeasurement, measure: Measure) -> Certificate:
    """Certify a number about the discretisation itself: only nudged starts and their round-off are varied."""
    run, value = measure(SAME)
    nudged = [measure(each)[1] for each in NUDGED]
    noise = max(abs(value - other) for other in nudged)
    measured = {"h/1": value, "nudged": nudged, "unit": key.unit}
    certificate = certify_number("measurement", key, value, noise, measured, cure=_describe_noise(noise))
    regime = {"timestep": "given", "failed": None if certificate.verdict != "cannot tell" else "nudged starts"}
    timestep_s = run.duration_s / max(run.steps, 1)
    certificate = replace(certificate, regime=regime | {"own timestep [s]": timestep_s, "round-off": noise})
    return _remark_last_stage(certificate, key, run, value, measure)


def _certify_motion(key: NumberKey, verify: ByMeasurement, measure: Measure) -> Certificate:
    """Certify a number about the motion; with `both`, the run at the own timestep must give the key too."""
    run, own = measure(Variant(probes=PROBES))
    regime = check_regime(run, to_the_end=verify.when == "end", fastest=verify.fastest)
    ladder = Ladder(
        lambda finer: measure(Variant(finer=finer))[1], regime, UNCERTAINTY_SHARE * key.tolerance, {1.0: own}
    )
    ladder.climb()
    nudged = [measure(replace(each, finer=regime.first))[1] for each in NUDGED]
    noise = max(abs(ladder.values[regime.first] - other) for other in nudged)
    failed, cure = _find_failure(ladder, noise)
    if verify.when == "end" and failed != "nudged starts" and (odd := _describe_odd_length(run)):
        failed, cure = "whole steps", odd
    measured: dict[str, Any] = {f"h/{finer:.6g}": ladder.values[finer] for finer in sorted(ladder.values)}
    measured |= {"nudged": nudged, "unit": key.unit}
    certificate = certify_number("measurement", key, ladder.best, max(ladder.uncertainty, noise), measured, cure=cure)
    checked = {"timestep": verify.timestep, **regime.to_json(ladder.finest), **ladder.to_json(), "round-off": noise}
    if certificate.verdict == "cannot tell":
        checked["failed"] = failed
    certificate = _compare_with_page(replace(certificate, regime=checked), key, verify, regime, own)
    return _remark_last_stage(certificate, key, run, own, measure)


def _remark_last_stage(
    certificate: Certificate, key: NumberKey, run: LabRun, own: float, measure: Measure
) -> Certificate:
    """Remark where the course's own page shows another number, as it reads what RK4's last stage left in `data`."""
    if not run.rederived:
        return certificate
    _, page = measure(Variant(as_stepped=True))
    if abs(page - own) <= UNCERTAINTY_SHARE * key.tolerance:
        return certificate
    remark = (
        f"After a step of RK4 data holds quantities of its last stage: the course's page shows {page:.6g}, and "
        f"the state has {own:.6g}."
    )
    return replace(certificate, remarks=(*certificate.remarks, remark))


def _compare_with_page(
    certificate: Certificate, key: NumberKey, verify: ByMeasurement, regime: Regime, own: float
) -> Certificate:
    """Compare the number about the motion with the one that a page shows, which runs at the model's own timestep."""
    is_shown = abs(own - key.answer) <= key.tolerance
    if not certificate.ok:
        hint = f"; the run at the own timestep gives the key, {own:.6g}: write timestep given if it is about that run"
        is_noise = certificate.regime["failed"] == "nudged starts"
        return replace(certificate, why=certificate.why + hint) if is_shown and not is_noise else certificate
    if verify.timestep == "both" and not is_shown:
        why = (
            f"the motion gives the key, {certificate.answer:.6g}, but the run at the own timestep, which a page shows, "
            f"{own:.6g}: shorten the model's timestep, or write timestep any, or given and the other key"
        )
        failed = {**certificate.regime, "failed": "own timestep"}
        return replace(certificate, verdict="cannot tell", why=why, regime=failed)
    if not regime.level:
        return certificate
    remark = (
        f"The own timestep, {regime.timestep_s:.6g} s, is too long for the fastest motion, {regime.fastest:.3g} 1/s: "
        f"the key was derived at timesteps {regime.first:g} times shorter, and a page shows {own:.6g}."
    )
    return replace(certificate, remarks=(*certificate.remarks, remark))


def _find_failure(ladder: Ladder, noise: float) -> tuple[str, str]:
    """Returns the condition because of which a number stays uncertain, and what the author may change."""
    if noise >= ladder.uncertainty:
        return "nudged starts", _describe_noise(noise)
    if ladder.missed >= 0.5 * ladder.uncertainty:
        return "incommensurate timestep", (
            "a timestep that is no simple fraction of the others disagrees, as where a force changes faster than the "
            "timestep: shorten the model's timestep, or give a larger tol"
        )
    cure = (
        "it still changes with the timestep: shorten the model's timestep, give a larger tol, or write timestep given"
    )
    return "converged", cure


def _describe_odd_length(run: LabRun) -> str | None:
    """Returns what to write where the run is no whole number of timesteps, so that each timestep ends elsewhere."""
    timestep_s = run.duration_s / max(run.steps, 1)
    steps = run.seconds / timestep_s
    whole = max(1, round(steps))
    if abs(steps - whole) <= WHOLE:
        return None
    return (
        f"{run.seconds:g} s are no multiple of the timestep {timestep_s:g} s, so that runs at other timesteps end at "
        f"other times: write seconds {whole * timestep_s:.9g}, or the timestep {run.seconds / whole:.9g} in the model"
    )


def _describe_noise(noise: float) -> str:
    return f"a start nudged by 1e-10 changes it by {noise:.2g}: ask for something earlier, or less sensitive"


def _summarise(values: Sequence[float], when: str) -> float:
    if when == "end":
        return values[-1]
    return max(values) if when == "max" else min(values) if when == "min" else sum(values) / len(values)


def certify_expression(key: NumberKey, verify: ByExpression, model_xml: ModelXml) -> Certificate:
    """Evaluate a closed form."""
    named = verify.model or verify.xml
    xml = read_xml(verify.model, verify.xml, model_xml) if named else EMPTY
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    value = evaluate(verify.expr, model, data, "verify.expr")
    if not isfinite(value):
        return refuse("expression", key.answer, f"the closed form gives {value}", key="verify.expr")
    return certify_number("expression", key, value, 0.0, {"value": value})
