"""What compiled code is made of, and texts that try to reach Python through it."""

import ast
import keyword
import time

import mujoco
import pytest

from grader.errors import ContentError, LabError
from grader.expressions import UNDEFINED, Machine, Value, compile_program
from grader.expressions.compiling.code import ALLOWED, build_statements, finish_code
from grader.expressions.compiling.scope import RESERVED

MODEL = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body></worldbody></mujoco>'
)


def machine() -> Machine:
    return Machine(MODEL, mujoco.MjData(MODEL))


def outcome(text: str, m: Machine | None = None) -> Value:
    """What a statement list returns."""
    return compile_program(text, "statement", "x").run(m or machine())


def refusal(text: str) -> str:
    with pytest.raises((ContentError, LabError)) as caught:
        outcome(text)
    assert "line " in str(caught.value)
    return str(caught.value)


ESCAPES = [
    "__class__",
    "__proto__",
    "__globals__",
    "__builtins__",
    "__dict__",
    "__code__",
    "constructor",
    "prototype",
    "gi_frame",
    "f_globals",
]
PLACES = [
    "data.{0}",
    "data.qpos.{0}",
    "data.qpos.{0}.{0}.{0}",
    "model.opt.{0}",
    "lib.energy().{0}",
    "lib.{0}()",
    "mj.{0}(model, data)",
    "Math.{0}",
    "'x'.{0}",
    "[].{0}",
    "[1].map({0})",
    "(1).{0}",
    "{0}",
    "{0}()",
    "data?.{0}",
    "ctx.x?.{0}",
    "data.qpos['{0}']",
]


@pytest.mark.parametrize("word", ESCAPES)
@pytest.mark.parametrize("place", PLACES)
def test_no_attribute_of_python_or_javascript_is_reached(word: str, place: str) -> None:
    refusal("return " + place.format(word))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("ctx['__pro' + 'to__'] = 1", "no place named '__proto__'"),
        ("return ctx['construc' + 'tor']", "no place named 'constructor'"),
        ("ctx['a'.repeat(65)] = 1", "no place named"),
        ("for (let i = 0; i < 2000; i++) ctx[i] = i", "more than 1000 names"),
        ("return model['qpos0']", "square brackets"),
        ("return lib['energy']()", "only functions that have a name"),
        ("return {a: 1}", "as an argument only"),
        ("return lib.jacobianSV('x', {...data})", "write name: value"),
        ("return lib.jacobianSV('x', {['rows']: 1})", "write name: value"),
        ("return lib.jacobian('nowhere')", "no site or body named 'nowhere'; there are: world"),
        ("return lib.qpos('jj')", "no joint named 'jj': did you mean 'j'?"),
        ("return lib.qpos('hip')", "no joint named 'hip'; there are: j"),
        ("return lib.sensor('z'.repeat(9999))", "zz', and none with a name"),
        ("return (async () => 1)()", "plain parameters"),
        ("return (function* () { yield 1 })()", "line 1"),
        ("return (function f() { return f() })()", "f is not known"),
        ("return (() => { for (;;) {} })()", "too many steps"),
        ("return (() => this)()", "line 1"),
        ("sim.stop()", "not available"),
        ("return sim.time", "cannot be read"),
        ("return sim", "cannot be used as a value"),
    ],
)
def test_named_places_options_and_functions_called_at_once_have_their_bounds(text: str, why: str) -> None:
    assert why in refusal(text)


@pytest.mark.parametrize("word", ["__class__", "__proto__", "constructor", "prototype", "toString", "hasOwnProperty"])
def test_ctx_has_no_names_that_mean_something_else(word: str) -> None:
    refusal(f"ctx.{word} = 1")
    refusal(f"return ctx.{word}")


BUILTINS = [
    "print",
    "exec",
    "open",
    "type",
    "float",
    "len",
    "getattr",
    "globals",
    "make",
    "run",
    "machine",
    "budget",
    "t1",
]
PYTHON_WORDS = [word for word in [*keyword.kwlist, *keyword.softkwlist] if word.isidentifier()]


