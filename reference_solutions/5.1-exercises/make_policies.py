"""Makes the reference policies of lesson 5.1, right and wrong, in NumPy alone: feedback laws from the Riccati equation,
and networks that imitate a law. Run it in the content folder: `python reference_solutions/5.1-exercises/make_policies.py`.
It takes some seconds, and gives the same files again, up to rounding."""

import io
import zipfile
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Policy = tuple[str, Mapping[str, Any] | bytes, str]
"""A name of a file, `<status>__<why>`, its arrays or its bytes, and the diagnosis that it must get."""

HERE = Path(__file__).parent
MODELS = HERE.parents[1] / "models"


def linearise(model: mujoco.MjModel, ctrl: Floats, period_s: float) -> tuple[Floats, Floats]:
    """Returns A and B of one control period about the model's initial state."""
    data = mujoco.MjData(model)
    data.ctrl[:] = ctrl
    size = 2 * model.nv
    a, b = np.zeros((size, size)), np.zeros((size, model.nu))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, a, b, None, None)
    whole_a, whole_b = np.eye(size), np.zeros((size, model.nu))
    for _ in range(round(period_s / model.opt.timestep)):
        whole_a, whole_b = a @ whole_a, a @ whole_b + b
    return whole_a, whole_b


def solve_riccati(a: Floats, b: Floats, q: Floats, r: Floats) -> Floats:
    """Returns the gains K of the controls -K x that minimise the sum of x'Qx + u'Ru."""
    p = q
    for _ in range(5000):
        gains = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
        p = q + a.T @ p @ (a - b @ gains)
    return gains


FUNCTIONS: Mapping[str, tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]] = {
    "tanh": (np.tanh, lambda h: 1 - h**2),
    "relu": (lambda z: np.maximum(z, 0), lambda h: (h > 0).astype(float)),
}
"""Each activation, and its derivative as a function of its value."""


def imitate(
    observed: Floats, wanted: Floats, hidden: tuple[int, ...], activation: str, *, squashed: bool = True
) -> dict[str, Floats]:
    """Returns a network of the form that lesson 5.1 declares, trained with Adam on the square of its error; `observed`
    (n, inputs) are normalised already."""
    rng = np.random.default_rng(0)
    function, slope = FUNCTIONS[activation]
    widths = (observed.shape[1], *hidden, wanted.shape[1])
    weights = [rng.normal(0, 1 / np.sqrt(rows), (rows, columns)) for rows, columns in pairwise(widths)]
    parts = [*weights, *(np.zeros(columns) for columns in widths[1:])]
    moments = [(np.zeros_like(part), np.zeros_like(part)) for part in parts]
    layers, steps = len(weights), 6000
    for step in range(1, steps + 1):
        rows = rng.integers(len(observed), size=256)
        values = [observed[rows]]
        for layer in range(layers):
            z = values[-1] @ parts[layer] + parts[layers + layer]
            values.append(function(z) if layer < layers - 1 else np.tanh(z) if squashed else z)
        error = (values[-1] - wanted[rows]) * (1 - values[-1] ** 2 if squashed else 1) / len(rows)
        slopes = [np.empty(0)] * len(parts)
        for layer in reversed(range(layers)):
            slopes[layer], slopes[layers + layer] = values[layer].T @ error, error.sum(axis=0)
            error = (error @ parts[layer].T) * slope(values[layer]) if layer else error
        rate = 0.01 * (0.5 + 0.5 * np.cos(np.pi * step / steps))
        for part, gradient, (first, second) in zip(parts, slopes, moments, strict=True):
            first += 0.1 * (gradient - first)
            second += 0.001 * (gradient**2 - second)
            part -= rate * (first / (1 - 0.9**step)) / (np.sqrt(second / (1 - 0.999**step)) + 1e-8)
    names = [*(f"W{i + 1}" for i in range(layers)), *(f"b{i + 1}" for i in range(layers))]
    return dict(zip(names, parts, strict=True))


