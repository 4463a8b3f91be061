"""Keys of predict questions: the lab is run under each option, or once for the claims of all options."""

import html
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from grader.certify.certificate import Certificate, of_choice, refused
from grader.certify.neighbours import neighbours
from grader.domain.lab import LabConfig, Readout, Select
from grader.domain.quiz import PredictQuestion
from grader.domain.verify import ByOptions, ByOutcome, Setting, When
from grader.labs.record import LabRun
from grader.labs.run import run_lab
from grader.labs.running import SAME, Variant
from grader.labs.values import Value, to_boolean

NUDGE = 1e-10
"""A start moved by this much must not change a verdict. Source: far above round-off, far below any pixel."""

ROUND_OFF = (Variant(nudge=NUDGE), Variant(nudge=-NUDGE))
FINER = (Variant(finer=2), Variant(finer=4))
NONE = re.compile(r"\b(none|neither|no option)\b", re.IGNORECASE)
ALL = re.compile(r"\b(all|both|each|every)\b", re.IGNORECASE)


def plain(text: str) -> str:
    """An option without its tags, for comparison with labels."""
    return " ".join(html.unescape(re.sub(r"<[^>]*>", "", text)).split())


def matching_select(options: Sequence[str], config: LabConfig) -> Select | None:
    """The select of a lab whose labels at least two of the options are."""
    wanted = {plain(option) for option in options}
    for control in config.controls:
        if isinstance(control, Select) and len(wanted & {plain(text) for text, _ in control.options}) >= 2:
            return control
    return None


def inferred_settings(options: Sequence[str], select: Select) -> list[Setting | None]:
    """The setting that each option names, None for an option that names none."""
    labels = {plain(text): text for text, _ in select.options}
    return [{select.label: labels[plain(o)]} if plain(o) in labels else None for o in options]


def certify_options(question: PredictQuestion, verify: ByOptions, xml: str) -> Certificate:
    """Run each option's setting; the right option is the one under which the criterion holds."""
    config = question.sim
    assert config is not None
    select = matching_select(question.options, config)
    settings = list(verify.settings or (inferred_settings(question.options, select) if select else ()))
    if len(settings) != len(question.options) or not any(settings):
        return refused("options", question.answer, "no option has a setting: write verify.settings, one per option")
    shown = with_criterion(config, None if verify.criterion == "stable" else [verify.criterion])
    held: dict[int, bool] = {}
    measured: dict[str, Any] = {}
    for i, setting in enumerate(settings):
        if setting is None:
            continue
        outcomes = [_outcome(shown, xml, setting, verify, v) for v in _variants(config, setting, verify)]
        measured[question.options[i]] = outcomes[0][1]
        if len({holds for holds, _ in outcomes}) > 1:
            why = f"{question.options[i]!r} depends on round-off or on the timestep: {[o for _, o in outcomes]}"
            return replace(refused("options", question.answer, why, key="answer"), measured=measured)
        held[i] = outcomes[0][0]
    right = right_options(question.options, held)
    certificate = of_choice("options", right, question.answer, question.options, measured)
    if select is not None and select.set == "model.opt.integrator" and verify.criterion == "stable":
        return neighbours(certificate, question, select, xml, verify.seconds)
    return certificate


def right_options(options: Sequence[str], held: dict[int, bool]) -> list[int]:
    """The options that are right: those that hold, or the one that says "none" or "all" where that is so."""
    holding = [i for i, holds in held.items() if holds]
    rest = [i for i in range(len(options)) if i not in held]
    nones = [i for i in rest if NONE.search(plain(options[i]))]
    alls = [i for i in rest if ALL.search(plain(options[i])) and i not in nones]
    if not holding and nones:
        return nones
    if len(holding) == len(held) and len(held) > 1 and alls:
        return alls
    return holding


def certify_outcome(question: PredictQuestion, verify: ByOutcome, xml: str) -> Certificate:
    """Run the lab once; the right option is the one whose claim is true, at h, h/2, h/4 and nudged."""
    config = question.sim
    assert config is not None
    if len(verify.claims) != len(question.options):
        return refused("outcome", question.answer, "verify.claims needs one expression per option")
    shown = with_criterion(config, verify.claims)
    truths = []
    for variant in (SAME, *FINER, *ROUND_OFF):
        run = run_lab(shown, xml, verify.controls, (), verify.seconds, variant=variant)
        truths.append([_holds(values, verify.when) for values in run.readouts])
    measured = {option: truths[0][i] for i, option in enumerate(question.options)}
    if any(other != truths[0] for other in truths):
        why = f"the claims depend on round-off or on the timestep: {truths}"
        return replace(refused("outcome", question.answer, why, key="answer"), measured=measured)
    right = [i for i, true in enumerate(truths[0]) if true]
    return of_choice("outcome", right, question.answer, question.options, measured)


def with_criterion(config: LabConfig, criteria: Sequence[str] | None) -> LabConfig:
    """The lab without what certificates do not read, and with expressions that they do."""
    readouts = tuple(Readout(label=text, expr=text) for text in criteria or ())
    return config.model_copy(update={"readouts": readouts, "plots": (), "trail": None})


def _variants(config: LabConfig, setting: Setting, verify: ByOptions) -> tuple[Variant, ...]:
    """Whether a run warns is a yes or no at its own timestep; an expression must agree at h, h/2 and h/4."""
    options_are_numerics = any(
        (getattr(c, "set", None) or "").startswith("model.opt.") for c in config.controls if c.label in setting
    )
    finer = () if verify.criterion == "stable" or options_are_numerics else FINER
    return (SAME, *ROUND_OFF, *finer)


def _outcome(
    config: LabConfig, xml: str, setting: Setting, verify: ByOptions, variant: Variant
) -> tuple[bool, dict[str, Any]]:
    run = run_lab(config, xml, setting, (), verify.seconds, variant=variant)
    if verify.criterion == "stable":
        return run.stable, stability(run)
    holds = _holds(run.readouts[0], verify.when)
    return holds, {"holds": holds, "final": run.to_json()["readouts"][0]["final"]["text"]}


def stability(run: LabRun) -> dict[str, Any]:
    """What a run showed: stable, or the first warning."""
    first = run.warnings[0] if run.warnings else None
    told = {"stable": run.stable, "seconds": round(run.duration_s, 6)}
    return told if first is None else told | {"warning": first.kind, "time": round(first.time_s, 6)}


def _holds(values: tuple[Value, ...], when: When) -> bool:
    truths = [to_boolean(value) for value in values]
    return truths[-1] if when == "end" else all(truths) if when == "always" else any(truths)
