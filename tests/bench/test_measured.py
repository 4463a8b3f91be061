"""No figure on a page is typed by hand: tables are renderings of the committed JSON, and so is what sentences say.

A claim is a part of a sentence, computed from the results or asserted over them. What the claims leave of the pages
holds no number and no superlative.
"""

import inspect
import re
from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.active_set import CONSTANT, order
from grader.bench import adaptive, precision, regions, stability, timing
from grader.bench.collisions import CASES
from grader.bench.measured import BLOCKS, MARKED, PICTURE, STUDIES, fill, load_results, savings
from grader.bench.scenes import load_scene
from grader.numerics.convergence import observed_order
from grader.numerics.integrators import BY_NAME
from grader.numerics.servo import Servo

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "docs" / "measured"
PAGES = ("README.md", "docs/measured.md")
RESULTS = load_results(KEPT)
SCENES = RESULTS["precision"]["scenes"]
SMOOTH = ("double_pendulum", "servo", "stiff_servo", "spinning_body", "eccentric_body")
SWITCHING = ("joint_limits", "cube")

COUNTS = "two|three|four|five|six|seven|eight|nine|ten|half|twice|third|quarter|fifth|hundred|thousand"
ABSOLUTE = "most|least|best|worst|every|each|never|always|nothing|none|nowhere|only|any|no"
SUPERLATIVE = r"(?!(?:re)?quest|tests?|rest)\w{2,}est"
NUMBER = re.compile(rf"(?<![\w.])\d|\b(?:{COUNTS}|{ABSOLUTE}|{SUPERLATIVE})\b", re.IGNORECASE)


def test_the_results_are_of_whole_runs_and_no_proof_was_broken() -> None:
    assert not any(RESULTS[name]["quick"] for name in STUDIES)
    assert RESULTS["skip"]["broken_proofs"] == []
    assert all(scene["bitwise"] for scene in RESULTS["skip"]["scenes"].values())
    assert RESULTS["precision"]["profiling_timer"] is True
    for scene in SCENES.values():
        assert all(error in scene["errors"][method] for method, _, _, error in scene["pareto"])


