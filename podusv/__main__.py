"""`podusv`, also as `python -m podusv`."""

from podusv_cli.__main__ import main

if __name__ == "__main__":
    main()
