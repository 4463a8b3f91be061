"""Certifies keys of predict questions: runs the lab under each option's setting, or once for all claims."""

import re
from collections.abc import Sequence
from dataclasses import replace
from math import log
from typing import Any

import numpy as np

from grader.certify.certificate import Certificate, certify_choice, refuse
from grader.certify.claims import check_claim, to_claim
from grader.domain.lab import LabConfig, Select
from grader.domain.pages.markup import plain_text
from grader.domain.verify import STABLE, ByOptions, ByOutcome, Claim, Setting
from grader.experiments.lasting import explain_lasting_motion
from grader.experiments.quantities import Floats
from grader.experiments.regime import Reading, RegimeFailure, compare_runs
from grader.experiments.runs import (
    LabRun,
    Variant,
    build_lab_scene,
    format_readout,
    remove_display,
    run_experiment,
    to_numbers,
)
from grader.numerics.integrators import INTEGRATORS
from grader.numerics.scene import Scene
from grader.numerics.stability.growth import measure_silent_growth
from grader.numerics.stability.limit import find_spectral_limit
from grader.questions import ModelXml, OptionKey

NONE = re.compile(r"\b(none|neither|no option)\b", re.IGNORECASE)
ALL = re.compile(r"\b(all|both|each|every)\b", re.IGNORECASE)
ONLY = re.compile(r"\bonly\b|\bno other\b|\balone\b", re.IGNORECASE)

VISIBLE, CERTAIN = 1.5, 20.0
"""Growth of small motions over a silent run that may be seen, and that is certain: undecided between the two."""

LIMIT_SPAN_S = (5e-4, 0.1)
"""Timesteps [s] between which the linear stability limit is sought."""


def find_matching_select(options: Sequence[str], lab: LabConfig) -> Select | None:
    """Returns the first select of a lab with a label in common with two or more of the options."""
    wanted = {plain_text(option) for option in options}
    for control in lab.controls:
        if isinstance(control, Select) and len(wanted & {plain_text(text) for text, _ in control.options}) >= 2:
            return control
    return None


def certify_prediction(
    key: OptionKey, lab: LabConfig, verify: ByOptions | ByOutcome, model_xml: ModelXml
) -> Certificate:
    """Run the lab of a question as its `verify` says."""
    xml = lab.xml or model_xml(lab.model or "")
    if isinstance(verify, ByOptions):
        return _certify_options(key, lab, verify, xml)
    return _certify_outcome(key, lab, verify, xml)


def _certify_options(key: OptionKey, lab: LabConfig, verify: ByOptions, xml: str) -> Certificate:
    """Run each option's setting; the right option is the one under which the criterion holds."""
    select = find_matching_select(key.options, lab)
    settings = list(verify.settings or (infer_settings(key.options, select) if select else ()))
    if len(settings) != len(key.options) or not any(settings):
        return refuse("options", key.answer, "no option has a setting: write verify.settings, one per option")
    if select is not None and (why := explain_contradiction(key.options, settings, select)):
        return refuse("options", key.answer, why, key="verify.settings")
    measuring = remove_display(lab, *(() if verify.criterion == STABLE else (_find_expression(verify.criterion),)))
    held: dict[int, bool] = {}
    measured: dict[str, Any] = {}
    regimes: dict[str, Any] = {}
    for i, setting in enumerate(settings):
        if setting is None:
            continue
        option = key.options[i]
        try:
            outcomes, regimes[option] = _measure_outcomes(measuring, lab, xml, setting, verify)
        except RegimeFailure as error:
            return refuse("options", key.answer, f"{option!r}: {error}", measured=measured, failed=error.condition)
        measured[option] = outcomes[0][1]
        if len({holds for holds, _ in outcomes}) > 1:
            why = f"{option!r} depends on round-off or on the timestep: {[o for _, o in outcomes]}"
            return refuse("options", key.answer, why, key="answer", measured=measured, failed="agreement of all runs")
        held[i] = outcomes[0][0]
    right = _find_right_options(key.options, held)
    certificate = certify_choice("options", right, key.answer, key.options, measured)
    certificate = replace(certificate, regime={"failed": None, **regimes})
    if select is not None and select.set == "model.opt.integrator" and verify.criterion == STABLE:
        return _compare_integrators(certificate, key, measuring, select, xml, seconds=verify.seconds)
    return certificate


