"""What sentences on a step claim of the script and its trace, and when it is true; where in the script they point."""

import ast
import re

from grader.exercises.explaining.claims import Evidence, SentenceClaim, build_claims, of_script
from grader.exercises.explaining.places import Landmark, build_landmarks, call_of, find_named_field, write_of
from grader.exercises.explaining.script import ParsedScript, is_field, writes_field

SPELLED = {"once": 1, "one": 1, "both": 2, "two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "seven": 7, "eight": 8}
"""Numbers of calls as sentences spell them."""

COUNT = rf"({'|'.join(SPELLED)}|\d+)"


def count_calls(evidence: Evidence, match: "re.Match[str]") -> bool:
    """Whether some step in the traces calls mj_forward as often as is said."""
    word = match[1].lower()
    counts = {note.numbers[0] for trace in evidence.traces for note in trace.list_notes("step") if len(note.numbers)}
    return not counts or (SPELLED[word] if word in SPELLED else int(word)) in counts


VIEWS = of_script(lambda script: script.has_view("qpos", "qvel", "qacc", "act_dot"))


def adds_to_time(script: ParsedScript) -> bool:
    """Whether a script gives data.time a value that it computes from data.time, as `data.time += h` does."""
    return any(
        (isinstance(node, ast.AugAssign) and is_field(node.target, "time"))
        or (isinstance(node, ast.Assign) and writes_field(node, "time")
        and any(isinstance(part, ast.Attribute) and part.attr == "time" for part in ast.walk(node.value)))
        for node in script.nodes
    )  # fmt: skip


CLAIMS: tuple[SentenceClaim, ...] = build_claims([
    (rf"(?:mj_forward is called|[Yy]ou call mj_forward) {COUNT}\b", count_calls),
    (rf"(?:All )?\b(?i:{COUNT}) calls of mj_forward find", count_calls),
    (r"v aliases data\.qvel, so copy it \(data\.qvel\.copy\(\)\)", of_script(lambda script: script.has_alias("qvel")),
     "keep the velocity at the start of the step, and add to that in every stage and at the end"),
    (r"q and v alias data\.qpos and data\.qvel, so copy them at the start of the step \(data\.qpos\.copy\(\)\);",
     of_script(lambda script: script.has_alias("qpos") or script.has_alias("qvel")),
     "keep copies of both from the start of the step, and add to these;"),
    (r"data\.act_dot is a view that the next mj_forward overwrites, so copy it", VIEWS,
     "keep the four, each as it was at its stage, and use their weighted mean"),
    (r"(All slopes equal the last one): data\.qvel and data\.qacc are views .*?, so copy them", VIEWS,
     r"\1: keep the four, each as it was at its stage, and use their weighted mean"),
    (r": without \.copy\(\), what you keep of .*? so copy each of them", VIEWS,
     ": keep the start of the step, and each slope as it was at its stage"),
    (r": q, v and the slopes are views, which data goes on changing, so copy each of them \(.*?\)", VIEWS,
     ": keep the start of the step, and each slope as it was at its stage"),
    (r"(your variable )?aliases data\.act, so copy it \(data\.act\.copy\(\)\)",
     of_script(lambda script: script.has_alias("act")),
     "keep those at the start of the step, and add to these in every stage and at the end"),
    (r": it adds up over the stages\. Keep t, and ", of_script(adds_to_time), ": "),
    (r"their two sums are one array, as after .*? Make an array for each",
     of_script(lambda script: script.has_shared_name),
     "positions change by the weighted mean of the velocities, velocities by that of the accelerations"),
    (r": go on with the loop over the joints after it \(no break or return in the loop\), and read",
     of_script(lambda script: script.has_loop), ": move all of them, and read"),
])  # fmt: skip


SCIPY = ("solve_ivp", "odeint", "ode", "RK45", "DOP853", "Radau", "LSODA", "quad")

LANDMARKS: tuple[Landmark, ...] = build_landmarks([
    (r"changes the model that it is given: (?:after the first call )?((?:model\.)[\w.]+)", find_named_field),
    (r"Your step calls mj_forwardSkip", call_of("mj_forwardSkip")),
    (r"Your step is taken by scipy", call_of(*SCIPY)),
    (r"32-bit floats", call_of("float32", "astype", "single")),
    (r"Your step rounds its result", call_of("round", "around")),
    (r"positions are clipped|cuts velocities off", call_of("clip", "minimum", "maximum", "min", "max")),
    (r"data\.ctrl differs in your calls", call_of("mj_resetData", "MjData")),
    (r"whatever the timestep of the model is", write_of("time")),
])  # fmt: skip