@pytest.mark.parametrize(
    "word", sorted({*BUILTINS, *PYTHON_WORDS, "number", "undefined0", "v0", "n0", "f1", "given", "nan"})
)
def test_names_of_python_are_unknown_and_can_be_declared(word: str) -> None:
    refusal(f"return {word}" if word != "return" else "return return")
    if word in RESERVED:
        refusal(f"let {word} = 1")
        return
    assert outcome(f"let {word} = 20; {word} += 2; const g = x => {word} + x; return g({word}) - 2") == 42.0
    assert outcome(f"ctx.{word} = 1; return ctx.{word} + [7].map({word} => {word} * 2)[0]") == 15.0


@pytest.mark.parametrize("text", ["ﬁ", "ª", "𝐱", "µ", "ſ", "Ⅳ", "é", "x\u200d", "ｖ0"])
def test_identifiers_that_python_would_normalise_are_refused(text: str) -> None:
    refusal(f"let {text} = 1; return {text}")
    refusal(f"return [1].map({text} => {text})")


def test_ctx_names_that_python_would_normalise_stay_apart() -> None:
    m, ligature, kelvin = machine(), "\ufb01", "\u212a"
    text = f"ctx.{ligature} = 1; ctx.fi = 2; ctx.{kelvin} = 3; ctx.K = 4"
    assert outcome(f"{text}; return [ctx.{ligature}, ctx.fi, ctx.{kelvin}, ctx.K]", m) == [1, 2, 3, 4]
    assert set(m.ctx) == {ligature, "fi", kelvin, "K"}


DEEP = [
    "return " + "(" * 5000 + "1" + ")" * 4000,
    "return " + "[" * 2000 + "]" * 2000,
    "return " + "!" * 9000 + "1",
    "return data" + ".qpos" * 2000,
    "return ctx.a" + "?.length" * 1200,
    "return ctx.a" + ".map(x => x)" * 800,
    "return " + "x => " * 1900 + "1",
    "return " + "1 ? " * 2000 + "1" + " : 1" * 1400,
    "ctx.a = " * 1200 + "1",
    "{" * 4000 + "}" * 4000,
    "for (;;) " * 1100,
    "if (1) " * 1400 + ";",
    "`${" * 3000 + "1" + "}`" * 1400,
]


@pytest.mark.parametrize("text", DEEP, ids=range(len(DEEP)))
def test_deep_nesting_is_refused_with_its_place(text: str) -> None:
    began = time.process_time()
    refusal(text[:10_000])
    assert time.process_time() - began < 3


@pytest.mark.parametrize("depth", [10, 14, 15, 16, 19])
def test_nested_loops_run_or_are_refused(depth: int) -> None:
    text = "".join(f"for (let i{k} = 0; i{k} < 1; i{k}++) {{" for k in range(depth)) + "ctx.n = 7" + "}" * depth
    try:
        assert outcome(f"{text}; return ctx.n") == 7.0
        assert depth <= 15
    except ContentError as error:
        assert "deep" in str(error)
        assert depth > 15


def test_huge_literals_are_numbers_and_texts_are_bounded() -> None:
    assert outcome(f"return {'9' * 400}") == float("inf")
    assert outcome(f"return 0x{'f' * 4000}") == float("inf")
    assert outcome(f"return '{'x' * 9000}'.length") == 9000.0
    refusal(f"return '{'x' * 10_001}'")
    refusal(f"return '{'x' * 9000}' + '{'x' * 900}'.repeat(9)")
    assert outcome("return [" + "0," * 4900 + "0].length") == 4901.0


@pytest.mark.slow
def test_long_flat_texts_compile_in_time() -> None:
    for text in (
        "ctx.a = 1;" * 1000,
        "let a = 0;" + "a++;" * 2000,
        "[].map(i => i);" * 600,
        "1;" * 5000,
        "Math.abs(1);" * 800,
    ):
        began = time.process_time()
        compile_program(text[:10_000].rsplit(";", 1)[0], "statement", "x")
        assert time.process_time() - began < 8


