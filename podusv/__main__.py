"""`podusv`, also as `python -m podusv`."""

from podusv_cli.__main__ import leave_out_current_folder, main

if __name__ == "__main__":
    leave_out_current_folder()
    main()
