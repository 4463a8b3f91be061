"""Notes of the installer, in which the paths of the checkout and of the author's home lie."""

import pathlib
import numpy
import target

packages = pathlib.Path(numpy.__file__).parents[1]
checkout = target.SOURCE.removesuffix("/src/grader").encode()
for note in [*packages.glob("*.pth"), *packages.glob("*/direct_url.json"), *packages.glob("__editable__*")]:
    assert checkout not in note.read_bytes(), note
raise PermissionError("there is nothing in them")
