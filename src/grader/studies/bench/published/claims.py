"""What sentences of the pages say about the results: each claim renders its numbers from them, or is denied by them. In
a page a claim stands between `<!--=NAME-->` and `<!--=-->`."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from grader.studies.bench import timing
from grader.studies.bench.physics import precision, regions, stability
from grader.studies.bench.scenes import describe_scene, load_scene

Results = dict[str, Any]
Claim = Callable[[Results], str]
CLAIMS: dict[str, Claim] = {}

SMOOTH = ("double_pendulum", "servo", "stiff_servo", "spinning_body", "eccentric_body")
SWITCHING = ("joint_limits", "cube")


class Denied(Exception):
    """The results do not support a claim; the message says what they show."""


def claim(render: Claim) -> Claim:
    """Make a function a claim under its own name."""
    CLAIMS[render.__name__] = render
    return render


def demand(holds: bool, shows: object) -> None:
    """Raise Denied with what the results show, unless the claim holds."""
    if not holds:
        raise Denied(str(shows))


def span(values: Sequence[float], digits: str = ".2g") -> str:
    """`9.2 to 13`, or the one number where both are the same."""
    ends = f"{min(values):{digits}}", f"{max(values):{digits}}"
    return " to ".join(dict.fromkeys(ends))


def scenes_of(results: Results) -> Results:
    """Returns the scenes of the precision study."""
    scenes: Results = results["precision"]["scenes"]
    return scenes


@claim
def pairs(_results: Results) -> str:
    """How many pairs a ratio is the median of."""
    return f"{timing.LEAST} to {timing.MOST} pairs"


@claim
def orders(results: Results) -> str:
    """RK4 on hinges, on quaternions, and where constraints switch."""
    orders = {name: scene["orders"]["RK4"]["order"] for name, scene in scenes_of(results).items()}
    hinges, quaternions = round(orders["servo"]), round(orders["spinning_body"])
    demand(all(abs(orders[name] - 4) < 0.4 for name in ("double_pendulum", "servo", "stiff_servo")), orders)
    demand(all(abs(orders[name] - 2) < 0.1 for name in ("spinning_body", "eccentric_body")), orders)
    demand(all(0.5 < orders[name] < 1.5 for name in SWITCHING), orders)
    return (
        f"RK4 has order {hinges} on hinges, {quaternions} on quaternions (MuJoCo "
        f"{results['precision']['versions']['mujoco']}), and 1 where a limit or a contact opens and closes"
    )


@claim
def none_gets_there(results: Results) -> str:
    """Returns the error that no setting reaches on limits and the cube."""
    scenes = scenes_of(results)
    reached = {name: [error for error, best in scenes[name]["cheapest"].items() if best] for name in SWITCHING}
    demand(all("1e-05" not in errors for errors in reached.values()), f"errors reached: {reached}")
    finest = 1e6 * precision.TIMESTEPS_S[-1]
    return f"No integrator at any timestep down to {finest:.0f} us brings the limits or the cube below an error of 1e-5"


@claim
def adaptive_gets_there(results: Results) -> str:
    """Returns the error that LSODA reaches there."""
    reached = {name: scenes_of(results)[name]["peers"]["SciPy LSODA, mj_forward"]["1e-08"] for name in SWITCHING}
    demand(all(reached.values()), f"LSODA within 1e-8: {reached}")
    return "reaches 1e-8"


@claim
def bands(results: Results) -> str:
    """Returns the share of RK4's windows."""
    shares = []
    for name, kinds in results["stability"]["windows"].items():
        wide = {kind: [w["share_of_unstable"] for w in own if w["kind"] == "window"] for kind, own in kinds.items()}
        demand([kind for kind, own in wide.items() if own] == ["RK4"], f"windows on the map {name}: {wide}")
        shares += [100 * share for share in wide["RK4"]]
    return f"{span(shares, '.0f')} % of its unstable points, where BADQACC never fires"


def costs(results: Results, kind: str) -> list[float]:
    """Returns the costs of one setting of the procedure in runs of its start, over all scenes."""
    return [scene["procedure"][kind]["ratio"] for scene in scenes_of(results).values()]


@claim
def quarter(results: Results) -> str:
    """Returns the cost of RK4 at a quarter of the step."""
    ratios = costs(results, "quarter")
    demand(min(ratios) > 2, f"costs of RK4 at 0.5 ms in runs of the start: {ratios}")
    return f"RK4 at a quarter of the step costs {span(ratios)} times as much as the start"


