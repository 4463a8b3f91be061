"""Tells a certificate in sentences: what was simulated, what came out, and how far that is from the key."""

from collections.abc import Mapping
from typing import Any

from grader.certify import Certificate
from grader.certify.remarks import Luck
from grader.domain.pages.markup import plain_text
from grader.questions import AnswerKey, NumberKey
from grader.web.text.numbers import NARROW, keep_unbroken, write_number, write_quantity

DIGITS = 6
"""Significant figures of what was derived."""

NUMBERS = {
    "times": "it is so {} times",
    "first": "it is so first at {}\u202fs",
    "max": "its largest value is {}",
    "min": "its smallest value is {}",
}
"""What the number of a claim is, by its `when`."""

PLACES = {"h/2": "a half of it", "h/4": "a quarter of it"}

ALL_INTEGRATORS = "all integrators"
CURE = "Draw more numbers, from wider ranges; or raise luck in the question's file, and say why in x-luck."


def word_key(key: AnswerKey, certificate: Certificate) -> list[tuple[str, list[str]]]:
    """Returns the sentences of a certificate under their headings; none where nothing was measured."""
    if not certificate.measured:
        return []
    method = {
        "stage": describe_stages, "threshold": describe_threshold, "measurement": describe_measurement,
        "expression": describe_expression, "options": describe_options, "outcome": describe_outcome,
    }[certificate.method]  # fmt: skip
    simulated, words = method(certificate.measured, find_unit(key))
    headed = [("Simulated", [simulated]), ("Came out", words), ("The key", [describe_key(key, certificate)])]
    if "shortest timestep [s]" in certificate.regime:
        headed.insert(1, ("Checked", [describe_regime(certificate.regime)]))
    return [(heading, [keep_unbroken(line) for line in lines]) for heading, lines in headed]


def describe_regime(regime: Mapping[str, Any]) -> str:
    """Says how short the timesteps were, compared with the motion."""
    shortest, own = (
        write_quantity(1000 * regime[name], "ms", 3) for name in ("shortest timestep [s]", "own timestep [s]")
    )
    fastest = f"The fastest motion has a rate of {write_quantity(regime['fastest rate [1/s]'], '1/s', 3)}"
    return f"{fastest}. The timesteps went from {own} to {shortest}: what is faster stays unseen."


def find_unit(key: AnswerKey) -> str:
    """Returns the unit of a number that is asked for; empty where none is."""
    return (key.unit or "") if isinstance(key, NumberKey) else ""


def format_amount(value: float | None, unit: str) -> str:
    """Returns a number with its unit, if it has one."""
    return write_quantity(value, unit, DIGITS) if unit else write_number(value, DIGITS)


def describe_key(key: AnswerKey, certificate: Certificate) -> str:
    """Says what the key says, and how far the simulation is from it."""
    if not isinstance(key, NumberKey):
        finds = {"certified": "finds the same", "refuted": "finds another answer", "cannot tell": "cannot tell"}
        right = plain_text(key.options[int(certificate.expected)])
        return f"“{right}”: the simulation {finds[certificate.verdict]}."
    unit, tolerance = find_unit(key), certificate.tolerance
    if certificate.answer is None or tolerance is None:
        return f"{format_amount(certificate.expected, unit)}."
    off = abs(certificate.answer - certificate.expected)
    share = f", {100 * off / tolerance:.0f}{NARROW}% of the tolerance" if tolerance else ""
    return (
        f"{format_amount(certificate.expected, unit)}, with a tolerance of {format_amount(tolerance, unit)}. "
        f"What came out is {write_quantity(off, unit, 2) if unit else write_number(off, 2)} away{share}."
    )


def describe_stages(measured: Mapping[str, Any], _: str) -> tuple[str, list[str]]:
    """Returns the call of mj_step that fills a field."""
    first = measured["filled by"]
    before, _, after = measured["calls"].get(first, "").partition(", then ")
    outcome = (
        f"{first} changes it first: from {before} to {after}.".replace(" 1 contacts", " 1 contact")
        if first
        else "No call changes it."
    )
    return f"The calls of mj_step one by one, with {measured['field']} read before and after each.", [outcome]


def describe_threshold(measured: Mapping[str, Any], unit: str) -> tuple[str, list[str]]:
    """Returns the bracket of a largest stable timestep."""
    stable, unstable = format_amount(measured["stable at"], unit), format_amount(measured["unstable at"], unit)
    simulated = f"{measured['integrator']} at ever closer timesteps, until {measured['compared with']} lay between two."
    return simulated, [f"Stable at {stable}, unstable at {unstable}."]


