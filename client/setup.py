"""Adds the judges of visible cases, modules of the grader itself, to the wheel: as mjgrader/shared/judges.zip, from
which Python imports them. Packed one by one they would make the wheel half as large again."""

import ast
import re
import zipfile
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

GRADER = Path(__file__).resolve().parents[1] / "src" / "grader"

JUDGING = [
    path.relative_to(GRADER).as_posix()
    for kind in ("rk4", "threshold", "values")
    for path in sorted(GRADER.glob(f"exercises/kinds/{kind}/judging/*.py"))
]
NUMERICS = (
    *(
        "integrators",
        "needs",
        "process",
        "recording",
        "rollout",
        "scene",
        "stepping",
        "version",
        "visuals",
        "workspace",
    ),
    *("accuracy/runge_kutta", "stability/horizon", "stability/linear"),
)
SHARED = (
    "exercises/driving/harness.py",
    "exercises/judgement.py",
    *JUDGING,
    *(f"numerics/{name}.py" for name in NUMERICS),
)
"""The only modules of the grader that leave the house: they import NumPy, MuJoCo and each other alone, and hold nothing
secret. tests/client/test_shared.py checks both."""

WITH_HELP = ("__init__.py", "notebook.py")
"""Modules of the client that keep their docstrings, which `help` shows; the others are packed like the shared ones."""

IMPORT = re.compile(r"^(\s*(?:from|import) )grader\.", re.MULTILINE)
EPOCH = (1980, 1, 1, 0, 0, 0)
"""The earliest time that a zip file can hold: the same sources give the same wheel."""

INIT = '''"""The grader's own judges, imported from judges.zip; src/grader of the grader has the comments."""

from pathlib import Path

__path__ = [str(Path(__file__).with_name("judges.zip"))]
'''


def rename(text: str) -> str:
    """Returns a module that imports the shared modules from where they are in the wheel."""
    return IMPORT.sub(r"\1mjgrader.shared.", text)


def strip(text: str) -> str:
    """Returns a module without comments, docstrings and the types of functions, which take half of its size."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.returns = None
        elif isinstance(node, ast.arg):
            node.annotation = None
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            code = [one for one in node.body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))]
            node.body = code or [ast.Pass()]
    text = ast.unparse(tree)
    narrow = re.sub(r"^ +", lambda indent: " " * (len(indent[0]) // 4), text, flags=re.MULTILINE)
    assert ast.dump(ast.parse(narrow)) == ast.dump(ast.parse(text))
    return narrow + "\n"


def list_packed() -> dict[str, str]:
    """Returns the modules in judges.zip by their paths."""
    packed = {name: strip(rename((GRADER / name).read_text(encoding="utf-8"))) for name in SHARED}
    folders = {parent.as_posix() for name in SHARED for parent in Path(name).parents if parent.name}
    return {**{f"{folder}/__init__.py": "" for folder in folders}, **packed}


class WithJudges(build_py):
    """Packs the shared modules, and lets everybody import them from there."""

    def run(self) -> None:
        """Builds the package."""
        super().run()
        package = Path(self.build_lib, "mjgrader")
        for path in package.rglob("*.py"):
            text = rename(path.read_text(encoding="utf-8"))
            path.write_text(text if path.name in WITH_HELP else strip(text), encoding="utf-8")
        shared = package / "shared"
        shared.mkdir(exist_ok=True)
        (shared / "__init__.py").write_text(INIT, encoding="utf-8")
        with zipfile.ZipFile(shared / "judges.zip", "w", zipfile.ZIP_STORED) as packed:  # the wheel compresses it whole
            for name, text in sorted(list_packed().items()):
                packed.writestr(zipfile.ZipInfo(name, EPOCH), text)


if __name__ == "__main__":
    setup(cmdclass={"build_py": WithJudges})