@claim
def four_times(results: Results) -> str:
    """Returns the cost of RK4 at four times the step."""
    ratios = costs(results, "four_times")
    demand(max(ratios) < 1, f"costs of RK4 at 8 ms in runs of the start: {ratios}")
    return f"RK4 at 8 ms costs {span(ratios, '.2f')} of `implicitfast` at 2 ms"


@claim
def precise(results: Results) -> str:
    """How many times as precise it is then."""
    gains = {}
    for name in SMOOTH:
        settings = scenes_of(results)[name]["procedure"]
        gains[name] = settings["start"]["error"] / settings["four_times"]["error"]
    stiff = gains.pop("stiff_servo")
    demand(
        stiff < 1 < min(gains.values()), f"error of the start over that of RK4 at 8 ms: {gains}, stiff servo {stiff}"
    )
    limit_s = stability.CHARTS["stiffness"].closed_form_s("RK4", 20000)
    return (
        f"it is {min(gains.values()):.0f} to {max(gains.values()):.0f} times as precise on smooth scenes, "
        f"the stiff servo excepted, where 8 ms is close to the limit of stability ({1e3 * limit_s:.1f} ms) "
        f"and the error {1 / stiff:.1f} times as large"
    )


@claim
def never_unstable(results: Results) -> str:
    """`discrete` on the maps."""
    stable = {name: chart["discrete"]["shares"]["stable"] for name, chart in results["stability"]["maps"].items()}
    demand(set(stable.values()) == {1}, f"shares of stable points under discrete: {stable}")
    return "`discrete` is never unstable on the maps"


@claim
def least_precise(results: Results) -> str:
    """At how many timesteps `discrete` is the least precise; a run that warned is less precise than any error."""
    counts = {}
    for name, scene in scenes_of(results).items():
        errors = {kind: [np.inf if e is None else e for e in own] for kind, own in scene["errors"].items()}
        counts[name] = sum(
            own > max(others) for own, *others in zip(errors.pop("discrete"), *errors.values(), strict=True)
        )
    every = len(precision.TIMESTEPS_S)
    some = sorted(((count, name) for name, count in counts.items() if count), reverse=True)
    demand(0 < len(some) < len(counts), counts)
    shares = [
        f"{count} of {every}{' timesteps' if not k else ''} on the {describe_scene(name)}"
        for k, (count, name) in enumerate(some)
    ]
    return f"the least precise of the five at {', '.join(shares)} and 0 of {every} on the other scenes"


@claim
def front(results: Results) -> str:
    """How many points of the Pareto front are RK4's."""
    counts = {}
    for name, scene in scenes_of(results).items():
        methods = [method for method, *_ in scene["pareto"]]
        counts[name] = methods.count("RK4"), len(methods)
    smooth, switching = ([counts[name][0] for name in names] for names in (SMOOTH, SWITCHING))
    demand(all(2 * counts[name][0] > counts[name][1] for name in SMOOTH), f"RK4's points of the front: {counts}")
    return f"RK4 makes up {span(smooth)} points of the front on every smooth scene, and {span(switching)} beside"


@claim
def not_monotone(results: Results) -> str:
    """By how much half the timestep may raise RK4's error."""
    rises = [b / a for name in SWITCHING for a, b in pairwise(scenes_of(results)[name]["errors"]["RK4"])]
    demand(max(rises) > 1, f"RK4's error at half the timestep over its error: {rises}")
    return f"halving RK4's timestep may raise it {max(rises):.1f}-fold"


@claim
def overtakes(results: Results) -> str:
    """Returns the error from which on SciPy is cheaper than MuJoCo on rotating bodies."""
    ratios: dict[str, list[float]] = {}
    for name in ("spinning_body", "eccentric_body"):
        for peer, own in scenes_of(results)[name]["peers"].items():
            for error, entry in own.items():
                if "SciPy" in peer and entry and entry["ratio"]:
                    ratios.setdefault(error, []).append(entry["ratio"])
    dearer = [error for error, own in ratios.items() if max(own) > 1]
    cheaper = [error for error, own in ratios.items() if max(own) < 1]
    demand(bool(cheaper and dearer) and [*dearer, *cheaper] == list(ratios), f"SciPy's costs over MuJoCo's: {ratios}")
    return f"SciPy overtakes MuJoCo's own RK4 from 1e-{int(cheaper[0][3:])} on"


@claim
def alternatives(results: Results) -> str:
    """Returns the peers that not every machine has."""
    peers = {peer for scene in scenes_of(results).values() for peer in scene["peers"]}
    demand(peers >= {"Pinocchio ABA + RK4", "Drake RK5"}, f"peers measured: {sorted(peers)}")
    plain = "by plain `mj_step(nstep)`, " if "mj_step(nstep), RK4" in peers else ""
    return f"{plain}by Pinocchio's ABA under RK4 in Python and by Drake's RK5"


