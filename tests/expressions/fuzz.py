"""Random programs: grown from the grammar, or real ones with a piece damaged."""

import random
import re

LEAVES = [
    "0",
    "1",
    "2",
    "3",
    "-1",
    "0.5",
    "-0.25",
    "1e3",
    "1e-7",
    "1e21",
    "NaN",
    "Infinity",
    "true",
    "false",
    "null",
    "undefined",
    "''",
    "'a'",
    "'1'",
    "'",
    "2",
    "'",
    "'0x1f'",
    "[]",
    "[1]",
    "[1,2]",
    "value",
    "data.qpos[0]",
    "data.qpos[7]",
    "data.qvel[6]",
    "data.ctrl[0]",
    "data.time",
    "model.nv",
    "model.opt.timestep",
    "ctx.none",
    "Math.PI",
    "data.qpos.length",
    "'abc'.length",
    "lib.qpos('hinge')",
    "(-0)",
    "4294967295",
    "-2147483649",
    "0.1",
]
BINARY = [
    "+",
    "-",
    "*",
    "/",
    "%",
    "**",
    "==",
    "!=",
    "===",
    "!==",
    "<",
    "<=",
    ">",
    ">=",
    "&",
    "|",
    "^",
    "<<",
    ">>",
    ">>>",
    "&&",
    "||",
    "??",
]
UNARY = ["-", "+", "!", "~", "typeof "]
CALLS = [
    "Math.abs",
    "Math.floor",
    "Math.ceil",
    "Math.round",
    "Math.sign",
    "Math.sqrt",
    "Math.max",
    "Math.min",
    "Math.trunc",
    "Math.hypot",
    "Number",
    "String",
    "Boolean",
    "isNaN",
    "isFinite",
    "Number.isInteger",
    "lib.deg",
    "Array.isArray",
    "Array.of",
    "Math.fround",
    "Math.atan2",
]
METHODS = [".map(x => x + 1)", ".join('-')", ".slice(1)", ".length", ".reverse()", ".filter(x => x)", ".concat(1)"]


def expression(rng: random.Random, depth: int) -> str:
    """A random expression whose value does not depend on how sin and pow round."""
    if depth == 0 or rng.random() < 0.1:
        return rng.choice(LEAVES)
    inner = [expression(rng, depth - 1) for _ in range(3)]
    form = rng.randrange(9)
    if form < 4:
        return _pair(rng, inner[0], inner[1])
    return [
        f"({rng.choice(UNARY)}({inner[0]}))",
        f"({inner[0]} ? {inner[1]} : {inner[2]})",
        f"{rng.choice(CALLS)}({', '.join(inner[: rng.randrange(1, 3)])})",
        f"[{inner[0]}, {inner[1]}]{rng.choice(METHODS)}",
        f"`{rng.choice('abc')}${{{inner[0]}}}`",
    ][form - 4]


def _pair(rng: random.Random, left: str, right: str) -> str:
    operator = rng.choice(BINARY)
    if operator == "**":
        right = rng.choice(["2", "0", "-1", "3", "Infinity", "NaN"])
    if rng.random() < 0.3 and operator not in ("**", "??", "&&", "||"):
        return f"{left} {operator} {right}"
    return f"(({left}) {operator} ({right}))"


def statements(rng: random.Random) -> str:
    """A random list of statements over `ctx`, locals, the state and loops."""
    lines = [f"let a = {expression(rng, 2)}, n = 0"]
    for _ in range(rng.randrange(1, 5)):
        lines.append(
            rng.choice(
                [
                    f"a = {expression(rng, 3)}",
                    f"n += {rng.choice(['1', '2', 'i0', 'n'])}".replace("i0", "0.5"),
                    f"if ({expression(rng, 2)}) {{ n++ }} else {{ a = n }}",
                    f"for (let i = 0; i < 4; i++) {{ if (i == {rng.randrange(5)}) {_jump(rng)}; n += i }}",
                    f"ctx.{rng.choice('xyz')} {rng.choice(['=', '+=', '??=', '||=', '-='])} {expression(rng, 2)}",
                    f"data.qvel[{rng.randrange(7)}] {rng.choice(['=', '+='])} {rng.choice(['n', '0.5', 'value'])}",
                    f"const f{len(lines)} = (x, y) => {expression(rng, 2)}; n = f{len(lines)}(n, a)",
                    f"for (const x of [{expression(rng, 1)}, 2]) ctx.x = x",
                ]
            )
        )
    return "; ".join([*lines, "ctx.a = a; ctx.n = n"])


COUNTS = ["i", "j", "k", "n", "a", "i + 1", "2 * i", "3 * j + i", "k++", "--k", "i - 1", "i * j", "0.5", "-1", "7"]
FIELDS = ["data.qvel", "data.qpos", "model.dof_damping", "model.geom_rgba", "model.geom_group", "b", "ctx.b"]
CHAINS = ["ctx.b?.[1]", "ctx.none?.[i++]", "ctx.none?.length", "b?.map(x => x + k++)", "ctx.none?.map(x => x).length"]
ASSIGNMENTS = ["=", "+=", "-=", "*=", "/=", "%=", "||=", "&&=", "??=", "|="]


