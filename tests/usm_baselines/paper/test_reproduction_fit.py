"""The fit aims at the paper's numbers, and an interrupted one goes on."""

import json

import pytest
from usm_baselines.paper import reproduction_fit
from usm_baselines.paper.reproduction_fit import FREEDOM, declared, fit, numbers, residual, seen


def test_the_residual_counts_in_units_of_the_aim():
    assert residual(seen()) == 0.0
    off = {name: list(values) for name, values in seen().items()}
    off["pd settled"][0] *= 1.3
    assert residual(off) == pytest.approx(1.0)
    off["sta operation"][1] /= 2.0
    assert residual(off) == pytest.approx(2.0)


def test_the_declaration_is_within_its_freedom_and_scored_alike_at_both_steps():
    for name, value in declared().items():
        low, high = FREEDOM[name]
        assert low < value < high
    coarse = numbers(declared(), 5e-4, implicit=True)
    fine = numbers(declared(), 5e-5, implicit=True)
    for name in seen():
        assert coarse[name] == pytest.approx(fine[name], rel=0.15)


def cheap_numbers(freedoms, step, implicit):
    """Numbers that are right at a speed of 0.1 m/s and a deflection of 0.5 rad."""
    off = freedoms["speed"] / 0.1, freedoms["deflection"] / 0.5
    return {
        name: [value * factor for value, factor in zip(values, off, strict=True)]
        for name, values in seen().items()
    }


def test_an_interrupted_fit_goes_on_and_ends_as_one_that_was_not(tmp_path, monkeypatch):
    monkeypatch.setattr(reproduction_fit, "numbers", cheap_numbers)

    def interrupt(done, total):
        if done > total / 2:
            raise KeyboardInterrupt

    path = tmp_path / "fit.json"
    with pytest.raises(KeyboardInterrupt):
        fit(path, 9, 1, interrupt)
    evaluated = len(json.loads(path.read_text())["evaluations"])
    fresh = []
    monkeypatch.setattr(
        reproduction_fit,
        "numbers",
        lambda *args, **options: fresh.append(1) or cheap_numbers(*args, **options),
    )
    whole = fit(path, 9, 1, lambda done, total: None)
    assert evaluated > 100
    assert evaluated + len(fresh) - 4 == len(whole.evaluations)  # four for the assessment
    assert whole == fit(tmp_path / "other.json", 9, 2, lambda done, total: None)
    assert whole.fitted.coarse.residual < 0.2 * whole.declared.coarse.residual
