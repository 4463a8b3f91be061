"""What sentences on a search claim of the script and its trace, and when it is true; where in the script they point."""

import ast
import re

import mujoco

from grader.exercises.explaining.claims import Evidence, SentenceClaim, build_claims, of_script, uses
from grader.exercises.explaining.places import (
    Landmark,
    build_landmarks,
    call_of,
    find_free_update,
    find_middle,
    find_result,
    find_test,
    write_of,
)
from grader.exercises.explaining.script import LOOPS, ParsedScript, read_name, walk_within
from grader.exercises.kinds.threshold.run_mistakes import FIELD_NAMES, SHORT_SHARE
from grader.exercises.kinds.threshold.search_trace import SearchTrace, read_search

WARNINGS = frozenset({"mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC", "mjWARN_BADCTRL"})
OTHER_WARNINGS = frozenset(name for name in dir(mujoco.mjtWarning) if name.startswith("mjWARN_")) - WARNINGS

HAND_RESETS = ("time", "qvel")
"""Fields of data that a script writes which begins a run again without mj_resetData."""


def read_failed(evidence: Evidence) -> list[SearchTrace]:
    """Returns the searches of the failed trials that can be read."""
    return [search for trace in evidence.failed if (search := read_search(trace)) is not None]


def steps_nowhere(evidence: Evidence, _: object) -> bool:
    """Whether some failed trial made no step."""
    searches = read_failed(evidence)
    return not searches or any(not search.total and not search.other_functions for search in searches)


def may_differ(evidence: Evidence, _: object) -> bool:
    """Whether the model of some run is not the given one, or the runs are not all known."""
    searches = read_failed(evidence)
    return any(
        search.other_functions or not search.runs or any(search.differing_fields) for search in searches
    ) or not searches  # fmt: skip


def has_short_run(evidence: Evidence, match: object) -> bool:
    """Whether some run without a warning is shorter than the longest."""
    runs = [run for search in read_failed(evidence) for run in search.runs if not run.warnings]
    horizon_s = float(match["horizon"])  # type: ignore[index]
    return not runs or any(run.duration_s < SHORT_SHARE * horizon_s for run in runs)


def begins_again(script: ParsedScript) -> bool:
    """Whether a script writes what mj_resetData would put back."""
    return any(script.find_write(field) for field in HAND_RESETS) or "mj_setState" in script.names


CLAIMS: tuple[SentenceClaim, ...] = build_claims([
    (r"without a single step", steps_nowhere),
    (r"^Nothing was simulated", steps_nowhere),
    (r"^Nothing was simulated: your answer comes from a formula or was written down",
     of_script(lambda script: not script.has_loop),
     "MuJoCo made no step: your answer comes from a formula, from a simulation of your own, or was written down"),
    (r"[Rr]uns are too short\b.*\b(?P<horizon>[\d.]+) s\b", has_short_run),
    (r": a return that stands inside the loop .*? ends it\. (Step until .*? s), and return after the loop",
     of_script(lambda script: script.returns_in_loops), r". \1"),
    (r"You linearise a step with mjd_transitionFD", uses("mjd_transitionFD")),
    (r"runs are those of mujoco\.rollout", uses("rollout")),
    (r"You set the solver", uses("solver", "PGS", "mjSOL_PGS")),
    (r"You switched the automatic reset off", uses("disableflags", "mjDSBL_AUTORESET", "AUTORESET")),
    (r"third bias parameter|joint's damping in place|You took the gains|the model of the file", may_differ),
    (r": the model that you step is not one whose timestep you set\. Set opt\.timestep on the very model .*? mj_step",
     of_script(lambda script: script.find_write("timestep")),
     ", that of the model itself, and nothing in your script sets model.opt.timestep. Set it before each run"),
    (r"never reset it, so that each run goes on where the last one ended",
     of_script(lambda script: not begins_again(script)),
     "never call mujoco.mj_resetData, so that what you do not set yourself stays as the last run left it"),
    (r"never reset it\.", of_script(lambda script: not begins_again(script)), "never call mujoco.mj_resetData."),
])  # fmt: skip


def find_return_in_loop(script: ParsedScript, _: object) -> int | None:
    """Returns the line of the first `return` that stands inside a loop."""
    return next(iter(script.returns_in_loops), None)


def find_changed_field(script: ParsedScript, match: "re.Match[str]") -> int | None:
    """Returns the line that writes one of the fields that a sentence names in words."""
    names = [field for field, words in FIELD_NAMES.items() if words in match[0]]
    return next((line for field in names if (line := script.find_write(field))), None)


def find_run(script: ParsedScript, _: object) -> int | None:
    """Returns the line of the innermost loop that steps."""
    return script.find_loop(lambda node: isinstance(node, ast.Call) and read_name(node.func) == "mj_step")


def find_search(script: ParsedScript, _: object) -> int | None:
    """Returns the line of the innermost loop that computes a middle."""
    lines = {*script.find_middles().values()}
    return script.find_loop(lambda node: isinstance(node, ast.Assign) and node.lineno in lines)


