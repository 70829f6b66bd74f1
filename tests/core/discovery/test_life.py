"""Mechanisms of ageing, fitted to lives made on paper."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.ageing.changes import Changes
from bsa.core.comparison.residuals import residuals
from bsa.core.discovery.life import LifeEngine
from bsa.core.effect import Effect, EffectParameter
from bsa.core.parameters import Candidate
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.trajectory import FloatArray, Trajectory
from bsa_toy_life import life, life_task

CYCLES, FITTED = 200, 120


def mechanism(name: str) -> Effect:
    return Effect(name, name, "", (EffectParameter("lost", "", 0.0, 0.0, 0.8, 1e-3),), "", "", ages=True)


ROOT, LINEAR, LATE, GAIN = (mechanism(name) for name in ("root", "linear", "late", "gain"))
BENDS = {"root": 0.5, "linear": 1.0, "late": 3.0}


def discovery(lost: float, bend: float, max_effects: int = 1, idle: float = 0.0) -> LifeEngine:
    """``idle`` is a factor of the residuals at strengths below 1e-3: the integrator's error."""
    task = life_task(life(CYCLES, lost, bend))

    def simulate(effects: tuple[Effect, ...], candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        found = []
        for candidate in candidates:
            lost = [(effect.values(candidate)["lost"], effect) for effect in effects]
            # What makes a cell gain capacity is never the mechanism.
            lives = [life(CYCLES, -a if e is GAIN else a, BENDS.get(e.name, 1.0)) for a, e in lost]
            shown = lives[0] if lives else life(CYCLES, 0.0)
            seen = residuals(task, Outcome((ExperimentRun(shown),)))
            small = 0.0 < sum(candidate.values()) < 1e-3
            found.append(seen if seen is None else (1.0 + idle * small) * seen)
        return found

    return LifeEngine(simulate, Changes(task, FITTED), max_effects=max_effects)


def both(lost: Mapping[Effect, float]) -> Trajectory:
    """A life that loses capacity by several laws."""
    none = life(CYCLES, 0.0)
    share = np.arange(CYCLES) / (CYCLES - 1)
    gone = sum((lost[effect] * share ** BENDS[effect.name] for effect in lost), np.zeros(CYCLES))
    assert none.cycle_table is not None
    table = replace(none.cycle_table, capacity_ah=1.0 - gone, resistance_ohm=0.02 * (1.0 + gone))
    return replace(none, cycle_table=table)


@pytest.mark.parametrize("hidden", [ROOT, LINEAR, LATE])
def test_the_mechanism_is_named_with_its_strength(hidden: Effect) -> None:
    found = discovery(0.1, BENDS[hidden.name]).run([ROOT, LINEAR, LATE])
    assert (found.verdict, found.best.names) == ("effect-found", (hidden.name,))
    assert found.best.estimates[hidden.key][0].value == pytest.approx(0.1, rel=0.02)
    assert found.best.held_rmse_v < 0.1 * found.base.held_rmse_v


def test_a_mechanism_that_is_not_in_the_catalogue_is_not_given_anothers_name() -> None:
    found = discovery(0.3, BENDS["late"]).run([ROOT])
    assert found.verdict == "unexplained"
    assert "squared misfit" in found.reason or "later cycles" in found.reason


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
    assert len(tried) < 30


def test_strengths_below_the_usual_are_tried_where_the_least_of_those_is_far_too_large() -> None:
    effect = replace(LINEAR, parameters=(EffectParameter("lost", "", 0.0, 0.0, 1e4, 10.0),))
    engine = discovery(0.1, 1.0)
    simulate = engine._simulate
    # The usual strengths lose all of the capacity and more.
    engine._simulate = lambda effects, candidates: [
        None if max(one.values(), default=0.0) >= 1.0 else simulate(effects, [one])[0] for one in candidates
    ]
    found = engine.run([effect])
    assert (found.verdict, found.best.names) == ("effect-found", ("linear",))
    assert found.best.estimates[effect.key][0].value == pytest.approx(0.1, rel=0.02)


def test_strengths_that_do_not_show_are_no_reason_to_stop() -> None:
    found = discovery(0.1, 1.0, idle=1e-3).run([LINEAR])
    assert (found.verdict, found.best.names) == ("effect-found", ("linear",))


def test_a_second_mechanism_that_makes_up_for_the_first_ones_law_is_not_named() -> None:
    found = discovery(0.1, 0.8, max_effects=2).run([LINEAR, LATE, ROOT])
    assert all(len(one.effects) == 1 or one.adequacy.adequate for one in found.explanations)
    assert len(found.best.names) == 1


def test_two_mechanisms_with_which_nothing_is_left_are_named() -> None:
    """The table loses by both laws, and so does the pair that is simulated."""
    hidden = {ROOT: 0.2, LATE: 0.2}
    record = both(hidden)
    task = life_task(record)

    def simulate(effects: tuple[Effect, ...], candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        lives = [both({effect: effect.values(one)["lost"] for effect in effects}) for one in candidates]
        return [residuals(task, Outcome((ExperimentRun(shown),))) for shown in lives]

    found = LifeEngine(simulate, Changes(task, FITTED)).run([ROOT, LINEAR, LATE])
    assert (found.verdict, found.best.names) == ("effect-found", ("late", "root"))


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_second_parameter_starts_where_it_is_known_or_at_its_own_value(scale: str) -> None:
    bend = EffectParameter("bend", "", 1.0, 0.3, 4.0, 1.0, scale)  # type: ignore[arg-type]
    bent = replace(LINEAR, name="bent", parameters=(*LINEAR.parameters, bend))
    hidden = {"bent: lost": 0.2, "bent: bend": 3.0, "root: lost": 0.2}
    task = life_task(lost_by(hidden))
    asked: list[Candidate] = []

    def simulate(effects: tuple[Effect, ...], candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        asked.extend(one for one in candidates if len(effects) == 2)
        return [residuals(task, Outcome((ExperimentRun(lost_by(one)),))) for one in candidates]

    found = LifeEngine(simulate, Changes(task, FITTED)).run([bent, ROOT])
    single = next(one for one in found.explanations if one.names == ("bent",))
    assert asked[0]["bent: bend"] == pytest.approx(single.fit.candidate["bent: bend"]) != 1.0
    assert found.best.names == ("bent", "root")
    assert found.best.fit.candidate["bent: bend"] == pytest.approx(3.0, rel=0.15)


def lost_by(lost: Candidate) -> Trajectory:
    """A life that loses capacity by two laws, of one of which the bend is a parameter."""
    none = life(CYCLES, 0.0)
    share = np.arange(CYCLES) / (CYCLES - 1)
    gone = lost.get("bent: lost", 0.0) * share ** lost.get("bent: bend", 1.0) + lost.get("root: lost", 0.0) * share**0.5
    assert none.cycle_table is not None
    table = replace(none.cycle_table, capacity_ah=1.0 - gone, resistance_ohm=0.02 * (1.0 + gone))
    return replace(none, cycle_table=table)


def test_each_mechanism_has_a_line_and_a_place_among_those_considered() -> None:
    lines: list[str] = []
    engine = discovery(0.1, 1.0)
    engine._progress._say = lines.append
    found = engine.run([LINEAR, GAIN])
    assert [line.split(":")[0].strip() for line in lines] == ["linear", "gain"]
    assert lines[0].endswith(" (1 of 2)")
    assert "comes no nearer" in lines[1]
    assert [(one.effect.name, bool(one.lacks)) for one in found.nominations] == [("linear", False), ("gain", True)]


@pytest.mark.slow
def test_fits_side_by_side_find_the_same() -> None:
    one, two = (discovery(0.1, 1.0) for _ in range(2))
    two._at_once = 2
    alone, together = (engine.run([ROOT, LINEAR, LATE]) for engine in (one, two))
    assert [e.label for e in alone.explanations] == [e.label for e in together.explanations]
    assert alone.best.fit.candidate == together.best.fit.candidate


def test_a_life_that_nothing_explains_is_told_what_was_tried_and_how_near_it_came() -> None:
    variant = replace(GAIN, name="root", variant="backwards")
    near = discovery(0.3, BENDS["late"]).run([ROOT, variant])
    assert near.verdict == "unexplained"
    assert "none explains how the cell changes from cycle to cycle: root (backwards);" in near.reason
    assert "; the nearest of them, root: " in near.reason
    assert near.reason.endswith("too far off for one to show")
    far = discovery(0.1, 1.0).run([GAIN])
    assert "at no strength does one of them come nearer to the life than the cell without ageing" in far.reason
    assert discovery(0.1, 1.0).run([]).reason.startswith("no mechanism could be tried")


def test_a_mechanism_that_cannot_be_simulated_is_not_said_to_come_no_nearer() -> None:
    engine = discovery(0.1, 1.0)
    simulate = engine._simulate
    engine._simulate = lambda effects, candidates: [None] if GAIN in effects else simulate(effects, candidates)
    found = engine.run([GAIN])
    assert found.nominations[0].lacks == "could not be simulated, at any strength that was tried"
    assert "none of them could be simulated and fitted" in found.reason


def test_a_dispersion_counts_the_means_that_were_taken_off() -> None:
    best = discovery(0.1, BENDS["late"]).run([ROOT]).best
    freedom = len(best.errors) - len(best.fit.space)
    taken_off = Changes(life_task(life(CYCLES, 0.1, BENDS["late"])), FITTED).common
    assert 0 < taken_off < freedom
    expected = replace(best, taken_off=0).dispersion(0.0) * freedom / (freedom - taken_off)
    assert best.dispersion(0.0) == pytest.approx(expected)
    assert expected > 1.0
