"""Certifies keys of predict questions: runs the lab under each option's setting, or once for all claims."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from grader.certify.certificate import Certificate, certify_choice, refuse
from grader.certify.claims import check_claim, to_claim
from grader.certify.experiments import (
    NUDGED,
    PROBES,
    SAME,
    LabRun,
    Variant,
    build_lab_scene,
    format_readout,
    remove_display,
    run_experiment,
)
from grader.certify.regime import Unresolved, choose_incommensurate, describe_reset, find_first_level
from grader.domain.lab import LabConfig, Select
from grader.domain.markup import plain_text
from grader.domain.verify import ByOptions, ByOutcome, Claim, Setting
from grader.numerics.stability.growth import measure_silent_growth
from grader.numerics.integrators import INTEGRATORS
from grader.numerics.scene import Scene
from grader.numerics.stability.linear import find_spectral_limit
from grader.questions import ModelXml, OptionKey

NONE = re.compile(r"\b(none|neither|no option)\b", re.IGNORECASE)
ALL = re.compile(r"\b(all|both|each|every)\b", re.IGNORECASE)
ONLY = re.compile(r"\bonly\b|\bno other\b|\balone\b", re.IGNORECASE)

VISIBLE, CERTAIN = 1.5, 20.0
"""Growth of small motions over a silent run that may be seen, and that is certain: between the two nobody can tell."""

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
    settings = list(verify.settings or (_infer_settings(key.options, select) if select else ()))
    if len(settings) != len(key.options) or not any(settings):
        return refuse("options", key.answer, "no option has a setting: write verify.settings, one per option")
    measuring = remove_display(lab, *(() if verify.criterion == "stable" else (_find_expression(verify.criterion),)))
    held: dict[int, bool] = {}
    measured: dict[str, Any] = {}
    for i, setting in enumerate(settings):
        if setting is None:
            continue
        try:
            outcomes = _outcomes(measuring, lab, xml, setting, verify)
        except Unresolved as error:
            why = f"{key.options[i]!r}: {error}"
            return replace(refuse("options", key.answer, why), regime={"holds": False})
        measured[key.options[i]] = outcomes[0][1]
        if len({holds for holds, _ in outcomes}) > 1:
            why = f"{key.options[i]!r} depends on round-off or on the timestep: {[o for _, o in outcomes]}"
            return replace(refuse("options", key.answer, why, key="answer"), measured=measured)
        if outcomes[0][0] is None:
            why = f"{key.options[i]!r} cannot be decided: {outcomes[0][1].get('why', 'MuJoCo reset the state')}"
            return replace(refuse("options", key.answer, why, key="answer"), measured=measured)
        held[i] = outcomes[0][0]
    right = _find_right_options(key.options, held)
    certificate = certify_choice("options", right, key.answer, key.options, measured)
    if select is not None and select.set == "model.opt.integrator" and verify.criterion == "stable":
        return _compare_integrators(certificate, key, measuring, select, xml, seconds=verify.seconds)
    return certificate


def _certify_outcome(key: OptionKey, lab: LabConfig, verify: ByOutcome, xml: str) -> Certificate:
    """Run the lab once; the right option is the one whose claim is true, at h, h/2, h/4 and from nudged starts."""
    if len(verify.claims) != len(key.options):
        return refuse("outcome", key.answer, "verify.claims needs one expression per option")
    claims = [to_claim(claim, verify.when) for claim in verify.claims]
    measuring = remove_display(lab, *(claim.expr for claim in claims))
    truths, numbers = [], list[list[float | None]]()
    every = any(claim.when != "end" or claim.until for claim in claims)

    def run_of(variant: Variant) -> LabRun:
        variant = replace(variant, every_step=every)
        keys = {"readouts": "verify.claims"}
        return run_experiment(measuring, xml, verify.controls, seconds=verify.seconds, variant=variant, keys=keys)

    try:
        given = verify.timestep == "given"
        to_the_end = all(claim.when == "end" for claim in claims)
        variants = (
            (SAME, *NUDGED) if given else _regime_variants(run_of, to_the_end=to_the_end, own=verify.timestep == "both")
        )
    except Unresolved as error:
        return replace(refuse("outcome", key.answer, str(error)), regime={"holds": False})
    for variant in variants:
        run = run_of(variant)
        found = [check_claim(claim, run, values) for claim, values in zip(claims, run.readouts, strict=True)]
        if any(holds is None for holds, _ in found):
            return replace(
                refuse("outcome", key.answer, str(describe_reset(run)), key="answer"), regime={"holds": False}
            )
        truths.append([bool(holds) for holds, _ in found])
        numbers.append([number for _, number in found])
    measured = {
        option: truths[0][i] if numbers[0][i] is None else {"true": truths[0][i], claims[i].when: numbers[0][i]}
        for i, option in enumerate(key.options)
    }
    if any(other != truths[0] for other in truths):
        shown = numbers if any(number is not None for row in numbers for number in row) else truths
        why = f"the claims depend on round-off or on the timestep: {shown}"
        return replace(refuse("outcome", key.answer, why, key="answer"), measured=measured)
    right = [i for i, true in enumerate(truths[0]) if true]
    return certify_choice("outcome", right, key.answer, key.options, measured)


def _infer_settings(options: Sequence[str], select: Select) -> list[Setting | None]:
    """Returns the setting that each option names, or None."""
    labels = {plain_text(text): text for text, _ in select.options}
    return [{select.label: labels[plain_text(o)]} if plain_text(o) in labels else None for o in options]


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


def _outcomes(
    measuring: LabConfig, lab: LabConfig, xml: str, setting: Setting, verify: ByOptions
) -> list[tuple[bool | None, dict[str, Any]]]:
    """What the runs give that must agree: nudged starts, and shorter timesteps unless the setting changes the numerics.

    Stability belongs to one timestep, so it is not compared with shorter ones, but with the linear growth of small
    motions: a motion that grows may be bounded by forces that are not linear, and then MuJoCo never warns.
    """
    options_are_numerics = any(
        (getattr(c, "set", None) or "").startswith("model.opt.") for c in lab.controls if c.label in setting
    )
    if verify.criterion == "stable":
        runs = [_measure_outcome(measuring, xml, setting, verify, v) for v in (SAME, *NUDGED)]
        return [_grown(measuring, xml, setting, runs[0])] if runs[0][0] and all(r[0] for r in runs) else runs
    if options_are_numerics or verify.timestep == "given":
        return [_measure_outcome(measuring, xml, setting, verify, v) for v in (SAME, *NUDGED)]
    keys = {"readouts": "verify.criterion"}
    variants = _regime_variants(
        lambda v: run_experiment(measuring, xml, setting, seconds=verify.seconds, variant=v, keys=keys),
        to_the_end=to_claim(verify.criterion, verify.when).when == "end",
        own=verify.timestep == "both",
    )
    return [_measure_outcome(measuring, xml, setting, verify, v) for v in variants]


def _regime_variants(run: Callable[[Variant], LabRun], *, to_the_end: bool, own: bool) -> tuple[Variant, ...]:
    """The variants that must agree on a claim about the motion itself. Raises Unresolved."""
    probed = run(Variant(probes=PROBES))
    if probed.warnings:
        return (SAME,)
    level, _ = find_first_level(probed, to_the_end=to_the_end)
    finest = 2.0**level
    finer = tuple(Variant(finer=f) for f in (finest, 2 * finest, 4 * finest, choose_incommensurate(probed, level)))
    return (*((SAME,) if own and level else ()), *finer, *(replace(v, finer=finest) for v in NUDGED))


def _measure_outcome(
    lab: LabConfig, xml: str, setting: Setting, verify: ByOptions, variant: Variant
) -> tuple[bool | None, dict[str, Any]]:
    """Whether the criterion holds under a setting, and what was measured; None where a reset hides it."""
    keys = {"readouts": "verify.criterion"}
    if verify.criterion == "stable":
        run = run_experiment(lab, xml, setting, seconds=verify.seconds, variant=variant, keys=keys)
        return run.stable, _describe_stability(run)
    claim = to_claim(verify.criterion, verify.when)
    variant = replace(variant, every_step=claim.when != "end" or claim.until is not None)
    run = run_experiment(lab, xml, setting, seconds=verify.seconds, variant=variant, keys=keys)
    holds, number = check_claim(claim, run, run.readouts[0])
    if holds is None:
        return None, {"why": describe_reset(run)}
    if number is not None:
        return holds, {"holds": holds, claim.when: number}
    return holds, {"holds": holds, "final": format_readout(run.readouts[0][-1], None)}


def _grown(
    lab: LabConfig, xml: str, setting: Setting, outcome: tuple[bool | None, dict[str, Any]]
) -> tuple[bool | None, dict[str, Any]]:
    """The outcome of a silent run, with the growth of small motions: not stable where it is certain, else None."""
    if lab.controller is not None:
        return outcome
    scene = build_lab_scene(lab, xml, setting)
    h, integrator = float(scene.model.opt.timestep), int(scene.model.opt.integrator)
    grown = measure_silent_growth(scene, timestep_s=h, integrator=integrator, steps=round(outcome[1]["seconds"] / h))
    if grown is None or grown.factor < VISIBLE:
        return outcome
    why = f"MuJoCo never warns, but small motions about the equilibrium grow {grown.per_step:.4g} times a step"
    if grown.factor < CERTAIN:
        return None, {**outcome[1], "why": f"{why}: the timestep is too near the limit for this length; move it away"}
    return False, {**outcome[1], "stable": False, "growth": f"{why}: large ones are bounded"}


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
