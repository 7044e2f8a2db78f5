"""The law `policy`: its network, what it sees, and the file that its weights come from."""

import base64
import json
import math
from pathlib import Path

import numpy as np
import pytest
from command_samples import ROOT, write
from policy_samples import content, drawn, packed, symmetric

import podusv
from podusv_cli.components.controllers.policy import INPUTS, OBSERVED, Policy, observe
from podusv_cli.components.controllers.policy_weights import PERIOD, tensors
from podusv_cli.core.errors import ScenarioError
from podusv_cli.core.kernel import bundle, call
from podusv_cli.core.phrases import value_text
from podusv_cli.findings.finding import preflight
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.tune import Tune
from podusv_cli.studies.tuning.space import AROUND, gains

STATE = np.array([1.0, -2.0, 0.7, 0.4, -0.1, 0.2])
TARGET = np.array([4.0, 3.0, 0.5, -0.2, 9.0, 9.0])
POLICY = "controller: {kind: policy, weights: sub/policy.safetensors}\n"


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def seen(x, target):
    out = np.zeros(INPUTS)
    observe(np.asarray(x, float), np.asarray(target, float), out)
    return dict(zip(OBSERVED, out, strict=True))


def demand(law, x=STATE, target=TARGET):
    tau, work = np.zeros(2), np.full(law.workspace(), np.nan)
    k, table = bundle(law.constants()), law.table()
    call(law.law, x=x, target=target, k=k, table=table, tau=tau, work=work)
    return tau


def test_a_target_is_seen_from_the_vessel():
    """Rotations as complex numbers, by the library's functions."""
    x, y, psi = STATE[:3]
    turned = complex(math.cos(psi), -math.sin(psi))
    there = complex(TARGET[0] - x, TARGET[1] - y) * turned
    moving = complex(TARGET[2], TARGET[3]) * turned
    angle = math.atan2(there.imag, there.real)
    wanted = [there.real, there.imag, *STATE[3:], moving.real, moving.imag, angle]
    np.testing.assert_allclose(list(seen(STATE, TARGET).values()), wanted, rtol=1e-14)


def test_abeam_to_starboard_is_a_quarter_turn():
    found = seen([0.0, 0.0, math.pi / 2, 0, 0, 0], [-5.0, 0.0, 0, 0, 0, 0])
    assert found["target to starboard [m]"] == pytest.approx(5.0)
    assert found["heading error [rad]"] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("squash", ["tanh", "clip"])
@pytest.mark.parametrize(
    "sizes", [[8, 2], [8, 5, 2], [8, 16, 12, 2], [8, 3, 7, 6, 3, 4, 2]], ids=str
)
def test_a_network_is_what_numpy_makes_of_its_layers(activation, squash, sizes):
    """Widths differ from layer to layer; the kernel has all hidden layers as wide as the widest.

    The layers of the deepest are 0, 2, 4, 6, 8 and 10.
    """
    random = np.random.default_rng(1)
    given = drawn(sizes) | {"mean": random.normal(size=8), "scale": random.uniform(0.5, 4.0, 8)}
    law = Policy(content=content(given), activation=activation, squash=squash, surge=5.0, yaw=3.0)
    between = np.tanh if activation == "tanh" else lambda h: np.maximum(h, 0.0)
    last = np.tanh if squash == "tanh" else lambda h: np.clip(h, -1.0, 1.0)
    layers = len(sizes) - 1
    for _ in range(20):
        x, target = random.normal(0.0, 2.0, 6), random.normal(0.0, 2.0, 6)
        h = (np.array(list(seen(x, target).values())) - given["mean"]) / given["scale"]
        for i in range(layers):
            h = given[f"{2 * i}.weight"] @ h + given[f"{2 * i}.bias"]
            h = between(h) if i < layers - 1 else last(h)
        np.testing.assert_allclose(demand(law, x, target), h * [5.0, 3.0], rtol=0, atol=1e-13)


def test_numbers_of_half_the_bits_are_taken_as_they_are():
    short = drawn([8, 6, 2], dtype=np.float32)
    long = {name: tensor.astype(float) for name, tensor in short.items()}
    np.testing.assert_array_equal(
        demand(Policy(content=content(short))), demand(Policy(content=content(long)))
    )


