"""Adds the lesson's content to the wheel, as grader/material; pyproject.toml says the rest."""

from pathlib import Path
from shutil import copytree, rmtree

from setuptools import setup
from setuptools.command.build_py import build_py

CONTENT = ("quizzes", "lessons", "models", "reference_solutions")


class WithContent(build_py):
    """Copies the content beside the package's modules; an editable install uses that of the checkout."""

    def run(self) -> None:
        """Builds the package."""
        super().run()
        if self.editable_mode:
            return
        material = Path(self.build_lib, "grader", "material")
        rmtree(material, ignore_errors=True)
        for folder in CONTENT:
            copytree(folder, material / folder)


setup(cmdclass={"build_py": WithContent})