def pack(arrays: Mapping[str, Any]) -> bytes:
    """Returns the bytes of an .npz file."""
    written = io.BytesIO()
    np.savez(written, **arrays)
    return written.getvalue()


def single(arrays: Mapping[str, Floats]) -> dict[str, NDArray[np.float32]]:
    """Returns the arrays as float32, as frameworks keep them."""
    return {name: array.astype(np.float32) for name, array in arrays.items()}


def make_cart_pole() -> Iterator[Policy]:
    """Linear policies of cart, pole, cart_rate and pole_rate; the force is in N."""
    model = mujoco.MjModel.from_xml_path(str(MODELS / "cart_pole.xml"))
    a, b = linearise(model, np.zeros(1), 0.01)
    gains = -solve_riccati(a, b, np.diag([20.0, 10, 1, 1]), np.diag([0.1])).T
    other = -solve_riccati(a, b, np.diag([40.0, 5, 5, 1]), np.diag([0.2])).T
    mean, std = np.array([0.9, 0.1, 0.3, 0]), np.array([2, 3, 1.5, 4.0])
    degrees = np.array([[1], [np.degrees(1)], [1], [np.degrees(1)]])
    yield "correct__riccati", {"W1": gains}, ""
    yield "correct__another_weighting", single({"W1": other}), ""
    yield "correct__with_mean_and_std", {"W1": gains * std[:, None], "mean": 0 * mean, "std": std}, ""
    yield "incorrect__sign", {"W1": -gains}, "The controls have the wrong sign"
    yield "incorrect__order_of_gymnasium", {"W1": gains[[0, 2, 1, 3]]}, "cart, cart_rate, pole, pole_rate, in this order"
    yield "incorrect__velocities_first", {"W1": gains[[2, 3, 0, 1]]}, "cart_rate, pole_rate, cart, pole, in this order"
    yield "incorrect__degrees", {"W1": gains / degrees}, "angles in degrees"
    yield "incorrect__sign_of_the_rate", {"W1": gains * [[1], [1], [1], [-1]]}, "pole_rate with the opposite sign"
    yield "incorrect__transposed", {"W1": gains.T}, "W1 has the shape (1, 4) instead of (4, 1): it is transposed"
    yield "incorrect__flat", {"W1": gains.ravel()}, "W1 has the shape (4,) instead of (4, 1)"
    yield "incorrect__shares_of_the_range", {"W1": gains / 20}, "Multiply the last layer by half the range"
    yield "incorrect__variance_in_place_of_std", {"W1": gains * std[:, None], "mean": 0 * mean, "std": std**2}, "works with the square root of std"
    yield "incorrect__inverse_of_std", {"W1": gains * std[:, None], "mean": 0 * mean, "std": 1 / std}, "works with 1 / std"
    yield "incorrect__signs_of_the_cart", {"W1": gains * [[-1], [1], [-1], [1]]}, "takes cart and cart_rate with the opposite sign"
    yield "incorrect__normalised_twice", {"W1": gains, "mean": mean, "std": std}, "normalised twice"
    yield "incorrect__without_mean_and_std", {"W1": gains * NORMALISED_CART_POLE[:, None]}, "works on normalised observations"
    yield "incorrect__whole_numbers", {"W1": gains.round().astype(int)}, "W1 holds int64 numbers"
    yield "incorrect__no_names", {"arr_0": gains}, "The arrays have no names"
    yield "incorrect__a_bias_too_many", {"W1": gains, "b1": np.zeros(1)}, "b1 that is not of the declared form"
    yield "incorrect__nan", {"W1": gains * [[1], [np.nan], [1], [1]]}, "W1 holds nan"
    yield "incorrect__zero_std", {"W1": gains, "mean": mean, "std": 0 * std}, "std holds a number that is not above 0"
    yield "partial__bang_bang", {"W1": 1e4 * gains}, "Nearly always the controls are beyond"
    yield "partial__forgets_the_cart", {"W1": gains * [[0], [1], [0], [1]]}, "does not use cart and cart_rate"
    yield "crashed__objects", {"W1": np.array([gains], dtype=object)}, "never read"
    yield "crashed__damaged", pack({"W1": gains})[:-40], "The file is damaged"
    pickled = io.BytesIO()
    with zipfile.ZipFile(pickled, "w") as file:
        file.writestr(zipfile.ZipInfo("archive/data.pkl"), b"\x80\x02}q\x00.")
    yield "crashed__saved_by_torch", pickled.getvalue(), "as torch.save"


