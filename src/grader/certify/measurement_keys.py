"""Certifies numbers that are measured in a run, or given by a closed form."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from math import isfinite, tau
from typing import Any

import mujoco
import numpy as np

from grader.certify.certificate import Certificate, certify_number, refuse
from grader.certify.series_remarks import remark_series
from grader.certify.wording import list_amounts
from grader.domain.lab import LabConfig, Readout
from grader.domain.pages.markup import plain_text
from grader.domain.quantities import BASE_UNITS
from grader.domain.verify import ByExpression, ByMeasurement
from grader.errors import InvalidAnswer
from grader.experiments.limits import (
    UNCERTAINTY_SHARE,
    Measure,
    describe_noise,
    explain_change,
    explain_unsettled,
    find_limit,
    list_other_ends,
    measure_nudged,
)
from grader.experiments.quantities import WAVES, Floats, cut, estimate_rest, explain_absence, measure_waves
from grader.experiments.quantities import measure as measure_quantity
from grader.experiments.regime import Regime, RegimeFailure, describe_reset, explain_window
from grader.experiments.runs import (
    SAME,
    LabRun,
    Variant,
    VerifyError,
    evaluate,
    read_xml,
    run_experiment,
    to_numbers,
)
from grader.questions import ModelXml, NumberKey
from grader.questions.kinds.number.units import convert, known_unit, read_unit

EMPTY = "<mujoco/>"

NAMES = re.compile(r"\b(?:model|data|lib|ctx)\b")
"""What an expression can derive a number from."""

EXTREMES = frozenset({"max", "min", "amplitude", "peak_to_peak"})
"""Quantities of the largest and the smallest value of a run, which a longer run may pass."""

OFF_REST = 0.05
"""The share of its whole motion by which the place about which something swings is not 0."""

EARLY = 0.9
"""The part of a run without whose rest an extreme is found again."""


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
    if why := explain_window(verify.until, verify.seconds):
        return refuse("measurement", key.answer, why, key="verify.until", failed="window")
    xml = read_xml(verify.model, verify.xml, model_xml)
    keys = {part: f"verify.{part}" for part in ("setup", "controller", "key")} | {"readouts": "verify.expr"}
    scale = find_scale(verify.when, key.unit)

    def read(variant: Variant, verify: ByMeasurement) -> tuple[LabRun, float]:
        variant = replace(variant, every_step=verify.when != "end" or verify.until is not None)
        run = run_experiment(config, xml, seconds=verify.seconds, variant=variant, keys=keys)
        if run.warnings:
            raise RegimeFailure("no reset", describe_reset(run))
        return run, scale * measure_series(run, verify)

    def measure(variant: Variant) -> tuple[LabRun, float]:
        run, value = read(variant, verify)
        if not isfinite(value):
            if (size := np.asarray(run.readouts[0][-1], dtype=object).size) != 1:
                raise RegimeFailure("finite", f"expr gives {size} numbers: choose one of them, as in expr[0]")
            raise RegimeFailure("finite", explain_absence(verify.when, verify.expr))
        return run, value

    def read_beside(others: Sequence[str]) -> LabRun:
        readouts = (*config.readouts, *(Readout(label=expr, expr=expr) for expr in others))
        variant = replace(SAME, every_step=True)
        return run_experiment(
            config.model_copy(update={"readouts": readouts}), xml, seconds=verify.seconds, variant=variant, keys=keys
        )

    try:
        certificate = (_certify_run if verify.timestep == "given" else _certify_motion)(key, verify, measure)
        if certificate.ok and verify.when == "settling":
            ends = list_other_ends(verify.until or verify.seconds, is_part=verify.until is not None)
            others = {end: read(SAME, verify.model_copy(update={"seconds": end, "until": None}))[1] for end in ends}
            why = explain_unsettled(measure(SAME)[1], others, key.tolerance, is_part=verify.until is not None)
            certificate = _doubt(certificate, "settled", why)
        certificate = remark_series(certificate, key, verify, xml, read_beside)
        return _remark_number(certificate, key, verify)
    except RegimeFailure as error:
        at = "verify.expr" if error.condition == "finite" else "verify"
        return refuse("measurement", key.answer, str(error), key=at, failed=error.condition)


def _certify_run(key: NumberKey, verify: ByMeasurement, measure: Measure) -> Certificate:
    """Certify a number about the discretisation itself: only nudged starts and their round-off are varied."""
    run, value = measure(SAME)
    nudged = measure_nudged(measure)
    noise = max(abs(value - other) for other in nudged)
    measured = {"h/1": value, "nudged": nudged, "unit": key.unit}
    _, of_state = measure(Variant(derived=True))
    is_of_state = abs(of_state - key.answer) <= key.tolerance < abs(value - key.answer)
    derived = of_state if is_of_state else value
    certificate = certify_number("measurement", key, derived, noise, measured, cure=describe_noise(noise))
    if certificate.ok and not run.rederived and abs(of_state - value) > UNCERTAINTY_SHARE * key.tolerance:
        certificate = certificate.with_remark(
            "mj_step leaves energies and poses of the state at which it began: a page shows "
            f"{value:.6g}, and the state itself has {of_state:.6g}."
        )
    regime = {"timestep": "given", "failed": None if certificate.verdict != "cannot tell" else "nudged starts"}
    timestep_s = run.duration_s / max(run.steps, 1)
    certificate = replace(certificate, regime=regime | {"own timestep [s]": timestep_s, "round-off": noise})
    certificate = _require_alike_waves(certificate, key, verify, measure, 1)
    certificate = _remark_rest(_remark_growth(certificate, key, verify, run), verify, run)
    return _remark_last_stage(certificate, key, run, value, measure)


def _certify_motion(key: NumberKey, verify: ByMeasurement, measure: Measure) -> Certificate:
    """Certify a number about the motion; with `both`, the run at the own timestep must give the key too."""
    limit = find_limit(
        measure, UNCERTAINTY_SHARE * key.tolerance, to_the_end=verify.when == "end", fastest=verify.fastest
    )
    values = limit.ladder.values
    measured: dict[str, Any] = {f"h/{finer:.6g}": values[finer] for finer in sorted(values)}
    measured |= {"nudged": limit.nudged, "unit": key.unit}
    certificate = certify_number("measurement", key, limit.value, limit.uncertainty, measured, cure=limit.cure)
    checked: dict[str, Any] = {"timestep": verify.timestep, **limit.to_json()}
    if certificate.verdict == "cannot tell":
        checked["failed"] = limit.failed
    certificate = _compare_with_page(replace(certificate, regime=checked), key, verify, limit.regime, limit.own)
    certificate = _require_alike_waves(certificate, key, verify, measure, limit.ladder.finest)
    certificate = _remark_rest(_remark_growth(certificate, key, verify, limit.run), verify, limit.run)
    return _remark_last_stage(certificate, key, limit.run, limit.own, measure)


def _require_alike_waves(
    certificate: Certificate, key: NumberKey, verify: ByMeasurement, measure: Measure, finer: float
) -> Certificate:
    """Refuses a period, a frequency or a rate that is another one in each wave of a run at a `finer` timestep."""
    if not certificate.ok or verify.when == "end" or verify.when not in WAVES:
        return certificate
    run, value = measure(Variant(finer=finer))
    waves = find_scale(verify.when, key.unit) * measure_waves(verify.when, *read_series(run), verify)
    return _doubt(certificate, "alike waves", explain_change(verify.when, waves, value, key.tolerance))


def _doubt(certificate: Certificate, condition: str, why: str | None) -> Certificate:
    """Withdraws a certificate where there is a reason, `why`, because of a condition that failed."""
    if why is None:
        return certificate
    return replace(certificate, verdict="cannot tell", why=why, regime={**certificate.regime, "failed": condition})


def _remark_growth(certificate: Certificate, key: NumberKey, verify: ByMeasurement, run: LabRun) -> Certificate:
    """Remarks that an extreme still grows when the run ends, unless the author has set that end: it may be no peak."""
    if not certificate.ok or verify.when == "end" or verify.when not in EXTREMES or verify.until is not None:
        return certificate
    times, values = read_series(run)
    is_early = times <= EARLY * times[-1]
    before = measure_quantity(verify.when, times[is_early], values[is_early], verify)
    change = measure_quantity(verify.when, times, values, verify) - before
    if not abs(change) > key.tolerance:  # or there is nothing before
        return certificate
    remark = (
        f"The {verify.when.replace('_', ' ')} changes by {change:.3g} in the last tenth of the run, so a longer run "
        "may give another: if the question asks for a peak, make verify.seconds longer."
    )
    return certificate.with_remark(remark)


def _remark_rest(certificate: Certificate, verify: ByMeasurement, run: LabRun) -> Certificate:
    """Remarks on a rate of peaks above 0 where what is measured swings about something else."""
    if not certificate.ok or verify.when != "decay_rate" or verify.level is not None:
        return certificate
    times, values = cut(*read_series(run), verify)
    rest = estimate_rest(times, values)
    if abs(rest) <= OFF_REST * float(np.ptp(values)):
        return certificate
    remark = (
        f"The peaks are taken above 0, and the swing is about {rest:.3g}: write that as verify.level if the question "
        "asks for the decay of the swing."
    )
    return certificate.with_remark(remark)


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
    return certificate.with_remark(remark)


def _compare_with_page(
    certificate: Certificate, key: NumberKey, verify: ByMeasurement, regime: Regime, own: float
) -> Certificate:
    """Compare the number about the motion with the one that a page shows, which runs at the model's own timestep."""
    is_shown = abs(own - key.answer) <= key.tolerance
    if not certificate.ok:
        hint = (
            f'; the run at the own timestep gives the key, {own:.6g}: write "timestep": "given" if it is about that run'
        )
        is_noise = certificate.regime["failed"] == "nudged starts"
        return replace(certificate, why=certificate.why + hint) if is_shown and not is_noise else certificate
    if verify.timestep == "both" and not is_shown:
        why = (
            f"the motion gives the key, {certificate.answer:.6g}, but the run at the own timestep, which a page shows, "
            f"{own:.6g}: shorten the model's timestep, or write timestep any, or given and the other key"
        )
        return _doubt(certificate, "own timestep", why)
    if not regime.level:
        return certificate
    remark = (
        f"The own timestep, {regime.timestep_s:.6g} s, is too long for the fastest motion, {regime.fastest:.3g} 1/s: "
        f"the key was derived at timesteps {regime.first:g} times shorter, and a page shows {own:.6g}."
    )
    return certificate.with_remark(remark)


