"""Random kernels: the source of a small module, always the same for a seed.

Every loop ends, every place lies within its vector, a variable is read only where it is set, and
`int` is given what fits into a whole number. All else that an author may write can come up.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from types import ModuleType
from typing import Any

from podusv_cli.core import plugins

HEAD = """
import math
import numpy as np
from podusv_cli.core.kernel import kernel, tail
GAIN, COUNT, PAIR = 1.5, 3, (0.25, -2.0)
"""
KERNELS = {  # their arguments and what they return; one may call those before it
    "whole": ("x, n", "{i}"),
    "truth": ("x, y", "{b}"),
    "one": ("x, y, seen", "{f}"),
    "two": ("x, n, seen", "({f}, {i})"),
    "effect": ("x, seen", ""),
    "watch": ("t, weight, s, row, k, seen", ""),
}
# What may be written for a float f, a whole number i, a truth b, a condition c, a place q, a place
# that is written out p, and a float as a whole number w. "{f}" stands for a float, and so on.
FORMS = {
    "f": "{f} + {f}|{f} - {f}|{f} * {f}|{f} / {f}|{f} % {f}|{f} // {f}|-{f}|+{f}|{f} ** 2|{f} ** 3|"
    "{f} ** 0.5|{f} ** {f}|{i} / {i}|{f} * {i}|{i} - {f}|abs({f})|float({i})|min({f}, {f})|"
    "max({f}, {f}, {i})|math.sin({f})|math.exp({f})|math.sqrt({f})|math.pow({f}, {f})|"
    "math.atan2({f}, {i})|math.tanh({f})|np.floor({f})|math.fabs({f})|({f} if {c} else {f})|"
    "({f} if {c} else {i})|2.0 * ({b})|max({b}, {b})|seen[{p}]|seen[{q}]|tail(seen, {q})[{q}]|"
    "one({f}, {f}, seen)|one({f}, {f}, tail(seen, {q}))|two({f}, {i}, seen)[0]",
    "i": "{i} + {i}|{i} - {i}|{i} * {i}|{i} // {i}|{i} % {i}|-{i}|{w}|min({i}, {i})|max({i}, {i})|"
    "math.floor(min(max({f}, -9.0), 9.0))|({i} if {c} else {i})|int({b})|{i} + ({b})|abs({i})|"
    "whole({f}, {i})|two({f}, {i}, seen)[1]",
    "b": "{f} < {f}|{f} >= {f}|{f} == {f}|{i} != {i}|{i} <= {f}|{f} < {f} <= {f}|({b} and {b})|"
    "({b} or {b})|not {c}|bool({f})|math.isnan({f})|math.isfinite({f})|truth({f}, {f})|"
    "({b} if {c} else {b})|({b}) == ({b})",
    "c": "{b}|{b}|({c} and {c})|({c} or {c})|not ({c})|{f}|{i}",
    "q": "{w} % 4|({i}) % 4|min(max({i}, 0), 4)|whole({f}, {i}) % 3",
    "p": "0|1|2|3|4|COUNT",
    "w": "int(max(-9e9, min({f}, 9e9)))",
}
LEAVES = {
    "f": "0.0|-0.0|0.3|-2.5|1e300|GAIN|PAIR[1]|1|seen[0]|seen[1]|seen[3]",
    "i": "0|2|-3|COUNT|{w}|{w}",
    "b": "{f} < {f}|{f} >= {f}|{f} == {f}|True",
    "c": "{f} < {f}|{f} > 0.0",
    "q": "0|1|2|COUNT|{w} % 4",
    "p": FORMS["p"],
    "w": FORMS["w"],
}
INPUTS = ("s[0]", "s[1]", "s[2]", "k.gain", "k.mode", "row[2]")
STATEMENTS = ["assign"] * 4 + ["store"] * 3 + ["augment", "several", "call"]
BLOCKS = ["branch", "branch", "loop", "rounds", "leaving", "guarded"]


class Writer:
    """Writes one kernel."""

    def __init__(self, seed: int, name: str) -> None:
        """The kernel of this name."""
        self.draw, self.name = random.Random(f"{seed} {name}"), name
        self.arguments, self.result = KERNELS[name]
        given = self.arguments.split(", ")
        self.known = {"f": [n for n in given if n in "xyt"], "i": [n for n in given if n == "n"]}
        self.known["b"] = []
        later = list(KERNELS)[list(KERNELS).index(name) :]
        self.lacks = [f"{other}(" for other in later] + ["seen"] * ("seen" not in given)
        self.count, self.loops = 0, 0
        self.counts: list[str] = []  # of loops, which have to end

    def kernel(self) -> str:
        """All of it."""
        body = self.block(2, self.draw.randint(1, 4))
        if self.name == "watch":
            body += self.lines("seen[5] = {f}", "seen[6] = {i}")
        head = ["@kernel", f"def {self.name}({self.arguments}):"]
        return "\n".join([*head, *(f"    {line}" for line in [*body, *self.leave()])]) + "\n"

    def one_of(self, forms: Sequence[str]) -> str:
        """One of these that may be written in this kernel."""
        return self.draw.choice([f for f in forms if not any(word in f for word in self.lacks)])

    def lines(self, *forms: str) -> list[str]:
        """Lines with their gaps filled in."""
        return [self.filled(form, 2) for form in forms]

    def filled(self, form: str, depth: int) -> str:
        for kind in "wfibcqp":
            while (gap := f"{{{kind}}}") in form:
                form = form.replace(gap, self.expression(kind, depth), 1)
        return form

    def expression(self, kind: str, depth: int) -> str:
        """An expression of this kind, with at most so many others in each other."""
        if self.draw.random() < depth / 3:
            return self.filled(self.one_of(FORMS[kind].split("|")), depth - 1)
        known = [*self.known.get(kind, []), *INPUTS * (self.name == "watch" and kind == "f")]
        return self.filled(self.one_of(known * 3 + LEAVES[kind].split("|")), 0)

    def new(self, kind: str) -> str:
        self.count += 1
        return f"{kind}{self.count}"

    def set(self, kind: str) -> str:
        """A variable that is set here, and known from now on."""
        own = [name for name in self.known[kind] if name not in self.counts]
        name = self.draw.choice(own) if own and self.draw.random() < 0.6 else self.new(kind)
        self.known[kind] += [name] * (name not in self.known[kind])
        return name

    def block(self, depth: int, count: int) -> list[str]:
        """So many statements, with at most so many blocks in each other."""
        kinds = self.draw.choices(STATEMENTS + BLOCKS * (depth > 0), k=count)
        return [line for kind in kinds for line in getattr(self, kind)(depth)]

    def inside(self, depth: int) -> list[str]:
        """A block whose variables are not known after it."""
        before = {kind: list(names) for kind, names in self.known.items()}
        made = self.block(depth - 1, self.draw.randint(1, 3))
        self.known = before
        return [f"    {line}" for line in made]

    def assign(self, depth: int) -> list[str]:
        kind, other = self.draw.choice(["ff", "ff", "fi", "ii", "bb"])
        value = self.lines(f"{{{other}}}")[0]
        return [f"{self.set(kind)} = {value}"]

    def store(self, depth: int) -> list[str]:
        places = ["seen[{p}]", "seen[{q}]", "tail(seen, {q})[{q}]", *self.known["f"]]
        return self.lines(f"{self.one_of(places)} = {self.draw.choice(['{f}', '{i}', '{b}'])}")

    def augment(self, depth: int) -> list[str]:
        place = self.one_of(["seen[{p}]", "seen[{q}]", *self.known["f"]])
        return self.lines(f"{place} {self.draw.choice(['+=', '-=', '*=', '/='])} {{f}}")

    def several(self, depth: int) -> list[str]:
        """Two variables at once, or a variable and a place."""
        if self.draw.random() < 0.5:
            value = self.filled(self.one_of(["{f}, {i}", "two({f}, {i}, seen)"]), 1)
            return [f"{self.set('f')}, {self.set('i')} = {value}"]
        value, place = self.lines("{f}", self.one_of(["seen[1]", "seen[{q}]", *self.known["f"]]))
        return [f"{self.set('f')} = {place} = {value}"]

    def call(self, depth: int) -> list[str]:
        return self.lines(
            self.one_of(["effect({f}, seen)", "effect({f}, tail(seen, {q}))", "pass"])
        )

    def leave(self) -> list[str]:
        return self.lines(f"return {self.result}".rstrip())

    def branch(self, depth: int) -> list[str]:
        made = [*self.lines("if {c}:"), *self.inside(depth)]
        for word in self.draw.choice([[], ["else:"], ["elif {c}:"], ["elif {c}:", "else:"]]):
            made += [*self.lines(word), *self.inside(depth)]
        return made

    def leaving(self, depth: int) -> list[str]:
        """An early return, or what ends a round of a loop."""
        words = ["return", *["break", "continue"] * 2 * (self.loops > 0)]
        made, word = [*self.lines("if {c}:"), *self.inside(1)], self.draw.choice(words)
        return [*made, f"    {self.leave()[0] if word == 'return' else word}"]

    def guarded(self, depth: int) -> list[str]:
        """A variable that is set anew in a branch, and read under the same condition."""
        flag, name = self.new("flag"), self.new("some")
        first = self.lines(
            f"{flag} = {{b}}", f"{name} = {{f}}", f"if {flag}:", f"    {name} = {{f}}"
        )
        place = self.one_of(["seen[0]", "seen[3]", *self.known["f"]])
        return [*first, *self.block(depth - 1, 1), f"if {flag}:", f"    {place} = {name}"]

    def loop(self, depth: int) -> list[str]:
        i, counts = self.new("i"), ["2", "COUNT", *["int(k.mode)"] * (self.name == "watch")]
        return [f"for {i} in range({self.draw.choice(counts)}):", *self.rest(depth, i)]

    def rounds(self, depth: int) -> list[str]:
        """A `while`, which ends after some rounds at the latest."""
        n = self.new("n")
        head = [f"{n} = 0", *self.lines(f"while {n} < 4 and {{c}}:"), f"    {n} += 1"]
        return [*head, *self.rest(depth, n)]

    def rest(self, depth: int, count: str) -> list[str]:
        """What a loop with this count does."""
        before, self.loops = self.known["i"], self.loops + 1
        self.known["i"] = [*before, count]
        self.counts.append(count)
        made = self.inside(depth)
        self.known["i"], self.loops = before, self.loops - 1
        return made


def text(seed: int) -> str:
    """The source of a module with a kernel `watch`, and those that it may call."""
    return HEAD + "\n".join(Writer(seed, name).kernel() for name in KERNELS)


def watching(seed: int) -> Any:
    """Its kernel `watch`, as if the module had been loaded from a file."""
    made, written = ModuleType(f"random_{seed}"), text(seed)
    vars(made)[plugins.TEXT] = written
    exec(compile(written, f"random_{seed}.py", "exec"), vars(made))  # noqa: S102
    return made.watch
