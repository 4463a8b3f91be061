"""Names the mistake behind wrong claims: the rule whose wrong values a learner's are, in every case that failed."""

from collections.abc import Iterator, Sequence

import numpy as np

from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.claims import driver
from grader.exercises.kinds.claims.judge import ClaimComparison, Outcome, capitalize
from grader.exercises.kinds.claims.parameters import Floats, Problem
from grader.exercises.kinds.claims.rules import RULES, Rule, has_other_start
from grader.exercises.kinds.claims.wrong_values import ENERGY, Scene

Judged = JudgedTrial[Problem, Outcome]

NEAR_SHARE = 0.05
"""How near a claim must be to a wrong value that is much smaller than the right one, as a share of the wrong value:
else, and in proportion, as near as a right claim to the right value."""

POINTS_MIN = 2
"""Points of a curve at which a wrong value must be known."""

FIGURES_ROUGH = 3
"""Significant figures up to which a number counts as rounded."""

STEPPING = frozenset({"mj_step", "mj_step1", "mj_step2", "rollout", "mj_Euler", "mj_RungeKutta", "mj_implicit"})
"""Functions that a script measures with."""

COMPUTING = frozenset({"enableflags", "mjENBL_ENERGY", "mj_energyPos", "mj_energyVel"})
"""Names of a script that lets MuJoCo compute energies."""

ZERO = "{label} is 0 in every case: what it is computed from never changes."
NO_ENERGY = (
    "{label} is 0 in every case: MuJoCo computes energies only where `model.opt.enableflags` has "
    "`mjtEnableBit.mjENBL_ENERGY`, or where you call mj_energyPos and mj_energyVel."
)
NEVER_SETTLES = (
    "{label} is the same in every case, as the end of a run is in which the motion never stays within the band: look "
    "at how far it is from where it comes to rest."
)
SAME_EVERYWHERE = "{label} is the same in every case: measure it on the model and from the start that you are given."
KEPT = (
    "{label} is right in the first case, and the same in all later ones: it is a number of that case, or what an "
    "earlier call has put into a list or a variable outside of the function. Measure it within the function, in every "
    "call."
)
SAME_FOR_ALL_X = "{label} is the same for every x: use x."
ROUNDED = "{label} is rounded too coarsely: return it as it was measured."


PRINTED = "Your function prints its result and returns None: return it instead."
NOTHING = "Your function returns None: end it with `return` and the values that are asked for."
NO_NAME = "The dictionary that your function returns has no `{name}`: its keys are spelt as the task gives them."
OTHER_COUNT = "Your function returns {got}, and {asked} are asked for: return a dictionary with their names."


def name_the_mistake(judged: Sequence[Judged]) -> str | None:
    """Returns the sentence for a function that returns something else than its claims, or of the first wrong claim that
    a rule explains in every case in which it is wrong."""
    if missing := explain_missing(judged):
        return missing
    failed = [
        (trial, comparison)
        for trial in judged
        for comparison in trial.judgement.outcome or ()
        if comparison.why and comparison.values is not None
    ]
    names = list(dict.fromkeys(comparison.claim.name for _, comparison in failed))
    for name in names:
        mine = [(trial.problem, comparison) for trial, comparison in failed if comparison.claim.name == name]
        template = explain_simply(judged, name) or explain_zero(judged, mine) or explain_by_rules(judged, mine)
        template = template or explain_sameness(judged, name)
        if template is not None:
            return template.replace("{label}", capitalize(mine[0][1].claim.label))
    return None


def explain_missing(judged: Sequence[Judged]) -> str | None:
    """Returns the sentence for a function that returns nothing, or not every claim."""
    for trial in judged:
        outcome, returned = trial.judgement.outcome or (), trial.trace.returned_values
        if not returned or all(comparison.values is not None for comparison in outcome):
            continue
        value = returned[0]
        if value.type == "NoneType":
            return PRINTED if trial.trace.printed_text is not None else NOTHING
        if value.type == "dict":
            absent = (comparison.claim.name for comparison in outcome if comparison.text.startswith(driver.ABSENT))
            return next((NO_NAME.format(name=name) for name in absent), None)
        count = value.shape[0] if value.shape else 1
        if count != len(outcome) > 1:
            return OTHER_COUNT.format(got="one value" if count == 1 else f"{count} values", asked=len(outcome))
    return None


def explain_simply(judged: Sequence[Judged], name: str) -> str | None:
    """Returns the sentence of a claim that is rounded, or the same for all x, or in every case of a script that steps
    nothing."""
    every = list_comparisons(judged, name)
    wrong = [comparison for comparison in every if comparison.why and comparison.values is not None]
    if all(map(is_rounded, wrong)):
        return ROUNDED
    if not judged[0].script.names & STEPPING and (same := explain_sameness(judged, name)):
        return same
    if wrong[0].claim.form == "curve" and all(np.ptp(comparison.values) == 0 for comparison in wrong):  # type: ignore[arg-type]
        return SAME_FOR_ALL_X if any(len(comparison.measured.values) > 1 for comparison in wrong) else None
    return None


