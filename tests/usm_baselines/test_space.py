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


def test_the_readings_of_the_pd_controller_are_tuned_in_units_of_their_own() -> None:
    assert [SPACES[reading]["k_p"].unit for reading in SPACES] == ["N/m", "1/s^2", "1/s^2"]
    assert [each for each in PDGains._fields if each in SPACES["observer"]] == list(
        SPACES["observer"]
    )
    assert "surface" not in SPACES["force"]