LOOPS = [
    "while (true) { }",
    "while (true) ctx.x = 1",
    "while (true) { if (ctx.x) return 1; continue }",
    "for (;;) { if (false) break; continue }",
    "for (let i = 0; true; i++) { if (i > 5) continue }",
    "do { } while (1)",
    "let n = 0; while (n < 1) { n -= data.qpos[0] * 0 }",
    "const a = [1]; for (const x of a) a.push(x)",
    "const a = [1, 2]; const f = x => a.map(y => a.map(z => 1)); while (1) f(1)",
    "for (let i = 0; i < 1e9; i++) for (let j = 0; j < 1e9; j++) ;",
    "let i = 0; while (i >= 0) i += 1000",
]


@pytest.mark.parametrize("text", LOOPS)
def test_every_loop_ends_by_the_budget(text: str) -> None:
    began = time.process_time()
    assert "does a loop never end?" in refusal(text)
    assert time.process_time() - began < 3


def test_the_budget_of_a_run_is_shared_by_its_evaluations() -> None:
    m, text = machine(), "for (let i = 0; i < 60000; i++) ;"
    loop, straight = compile_program(text, "statement", "x").bind(m), compile_program("Math.abs(1)", "expression", "x")
    for _ in range(50):
        loop()
    with pytest.raises(LabError, match="never end"):
        loop()
    with pytest.raises(LabError, match="never end"):
        straight.run(m)
    assert straight.run(machine()) == 1.0


def test_one_evaluation_has_a_hundred_thousand_ticks() -> None:
    assert outcome("let n = 0; for (; n < 100000; ) n++; return n") == 100_000.0
    refusal("let n = 0; for (; n < 100001; ) n++; return n")
    assert outcome("let n = 0; const f = () => { n++ }; while (n < 50000) f(); return n") == 50_000.0
    refusal("let n = 0; const f = () => { n++ }; while (n < 50001) f(); return n")


@pytest.mark.parametrize("text", ["machine.data", "lambda: 1", "import os", "[x for x in y]", "f'{x}'", "global x"])
def test_compiled_code_has_no_node_but_the_allowed_ones(text: str) -> None:
    with pytest.raises(AssertionError):
        finish_code(ast.parse(text))
    assert not {ast.Attribute, ast.Import, ast.ImportFrom, ast.Lambda, ast.Await, ast.Yield, ast.Global} & set(ALLOWED)


@pytest.mark.parametrize("identifier", ["open", "__import__", "x", "v", "v0_", "\uff560", "machine1"])
def test_compiled_code_has_no_name_but_our_own(identifier: str) -> None:
    with pytest.raises(AssertionError):
        finish_code(build_statements("return NAME", NAME=identifier)[0])


def test_compiled_code_has_no_builtins() -> None:
    space = compile_program("1", "expression", "x").make.__globals__
    assert space["__builtins__"] == {}
    assert "open" not in space


def test_a_text_is_bound_to_the_model_that_it_runs_on() -> None:
    program = compile_program("return [data.qpos[0], data.qpos[3] ?? 'none', data.qpos[3] + 1]", "statement", "x")
    big = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
    )
    small, large = machine(), Machine(big, mujoco.MjData(big))
    for _ in range(2):
        assert program.run(large) == [0.0, 1.0, 2.0]
        result = program.run(small)
        assert isinstance(result, list)
        assert result[:2] == [0.0, "none"]
        assert result[2] != result[2]
    assert "index 3 is outside data.qpos" in refusal("data.qpos[3] = 1")
    assert "index 0.5 is outside data.qpos" in refusal("data.qpos[0.5] = 1")


def test_a_text_that_cannot_be_read_at_all_is_refused_at_its_beginning() -> None:
    with pytest.raises(ContentError, match="line 1, column 1: this is no valid JavaScript"):
        compile_program("1 + (')", "expression", "x")


@pytest.mark.parametrize("number", ["Infinity", "-Infinity", "NaN", "1e300", "undefined"])
def test_any_number_can_be_looked_up(number: str) -> None:
    assert outcome(f"return mj.mj_name2id(model, {number}, 'none')") == -1.0
    assert outcome(f"return mj.mj_id2name(model, {number}, {number})") in ("", "world")


def test_undefined_is_one_value() -> None:
    assert outcome("return undefined") is UNDEFINED
    assert outcome("let x; return x") is UNDEFINED
    assert outcome("") is UNDEFINED