def _certify_outcome(key: OptionKey, lab: LabConfig, verify: ByOutcome, xml: str) -> Certificate:
    """Run the lab once; the right option is the one whose claim is true in every variant of the run."""
    if len(verify.claims) != len(key.options):
        return refuse("outcome", key.answer, "verify.claims needs one expression per option")
    claims = [to_claim(claim, verify.when) for claim in verify.claims]
    measuring = remove_display(lab, *(claim.expr for claim in claims))
    every_step = any(claim.when != "end" or claim.until for claim in claims)

    def run(variant: Variant) -> LabRun:
        variant = replace(variant, every_step=every_step)
        keys = {"readouts": "verify.claims"}
        return run_experiment(measuring, xml, verify.controls, seconds=verify.seconds, variant=variant, keys=keys)

    rederived = False

    def read(variant: Variant) -> Reading:
        nonlocal rederived
        done = run(variant)
        rederived |= done.rederived
        checks = [check_claim(claim, done, values) for claim, values in zip(claims, done.readouts, strict=True)]
        return [holds for holds, _ in checks], [number for _, number in checks]

    try:
        readings, regime = compare_runs(read, run, verify, to_the_end=all(claim.when == "end" for claim in claims))
    except RegimeFailure as error:
        return refuse("outcome", key.answer, str(error), key="answer", failed=error.condition)
    truths, numbers = (list(column) for column in zip(*readings, strict=True))
    measured = {
        option: holds if number is None else {"true": holds, claim.when: number}
        for option, claim, holds, number in zip(key.options, claims, truths[0], numbers[0], strict=True)
    }
    if any(other != truths[0] for other in truths):
        shown = numbers if any(number is not None for row in numbers for number in row) else truths
        why = f"the claims depend on round-off or on the timestep: {shown}"
        return refuse("outcome", key.answer, why, key="answer", measured=measured, failed="agreement of all runs")
    right = [i for i, true in enumerate(truths[0]) if true]
    remarks: tuple[str, ...] = ()
    if rederived and read(Variant(as_stepped=True))[0] != truths[0]:
        remarks = ("The course's page shows another outcome: after a step of RK4 data is of its last stage.",)
    certificate = certify_choice("outcome", right, key.answer, key.options, measured)
    return replace(certificate, regime=regime, remarks=remarks)


def infer_settings(options: Sequence[str], select: Select) -> list[Setting | None]:
    """Returns the setting that each option names, or None."""
    labels = {plain_text(text): text for text, _ in select.options}
    return [{select.label: labels[plain_text(o)]} if plain_text(o) in labels else None for o in options]


def explain_contradiction(options: Sequence[str], settings: Sequence[Setting | None], select: Select) -> str | None:
    """Returns why settings are not those of their options, where an option is a label of the select."""
    values = {plain_text(text): (text, value) for text, value in select.options}
    for option, setting in zip(options, settings, strict=True):
        named = values.get(plain_text(option))
        if named is not None and setting and select.label in setting and setting[select.label] not in named:
            sets = f"verify.settings set {select.label!r} to {setting[select.label]!r}"
            return f"the option {option!r} is a setting itself, and {sets} for it: write them in the options' order"
    return None


def _find_right_options(options: Sequence[str], held: dict[int, bool]) -> list[int]:
    """Return the options that hold; if none or all of them hold, the option that says "none" or "all"."""
    holding = [i for i, holds in held.items() if holds]
    rest = [i for i in range(len(options)) if i not in held]
    nones = [i for i in rest if NONE.search(plain_text(options[i]))]
    alls = [i for i in rest if ALL.search(plain_text(options[i])) and i not in nones]
    if not holding and nones:
        return nones
    if len(holding) == len(held) and len(held) > 1 and alls:
        return alls
    return holding


Outcome = tuple[bool, dict[str, Any]]
"""Whether the criterion holds under a setting, and what was measured."""


def _measure_outcomes(
    measuring: LabConfig, lab: LabConfig, xml: str, setting: Setting, verify: ByOptions
) -> tuple[list[Outcome], dict[str, Any]]:
    """Returns the outcomes of the runs that must agree, and the regime as JSON. Raises RegimeFailure.

    Stability belongs to one timestep, and so does what a setting of the numerics changes: only starts are nudged. A run
    without a warning is stable only if small motions do not grow either: large ones may be bounded by nonlinear forces.
    """
    sets_numerics = any(
        (getattr(c, "set", None) or "").startswith("model.opt.") for c in lab.controls if c.label in setting
    )
    if verify.criterion == STABLE or sets_numerics:
        verify = verify.model_copy(update={"timestep": "given"})
    keys = {"readouts": "verify.criterion"}
    outcomes, regime = compare_runs(
        lambda v: _measure_outcome(measuring, xml, setting, verify, v),
        lambda v: run_experiment(measuring, xml, setting, seconds=verify.seconds, variant=v, keys=keys),
        verify,
        to_the_end=to_claim(verify.criterion, verify.when).when == "end",
    )
    if verify.criterion == STABLE and all(holds for holds, _ in outcomes):
        outcomes = [_check_growth(measuring, xml, setting, verify.seconds, outcomes[0])]
    return outcomes, regime


