"""Names the mistake behind a policy that fails: from what its layers did, from which episodes fail, and from what the
same weights achieve under another convention. No sentence has a number of an episode."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from grader.exercises.episodes.goals import measure_saturation, switches_ends
from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import Record
from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.policy.bench import Bench
from grader.exercises.kinds.policy.judge import RefusedFile, SimulatedPolicy
from grader.exercises.kinds.policy.network import Network
from grader.exercises.kinds.policy.parameters import PolicyParameters
from grader.exercises.kinds.policy.variants import Variant, list_variants

Judged = JudgedTrial[Problem, Any]

SATURATED = 0.8
"""The share of time at the actuators' limits that counts as nearly always."""

FULL_FROM = 1 - 1e-6
"""The size from which on a tanh counts as at its end."""

CONSTANT = "The controls never change, whatever the policy observes: was an untrained or a masked network saved?"
DEAD = (
    "Every unit of hidden layer {layer} is 0 whatever the policy observes (dead units), so that the controls never "
    "change. Train with a smaller learning rate, or check that biases and weights belong together."
)
FULL = (
    "Every unit of hidden layer {layer} stays at the end of its range, so that the policy hears next to nothing of "
    "what it observes: normalise the observations as in training, or check their units."
)
OVERFLOWS = "The outputs of the network overflow: its weights are far too large."
IGNORES = "The policy does not use {names}: the rows of W1 are 0 there, as if the training had left them out."
SATURATES = (
    "Nearly always the controls are beyond what the actuators give: it switches from one end to the other. Scale the "
    "outputs to the actuators' ranges."
)
ONE_END = (
    "Nearly always the controls are at one end of what the actuators give: look for a wrong sign, or for outputs that "
    "are not scaled to the actuators' ranges."
)
TUNED = (
    "The policy works in the episodes that you see, not in the hidden ones, whose starts and models are drawn: it was "
    "trained on too few. Train on starts and models drawn from the ranges of the exercise."
)


def name_the_mistake(parameters: PolicyParameters, judged: Sequence[Judged]) -> str | None:
    """Returns the sentence of the first mistake that explains the failed cases."""
    wrong = [trial for trial in judged if not trial.counts]
    refused = next((trial for trial in wrong if isinstance(trial.judgement.outcome, RefusedFile)), None)
    if refused is not None:
        return refused.judgement.message
    failed = [(trial, outcome) for trial in wrong if isinstance(outcome := trial.judgement.outcome, SimulatedPolicy)]
    if not failed or len(failed) < len(wrong):
        return None
    records = [(outcome.network, record) for _, outcome in failed for record in outcome.list_failed()]
    if not all(np.isfinite(record.asked).all() for _, record in records):
        return OVERFLOWS
    if (variant := find_variant(parameters, judged)) is not None:
        return variant.sentence
    found = {explain_layers(network, record) for network, record in records}
    if len(found) == 1 and (sentence := found.pop()) is not None:
        return sentence
    visible = [trial for trial in judged if not trial.hidden]
    is_tuned = bool(visible) and all(trial.counts for trial in visible)
    return TUNED if is_tuned else explain_motion(*failed[0])


def explain_motion(judged: Judged, outcome: SimulatedPolicy) -> str | None:
    """Returns what is left to say of a policy that no variant mends: what it ignores, or that it always does its
    utmost."""
    ignored = np.flatnonzero(~outcome.network.layers[0][0].any(axis=1))
    if len(ignored):
        return IGNORES.format(names=" and ".join(judged.trial.inputs["observed"][i] for i in ignored))
    failed = outcome.list_failed()
    if not failed or np.mean([measure_saturation(judged.problem, record) for record in failed]) <= SATURATED:
        return None
    return SATURATES if any(switches_ends(judged.problem, record) for record in failed) else ONE_END


def explain_layers(network: Network, record: Record) -> str | None:
    """Returns what is wrong with a policy whose layers do not respond to what was observed in an episode. Weights that
    another convention would read otherwise, such as transposed ones, do so in some episodes too: it must hold in
    all."""
    rows = len(record.time_s)
    *hidden, _ = network.list_activations(record.observed)
    for layer, values in enumerate(hidden, 1):
        if rows > 1 and network.activation == "relu" and not values.any():
            return DEAD.format(layer=layer)
        if rows > 1 and network.activation == "tanh" and (np.abs(values) > FULL_FROM).all():
            return FULL.format(layer=layer)
    return CONSTANT if rows > 1 and np.ptp(record.asked, axis=0).max() == 0 else None


def find_variant(parameters: PolicyParameters, judged: Sequence[Judged]) -> Variant | None:
    """Returns the first variant that works in every case."""
    first, bench = judged[0], Bench(parameters, judged)
    variants = list_variants(parameters, first.problem, first.judgement.outcome.network)
    return next((variant for variant in variants if bench.works(variant)), None)