NORMALISED_CART_POLE = np.array([0.3, 0.06, 0.6, 0.4])
"""The std by which the training of the cart's lesson divides, which the question knows as well."""


def hold_arm(angle: Floats, rate: Floats, target: Floats, gain: float = 30.0, damping: float = 5.0) -> Floats:
    """Returns the torque [N m] of a spring, a damper and the weight, within the motor's limits, as shares of them."""
    torque = gain * (target - angle) - damping * rate + 9.81 * 0.5 * np.sin(angle)
    return np.clip(torque, -12, 12) / 12


MEAN_ARM, STD_ARM = np.zeros(3), np.array([1.0, 2.5, 0.9])


def make_servo_arm() -> Iterator[Policy]:
    """Networks of two hidden layers of 32 units that imitate a law; the output is a share of the range, behind tanh."""
    rng = np.random.default_rng(1)
    n = 40_000
    target = rng.uniform(-1.6, 1.6, n)
    near = rng.uniform(size=n) < 0.6
    angle = np.where(near, target + rng.normal(0, 0.15, n), rng.uniform(-2, 2, n))
    rate = np.where(near, rng.normal(0, 0.7, n), rng.uniform(-8, 8, n) * rng.uniform(size=n))
    seen = (np.stack([angle, rate, target], axis=1) - MEAN_ARM) / STD_ARM
    wanted = hold_arm(angle, rate, target)[:, None]
    norm = {"mean": MEAN_ARM, "std": STD_ARM}
    right = imitate(seen, wanted, (32, 32), "tanh")
    both = single({**right, **norm})
    yield "correct__imitates_a_law", both, ""
    folded = {**right, "W1": right["W1"] / STD_ARM[:, None]}
    yield "correct__std_within_the_first_layer", folded, ""
    yield "incorrect__trained_with_relu", single({**imitate(seen, wanted, (32, 32), "relu"), **norm}), "works with relu between its layers"
    yield "incorrect__square_layer_transposed", {**both, "W2": both["W2"].T}, "works with W2 transposed"
    yield "partial__reshaped", {**both, "W1": both["W1"].T.reshape(3, 32), "W2": both["W2"].T}, "A reshape has mixed up the numbers of W1"
    yield "incorrect__without_mean_and_std", single(right), "works on normalised observations"
    linear = imitate(seen, wanted, (32, 32), "tanh", squashed=False)
    yield "correct__trained_without_the_tanh", single({**linear, **norm}), ""
    newtons = {**linear, **norm, "W3": 12 * linear["W3"], "b3": 12 * linear["b3"]}
    yield "incorrect__newton_metres", single(newtons), "works if its outputs are controls"
    yield "incorrect__untrained", {name: 0 * array + (name == "std") for name, array in both.items()}, "The controls never change"
    yield "incorrect__full_units", {**both, "W1": 0 * both["W1"], "b1": 0 * both["b1"] + 30}, "hidden layer 1 stays at the end"
    stiff = imitate(seen, hold_arm(angle, rate, target, 120, 45)[:, None], (32, 32), "tanh")
    yield "incorrect__trained_at_a_shorter_period", single({**stiff, **norm}), "works if it is asked more often"
    order = [2, 0, 1]
    first = {**both, "W1": both["W1"][order], "std": both["std"][order]}
    yield "incorrect__target_first", first, "target, angle, rate, in this order"
    always = seen * [1, 1, 0] + np.array([0, 0, 1.2]) / STD_ARM
    blind = imitate(always, hold_arm(angle, rate, 0 * target + 1.2)[:, None], (32, 32), "tanh")
    yield "partial__trained_on_one_target", single({**blind, **norm}), "works in the episodes that you see, not in the hidden ones"
    names = {f"net.{2 * i}.{kind}": both[f"{short}{i + 1}"].T for i in range(3) for short, kind in (("W", "weight"), ("b", "bias"))}
    yield "incorrect__names_of_a_state_dict", names, "The file has no array W1"
    yield "incorrect__other_width", {**both, "W1": both["W1"][:, :16], "b1": both["b1"][:16]}, "its layer has 16 units, and 32 are declared"
    huge = {name: (array * 1e6).astype(np.float16) if name == "W3" else array for name, array in both.items()}
    yield "incorrect__float16_overflows", huge, "float16 ends at 65504"