def _measure_outcome(lab: LabConfig, xml: str, setting: Setting, verify: ByOptions, variant: Variant) -> Outcome:
    keys = {"readouts": "verify.criterion"}
    if verify.criterion == STABLE:
        run = run_experiment(lab, xml, setting, seconds=verify.seconds, variant=variant, keys=keys)
        return run.stable, _describe_stability(run)
    claim = to_claim(verify.criterion, verify.when)
    variant = replace(variant, every_step=claim.when != "end" or claim.until is not None)
    run = run_experiment(lab, xml, setting, seconds=verify.seconds, variant=variant, keys=keys)
    holds, number = check_claim(claim, run, run.readouts[0])
    if number is not None:
        return holds, {"holds": holds, claim.when: number}
    return holds, {"holds": holds, "final": format_readout(run.readouts[0][-1], None)}


def _check_growth(lab: LabConfig, xml: str, setting: Setting, seconds: float | None, silent: Outcome) -> Outcome:
    """Returns the outcome of a run without a warning: not stable if small motions certainly grow, or where that cannot
    be told if only the timestep keeps the motion up. Raises RegimeFailure."""
    scene = build_lab_scene(lab, xml, setting)
    h, integrator = float(scene.model.opt.timestep), int(scene.model.opt.integrator)
    growth = None
    if lab.controller is None:
        growth = measure_silent_growth(scene, timestep_s=h, integrator=integrator)
    if growth is None:
        why = _explain_lasting_motion(lab, xml, setting, seconds, scene.model.nv)
        return silent if why is None else _withdraw(silent, f"MuJoCo never warns, but {why}")
    grown = silent[1]["seconds"] / h * log(growth)
    if grown < log(VISIBLE):
        return silent
    why = f"MuJoCo never warns, but small motions about the equilibrium grow {growth:.6g} times a step"
    if grown < log(CERTAIN):
        cure = "the timestep is too near the limit for a run of this length; move it away"
        raise RegimeFailure("growth about the equilibrium", f"{why}: {cure}")
    return _withdraw(silent, f"{why}: large ones are bounded")


def _withdraw(silent: Outcome, growth: str) -> Outcome:
    """Returns the outcome of a run without a warning that is not stable because of its `growth`."""
    return False, {**silent[1], "stable": False, "growth": growth}


def _explain_lasting_motion(lab: LabConfig, xml: str, setting: Setting, seconds: float | None, nv: int) -> str | None:
    """Says that only the timestep keeps the motion of a setting up; None where it does not."""
    config = remove_display(lab, *(f"data.qvel[{dof}]" for dof in range(nv)))

    def read(variant: Variant) -> tuple[LabRun, Floats]:
        variant = replace(variant, every_step=True)
        run = run_experiment(config, xml, setting, seconds=seconds, variant=variant, keys={})
        return run, np.array([to_numbers(series) for series in run.readouts])

    return explain_lasting_motion(read) if nv else None


def _describe_stability(run: LabRun) -> dict[str, Any]:
    """Whether a run was stable, its length, and its first warning."""
    first = run.warnings[0] if run.warnings else None
    result = {"stable": run.stable, "seconds": round(run.duration_s, 6)}
    return result if first is None else result | {"warning": first.kind, "time": round(first.time_s, 6)}


def _find_expression(criterion: str | Claim) -> str:
    return criterion.expr if isinstance(criterion, Claim) else criterion


def _compare_integrators(
    certificate: Certificate,
    key: OptionKey,
    lab: LabConfig,
    select: Select,
    xml: str,
    *,
    seconds: float | None,
) -> Certificate:
    """Add the same run under all five integrators, and a remark on a stable one that is not among the options."""
    scene = build_lab_scene(lab, xml)
    offered = {value for _, value in select.options}
    table: dict[str, Any] = {}
    overlooked = []
    for integrator in INTEGRATORS:
        variant = Variant(integrator=integrator.code)
        stable = run_experiment(lab, xml, seconds=seconds, variant=variant, keys={}).stable
        limit_ms = _find_limit_ms(scene, integrator.code)
        is_option = integrator.code in offered
        table[integrator.name] = {"stable": stable, "limit_ms": limit_ms, "is_option": is_option}
        if stable and not is_option:
            overlooked.append(integrator.name + ("" if limit_ms is None else f" (up to {limit_ms:.2f} ms)"))
    measured = {**certificate.measured, "all integrators": table}
    return replace(certificate, measured=measured, remarks=(*certificate.remarks, *_list_remarks(key, overlooked)))


def _list_remarks(key: OptionKey, overlooked: list[str]) -> list[str]:
    if not overlooked:
        return []
    only = ", and the explanation says that only one is" if ONLY.search(key.explain) else ""
    return [f"Stable here too, though no option: {', '.join(overlooked)}{only}."]


def _find_limit_ms(scene: Scene, integrator: int) -> float | None:
    """Returns the linear stability limit [ms]; None if there is none in LIMIT_SPAN_S, or no equilibrium."""
    low_s, high_s = LIMIT_SPAN_S
    try:
        limit = find_spectral_limit(scene, low_s=low_s, high_s=high_s, integrator=integrator)
    except ValueError:
        return None
    return None if limit is None else round(1000 * limit, 3)
