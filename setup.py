"""Which packages podusv has; scenarios, pages and examples lie beside it in a checkout."""

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

ROOMS = {f"podusv_cli.{room}": room for room in ("configs", "docs", "examples", "results")}


class BuildWithoutScripts(build_py):
    """Takes the files that pyproject.toml names of scenarios, pages, examples, and no script."""

    def find_package_modules(self, package, package_dir):
        """The modules of a package; of a folder of files there are none."""
        return [] if package in ROOMS else super().find_package_modules(package, package_dir)


setup(
    packages=[*find_packages(include=["podusv", "podusv_cli*"]), *ROOMS],
    package_dir=ROOMS,
    cmdclass={"build_py": BuildWithoutScripts},
)