def list_run_nodes(script: ParsedScript) -> list[ast.AST]:
    """Returns what stands in the innermost function that steps; nothing where none does."""
    functions = [node for node in script.nodes if isinstance(node, ast.FunctionDef)]
    for function in reversed(functions):
        within = list(walk_within(function))
        if any(isinstance(node, ast.Call) and read_name(node.func) == "mj_step" for node in within):
            return within
    return []


def find_run_result(script: ParsedScript, _: object) -> int | None:
    """Returns the line of the last `return` of the innermost function that steps."""
    return max((node.lineno for node in list_run_nodes(script) if isinstance(node, ast.Return)), default=None)


def read_word(node: ast.AST) -> str:
    """Returns the name, attribute or text that a node is; empty for any other."""
    return str(getattr(node, "attr", getattr(node, "id", getattr(node, "value", ""))))


def find_own_test(script: ParsedScript, _: object) -> int | None:
    """Returns the line of the one condition without a warning by which a run ends early, or which it returns; None
    where there is none, or several."""
    within = list_run_nodes(script)
    loops = [node for node in within if isinstance(node, LOOPS)]
    branches = [node for loop in loops for node in walk_within(loop) if isinstance(node, ast.If)]
    ending = [
        node for node in branches if any(isinstance(statement, ast.Return | ast.Break) for statement in node.body)
    ]
    returned = [node.value for node in within if isinstance(node, ast.Return) and isinstance(node.value, ast.Compare)]
    tests = [node.test for node in ending] or returned
    lines = {test.lineno for test in tests if not any("warning" in read_word(node) for node in ast.walk(test))}
    return lines.pop() if len(lines) == 1 else None


def find_none_return(script: ParsedScript, _: object) -> int | None:
    """Returns the line of the one condition on which a function returns None; None where there is none, or several."""
    lines = {
        node.test.lineno
        for node in script.nodes
        if isinstance(node, ast.If)
        and any(isinstance(each, ast.Return) and getattr(each.value, "value", each.value) is None for each in node.body)
    }
    return lines.pop() if len(lines) == 1 else None


LANDMARKS: tuple[Landmark, ...] = build_landmarks([
    (r"moves its (?:lower|upper) end to the middle after", find_free_update),
    (r"goes on upwards|Your test is the wrong way round", find_test),
    (r"on which it returns None", find_none_return),
    (r"never moves its (?:lower|upper) end|Your search tries the same timestep again", find_test),
    (r"^Your middle is", find_middle),
    (r"(?:only run|Every run) used a timestep|use timesteps far beyond", write_of("timestep")),
    (r"where another integrator was asked for", write_of("integrator")),
    (r"Your runs start with .* at 0, where nothing moves", write_of("qpos")),
    (r"Your runs start with .* at 0, where nothing moves", call_of("MjData", "mj_resetData")),
    (r"Your runs start with|first run starts as it should|starts with nan", write_of("qpos", "qvel")),
    (r"Your runs set data\.ctrl", write_of("ctrl")),
    (r"Your script resets the data after the run|You reset the data before every step",
     call_of("mj_resetData", "mj_resetDataKeyframe", "MjData")),
    (r"a `?return`? that stands inside the loop", find_return_in_loop),
    (r"[Rr]uns are too short|runs ends after its first step", find_run),
    (r"go on halving|no timestep between them was tried", find_search),
    (r"your answer calls that timestep stable", find_run_result),
    (r"you call it unstable", find_own_test),
    (r"[Yy]our function prints", call_of("print")),
    (r"The model that you step is not the one you were given: .*?\.", find_changed_field),
    (r"actuators of your model are switched off|automatic reset off", write_of("disableflags")),
    (r"mjd_transitionFD", call_of("mjd_transitionFD")),
    (r"runs are those of mujoco\.rollout", call_of("rollout")),
    (r"Your answer is rounded", call_of("round", "around")),
    (r"You set the solver", write_of("solver")),
    (r"you return|[Yy]our function returns|You report(?:ed)? |ends of your brackets", find_result),
    (r"thousand times one of your timesteps|Your (?:answer|second number)", find_result),
])  # fmt: skip


def describe_test(script: ParsedScript) -> str:
    """Returns what a script looks for in place of a warning, as its text shows, in a sentence with a space behind it;
    empty if it shows nothing."""
    names, counted = script.names, script.find_bound("number")
    has_clause = any(isinstance(node, ast.ExceptHandler) for node in script.nodes)
    tests = (
        ("lastinfo" in names and "number" not in names,
         "You read lastinfo, which says where MuJoCo warned (0 for the first coordinate), not how often. "),
        (counted is not None and counted >= 1,
         "You ask for more than one warning, but after the first one the state is at rest: a single one counts. "),
        (bool(names & OTHER_WARNINGS) and not names & WARNINGS, "You look at a warning of another kind. "),
        ("warning" in names, ""),
        (bool(names & {"isnan", "isfinite", "isinf"}),
         "You look for nan or inf, but after the reset all numbers are finite again. "),
        (has_clause, "You wait for an exception, but MuJoCo raises none. "),
    )  # fmt: skip
    return next((sentence for is_so, sentence in tests if is_so), "")