def test_a_file_of_the_format_s_own_library_is_read():
    library = pytest.importorskip("safetensors.numpy", reason="podusv[gym] is not installed")
    given = drawn([8, 4, 2], dtype=np.float32) | {"mean": np.arange(8.0), "scale": np.ones(8)}
    found, remarks = tensors(library.save(given, metadata={"trained": "by hand"}))
    assert remarks == {"trained": "by hand"}
    assert found.keys() == given.keys()
    for name, tensor in found.items():
        np.testing.assert_array_equal(tensor, given[name])
    np.testing.assert_array_equal(library.load(packed(given))["2.weight"], given["2.weight"])


def test_layers_of_a_module_with_a_name_are_read():
    given = {f"actor.{name}": tensor for name, tensor in drawn([8, 4, 2]).items()}
    np.testing.assert_array_equal(
        demand(Policy(content=content(given))), demand(Policy(content=content(drawn([8, 4, 2]))))
    )


def test_base64_may_have_lines():
    whole = content(drawn([8, 2]))
    lines = "\n".join(whole[i : i + 76] for i in range(0, len(whole), 76))
    np.testing.assert_array_equal(demand(Policy(content=lines)), demand(Policy(content=whole)))


def test_a_search_for_gains_leaves_the_limits_of_the_demand_as_they_are():
    base, law = podusv.load("podusv:mu_2017/corrected.yaml"), Policy(content=content(drawn([8, 2])))
    assert gains(law, "policy", base, Tune(space={AROUND: 4.0})) == ()


def scenario(data: bytes) -> Scenario:
    """A scenario beside a folder with this file of weights."""
    Path("sub").mkdir(exist_ok=True)
    Path("sub/policy.safetensors").write_bytes(data)
    write("a.yaml", "extends: podusv:mu_2017/corrected.yaml\n" + POLICY)
    return podusv.load("a.yaml", {"simulation.duration": 2.0})


def test_a_run_has_its_weights_in_its_folder():
    given = scenario(packed(symmetric()))
    run = podusv.run(given, out="first", figures=False)
    Path("sub/policy.safetensors").unlink()
    again = podusv.run("first/resolved.yaml", out="again", figures=False)
    np.testing.assert_array_equal(run["psi"], again["psi"])
    assert run.scenario.controller.content == base64.b64encode(packed(symmetric())).decode()


PAPER = podusv.load("podusv:laws/learned.yaml").singles()["policy"]


def said(period: float, data: bytes | None = None) -> list[str]:
    """What is said of a policy's period."""
    given = PAPER if data is None else scenario(data)
    found = preflight(podusv.load(given, {"control.period": period}))
    return [finding.text for finding in found if finding.code == "policy-period"]


def test_another_period_than_in_training_is_said():
    assert said(0.2) == []
    (slower,) = said(0.5)
    assert "a demand held for 0.2 s, and here it holds for 0.5 s; set control.period=0.2" in slower
    assert "and here it changes at every step" in said(0.0)[0]
    assert said(0.5, packed(symmetric())) == []  # a file that does not say
    assert said(0.5, packed(symmetric(), **{PERIOD: "0.5"})) == []
    assert said(0.1, packed(symmetric(), **{PERIOD: "0.5"})) != []


def test_a_run_s_folder_keeps_the_period_of_the_training():
    podusv.run(podusv.load(PAPER, {"simulation.duration": 1.0}), out="run", figures=False)
    found = preflight(podusv.load("run/resolved.yaml", {"control.period": 0.1}))
    assert "policy-period" in {finding.code for finding in found}


def test_a_demand_that_holds_longer_than_in_training_costs_the_shipped_policy_its_target():
    """Why it is said, with the numbers of docs/learning.md."""
    page = " ".join((ROOT / "docs/learning.md").read_text().split())
    iae = [
        podusv.simulate(PAPER, {"control.period": period}).metrics["iae"] for period in (0.2, 1.0)
    ]
    assert iae[1] > 3.0 * iae[0]
    assert f"has an IAE of {iae[0]:.0f} m s at that period and of {iae[1]:.0f} at 1 s" in page


def raw(header, numbers=b""):
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + numbers


def test_a_page_shows_the_length_and_the_end_of_weights_in_place_of_them():
    whole = content(symmetric())
    assert value_text(whole) == f"{len(whole):,} characters that end in {whole[-8:]}"
    assert value_text("a" * 64) == "a" * 64  # a digest
    assert value_text("words " * 100) == "words " * 100


def layers(**changes):
    return packed(drawn([8, 4, 2]) | {name.replace("_", "."): t for name, t in changes.items()})


