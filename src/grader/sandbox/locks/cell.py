"""Finds the files that the bubblewrap cell around the zygote needs, and builds the command of the cell."""

import importlib.util
import os
import re
import shutil
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from grader.errors import JailRefused
from grader.sandbox.policy import ENVIRONMENT, MODELS, PACKAGES, SCRATCH

INSIDE = Path(__file__).parents[1] / "inside"
NULL = Path("/dev/null")
LIB = Path("/lib")
# -I would ignore PYTHONHASHSEED; these leave out the working directory, the user's packages, bytecode and `site`.
ISOLATED = ("-P", "-s", "-S", "-B")


@dataclass(frozen=True)
class Runtime:
    """The files that the cell needs to run the interpreter of this process."""

    executable: Path
    binds: tuple[Path, ...]  # files and folders, readable
    links: tuple[tuple[str, Path], ...]  # (target, link) of a merged /usr and of the dynamic loader
    packages: tuple[Path, ...]  # folders for sys.path
    library: Path | None = None  # MuJoCo's: the zygote loads it, and no script may map it again

    @property
    def roots(self) -> tuple[Path, ...]:
        """Return what holds all that is bound: a folder of packages has nothing else in the cell."""
        return _drop_nested((*self.binds, *self.packages))

    @property
    def readable(self) -> tuple[Path, ...]:
        """Return what a script may read: everything that is bound, except MuJoCo's library."""
        return tuple(entry for path in self.binds for entry in _list_visible(path, self.library))


def find_runtime() -> Runtime:
    """Find the interpreter, its library, MuJoCo's and NumPy's folder, and the system's shared libraries. Raises
    JailRefused if MuJoCo, NumPy or the C library cannot be found."""
    executable = Path(getattr(sys, "_base_executable", sys.executable)).resolve()
    packages = tuple(dict.fromkeys(_find_package_folder(name) for name in ("mujoco", "numpy")))
    library = {Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib")}
    if sys.prefix != sys.base_prefix:  # sysconfig answers for the base interpreter, wherever it is
        library = {path for path in library if path.is_relative_to(Path(sys.base_prefix).resolve())} or library
    # Where programs name their loader: x86-64 in /lib64, aarch64 in /lib, often as a link.
    loaders = sorted(LIB.resolve().glob("ld-linux-*"))
    wanted = [
        executable,
        *_find_shared_python(),
        *library,
        *_find_packages(packages),
        *_find_system_libraries(),
        *loaders,
        *_find_zone_data(),
    ]
    links = tuple((str(link.readlink()), link) for link in (LIB, Path("/lib64"), *loaders) if link.is_symlink())
    binds = [path for path in wanted if path.exists() and not path.is_symlink()]
    mujoco = next(_find_package_folder("mujoco").glob("mujoco/libmujoco.so*"), None)
    return Runtime(executable, _drop_nested(binds), links, packages, mujoco)


def build_cell_command(runtime: Runtime, models: Path, inside: Path, control: int) -> list[str]:
    """Return the command that starts the zygote in its cell. As root the cell has no user namespace: the zygote becomes
    the user nobody, and gets the two capabilities that this takes. Raises JailRefused without bubblewrap."""
    program = shutil.which("bwrap")
    if program is None:
        raise JailRefused("bubblewrap (bwrap) is not installed.")
    if os.geteuid() == 0:
        user = ["--cap-add", "CAP_SETUID", "--cap-add", "CAP_SETGID"]
    else:
        user = ["--unshare-user"]
    fences = (
        "--unshare-pid --unshare-net --unshare-ipc --unshare-uts --unshare-cgroup-try --die-with-parent --new-session"
    )
    command = [program, *fences.split(), "--hostname", "cell", "--cap-drop", "ALL", *user, "--proc", "/proc"]
    entries = [NULL, *runtime.binds, *(link for _, link in runtime.links), Path(SCRATCH, "x"), Path("/cell/inside")]
    for folder in _list_parents(entries):
        command += ["--perms", "0755", "--dir", str(folder)]  # bubblewrap's own default lets only root through
    for target, link in runtime.links:
        command += ["--symlink", target, str(link)]
    command += ["--dev-bind", str(NULL), str(NULL)]
    for path in runtime.binds:
        command += ["--ro-bind", str(path), str(path)]
    command += ["--ro-bind", str(models.resolve()), MODELS, "--ro-bind", str(inside.resolve()), "/cell/inside"]
    command += ["--remount-ro", "/", "--chdir", "/", "--clearenv"]
    for name, value in ENVIRONMENT.items():
        command += ["--setenv", name, value]
    return [*command, *build_zygote_command(runtime, "/cell", control)]


def build_zygote_command(runtime: Runtime, folder: str, control: int) -> list[str]:
    """Return the command of the zygote itself; `folder` holds the package `inside`."""
    paths = [folder, *map(str, runtime.packages)]
    code = f"import sys; sys.path += {paths!r}; from inside import zygote; zygote.main()"
    return [str(runtime.executable), *ISOLATED, "-c", code, str(control)]


def _find_package_folder(name: str) -> Path:
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        raise JailRefused(f"The package {name} is not installed.")
    return Path(spec.origin).resolve().parent.parent


def _find_shared_python() -> list[Path]:
    if not sysconfig.get_config_var("Py_ENABLE_SHARED"):
        return []
    folder, name = sysconfig.get_config_var("LIBDIR"), sysconfig.get_config_var("INSTSONAME")
    return [(Path(str(folder)) / str(name)).resolve()] if folder and name else []


def _find_system_libraries() -> list[Path]:
    """Returns the folder of the C library and of its loader."""
    mapped = re.findall(
        r"\s(/\S*/(?:libc\.so\.6|libc-[\d.]+\.so|ld-linux\S*))$", Path("/proc/self/maps").read_text(), re.M
    )
    if not mapped:
        raise JailRefused("The C library of this machine cannot be found.")
    return list({Path(path).resolve().parent for path in mapped} | {Path("/lib64"), Path("/usr/lib64")})


def _find_zone_data() -> list[Path]:
    return [Path("/usr/share/zoneinfo")]


def _drop_nested(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Leave out paths under other paths; keep the order, in which they are bound."""
    unique = sorted(set(paths))
    return tuple(p for p in unique if not any(p != other and p.is_relative_to(other) for other in unique))


def _list_parents(paths: Iterable[Path]) -> list[Path]:
    """Returns every folder above the paths, the outer ones first."""
    return sorted({folder for path in paths for folder in path.parents if folder != Path("/")})


def _find_packages(folders: Iterable[Path]) -> Iterator[Path]:
    """Find PACKAGES, with the libraries that wheels bring along beside them, and what tells their versions."""
    for folder in folders:
        for package in PACKAGES:
            yield from (folder / package, folder / f"{package}.libs")
            yield from folder.glob(f"{package}-*.dist-info/METADATA")


def _list_visible(path: Path, hidden: Path | None) -> list[Path]:
    """Return the path itself; if the hidden file lies beneath it, its entries without that."""
    if path == hidden:
        return []
    if hidden is None or not hidden.is_relative_to(path):
        return [path]
    return [deeper for entry in path.iterdir() for deeper in _list_visible(entry, hidden)]
