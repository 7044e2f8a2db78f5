"""Equations of the pages on a terminal: plain symbols, rows below each other, nothing of LaTeX."""

from __future__ import annotations

import io
import re

import pytest
from command_samples import ROOT

from podusv_cli.workflows import docs
from podusv_cli.workflows.plain_math import BLOCK, plain, plain_blocks

PAGES = [name for name in docs.names() if "$$" in docs.page(name)]


@pytest.mark.parametrize(
    ("latex", "shown"),
    [
        (r"\dot\psi_e = w - r", "psi_e' = w - r"),
        (r"\ddot x_d \cos\psi_d", "x_d'' cos psi_d"),
        (r"\dot{\hat W}_u = \Gamma_u u_e m_{11} \Phi", "W_hat_u' = Gamma_u u_e m11 Phi"),
        (r"\tilde b = \hat b - b_{\max}", "b_tilde = b_hat - b_max"),
        (r"k_{\psi e} \psi_e + \tau_{u,cmd}", "k_psie psi_e + tau_u_cmd"),
        (r"m - X_{\dot u}", "m - X_udot"),
        (r"y_{k+1} - y_k", "y_(k+1) - y_k"),
        (r"\frac{a + b}{2 c} - \frac{1}{2} d", "(a + b)/(2 c) - 1/2 d"),
        (r"\frac{a / b}{c}, \frac{f(x - y)}{|u - v|}", "a / b/c, f(x - y)/|u - v|"),
        (r"\frac{-e}{\frac{a}{b}}", "-e/(a/b)"),
        (r"\sqrt{K_f} + \sqrt{a^2 + b^2}", "sqrt(K_f) + sqrt(a^2 + b^2)"),
        (r"M^{-1} x^2 e^{-2 \lambda t} W^\star R^T", "M^-1 x^2 e^(-2 lambda t) W* R^T"),
        (r"\hat W_u \cdot \Phi, \quad 2 \times 3", "W_hat_u.Phi,   2 x 3"),
        (r"\left(1 - \frac{a}{b}\right)^2 \le \pi", "(1 - a/b)^2 <= pi"),
        (r"\begin{bmatrix} a & 0 \\ 0 & m_{22} \end{bmatrix} \nu", "[[a, 0], [0, m22]] nu"),
        (
            r"\begin{cases} 1 & \text{if } a > 0 \\ 0 & \text{else} \end{cases}",
            "{1 if a > 0; 0 else}",
        ),
        (r"\mathrm{clip}\left(\frac{x}{r}, 1\right)", "clip(x/r, 1)"),
        (r"P \leftarrow P - 0.5 t", "P <- P - 0.5 t"),
    ],
)
def test_an_equation_has_the_symbols_of_logs(latex: str, shown: str) -> None:
    assert plain(latex) == shown


def test_rows_and_columns_stay_beside_each_other() -> None:
    latex = r"""\begin{aligned}
    a &= b, \quad c = d && \text{(1)} \\
    \tau_u &= b \\
    &\quad + c && \text{(2)}
    \end{aligned}"""
    assert plain(latex).splitlines() == ["a     = b,   c = d   (1)", "tau_u = b", "      + c   (2)"]


def test_a_row_that_ends_early_moves_no_column() -> None:
    latex = r"a &= b, & c &= d \\ e &= f + g + h + i"
    assert plain(latex).splitlines() == ["a = b,   c = d", "e = f + g + h + i"]


def test_of_a_page_equations_alone_are_changed() -> None:
    page = "Cost: $5 \\tau_u\n\n$$\n\\tau_u = 1\n$$\n\n- a\n\n  $$\n  x^2\n  $$\n"
    made = "Cost: $5 \\tau_u\n\n```\ntau_u = 1\n```\n\n- a\n\n  ```\n  x^2\n  ```\n"
    assert plain_blocks(page) == made


@pytest.mark.parametrize("name", PAGES)
def test_no_latex_is_left_on_a_page(name: str) -> None:
    for block in BLOCK.finditer(docs.page(name)):
        assert not re.search(r"[\\&$]|[_^]{", plain(block[2]))
    assert "$$" not in docs.readable(name)


def test_scripts_are_one_symbol_or_in_braces() -> None:
    """LaTeX takes one letter below a symbol, a reader of plain letters takes the word."""
    for name in PAGES:
        for block in BLOCK.finditer(docs.page(name)):
            assert not re.search(r"[_^][A-Za-z0-9]{2}", block[2]), (name, block[2])


@pytest.mark.parametrize("name", PAGES)
def test_an_equation_is_mathml_on_the_site(name: str) -> None:
    latex2mathml = pytest.importorskip("docutils.utils.math.latex2mathml")
    for block in BLOCK.finditer(docs.page(name)):
        assert latex2mathml.tex2mathml(block[2], as_block=True).startswith("<math")


def test_pages_with_equations_have_them_in_latex() -> None:
    """Indented lines with a rate or a power are equations in letters."""
    with_equations = {
        "model",
        "laws/velocity_vector",
        "theory",
        "estimators",
        "sea",
        "pod",
        "findings",
    }
    assert with_equations <= set(PAGES)
    left = re.compile(r"^    \w+'* = .*(?:\^2|_\w+ \w+_|cos |sqrt\()", re.M)
    for path in (
        *(ROOT / "docs").glob("*.md"),
        *(ROOT / "docs/laws").glob("*.md"),
        *(ROOT / "results").glob("*.md"),
    ):
        prose = re.sub(r"^ *```.*?^ *```", "", path.read_text(), flags=re.M | re.S)
        assert left.findall(prose) == [], path


def test_a_search_finds_equations_by_the_names_of_logs_and_shows_no_latex() -> None:
    (first, line), *_ = docs.search("Lemma 1 alpha_r psi_e beta_r")
    assert first.page == "model"
    assert "\\" not in line


def test_rendered_for_a_terminal_equations_stay_in_their_lines() -> None:
    from rich.console import Console
    from rich.markdown import Markdown

    console = Console(file=io.StringIO(), width=100)
    console.print(Markdown(docs.readable("model")))
    assert isinstance(console.file, io.StringIO)
    shown = console.file.getvalue()
    assert "alpha_r = w + k_psie psi_e" in shown
    assert "$$" not in shown