BAD = {
    "no file of the format": (b"hello, this is text", "is no safetensors file"),
    "empty": (b"", "is no safetensors file"),
    "header beyond its end": (bytes([3]) + bytes(7) + b"{}", "is no safetensors file"),
    "numbers of no tensor": (layers() + b"  ", "its header does not fit its numbers; save it aga"),
    "numbers of two tensors": (
        raw(
            {name: {"dtype": "F64", "shape": [2], "data_offsets": [0, 16]} for name in "ab"},
            bytes(16),
        ),
        "its header does not fit its numbers",
    ),
    "cut off": (layers()[:-8], "the file ends within 2.bias"),
    "not finite": (layers(**{"2_bias": np.array([1.0, np.nan])}), "2.bias has a number that is n"),
    "other input": (
        layers(**{"0_weight": np.ones((4, 6))}),
        r"0.weight has shape \(4, 6\), must "
        r"be \(any, 8\): the observation \(target ahead \[m\]",
    ),
    "layers that do not fit": (
        layers(**{"2_weight": np.ones((2, 5))}),
        r"2.weight has shape "
        r"\(2, 5\), must be \(any, 4\): 0 has 4 numbers",
    ),
    "bias": (layers(**{"2_bias": np.ones(3)}), r"2.bias has shape \(3,\), must be \(2,\)"),
    "three outputs": (packed(drawn([8, 4, 3])), "2 has 3 outputs, must have 2: shares of surge"),
    "scale": (packed(drawn([8, 2]) | {"scale": np.zeros(8)}), "scale has a number that is not abo"),
    "mean": (packed(drawn([8, 2]) | {"mean": np.zeros(7)}), r"mean has shape \(7,\), must be \(8,"),
    "half a layer": (packed({"0.weight": np.ones((2, 8))}), "0.bias is missing"),
    "no layers": (packed({"mean": np.ones(8)}), "must have the layers of one network, found none"),
    "nothing between": (
        layers(**{"0_weight": np.zeros((0, 8))}),
        r"0.weight has shape \(0, 8\), which has no num",
    ),
    "no numbers, and huge": (
        raw({"0.weight": {"dtype": "F32", "shape": [2**70, 0], "data_offsets": [0, 0]}}),
        "0.weight has shape .* which has no numbers",
    ),
    "one number in two ways": (layers(**{"00_bias": np.ones(4)}), "'00.bias' is no tensor of a po"),
    "a number of 5000 digits": (layers(**{5000 * "1" + "_bias": np.ones(4)}), "is no tensor of a"),
    "two networks": (
        packed(
            {
                f"{part}.{name}": tensor
                for part in ("pi", "vf")
                for name, tensor in drawn([8, 2]).items()
            }
        ),
        "found 'pi.' and 'vf.'",
    ),
    "a period in words": (
        packed(drawn([8, 2]), **{"control.period": "0.2 s"}),
        "its remark control.period is '0.2 s'; write how long",
    ),
    "no period": (packed(drawn([8, 2]), **{"control.period": "nan"}), "its remark control.period"),
    "something else": (layers(log_std=np.ones(2)), "'log.std' is no tensor of a policy"),
    "whole numbers": (layers(**{"2_bias": np.array([1, 2])}), "2.bias has numbers I64; save it as"),
}


@pytest.mark.parametrize("case", BAD)
def test_weights_that_are_no_policy_are_a_sentence_with_their_place(case):
    data, says = BAD[case]
    with pytest.raises(ScenarioError, match=rf"sub/policy.safetensors: controller.cont.*{says}"):
        scenario(data)


@pytest.mark.parametrize(
    ("controller", "says"),
    [
        ("{kind: policy}", "weights is missing; name a safetensors file"),
        ("{kind: policy, weights: none.safetensors}", "controller.weights: .*none.safetenso"),
        ("{kind: policy, content: '?!'}", "is no base64"),
    ],
)
def test_a_policy_without_weights_is_a_sentence(controller, says):
    write("a.yaml", f"extends: podusv:mu_2017/corrected.yaml\ncontroller: {controller}\n")
    with pytest.raises(ScenarioError, match=says):
        podusv.load("a.yaml")


@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_runs_side_by_side_have_the_bits_of_runs_alone(activation):
    base = podusv.load(scenario(packed(drawn([8, 6, 5, 2]))), {"controller.activation": activation})
    many = {"vessel.m": [20.0, 23.8, 26.0, 30.0], "start.psi": [0.0, 1.0, -2.0, 3.0]}
    alone, side_by_side = (
        podusv.simulate_many(base, many, side_by_side=beside) for beside in (False, True)
    )
    assert alone.equals(side_by_side)
    assert alone["iae"].nunique() == 4