def loops(rng: random.Random) -> str:
    """A random list of statements that counts, indexes fields and arrays, and changes variables from functions."""
    head = "let i = 0, j = 1, k = 2, n = 0, a = 0.5, s = 0; const b = [1, 2.5, 'x', [3]]; ctx.b = [4, 5]; var w"
    tail = "ctx.all = [i, j, k, n, a, s, w, b.length]; ctx.b0 = b[0]; ctx.b1 = b[1]"
    return "; ".join([head, *(_step(rng, 3) for _ in range(rng.randrange(2, 6))), tail])


def _count(rng: random.Random) -> str:
    return rng.choice(COUNTS)


def _element(rng: random.Random) -> str:
    return f"{rng.choice(FIELDS)}[{_count(rng)}]"


def _amount(rng: random.Random) -> str:
    plain = [
        _element(rng),
        _count(rng),
        "s",
        "w",
        "value",
        rng.choice(CHAINS),
        f"Math.max({_element(rng)}, {_count(rng)})",
        "data.qvel.length",
    ]
    if rng.random() < 0.5:
        return rng.choice(plain)
    operator = rng.choice(["+", "-", "*", "/", "<", "===", "&&", "||", "??", "%"])
    pair = f"(({rng.choice(plain)}) {operator} ({rng.choice(plain)}))"
    return rng.choice([pair, f"({pair} ? {rng.choice(plain)} : {rng.choice(plain)})", f"-({pair})", f"!({pair})"])


COMPOUND = [
    "for (let NEW = 0; NEW < 4; NEW++) BODY",
    "for (let NEW = 0; NEW < model.nv; NEW += 2) { s += data.qvel[NEW]; data.qvel[NEW] += 1 }",
    "for (let NEW = 1; NEW < b.length; NEW++) { w = b[NEW]; b[NEW] = b[NEW - 1]; data.qpos[NEW + 2] *= b[0] }",
    "for (i = 0, k = 3; i < k; i++, k--) BODY",
    "for (const NEW of [1, a, 'y']) { w = NEW; STEP }",
    "do BODY while (j++ < 3)",
    "while (n++ < 3) BODY",
    "if (AMOUNT) { STEP } else { STEP }",
    "[1, 2].forEach((NEW, q) => { VARIABLE OPERATOR NEW; STEP })",
    "const NEW = (x, y) => { n += x; return AMOUNT }; s = NEW(AMOUNT, NEW(1))",
    "const NEW = [i, j, k].map((x, y) => { STEP; return x + AMOUNT }); w = NEW[0]",
]
SIMPLE = [
    "VARIABLE OPERATOR AMOUNT",
    "VARIABLE++",
    "--VARIABLE",
    "ELEMENT OPERATOR AMOUNT",
    "VARIABLE = (ELEMENT OPERATOR AMOUNT)",
    "VARIABLE = ELEMENT++",
    "VARIABLE = -- ELEMENT",
    "ctx.x OPERATOR (VARIABLE = AMOUNT)",
]


def _step(rng: random.Random, depth: int) -> str:
    """One statement; the words in capitals of a form are filled in from left to right."""
    new, form = (
        f"{rng.choice('pqr')}{rng.randrange(1000)}",
        rng.choice(COMPOUND if depth and rng.random() < 0.5 else SIMPLE),
    )
    fill = {
        "NEW": lambda: new,
        "BODY": lambda: _body(rng, depth),
        "STEP": lambda: _step(rng, depth - 1),
        "AMOUNT": lambda: _amount(rng),
        "ELEMENT": lambda: _element(rng),
        "VARIABLE": lambda: rng.choice("ijknasw"),
        "OPERATOR": lambda: rng.choice(ASSIGNMENTS),
    }
    return re.sub("|".join(fill), lambda word: fill[word.group()](), form)


def _body(rng: random.Random, depth: int) -> str:
    jump = f"if ({_amount(rng)}) {_jump(rng)}; " if rng.random() < 0.4 else ""
    return "{ " + _step(rng, depth - 1) + "; " + jump + _step(rng, depth - 1) + " }"


def _jump(rng: random.Random) -> str:
    return rng.choice(["break", "continue"])


def damage(rng: random.Random, text: str, others: list[str]) -> str:
    """The text with a piece taken out, doubled, swapped or put in from elsewhere."""
    i, j = sorted((rng.randrange(len(text) + 1), rng.randrange(len(text) + 1)))
    j = min(j, i + 4)
    match rng.randrange(4):
        case 0:
            return text[:i] + text[j:]
        case 1:
            return text[:j] + text[i:]
        case 2:
            return text[:i] + rng.choice("()[]{}.,;+-*/%=!<>&|?:'`\"\\ \n019aeix_$#@") + text[j:]
    other = rng.choice(others)
    k = rng.randrange(len(other) + 1)
    return text[:i] + other[k : k + 6] + text[j:]
