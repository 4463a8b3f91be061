"""Reads the learner's file of arrays, or an ONNX file, in the jail. The text of `onnx` and of this file is that of the
driver: NumPy and the standard library alone. Names, types and shapes are read from the headers before any array is, so
that nothing is unpickled, and no array is larger than the declared one. It submits all numbers in one row, in the
declared order, or a sentence on what is wrong with the file."""

import io
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np

Refused: type[Exception] = globals().get("Refused", Exception)
read_chain: Callable[[bytes, int], Any] = globals().get("read_chain", lambda *_: None)
"""Names of `onnx`, whose text comes before this one in the jail."""

NAMES_SHOWN, CHARS_SHOWN = 6, 40
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
NORMALISATION = ("mean", "std")
CURE = (
    'Send an .npz file: numpy.savez("policy.npz", W1=first.weight.detach().numpy().T, b1=first.bias.detach().numpy(), '
    "...) for PyTorch's layers."
)

Shape = tuple[int, ...]


class WrongFile(Exception):
    """The file cannot be read."""


class WrongArrays(Exception):
    """The arrays of the file are not those of the declared form."""


def trial(functions: Any, inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Submits `weights` (n,), or `refused`, a text, with `unreadable`, whether no array could be read."""
    (entry,) = functions
    try:
        submit("weights", read_file(entry(), {name: tuple(shape) for name, shape in inputs["arrays"].items()}, inputs))
    except (WrongFile, WrongArrays) as error:
        submit("refused", np.frombuffer(str(error).encode(), dtype=np.uint8))
        submit("unreadable", np.array(isinstance(error, WrongFile)))


def read_file(data: bytes, shapes: Mapping[str, Shape], inputs: Mapping[str, Any]) -> Any:
    """Returns the numbers of a file in one row: the declared arrays, then mean and std if it has them. Raises WrongFile
    and WrongArrays."""
    arrays = (read_arrays if data.startswith(b"PK") else read_network)(data, shapes, inputs)
    if "std" in arrays and not (arrays["std"] > 0).all():
        raise WrongArrays("std holds a number that is not above 0: observations are divided by it.")
    return np.concatenate([array.ravel() for array in arrays.values()])


def read_arrays(data: bytes, shapes: Mapping[str, Shape], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the arrays of an .npz file by name. Raises WrongFile and WrongArrays."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as file:
            members = list_members(file)
            check_names([*members], shapes, inputs["observed"])
            optional = dict.fromkeys(NORMALISATION, (inputs["width"],)) if "std" in members else {}
            return {
                name: read_array(file, members[name], name, shape) for name, shape in {**shapes, **optional}.items()
            }
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, RuntimeError, ValueError) as error:
        raise WrongFile(f"The file is damaged, or no .npz file: write it with numpy.savez ({cut(error)}).") from None


def read_network(data: bytes, shapes: Mapping[str, Shape], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the arrays of an ONNX file by name: the declared ones, then mean and std if it has them. Raises WrongFile
    and WrongArrays."""
    try:
        chain = read_chain(data, inputs["width"])
    except Refused as error:
        raise WrongArrays(f"{error}. {CURE}") from None
    except ValueError as error:
        raise WrongFile(f"The file is damaged, or neither .npz nor .onnx ({cut(error)}). {CURE}") from None
    sizes = (inputs["width"], *(layer.weights.shape[1] for layer in chain.layers))
    wanted = (inputs["width"], *(shape[1] for shape in shapes.values() if len(shape) == 2))
    if sizes != wanted:
        raise WrongArrays(f"The layers of the ONNX file have the sizes {show(sizes)} instead of {show(wanted)}.")
    arrays: dict[str, Any] = {}
    for number, (layer, function) in enumerate(zip(chain.layers, inputs["functions"], strict=True), 1):
        if layer.functions != [function] * (function != "linear"):
            has = " and ".join(layer.functions[:4]) or "linear"
            raise WrongArrays(
                f"Layer {number} of the ONNX file ends with {has}, and that of this policy with {function}."
            )
        bias = np.zeros(layer.weights.shape[1]) if layer.bias is None else layer.bias
        if f"b{number}" not in shapes and bias.any():
            raise WrongArrays(f"Layer {number} of the ONNX file has a bias, and this policy has none.")
        arrays |= {f"W{number}": layer.weights, f"b{number}": bias}
    arrays = {name: arrays[name] for name in shapes}
    if chain.mean is not None or chain.std is not None:
        zero, one = np.zeros(inputs["width"]), np.ones(inputs["width"])
        arrays |= {"mean": zero if chain.mean is None else chain.mean, "std": one if chain.std is None else chain.std}
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise WrongArrays(explain_not_finite(name, array))
    return {name: array.astype(np.float64) for name, array in arrays.items()}


def list_members(file: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Returns the members of a file by the names of their arrays. Raises WrongFile."""
    members: dict[str, zipfile.ZipInfo] = {}
    for info in file.infolist():
        name = info.filename
        if name.endswith((".pkl", "/version")):
            raise WrongFile(
                f"The file holds {cut(name)}, as torch.save and pickle write it: to read that runs code, so that it is "
                "never opened. Save the arrays with numpy.savez."
            )
        if not name.endswith(".npy") or info.flag_bits & 1 or info.compress_type not in METHODS:
            raise WrongFile(f"{cut(name)} in the file is no array as numpy.savez writes it.")
        name = name.removesuffix(".npy")
        if name in members:
            raise WrongFile(f"{cut(name)} is in the file twice.")
        members[name] = info
    return members


def check_names(names: Sequence[str], shapes: Mapping[str, Shape], observed: Sequence[str]) -> None:
    """Raises WrongArrays for names that are missing or unknown."""
    wanted = ", ".join(shapes)
    has = ", ".join(cut(name) for name in names[:NAMES_SHOWN]) + ", ..." * (len(names) > NAMES_SHOWN) or "none"
    missing = [name for name in shapes if name not in names]
    if missing and "arr_0" in names:
        raise WrongArrays(f"The arrays have no names: write numpy.savez(file, W1=..., ...). The names are {wanted}.")
    if missing:
        raise WrongArrays(f"The file has no array {missing[0]}. It needs {wanted}; it has {has}.")
    if further := [name for name in names if name not in {*shapes, *NORMALISATION}]:
        raise WrongArrays(
            f"The file has an array {cut(further[0])} that is not of the declared form. It needs {wanted}; mean and "
            "std of the observations are allowed."
        )
    if ("mean" in names) != ("std" in names):
        raise WrongArrays("The file needs both mean and std, or neither.")


def read_array(file: zipfile.ZipFile, info: zipfile.ZipInfo, name: str, wanted: Shape) -> Any:
    """Returns one array, after a look at its header. Raises WrongFile and WrongArrays."""
    with file.open(info) as stream:
        shape, dtype = read_header(stream, name)
    if dtype.hasobject:
        raise WrongFile(
            f"{name} holds Python objects: to read them runs code, so that they are never read. Save plain arrays, "
            f"such as numpy.asarray({name}, dtype=numpy.float32)."
        )
    if dtype.kind != "f":
        raise WrongArrays(
            f"{name} holds {dtype.name} numbers: save floats, such as numpy.asarray({name}, dtype=numpy.float32)."
        )
    if shape != wanted:
        raise WrongArrays(explain_shape(name, shape, wanted))
    with file.open(info) as stream:
        try:
            array = np.lib.format.read_array(stream, allow_pickle=False)
        except ValueError:
            raise WrongFile(f"{name} is shorter than its header says: the file is damaged.") from None
    if not np.isfinite(array).all():
        raise WrongArrays(explain_not_finite(name, array))
    return array.astype(np.float64)


def read_header(stream: Any, name: str) -> tuple[Shape, Any]:
    """Returns shape and type of an array. Raises WrongFile."""
    readers: dict[tuple[int, int], Callable[[BinaryIO], Any]] = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    try:
        shape, _, dtype = readers[np.lib.format.read_magic(stream)](stream)
    except (ValueError, KeyError, TypeError, SyntaxError, RecursionError, tokenize.TokenError):
        raise WrongFile(f"{name} in the file is no array as numpy.savez writes it.") from None
    return tuple(shape), dtype


def explain_shape(name: str, shape: Shape, wanted: Shape) -> str:
    """Returns the sentence on an array of another shape."""
    what = f"{name} has the shape {show(shape)} instead of {show(wanted)}"
    if len(shape) == 2 and shape[::-1] == wanted:
        return (
            f"{what}: it is transposed. PyTorch's nn.Linear keeps its weight as (out, in), and here x @ {name} is "
            "computed: save layer.weight.T."
        )
    if len(wanted) == 1 and max(shape, default=1) == wanted[0] == np.prod(shape[:8], dtype=float):
        return f"{what}: save it flat, with .ravel()."
    if name == "W1" and len(shape) == 2 and shape[1:] == wanted[1:]:
        return f"{what}: this policy takes {shape[0]} observations, and there are {wanted[0]}."
    if len(shape) == 2 and len(wanted) == 2 and shape[0] == wanted[0]:
        return f"{what}: its layer has {shape[1]} units, and {wanted[1]} are declared."
    return f"{what}."


def explain_not_finite(name: str, array: Any) -> str:
    """Returns the sentence on an array with nan or inf."""
    if np.isnan(array).any():
        return f"{name} holds nan (not a number): the training diverged, or divided by 0. Check before you save."
    if array.dtype == np.float16:
        return f"{name} holds inf: float16 ends at 65504. Save it as float32."
    return f"{name} holds inf: the training diverged. Check before you save."


def show(shape: Shape) -> str:
    """Returns a shape in round brackets, cut after four sizes."""
    sizes = ", ".join(map(cut, shape[:4])) + ", ..." * (len(shape) > 4)
    return f"({sizes},)" if len(shape) == 1 else f"({sizes})"


def cut(text: object) -> str:
    """Returns a text of the file in a line that is safe to show."""
    safe = "".join(char if char.isprintable() else "?" for char in str(text))
    return safe if len(safe) <= CHARS_SHOWN else f"{safe[:CHARS_SHOWN]}..."