def list_comparisons(judged: Sequence[Judged], name: str) -> list[ClaimComparison]:
    """Returns the comparisons of a claim, in every case."""
    return [
        comparison for trial in judged for comparison in trial.judgement.outcome or () if comparison.claim.name == name
    ]


def explain_sameness(judged: Sequence[Judged], name: str) -> str | None:
    """Returns the sentence of a claim that is the same in cases in which it should not be."""
    given = [comparison for comparison in list_comparisons(judged, name) if comparison.values is not None]
    first = given[0]
    if all(np.array_equal(other.values, first.values) for other in given) and not all(  # type: ignore[arg-type]
        np.allclose(other.measured.values, first.measured.values, rtol=1e-3) for other in given
    ):
        steps = bool(judged[0].script.names & STEPPING)
        if steps and not first.why:
            return KEPT
        return NEVER_SETTLES if first.claim.quantity == "settling" and steps else SAME_EVERYWHERE
    return None


def explain_zero(judged: Sequence[Judged], wrong: Sequence[tuple[Problem, ClaimComparison]]) -> str | None:
    """Returns the sentence of a claim that is 0 in every case."""
    every = list_comparisons(judged, wrong[0][1].claim.name)
    if any(comparison.values is None or comparison.values.any() for comparison in every):
        return None
    if ENERGY.search(every[0].claim.expr) and not judged[0].script.names & COMPUTING:
        return NO_ENERGY
    return explain_by_rules(judged, wrong, (has_other_start,)) or ZERO


def is_rounded(comparison: ClaimComparison) -> bool:
    """Whether every number of a claim is the measured one, rounded to a few significant figures."""
    assert comparison.values is not None
    if comparison.claim.form == "interval":
        return False
    return any(
        all(
            got == float(f"{right:.{figures}g}")
            for got, right in zip(comparison.values.tolist(), comparison.measured.values.tolist(), strict=True)
        )
        for figures in range(1, FIGURES_ROUGH + 1)
    )


def explain_by_rules(
    judged: Sequence[Judged], wrong: Sequence[tuple[Problem, ClaimComparison]], rules: Sequence[Rule] = RULES
) -> str | None:
    """Returns the sentence of the first rule that gives the claim in every case in which it is wrong."""
    scenes = [(build_scene(judged, problem, comparison), comparison) for problem, comparison in wrong]
    for rule in rules:
        (first, one), *others = scenes
        for sentence in list_matching(first, one, rule):
            if all(sentence in list_matching(scene, other, rule) for scene, other in others):
                return sentence
    return None


def build_scene(judged: Sequence[Judged], problem: Problem, comparison: ClaimComparison) -> Scene:
    """Returns the scene of a wrong claim."""
    outcome = next(trial.judgement.outcome for trial in judged if trial.problem is problem)
    names = judged[0].script.names
    rights = tuple(each.measured.values for each in outcome)
    return Scene(
        problem, comparison.claim, comparison.measured, rights, steps=bool(names & STEPPING),
        subtracts="ptp" in names or {"min", "max"} <= names,
    )  # fmt: skip


def list_matching(scene: Scene, comparison: ClaimComparison, rule: Rule) -> Iterator[str]:
    """Yields the sentences of a rule whose wrong values are the learner's."""
    for sentence, values in rule(scene):
        if values is not None and is_near(comparison, values):
            yield sentence


def is_near(comparison: ClaimComparison, wrong: Floats) -> bool:
    """Whether a claim is a wrong value, which is not right itself. An interval is one that holds it. Of a curve the
    points count at which the wrong value is known."""
    right, allowed = comparison.measured.values, comparison.allowed
    known = np.isfinite(wrong)
    if comparison.values is None or wrong.shape != right.shape or known.sum() < min(len(right), POINTS_MIN):
        return False
    if float(np.abs(wrong - right)[known].max()) <= allowed:
        return False
    if comparison.claim.form == "interval":
        low, high = comparison.values.tolist()
        return bool(low <= wrong[0] <= high and not low <= right[0] <= high)
    sizes = [float(np.abs(values[known]).max()) for values in (wrong, right)]
    scaled = sizes[0] / sizes[1] if sizes[1] > 0 else 1.0
    slack = max(allowed * scaled, min(allowed, NEAR_SHARE * sizes[0]))
    return bool(np.abs(comparison.values - wrong)[known].max() <= slack)
