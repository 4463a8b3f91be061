"""Proposes a `verify` for a predict question: each option becomes a claim about the run, by its number or by what it
says of a change, or a setting whose option comes out on top. The claims are certified as any are, and know no key."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from grader.certify.predict_keys import find_matching_select, infer_settings
from grader.certify.proposals.expressions import FittedExpression, fit_unit
from grader.certify.proposals.number_proposals import NAMES
from grader.certify.proposals.proposal import Proposal, write_verify
from grader.certify.proposals.scenes import LabScene, ShownExpression, read_numbers
from grader.certify.proposals.trying import BROKEN, certify_with
from grader.certify.wording import (
    Amount,
    AskedQuantities,
    Way,
    read_amount,
    read_question,
    read_ways,
    read_words,
)
from grader.domain.pages.markup import plain_text
from grader.domain.verify import ByOptions, ByOutcome, Setting
from grader.experiments.quantities import Floats, measure
from grader.experiments.runs import LabRun, Variant, remove_display, run_experiment
from grader.questions import ModelXml, OptionKey

TRIED_MAX = 3
"""Candidates that are certified: about ten runs each."""

SHARE = 1 / 3
"""Half the width of what counts as the number of an option, as a share of the distance to the nearest other one."""

CHANGED, STILL = 0.01, 0.02
"""A change counts from this size on, or from this share of the value at the start; what is within a factor MARGIN of it
is neither."""

MARGIN = 3.0

LEAD = 0.05
"""How far the value of the best setting must be ahead of the next, as a share of the range of all."""


@dataclass(frozen=True)
class OptionCandidate:
    """A `verify` of a predict question, how sentences call what it measures, and how well it fits the words."""

    verify: ByOutcome | ByOptions
    what: str
    rank: int


def propose_for_option(key: OptionKey, scenes: Sequence[LabScene], model_xml: ModelXml, text: str) -> Proposal | None:
    """Returns the candidate that fits best, with the option that it gives. The key holds only if every candidate that
    fits as well gives it, too: with few options one of them would give any key by chance."""
    own = next((scene for scene in scenes if scene.is_own), None)
    if own is None:
        return None
    asked = read_question(text)
    try:
        candidates = sorted(list_candidates(key, asked, own, text), key=lambda candidate: -candidate.rank)
    except BROKEN:
        return None
    decided: list[tuple[OptionCandidate, int, bool]] = []
    for candidate in candidates[:TRIED_MAX]:
        certificate = certify_with(key, candidate.verify, model_xml)
        if certificate is not None and isinstance(certificate.answer, int):
            decided.append((candidate, certificate.answer, certificate.ok))
    decided = [each for each in decided if each[0].rank == decided[0][0].rank]
    if not decided:
        return None
    answers = {answer for _, answer, _ in decided}
    is_agreed = len(answers) == 1
    candidate, answer, is_certified = next((each for each in decided if is_agreed or not each[2]), decided[0])
    caution = "" if is_agreed else "; other quantities of its simulation give another option"
    return Proposal(
        write_verify(candidate.verify), is_agreed and is_certified, candidate.what, name_option(key, answer),
        name_option(key, key.answer), len(decided), caution,
    )  # fmt: skip


def name_option(key: OptionKey, index: int) -> str:
    """Returns an option as sentences call it."""
    return f"“{plain_text(key.options[index])}”"


def list_candidates(key: OptionKey, asked: AskedQuantities, scene: LabScene, text: str) -> Iterator[OptionCandidate]:
    """Yields what the options may claim. Raises what `LabScene.run` does."""
    if (select := find_matching_select(key.options, scene.lab)) is not None:
        yield from list_rankings(key, asked, scene, infer_settings(key.options, select))
        return
    amounts = [read_amount(option) for option in key.options]
    ways = read_ways(text, key.options)
    if not any(amounts) and ways is None:
        return
    shown = scene.list_shown() or scene.list_joints()
    run = scene.run([curve.expr for curve in shown], scene.seconds)
    for quantity, column in zip(shown, run.readouts, strict=True):
        values = read_numbers(column)
        if not np.isfinite(values).all():
            continue
        rank = min(len(read_words(quantity.label) & asked.words), 2)
        if all(amounts):
            yield from claim_amounts([amount for amount in amounts if amount], asked, scene, quantity, rank)
        elif ways is not None:
            yield from claim_ways(ways, scene, quantity, values, rank)


def claim_amounts(
    amounts: Sequence[Amount], asked: AskedQuantities, scene: LabScene, shown: ShownExpression, rank: int
) -> Iterator[OptionCandidate]:
    """Yields claims that a quantity is near the number of an option."""
    numbers = [amount.value for amount in amounts]
    if len(set(numbers)) < len(numbers) or len({amount.unit and amount.unit.powers for amount in amounts}) > 1:
        return
    unit = amounts[0].unit.text if amounts[0].unit else None
    widths = [SHARE * min(abs(number - other) for other in numbers if other != number) for number in numbers]
    if asked.quantities and asked.quantities[0] == "crossings":
        level = {"when": "times"}
        claims: list[dict[str, Any] | str] = [
            {"expr": f"{shown.expr} > 0", "at_least": cut(value - width), "at_most": cut(value + width), **level}
            for value, width in zip(numbers, widths, strict=True)
        ]
        yield OptionCandidate(build_outcome(scene, claims), f"how often “{shown.label}” becomes positive", rank)
        return
    fitted = fit_unit(shown, scene.model, unit)
    if fitted is None:
        return
    for name in [quantity for quantity in asked.quantities if quantity in ("end", "max", "min")] or ["end"]:
        claims = [claim_number(fitted, name, value, width) for value, width in zip(numbers, widths, strict=True)]
        what = f"{NAMES[name]} of “{shown.label}” within {scene.seconds:g} s"
        yield OptionCandidate(build_outcome(scene, claims), what, rank + 2 * fitted.is_certain)


def claim_number(fitted: FittedExpression, name: str, number: float, width: float) -> dict[str, Any] | str:
    """Returns the claim that a quantity is within `width` of a number."""
    if name == "end":
        return f"Math.abs({fitted.expr} - {write(number)}) <= {write(width)}".replace("- -", "+ ")
    return {"expr": fitted.expr, "when": name, "at_least": cut(number - width), "at_most": cut(number + width)}


def claim_ways(
    ways: Sequence[Way], scene: LabScene, shown: ShownExpression, values: Floats, rank: int
) -> Iterator[OptionCandidate]:
    """Yields claims that a value rises, falls or stays; of two options of which one says that it stays, that it ever
    leaves its start. What changes by about as much as counts is left out."""
    start, end = float(values[0]), float(values[-1])
    bound = max(STILL * abs(start), 0.0) or CHANGED
    is_pair = len(ways) == 2 and Way.SAME in ways
    size = float(np.abs(values - start).max()) if is_pair else abs(end - start)
    if bound / MARGIN < size < bound * MARGIN or (Way.MOVES in ways and not is_pair):
        return
    off = f"{shown.expr} - {write(start)}".replace("- -", "+ ") if start else shown.expr
    edge = write(bound)
    claims: list[dict[str, Any] | str] = []
    for way in ways:
        if is_pair:
            still = {"expr": f"Math.abs({off}) <= {edge}", "when": "always"}
            moved = {"expr": f"Math.abs({off}) > {edge}", "when": "ever"}
            claims.append(still if way is Way.SAME else moved)
        else:
            claims.append(
                {Way.UP: f"{off} > {edge}", Way.DOWN: f"{off} < -{edge}"}.get(way, f"Math.abs({off}) <= {edge}")
            )
    what = f"the change of “{shown.label}” from its start"
    yield OptionCandidate(build_outcome(scene, claims), what, rank)


def list_rankings(
    key: OptionKey, asked: AskedQuantities, scene: LabScene, settings: Sequence[Setting | None]
) -> Iterator[OptionCandidate]:
    """Yields criteria under which the option with the largest, or smallest, value of its run is right, where the
    question asks for that."""
    name = next((quantity for quantity in asked.quantities if quantity in ("max", "min")), None)
    if name is None or None in settings:
        return
    shown = scene.list_shown() or scene.list_joints()
    lab = remove_display(scene.lab, *(curve.expr for curve in shown))
    runs = [run_setting(lab, scene, setting) for setting in settings]
    for index, expression in enumerate(shown):
        for expr, change in ((expression.expr, np.asarray), (f"Math.abs({expression.expr})", np.abs)):
            tops = [find_top(run, index, change) for run in runs]
            if not np.isfinite(tops).all() or (
                change is np.abs and tops == [find_top(run, index, np.asarray) for run in runs]
            ):
                continue
            order = sorted(tops, reverse=name == "max")
            lead, spread = abs(order[0] - order[1]), abs(order[0] - order[-1])
            if lead <= LEAD * spread:
                continue
            middle = cut((order[0] + order[1]) / 2)
            bound = {"at_least": middle} if name == "max" else {"at_most": middle}
            verify = ByOptions.model_validate(
                {"by": "options", "criterion": {"expr": expr, "when": "max", **bound}, "seconds": scene.seconds}
            )
            what = f"the largest value of “{expression.label}”{' without sign' * (change is np.abs)} under each option"
            yield OptionCandidate(verify, what, min(len(read_words(expression.label) & asked.words), 2))


def run_setting(lab: Any, scene: LabScene, setting: Setting | None) -> LabRun:
    """Returns the run of a lab under the setting of an option."""
    return run_experiment(lab, scene.xml, setting, seconds=scene.seconds, variant=Variant(every_step=True), keys={})


def find_top(run: LabRun, index: int, change: Any) -> float:
    """Returns the largest value of a readout; NaN where MuJoCo reset the run."""
    values = change(read_numbers(run.readouts[index]))
    return float("nan") if run.warnings else measure("max", np.array(run.times), values)


def build_outcome(scene: LabScene, claims: Sequence[Mapping[str, Any] | str]) -> ByOutcome:
    """Returns a `verify` with a claim for each option."""
    return ByOutcome.model_validate({"by": "outcome", "claims": list(claims), "seconds": scene.seconds})


def cut(number: float) -> float:
    """Returns a number with six digits, which an author can read."""
    return float(f"{number:.6g}")


def write(number: float) -> str:
    """Returns a number as the language writes it."""
    return f"{number:.9g}"