def describe_measurement(measured: Mapping[str, Any], unit: str) -> tuple[str, list[str]]:
    """Returns a measured value at finer timesteps, and from nudged starts."""
    readings = [
        f"{format_amount(value, unit)} at {'the timestep' if h == 'h/1' else PLACES.get(h) or f'1/{h[2:]} of it'}"
        for h, value in measured.items()
        if h.startswith("h/")
    ]
    nudged = " and ".join(format_amount(value, unit) for value in measured["nudged"])
    simulated = "The run at its timestep, at finer ones, and from starts that are shifted by less than can be seen."
    return simulated, [f"{', '.join(readings)}.", f"From the shifted starts {nudged}."]


def describe_expression(measured: Mapping[str, Any], unit: str) -> tuple[str, list[str]]:
    """Returns the value of a closed form."""
    return "Nothing: a closed form was evaluated.", [f"{format_amount(measured['value'], unit)}."]


def describe_options(measured: Mapping[str, Any], _: str) -> tuple[str, list[str]]:
    """Says what happened under each option's setting."""
    each = {plain_text(name): run for name, run in measured.items() if name != ALL_INTEGRATORS}
    lengths = {run["seconds"] for run in each.values() if "seconds" in run}
    length = f", {write_quantity(max(lengths), 's')} each" if lengths else ""
    lines = [f"{name}: {describe_run(run)}." for name, run in each.items()]
    if ALL_INTEGRATORS in measured:
        lines += [
            f"{name}, which is no option: {'stable' if run['stable'] else 'unstable'}{describe_limit(run['limit_ms'])}."
            for name, run in measured[ALL_INTEGRATORS].items()
            if not run["is_option"]
        ]
    return f"The lab under the setting of each option{length}.", lines


def describe_run(run: Mapping[str, Any]) -> str:
    """Says how one run ended."""
    if "warning" in run:
        return f"MuJoCo warned of {run['warning']} at {write_quantity(run['time'], 's')}"
    if "stable" in run:
        return "stable to the end" if run["stable"] else run.get("growth", "unstable")
    return describe_truth(run["holds"], {name: value for name, value in run.items() if name != "holds"})


def describe_limit(limit_ms: float | None) -> str:
    """Returns the limit of an integrator, if there is one."""
    return "" if limit_ms is None else f"; its limit is {write_quantity(limit_ms, 'ms')}"


def describe_outcome(measured: Mapping[str, Any], _: str) -> tuple[str, list[str]]:
    """Says which options' claims were true."""
    lines = []
    for option, outcome in measured.items():
        more = {name: value for name, value in outcome.items() if name != "true"} if isinstance(outcome, dict) else {}
        lines.append(f"{plain_text(option)}: {describe_truth(outcome['true'] if more else outcome, more)}.")
    return "The lab once, then at finer timesteps and from shifted starts.", lines


def describe_truth(holds: Any, more: Mapping[str, Any]) -> str:
    """Says whether a claim is true, and the number that decided."""
    numbers = ", ".join(
        f"the last value is {value}" if name == "final" else NUMBERS[name].format(write_number(value, DIGITS))
        for name, value in more.items()
    )
    return f"{'true' if holds else 'not true'}{f' ({numbers})' if numbers else ''}"


def describe_luck(luck: Luck) -> tuple[str, tuple[str, ...]]:
    """Returns the chance that a fixed answer passes an exercise, and what to do where it is too large."""
    passes = f"passes with a chance of at most {format_chance(luck.chance)}" if luck.chance < 1 else "passes every time"
    always = "A script that returns the same answer whatever it is asked"
    return f"{always} {passes}; at most {format_chance(luck.allowed)} is allowed.", () if luck.why is None else (CURE,)


def format_chance(chance: float) -> str:
    """Returns a chance in per cent, or as one in so many, rounded down to two figures."""
    if chance >= 0.01 or chance == 0:
        return f"{100 * chance:.0f}{NARROW}%"
    if chance <= 1e-9:
        return write_number(chance, 2)
    odds = round(1 / chance)
    last = 10 ** (len(str(odds)) - 2)
    return f"one in {odds // last * last:,}".replace(",", NARROW)