def measure_series(run: LabRun, verify: ByMeasurement) -> float:
    """Returns what `verify` measures in the first readout of a run; NaN where the run does not have it."""
    name = "final" if verify.when == "end" else verify.when
    return measure_quantity(name, *read_series(run), verify)


def read_series(run: LabRun) -> tuple[Floats, Floats]:
    """Returns the times of a run and its first readout."""
    return np.array(run.times), to_numbers(run.readouts[0])


def find_scale(when: str, unit: str | None) -> float:
    """Returns what a quantity that is read from moments is multiplied by to be in a unit: 1000 for a period in ms, 2π
    for a frequency in rad/s; 1 for all others. Raises VerifyError where the unit measures something else."""
    wanted = known_unit(unit or "")
    if when not in BASE_UNITS or wanted is None:
        return 1.0
    ways = [(1.0, BASE_UNITS[when]), *[(tau, "rad/s")] * (when == "frequency")]
    for size, name in ways:
        with suppress(InvalidAnswer):
            return convert(size, read_unit(name), wanted)
    what = f"{when.replace('_', ' ')} has {'the unit ' * bool(BASE_UNITS[when])}{BASE_UNITS[when] or 'no unit'}"
    raise VerifyError("unit", f"the {what}, and {unit} measures something else: write another unit, or another when")


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
    return _remark_number(certify_number("expression", key, value, 0.0, {"value": value}), key, verify)


def _remark_number(certificate: Certificate, key: NumberKey, verify: ByMeasurement | ByExpression) -> Certificate:
    """Remarks that an expression is a number alone: nothing in it is of a model, nor of the words of its question."""
    if NAMES.search(verify.expr) or (isinstance(verify, ByExpression) and _is_about_words(verify.expr, key)):
        return certificate
    remark = "verify.expr is a number alone, from which nothing is derived: write where it comes from."
    return certificate.with_remark(remark)


def _is_about_words(expr: str, key: NumberKey) -> bool:
    """Whether an expression that computes has a number of the question, up to a power of ten, as another unit gives. A
    field of several numbers is not known to have none: only its label is at hand."""
    with suppress(ValueError):
        float(expr)
        return False
    if key.place:
        return True
    written, asked = (
        {f"{abs(amount.value):.9e}".split("e")[0] for amount in list_amounts(text)}
        for text in (expr, plain_text(key.text))
    )
    return bool(written & asked)
