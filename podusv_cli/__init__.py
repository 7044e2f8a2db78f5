"""The code of podusv. From Python, `import podusv` has its public names.

The authors of plug-ins import `podusv_cli.plugin` and `podusv_cli.testing`.
"""

__version__ = "0.1.0"
