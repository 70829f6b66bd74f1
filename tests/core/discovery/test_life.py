"""Mechanisms of ageing, fitted to lives made on paper."""

from collections.abc import Sequence

import pytest
from bsa.core.ageing.changes import Changes
from bsa.core.discovery.life import LifeDiscovery
from bsa.core.effect import Effect, EffectParameter
from bsa.core.parameters import Candidate
from bsa.core.residuals import residuals
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.trajectory import FloatArray
from bsa_toy_life import life, life_task

CYCLES, FITTED = 200, 120


def mechanism(name: str) -> Effect:
    return Effect(name, name, "", (EffectParameter("lost", "", 0.0, 0.0, 0.8, 1e-3),), "", "", ages=True)


ROOT, LINEAR, LATE = (mechanism(name) for name in ("root", "linear", "late"))
BENDS = {"root": 0.5, "linear": 1.0, "late": 3.0}


def discovery(lost: float, bend: float) -> LifeDiscovery:
    task = life_task(life(CYCLES, lost, bend))

    def simulate(effects: tuple[Effect, ...], candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        found = []
        for candidate in candidates:
            lives = [life(CYCLES, effect.values(candidate)["lost"], BENDS[effect.name]) for effect in effects]
            shown = lives[0] if lives else life(CYCLES, 0.0)
            found.append(residuals(task, Outcome((ExperimentRun(shown),))))
        return found

    return LifeDiscovery(simulate, Changes(task, FITTED), max_effects=1)


@pytest.mark.parametrize("hidden", [ROOT, LINEAR, LATE])
def test_the_mechanism_is_named_with_its_strength(hidden: Effect) -> None:
    found = discovery(0.1, BENDS[hidden.name]).run([ROOT, LINEAR, LATE])
    assert (found.verdict, found.best.names) == ("effect-found", (hidden.name,))
    assert found.best.estimates[hidden.key][0].value == pytest.approx(0.1, rel=0.02)
    assert found.best.held_rmse_v < 0.1 * found.base.held_rmse_v


def test_a_mechanism_that_is_not_in_the_catalogue_is_not_given_anothers_name() -> None:
    found = discovery(0.3, BENDS["late"]).run([ROOT])
    assert found.verdict == "unexplained"
    assert "gap" in found.reason or "data not fitted" in found.reason


def test_a_life_without_ageing_lacks_nothing() -> None:
    found = discovery(0.0, 1.0).run([ROOT])
    assert found.verdict == "no-missing-effect"


def test_strengths_far_beyond_the_best_are_not_simulated() -> None:
    engine = discovery(0.015, 1.0)
    tried: list[float] = []
    simulate = engine._simulate

    def watched(effects: tuple[Effect, ...], candidates: Sequence[Candidate]) -> Sequence[FloatArray | None]:
        tried.extend(value for candidate in candidates for value in candidate.values())
        return simulate(effects, candidates)

    engine._simulate = watched
    assert engine.run([LINEAR]).best.names == ("linear",)
    assert 0.2 < max(tried) < 0.5
    assert engine.simulations < 30
