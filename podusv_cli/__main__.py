"""`python -m podusv_cli` is `podusv`."""

from podusv_cli.cli import main

main()