@pytest.mark.parametrize("page", PAGES)
def test_the_page_is_the_rendering_of_the_results(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert MARKED.search(text), f"{page} has no <!-- measured:begin NAME --> ... <!-- measured:end NAME -->"
    assert fill(text, RESULTS) == text, "run: make measured-tables"


def test_the_pages_use_every_block_and_picture() -> None:
    text = "".join((ROOT / page).read_text(encoding="utf-8") for page in PAGES)
    assert {found[1] for found in MARKED.findall(text)} == set(BLOCKS)
    pictures = {path.name: path.stat().st_size for path in KEPT.glob("*.png")}
    assert set(PICTURE.findall(text)) == set(pictures)
    assert min(pictures.values()) > 10_000


def test_another_figure_is_noticed() -> None:
    page = "<!-- measured:begin skip -->\nold\n<!-- measured:end skip -->\n"
    filled = fill(page, RESULTS)
    assert "old" not in filled
    assert fill(filled, RESULTS) == filled


def span(values: Sequence[float], digits: str = ".2g") -> str:
    return f"{min(values):{digits}} to {max(values):{digits}}"


def order_of(scene: str) -> float:
    return float(SCENES[scene]["orders"]["RK4"]["order"])


def pairs() -> str:
    signature = inspect.signature(timing.paired).parameters
    return f"{min(precision.PEER_PAIRS, adaptive.PAIRS)} to {signature['most'].default} pairs"


def middle() -> str:
    return f"the middle {timing.SPREAD[-1] - timing.SPREAD[0]} %"


def orders() -> str:
    assert order_of("servo") == pytest.approx(4, abs=0.1)
    assert order_of("stiff_servo") == pytest.approx(4, abs=0.1)
    assert order_of("spinning_body") == pytest.approx(2, abs=0.05)
    assert all(0.5 < order_of(name) < 1.5 for name in SWITCHING)
    assert RESULTS["precision"]["versions"]["mujoco"] == "3.14.0"
    return (
        "RK4 has order 4 on hinges, 2 on quaternions (MuJoCo 3.14.0), and 1 where a limit or a contact opens and closes"
    )


def first_order() -> str:
    assert all(0.5 < SCENES[name]["orders"]["RK4"]["order"] < 1.5 for name in SWITCHING)
    return "Contacts that switch make RK4 first order"


def order_kept() -> str:
    (kept,) = {round(order(name, "RK4")) for name in CONSTANT}
    return f"it keeps order {kept}"


def none_gets_there() -> str:
    assert all(SCENES[name]["cheapest"]["1e-05"] is None for name in SWITCHING)
    finest = 1e6 * precision.TIMESTEPS_S[-1]
    return f"No integrator at any timestep down to {finest:.0f} us brings the limits or the cube below an error of 1e-5"


def adaptive_gets_there() -> str:
    assert all(SCENES[name]["peers"]["SciPy LSODA, mj_forward"]["1e-08"] is not None for name in SWITCHING)
    return "reaches 1e-8"


def bands() -> str:
    kinds = RESULTS["stability"]["windows"]
    shares = [
        100 * window["share_of_unstable"]
        for chart in kinds.values()
        for window in chart["RK4"]
        if window["kind"] == "window"
    ]
    assert len(shares) == len(kinds)
    assert all(window["kind"] != "window" for one in kinds.values() for k in one if k != "RK4" for window in one[k])
    return f"{min(shares):.0f} % to {max(shares):.0f} % of its unstable points, where BADQACC never fires"


def box() -> str:
    case, start = CASES["box"], load_scene(CASES["box"].scene)
    assert all(one["shares"]["warned"] == 0 for one in RESULTS["stability"]["cases"]["box"].values())
    for integrator in BY_NAME:
        for timestep_s in (1e-3, case.timestep_span_s[0]):
            assert case.outcome(case.follow(case.start(start, 0.01), 0.01, integrator, timestep_s)) == "launched"
    return "is thrown out without any warning, and no smaller timestep prevents it"


def procedure(kind: str) -> list[float]:
    return [scene["procedure"][kind]["cost"] for scene in SCENES.values()]


def quarter() -> str:
    return f"RK4 at a quarter of the step costs {span(procedure('quarter'))} times as much as the start"


def four_times() -> str:
    low, high = min(procedure("four_times")), max(procedure("four_times"))
    assert high < 1
    return f"RK4 at 8 ms costs {low:.2f} to {high:.2f} of `implicitfast` at 2 ms"


def precise() -> str:
    gains = {
        name: SCENES[name]["procedure"]["start"]["error"] / SCENES[name]["procedure"]["four_times"]["error"]
        for name in SMOOTH
    }
    stiff = gains.pop("stiff_servo")
    limit_s = stability.CHARTS["stiffness"].closed_form_s("RK4", 20000)
    return (
        f"it is {min(gains.values()):.0f} to {max(gains.values()):.0f} times as precise on smooth scenes, "
        f"the stiff servo excepted, where 8 ms is close to the limit of stability ({1e3 * limit_s:.1f} ms) "
        f"and the error {1 / stiff:.1f} times as large"
    )


def never_unstable() -> str:
    shares = [chart["discrete"]["shares"] for chart in RESULTS["stability"]["maps"].values()]
    assert all(one["stable"] == 1 for one in shares)
    return "`discrete` is never unstable on the maps"


def least_precise() -> str:
    """A run that warned is less precise than any error."""
    counts = {}
    for name, scene in SCENES.items():
        errors = {kind: [np.inf if e is None else e for e in own] for kind, own in scene["errors"].items()}
        counts[name] = sum(
            all(errors["discrete"][k] > errors[kind][k] for kind in errors if kind != "discrete")
            for k in range(len(precision.TIMESTEPS_S))
        )
    eccentric, stiff, cube = (counts.pop(name) for name in ("eccentric_body", "stiff_servo", "cube"))
    assert set(counts.values()) == {0}
    every = len(precision.TIMESTEPS_S)
    return (
        f"the least precise of the five at {eccentric} of {every} timesteps on the eccentric body, "
        f"{stiff} of {every} on the stiff servo, {cube} of {every} on the cube and 0 of {every} on the other scenes"
    )


def scope() -> str:
    assert (len(BY_NAME), len(precision.TIMESTEPS_S), len(precision.SCENES)) == (5, 10, 7)
    assert list(SCENES) == list(precision.SCENES)
    return f"over {RESULTS['precision']['horizon_s']} s (sup norm; rotations as rotation vectors) against CPU time, for"


def front() -> str:
    counts = {name: [method for method, *_ in scene["pareto"]].count("RK4") for name, scene in SCENES.items()}
    smooth, switching = ([counts[name] for name in names] for names in (SMOOTH, SWITCHING))
    assert all(2 * counts[name] > len(SCENES[name]["pareto"]) for name in SMOOTH)
    return f"RK4 makes up {span(smooth)} points of the front on every smooth scene, and {span(switching)} beside"


def not_monotone() -> str:
    rises = [b / a for name in SWITCHING for a, b in pairwise(SCENES[name]["errors"]["RK4"])]
    return f"halving RK4's timestep may raise it {max(rises):.1f}-fold"


@cache
def averaged() -> str:
    """The root mean square of the errors over starts whose impacts fall at other phases of a step."""
    timesteps_s = [0.008 / 2**k for k in range(7)]
    squares: dict[str, list[list[float]]] = {"RK4": [], "Euler": []}
    for number in range(8):
        scene = load_scene("joint_limits").at(qpos=[1.5 + 0.003 * number, 0.5])
        truth, _, _ = precision.through_impacts(scene)
        for integrator, found in squares.items():
            settings = [precision.Setting("joint_limits", integrator, h) for h in timesteps_s]
            found.append([setting.error(truth, scene)["error"] ** 2 for setting in settings])
    fits = {name: observed_order(timesteps_s, np.sqrt(np.mean(found, axis=0))) for name, found in squares.items()}
    assert all(fit.high - fit.low < 0.3 for fit in fits.values())
    return (
        f"Averaged over {len(squares['RK4'])} starts, whose impacts fall at other phases of a step, RK4 shows order "
        f"{fits['RK4'].order:.1f} on the limits, and Euler {fits['Euler'].order:.1f}."
    )


def overtakes() -> str:
    for name in ("spinning_body", "eccentric_body"):
        for peer, ratios in SCENES[name]["peers"].items():
            if "SciPy" in peer:
                assert ratios["1e-04"]["ratio"] > 1 > ratios["1e-05"]["ratio"]
    return "SciPy overtakes MuJoCo's own RK4 from 1e-5 on"


def agreement() -> str:
    return f"radius agree to {RESULTS['stability']['totals']['largest_spectral_to_closed']:.0e}"


def servo_limits(values: Any) -> list[Servo]:
    return [Servo(stability.PENDULUM_INERTIA, 100, kv, stability.PENDULUM_GRAVITY_STIFFNESS) for kv in values]


def damping() -> str:
    assert stability.CHARTS["damping"].servo(5.0) == servo_limits([5.0])[0]
    servos = servo_limits(np.geomspace(0.5, 100, 60))
    assert all(a.euler_s > b.euler_s and a.implicit_s < b.implicit_s for a, b in pairwise(servos))
    beyond = servo_limits([40, 80])
    assert beyond[1].rk4_s / beyond[0].rk4_s == pytest.approx(beyond[1].euler_s / beyond[0].euler_s, rel=0.05)
    critical = 2 * (servos[0].inertia * servos[0].stiffness) ** 0.5
    limits = [servo.rk4_s for servo in servo_limits(np.linspace(0.5, critical, 100))]
    assert max(limits) / min(limits) - 1 < 0.14
    assert 1 - min(limits) / max(limits) < 0.125
    return f"stays within {100 * (1 - min(limits) / max(limits)):.0f} % up to critical damping, and then falls as fast"


def horizon() -> str:
    assert stability.SECONDS == 3
    longest = stability.CHARTS["damping"].timestep_span_s[1]
    return f"at {1e3 * longest:.0f} ms, 3 s are {stability.SECONDS / longest:.0f} steps"


def ball_and_wall() -> str:
    model = load_scene("ball_and_wall").model
    ball = min(size[0] for kind, size in zip(model.geom_type, model.geom_size, strict=True) if kind == 2)
    wall = min(size[0] for kind, size in zip(model.geom_type, model.geom_size, strict=True) if kind == 6)
    return f"a ball of {100 * ball:g} cm radius that flies at a wall {200 * wall:g} cm thick"


def pushed() -> str:
    case, scene = CASES["ball"], load_scene(CASES["ball"].scene)
    for integrator in BY_NAME:
        for timestep_s in (1e-3, 1e-4):
            outcomes = {
                speed: case.outcome(case.follow(case.start(scene, speed), speed, integrator, timestep_s))
                for speed in (3, 4, 10, 100)
            }
            assert outcomes.pop(3) == "stopped"
            assert set(outcomes.values()) == {"pushed through"}  # and not tunnelled, as at larger timesteps
    assert all(one["shares"]["tunnelled"] > 0.1 for one in RESULTS["stability"]["cases"]["ball"].values())
    return "from 4 m/s on the ball is pushed through the wall at 1 ms and at 0.1 ms alike"


def wheel() -> str:
    resets = [one["reset"] for one in RESULTS["stability"]["cases"]["wheel"].values() if one["reset"]]
    assert resets
    for reset in resets:
        assert reset["time_after_s"] == pytest.approx(reset["timestep_s"], rel=1e-3)
        assert reset["qpos_after"] == [0.0]
    return "the clock back to the first step and the wheel to 0"


def timer() -> str:
    apart = [savings(scene) for scene in RESULTS["skip"]["scenes"].values()]
    return f"saves more than skipping on {sum(first > last for first, _, last in apart)} of {len(apart)} scenes"


def constrained() -> str:
    needed = [
        savings(scene)[2]
        for scene in RESULTS["skip"]["scenes"].values()
        if any(flag["part"] == "constraints" and not flag["proven"] for flag in scene["flags"])
    ]
    assert len(needed) == 3
    return f"skipping saves next to nothing (x{min(needed):.2f} to x{max(needed):.2f}) where constraints are needed"


def bitwise() -> str:
    assert all(scene["bitwise"] for scene in RESULTS["skip"]["scenes"].values())
    return "bitwise the same for all five integrators"


def islands() -> str:
    changes = {
        name: flag["largest_difference"]
        for name, scene in RESULTS["skip"]["scenes"].items()
        for flag in scene["flags"]
        if flag["part"] == "islands" and flag["largest_difference"]
    }
    assert list(changes) == ["two_bodies"]
    return f"on the two bodies they change the state by {changes['two_bodies']:.0e}"


def sides() -> str:
    found = RESULTS["regions"]
    assert found["wrong"] == 0
    return (
        f"the closed forms and MuJoCo's own step differ by {found['largest_difference']:.0e} at most, "
        f"and all {found['points']} simulated points do what the plane says"
    )


def turned() -> str:
    limits = RESULTS["regions"]["limits"]
    first, last = (str(angle) for angle in (regions.ANGLES[0], regions.ANGLES[-1]))
    ends = {kind: (one[first], one[last]) for kind, one in limits.items()}
    assert limits["implicit"] == limits["implicitfast"]
    assert ends["discrete"] == (None, None)
    euler, implicit = ends["Euler"], ends["implicit"]
    return (
        f"From {first} to {last} degrees, as damping grows, the distance of the border from zero falls for Euler from "
        f"{euler[0]:.2f} to "
        f"{euler[1]:.2f}, and rises for `implicit` and `implicitfast` from {implicit[0]:.2f} to {implicit[1]:.2f}."
    )


def three_servos() -> str:
    assert len(RESULTS["regions"]["servos"]) == 3
    return "the pendulum's servo at three stiffnesses"


def ten_minutes() -> str:
    assert RESULTS["energy"]["minutes"] == 10
    assert list(RESULTS["energy"]["scenes"]) == ["double_pendulum", "spinning_body"]
    return "over ten minutes"


def fed() -> str:
    warned = {
        (name, kind)
        for name, kinds in RESULTS["energy"]["scenes"].items()
        for kind, runs in kinds.items()
        if all(run["warning"] for run in runs.values())
    }
    kept = [run for kinds in RESULTS["energy"]["scenes"].values() for runs in kinds.values() for run in runs.values()]
    assert warned == {("double_pendulum", "implicit"), ("spinning_body", "Euler")}
    assert sum(run["warning"] is not None for run in kept) == 6
    return (
        "`implicit` feeds the double pendulum, and Euler the spinning body, until MuJoCo warns and resets them, "
        "at each of the three timesteps"
    )


def lost() -> str:
    kinds = RESULTS["energy"]["scenes"]["spinning_body"]
    lasts = [run["last"] for kind in ("implicit", "implicitfast", "discrete") for run in kinds[kind].values()]
    assert max(lasts) < 0
    taken = f"{-100 * max(lasts):.0f} % to {-100 * min(lasts):.0f} %"
    return f"the other three methods of first order take {taken} of its energy"


def gentle() -> str:
    worst = {name: kinds["RK4"] for name, kinds in RESULTS["energy"]["scenes"].items()}
    for runs in worst.values():
        assert runs["4 ms"]["largest"] > runs["2 ms"]["largest"] > runs["1 ms"]["largest"]
    pendulum, body = (worst[name]["2 ms"]["largest"] for name in ("double_pendulum", "spinning_body"))
    return f"RK4 at 2 ms stays within {pendulum:.0e} and {body:.0e}"


def fixed_cost() -> str:
    models = RESULTS["models"]["models"].values()
    fixed, resets = [one["fixed_us"] for one in models], [one["reset_us"] for one in models]
    return (
        f"A run of {RESULTS['models']['steps']} steps costs {min(fixed):.1f} to {max(fixed):.1f} us beside its steps "
        f"and MuJoCo's own reset, which takes {min(resets):.1f} to {max(resets):.1f} us"
    )


def many() -> str:
    models = RESULTS["models"]["models"]
    assert all(one["bitwise"] for one in models.values())
    return f"on {len(models)} models"


def everywhere() -> str:
    found = RESULTS["models"]
    touched = [one["skipping"]["ratio"] for one in found["models"].values() if "contacts" in one["needed"]]
    free = [one["skipping"]["ratio"] for one in found["models"].values() if "constraints" not in one["needed"]]
    assert max(touched) < min(free)
    return (
        f"Where contacts may open, skipping saves next to nothing (x{min(touched):.2f} to x{max(touched):.2f}); "
        f"where nothing is constrained it saves x{min(free):.2f} to x{max(free):.2f}"
    )


def fewest() -> str:
    """The double pendulum and the stiff pile within 1e-6."""
    scenes = RESULTS["adaptive"]["scenes"]
    mujoco, solvers = scenes["double_pendulum"]["mujoco"]["1e-06"], scenes["double_pendulum"]["adaptive"]
    best = min((one["1e-06"] for one in solvers.values() if one["1e-06"]), key=lambda one: one["evaluations"])
    assert best["evaluations"] < mujoco["evaluations"]
    assert best["ratio"] > mujoco["ratio"]
    return (
        f"within 1e-6 on the double pendulum {best['method']} takes {best['evaluations']} evaluations where "
        f"{mujoco['method']} takes {mujoco['evaluations']}, and yet {best['ratio'] / mujoco['ratio']:.1f} times its "
        "CPU time"
    )


def stiff_pile() -> str:
    scene = RESULTS["adaptive"]["scenes"]["pile"]
    truth, horizon_s = scene["reference"], RESULTS["adaptive"]["horizons_s"]["pile"]
    model = load_scene("pile").model
    assert (model.nbody - 1, model.geom_solref[-1, 0]) == (6, 0.004)
    return (
        f"six smooth spheres with a contact time constant of 4 ms that fall into a trough; in {horizon_s} s the number "
        f"of contacts changes {truth['changes']} times, up to {truth['most_constraints']}; the own error of the "
        f"reference is {truth['own_error']:.0e}"
    )


def pile_orders() -> str:
    orders = {kind: one["order"] for kind, one in RESULTS["adaptive"]["scenes"]["pile"]["orders"].items() if one}
    return f"the fitted orders lie between {min(orders.values()):.1f} and {max(orders.values()):.1f}"


CLAIMS: tuple[Callable[[], str], ...] = (
    *(pairs, middle, orders, first_order, order_kept, none_gets_there, adaptive_gets_there, bands, box),
    *(
        quarter,
        four_times,
        precise,
        never_unstable,
        least_precise,
        scope,
        front,
        not_monotone,
        averaged,
        overtakes,
        agreement,
    ),
    *(damping, horizon, ball_and_wall, pushed, wheel, timer, constrained, bitwise, islands),
    *(sides, turned, three_servos, ten_minutes, fed, lost, gentle, fixed_cost, many, everywhere),
    *(fewest, stiff_pile, pile_orders),
)

DEFINITIONS = (
    "Every table on this page",
    "No warning",
    "no warning",
    "A box started a centimetre inside",
    "five integrators at ten timesteps on seven scenes",
    "for five integrators on seven scenes",
    "the largest position error",
    "nothing is both cheaper and more precise",
    "The cheapest setting within each error",
    "(Euler at 2 ms)",
    "RK4 at a quarter of its timestep",
    "at four times its timestep",
    "with its 95 % interval",
    "its own error is its largest distance to a second solution",
    "no noise",
    "nothing skipped",
    "MuJoCo's cheapest setting, each at its cheapest within the error",
    "of second order",
    "with kv = 5, started at 1 rad, simulated for 3 s at each timestep",
    "of the one-step map is 1,",
    "2 sqrt(I/kp)",
    "kp = 100",
    "over its two parameters",
    "grid of each second row and column",
    "touches no wall",
    "each part of the engine",
    "that no force depends on",
    "no flag of MuJoCo leaves their poses out",
    "Each flag alone",
    "The cheapest setting within each position error over 1.024 s",
    "no confidence interval",
    "(each with its conjugate)",
    "Energy over ten minutes",
    "at its first warning",
    "with the 95 % confidence interval of the median",
    "one limit or one pair of geoms",
    "a single eigenvalue",
)
"""What a measurement is, not what it found: the settings in it are asserted in the test below."""


def prose(page: str) -> str:
    """The sentences of a page that are about measurements, on one line: without blocks, pictures and commands."""
    text = (ROOT / page).read_text(encoding="utf-8")
    if page == "README.md":
        text = text[text.index("## Measured") : text.index("## Licence")]
    text = re.sub(r"^\d\. ", "", MARKED.sub("", text), flags=re.MULTILINE)
    return " ".join(re.sub(r"!\[[^]]*]\([^)]*\)|\([\w./]*\.\w+\)", "", text).replace("*", "").split())


def test_what_a_measurement_is_stands_in_the_code() -> None:
    charts = stability.CHARTS
    assert charts["stiffness"].servo(100.0) == servo_limits([5.0])[0]
    assert load_scene("servo").start.qpos.tolist() == [1.0]
    assert precision.YARDSTICK == ("Euler", 0.002)
    assert precision.PROCEDURE == {
        "start": ("implicitfast", 0.002),
        "quarter": ("RK4", 0.0005),
        "four_times": ("RK4", 0.008),
    }
    assert precision.HORIZON_S == RESULTS["precision"]["horizon_s"] == 1.024


@pytest.mark.parametrize(
    "claim",
    [pytest.param(claim, marks=[pytest.mark.slow] if claim is averaged else []) for claim in CLAIMS],
    ids=lambda claim: claim.__name__,
)
def test_the_page_says_what_the_results_say(claim: Callable[[], str]) -> None:
    assert claim() in prose("docs/measured.md")


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_no_number_or_superlative_is_left_without_a_claim(page: str) -> None:
    text = prose(page)
    for part in sorted((*DEFINITIONS, *(claim() for claim in CLAIMS)), key=len, reverse=True):
        text = text.replace(part, "")
    left = [text[max(0, found.start() - 50) : found.end() + 30] for found in NUMBER.finditer(text)]
    assert not left, "\n".join(left)


@pytest.mark.parametrize(
    "sentence", ["It saves 3 times.", "It is the fastest.", "It never fails.", "It takes ten runs."]
)
def test_a_new_number_or_superlative_is_noticed(sentence: str) -> None:
    assert NUMBER.search(sentence)
    assert not NUMBER.search("RK4 and DOP853 are tested at the rest.")
