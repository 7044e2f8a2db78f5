"""The code of podusv. From Python, `import podusv` has its public names.

The authors of plug-ins import `podusv_cli.plugin` and `podusv_cli.testing`.
"""

__version__ = "0.1.0"

# What messages, help and about.json say of a part is its docstring.
WITHOUT_DOCSTRINGS = (
    "python -OO (PYTHONOPTIMIZE=2) removes the docstrings that podusv writes into its results; run "
    "it with -O or without"
)
