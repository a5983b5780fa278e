"""A gain is declared once, and everything else follows from that."""

import copy
import pickle
from typing import Any, NamedTuple

import numba
import pytest
import usm_baselines
from usm_baselines import registry
from usm_baselines.laws.pd import SPACES, PDGains
from usm_baselines.policy import ScriptedPolicy
from usm_baselines.space import Gain, Range, declared, space_of

from usm_gym import suite

OBSERVER = "observer_gain"


class Gains(NamedTuple):
    stiffness: float = Gain(200.0, "N/m", "force over error", tuned=(30.0, 3000.0), positive=True)
    offset: float = Gain(0.0, "N", "constant force")
    damping: float = Gain(6.0, "N s/m", "force over rate", tuned=(1.0, 100.0))


class Spring(ScriptedPolicy):
    Gains = Gains


@numba.njit
def total(gains: Any) -> Any:
    return gains.stiffness + gains.offset + gains.damping


def test_what_follows_from_a_declaration() -> None:
    assert Gains() == (200.0, 0.0, 6.0)
    assert declared(Gains)["damping"].unit == "N s/m"
    assert declared(Gains)["damping"].meaning == "force over rate"
    assert [name for name, gain in declared(Gains).items() if gain.positive] == ["stiffness"]
    spring, damping = Range(30.0, 3000.0, "N/m"), Range(1.0, 100.0, "N s/m")
    assert list(space_of(Gains).items()) == [("stiffness", spring), ("damping", damping)]
    low = Range(0.1, 1.0, "N")
    assert list(space_of(Gains, offset=low)) == ["stiffness", "offset", "damping"]
    assert space_of(Gains, damping=low)["damping"] == low


def test_kernels_copies_and_files_see_plain_numbers() -> None:
    assert total(Gains()) == total(Gains(200.0, 0.0, 6.0)) == 206.0
    assert len(total.signatures) == 1
    for kept in (pickle.loads(pickle.dumps(Gains())), copy.deepcopy(Gains())):
        assert kept == Gains()
        assert {type(gain) for gain in kept} == {float}


def test_a_law_is_registered_with_the_space_that_it_declares(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(registry, "_entries", dict(registry._entries))
    own = {"damping": Range(2.0, 3.0, "N s/m")}
    for id, given in (("declared", None), ("own", own), ("none", {})):
        usm_baselines.register(id, Spring, "a spring", space=given)
    usm_baselines.register("foreign", lambda nominal: Spring(nominal), "a spring")
    assert registry.entry("declared").space == space_of(Gains)
    assert registry.entry("own").space == own
    assert registry.entry("none").space == registry.entry("foreign").space == {}


def test_where_a_value_lies_in_a_range() -> None:
    log, linear = Range(1e-2, 1e2, "1"), Range(0.0, 4.0, "1", log=False)
    for span, middle in ((log, 1.0), (linear, 2.0)):
        values = [span.low, middle, span.high]
        assert [span.at(place) for place in (0.0, 0.5, 1.0)] == pytest.approx(values)
        assert [span.place(value) for value in values] == pytest.approx([0.0, 0.5, 1.0])
        assert span.at(1.0) <= span.high


def test_laws_with_the_same_gain_look_for_it_in_the_same_range() -> None:
    spaces = {id: registry.entry(id).space for id in registry.ids()}
    observers = {id: space["observer_gain"] for id, space in spaces.items() if OBSERVER in space}
    assert len(observers) == 16  # eight laws, told the lag or not
    shared = {OBSERVER, "acceleration_noise", "disturbance_noise", "variation_weight"}
    shared |= {"epsilon", "beta_offset", "omega", "dead_zone", "alpha_start"}
    for gain in shared:
        assert len({space[gain] for space in spaces.values() if gain in space}) == 1, gain
    for id, space in spaces.items():
        assert not {"heading_gain", "k2_exponent"} & set(space), id


def test_laws_on_the_papers_observer_have_its_gains_and_its_exponent() -> None:
    nominal = suite("operation")[0].nominal
    for id in ("sta", "sta-shtessel", "pd", "pd-mass", "pd-observer", "smc", "gsta", "agsta"):
        for name in (id, f"{id}-lag", f"{id}-tuned", f"{id}-lag-tuned"):
            assert usm_baselines.make(name, nominal).gains.k2_exponent == 0.5, name
        assert usm_baselines.make(id, nominal).gains.observer_gain == 55.0, id


def test_the_readings_of_the_pd_controller_are_tuned_in_units_of_their_own() -> None:
    assert [SPACES[reading]["k_p"].unit for reading in SPACES] == ["N/m", "1/s^2", "1/s^2"]
    assert [each for each in PDGains._fields if each in SPACES["observer"]] == list(
        SPACES["observer"]
    )
    assert "surface" not in SPACES["force"]
