"""The page of `podusv live`, which asks the server for runs while values are moved."""

from __future__ import annotations

from podusv_cli.pages.page import environment


def live_page(title: str, base: str) -> str:
    """The page as HTML; it sends its requests to addresses under the path `base`."""
    template = environment("podusv_cli.comparison").get_template("live.html.j2")
    return template.render(title=title, base=base)
