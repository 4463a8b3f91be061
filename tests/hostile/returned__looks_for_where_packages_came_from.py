"""Notes of the installer, in which the paths of the checkout and of the author's home lie, and packages of others."""

import pathlib
import numpy

packages = pathlib.Path(numpy.__file__).parents[1]
assert not [*packages.glob("*.pth"), *packages.glob("*/direct_url.json"), *packages.glob("__editable__*")]
assert not [*packages.glob("grader*"), *packages.glob("fastapi*")]