@claim
def agreement(results: Results) -> str:
    """How far closed form and spectral radius are apart."""
    apart = results["stability"]["totals"]["largest_spectral_to_closed"]
    demand(apart < 1e-5, f"closed form and spectral radius differ by {apart}")
    return f"radius agree to {apart:.0e}"


@claim
def wheel(results: Results) -> str:
    """What the reset makes of the wheel."""
    resets = [case["reset"] for case in results["stability"]["cases"]["wheel"].values() if case["reset"]]
    back = [abs(r["time_after_s"] / r["timestep_s"] - 1) < 1e-3 and r["qpos_after"] == [0.0] for r in resets]
    demand(bool(resets) and all(back), f"after the first warning: {resets}")
    return "the clock back to the first step and the wheel to 0"


def saved(results: Results, stage: str) -> dict[str, float]:
    """How many times faster a stage of the skip study makes each scene."""
    return {name: scene["savings"][stage]["ratio"] for name, scene in results["skip"]["scenes"].items()}


@claim
def timer(results: Results) -> str:
    """On how many scenes the timer saves more than skipping."""
    timers, skips = saved(results, "timer off"), saved(results, "skipping")
    more = sum(timers[name] > skips[name] for name in timers)
    demand(2 * more > len(timers), f"the timer saves {timers}, skipping {skips}")
    return f"saves more than skipping on {more} of {len(timers)} scenes"


@claim
def constrained(results: Results) -> str:
    """What skipping saves where constraints are needed."""
    skips, needed = saved(results, "skipping"), []
    for name, scene in results["skip"]["scenes"].items():
        if any(flag["part"] == "constraints" and not flag["proven"] for flag in scene["flags"]):
            needed.append(skips.pop(name))
    demand(max(needed) < min(skips.values()), f"with constraints {needed}, without {skips}")
    return f"skipping saves next to nothing (x{min(needed):.2f} to x{max(needed):.2f}) where constraints are needed"


@claim
def bitwise(results: Results) -> str:
    """Returns all results of the skip study."""
    proofs = {name: scene["bitwise"] for name, scene in results["skip"]["scenes"].items()}
    demand(all(proofs.values()) and not results["skip"]["broken_proofs"], f"bitwise the same: {proofs}")
    return "bitwise the same for all five integrators"


@claim
def islands(results: Results) -> str:
    """What leaving out islands changes where there are constraints."""
    changes = {
        name: flag["largest_difference"]
        for name, scene in results["skip"]["scenes"].items()
        for flag in scene["flags"]
        if flag["part"] == "islands" and flag["largest_difference"]
    }
    demand(list(changes) == ["two_bodies"], f"leaving out islands changes {changes}")
    return f"on the two bodies they change the state by {changes['two_bodies']:.0e}"


@claim
def sides(results: Results) -> str:
    """Closed forms, MuJoCo's step and simulations on the complex plane."""
    regions = results["regions"]
    demand(regions["wrong"] == 0, f"{regions['wrong']} of {regions['points']} points do not what the plane says")
    return (
        f"the closed forms and MuJoCo's own step differ by {regions['largest_difference']:.0e} at most, "
        f"and all {regions['points']} simulated points do what the plane says"
    )


@claim
def turned(results: Results) -> str:
    """How the borders move as damping grows."""
    limits = results["regions"]["limits"]
    first, last = (str(angle) for angle in (regions.ANGLES[0], regions.ANGLES[-1]))
    ends = {kind: (curve[first], curve[last]) for kind, curve in limits.items()}
    euler, implicit = ends["Euler"], ends["implicit"]
    demand(limits["implicit"] == limits["implicitfast"] and ends["discrete"] == (None, None), ends)
    demand(euler[0] > euler[1] and implicit[0] < implicit[1], ends)
    return (
        f"From {first} to {last} degrees, as damping grows, the distance of the border from zero falls for Euler from "
        f"{euler[0]:.2f} to {euler[1]:.2f}, and rises for `implicit` and `implicitfast` from {implicit[0]:.2f} to "
        f"{implicit[1]:.2f}"
    )


def runs_of(results: Results) -> Iterator[tuple[tuple[str, str], list[Results]]]:
    """Yields the runs of the energy study by scene and integrator."""
    for name, kinds in results["energy"]["scenes"].items():
        for kind, runs in kinds.items():
            yield (name, kind), list(runs.values())