def make_drone() -> Iterator[Policy]:
    """Networks of one hidden layer of twelve ReLU, which hold a linear law exactly: x = relu(x) - relu(-x). The outputs
    are shares of the range of each rotor."""
    model = mujoco.MjModel.from_xml_path(str(MODELS / "planar_drone.xml"))
    hover = 9.81 / 2
    a, b = linearise(model, np.full(2, hover), 0.02)
    gains = -solve_riccati(a, b, np.diag([10.0, 10, 5, 1, 1, 0.3]), np.diag([0.1, 0.1])).T
    share, bias = gains / 5, np.full(2, (hover - 5) / 5)
    both = np.hstack([np.eye(6), -np.eye(6)])
    right = {"W1": both, "b1": np.zeros(12), "W2": np.vstack([share, -share]), "b2": bias}
    yield "correct__riccati_in_relu", right, ""
    yield "correct__float16", {name: array.astype(np.float16) for name, array in right.items()}, ""
    yield "incorrect__rotors_exchanged", {**right, "W2": right["W2"][:, ::-1], "b2": bias}, "works once its controls are exchanged"
    yield "incorrect__newtons", {**right, "W2": 5 * right["W2"], "b2": np.full(2, hover)}, "works if its outputs are controls"
    unit = {**right, "W2": right["W2"] / 2, "b2": np.full(2, hover / 10)}
    yield "incorrect__shares_from_zero", unit, "shares of the actuators' ranges from 0 to 1"
    yield "incorrect__full_weight_on_each", {**right, "b2": np.full(2, (2 * hover - 5) / 5)}, "is divided by 2, the number of actuators"
    yield "incorrect__dead_units", {**right, "b1": np.full(12, -50.0)}, "(dead units)"
    yield "incorrect__sign_of_the_tilt", {**right, "W1": both * np.array([1, 1, -1, 1, 1, 1])[:, None]}, "takes tilt with the opposite sign"
    beside = [0, 3, 1, 4, 2, 5]
    yield "incorrect__rates_beside_positions", {**right, "W1": both[beside]}, "x, x_rate, z, z_rate, tilt, tilt_rate, in this order"
    leaky = {**right, "W2": np.vstack([share, -share]) / 1.01}
    yield "correct__leaky_by_a_percent", leaky, ""
    yield "incorrect__without_rates", {**right, "W1": both * np.array([1, 1, 1, 0, 0, 0])[:, None]}, "does not use x_rate and z_rate and tilt_rate"
    yield "incorrect__overflows", {**right, "W1": 1e200 * both, "W2": 1e200 * right["W2"]}, "The outputs of the network overflow"


@np.errstate(over="ignore")
def write_all(root: Path) -> None:
    """Writes every policy, with its diagnosis beside it."""
    makers = {"cart-pole-policy": make_cart_pole, "servo-arm-policy": make_servo_arm, "drone-policy": make_drone}
    for question, make in makers.items():
        folder = root / question
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.iterdir():
            old.unlink()
        for name, arrays, diagnosis in make():
            (folder / f"{name}.npz").write_bytes(arrays if isinstance(arrays, bytes) else pack(arrays))
            if diagnosis:
                (folder / f"{name}.txt").write_text(f"# diagnosis: {diagnosis}\n", encoding="utf-8")


if __name__ == "__main__":
    write_all(HERE)
