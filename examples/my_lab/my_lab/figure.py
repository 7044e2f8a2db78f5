"""A figure of the line-of-sight law's errors."""

from podusv_cli.plugin import figure, signals_over_time

track_error = figure(
    "track_error", caption="Cross-track error and course of the line-of-sight law", signals=("e_y",)
)(signals_over_time("e_y", "chi_d"))