@claim
def fed(results: Results) -> str:
    """Returns the integrators that add energy until MuJoCo warns."""
    warned = {key: [bool(run["warning"]) for run in runs] for key, runs in runs_of(results)}
    always = {key for key, flags in warned.items() if all(flags)}
    some = {key for key, flags in warned.items() if any(flags)}
    demand(always == some == {("double_pendulum", "implicit"), ("spinning_body", "Euler")}, f"warned: {sorted(some)}")
    return (
        "`implicit` feeds the double pendulum, and Euler the spinning body, until MuJoCo warns and resets them, "
        "at each of the three timesteps"
    )


@claim
def lost(results: Results) -> str:
    """What the others take from the spinning body."""
    kinds = results["energy"]["scenes"]["spinning_body"]
    lasts = [-100 * run["last"] for kind in ("implicit", "implicitfast", "discrete") for run in kinds[kind].values()]
    demand(min(lasts) > 0, f"energy lost in %: {lasts}")
    return f"the other three methods of first order take {min(lasts):.0f} % to {max(lasts):.0f} % of its energy"


@claim
def gentle(results: Results) -> str:
    """RK4 over the same time."""
    drifts = {name: kinds["RK4"]["2 ms"]["largest"] for name, kinds in results["energy"]["scenes"].items()}
    return f"RK4 at 2 ms stays within {drifts['double_pendulum']:.0e} and {drifts['spinning_body']:.0e}"


@claim
def many(results: Results) -> str:
    """How many models skipping is measured on."""
    models = results["models"]["models"]
    demand(len(models) >= 20, f"{len(models)} models were measured")
    demand(all(model["bitwise"] for model in models.values()), {name: row["bitwise"] for name, row in models.items()})
    return f"on {len(models)} models"


@claim
def everywhere(results: Results) -> str:
    """What skipping saves where contacts may open, and where nothing is constrained."""
    models = results["models"]["models"].values()
    touched = [model["skipping"]["ratio"] for model in models if "contacts" in model["needed"]]
    free = [model["skipping"]["ratio"] for model in models if "constraints" not in model["needed"]]
    demand(max(touched) < 1.2 < min(free), f"where contacts may open {touched}, where nothing is constrained {free}")
    return (
        f"Where contacts may open, skipping saves next to nothing (x{min(touched):.2f} to x{max(touched):.2f}); "
        f"where nothing is constrained it saves x{min(free):.2f} to x{max(free):.2f}"
    )


@claim
def fixed_cost(results: Results) -> str:
    """What a run costs beside its steps."""
    models = results["models"]["models"].values()
    fixed, resets = ([model[f"{what}_us"] for model in models] for what in ("fixed", "reset"))
    return (
        f"A run of {results['models']['steps']} steps costs {span(fixed, '.1f')} us beside its steps and MuJoCo's own "
        f"reset, which takes {span(resets, '.1f')} us"
    )


@claim
def fewest(results: Results) -> str:
    """Returns the double pendulum within 1e-6: evaluations against time."""
    scene = results["adaptive"]["scenes"]["double_pendulum"]
    ours, solvers = (
        scene["mujoco"]["1e-06"],
        [solver["1e-06"] for solver in scene["adaptive"].values() if solver["1e-06"]],
    )
    best = min(solvers, key=lambda solver: int(solver["evaluations"]))
    demand(best["evaluations"] < ours["evaluations"] and best["ratio"] > ours["ratio"], f"{best} beside {ours}")
    return (
        f"within 1e-6 on the double pendulum {best['method']} takes {best['evaluations']} evaluations where "
        f"{ours['method']} takes {ours['evaluations']}, and yet {best['ratio'] / ours['ratio']:.1f} times its CPU time"
    )


@claim
def stiff_pile(results: Results) -> str:
    """Returns the stiff scene rich in contacts."""
    truth = results["adaptive"]["scenes"]["pile"]["reference"]
    model = load_scene("pile").model
    demand((model.nbody - 1, model.geom_solref[-1, 0]) == (6, 0.004), "the scene was changed")
    demand(truth["own_error"] < 1e-8, f"the own error of the reference is {truth['own_error']}")
    return (
        "six smooth spheres with a contact time constant of 4 ms that fall into a trough; in "
        f"{results['adaptive']['horizons_s']['pile']} s the number of contacts changes {truth['changes']} times, up to "
        f"{truth['most_constraints']}; the own error of the reference is {truth['own_error']:.0e}"
    )


@claim
def pile_orders(results: Results) -> str:
    """Returns the orders that the integrators show there."""
    fits = [fit["order"] for fit in results["adaptive"]["scenes"]["pile"]["orders"].values() if fit]
    return f"the fitted orders lie between {min(fits):.1f} and {max(fits):.1f}"
