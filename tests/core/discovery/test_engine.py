from dataclasses import replace

import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.contracts.requests import Prediction
from bsa.core.discovery.base_fit import calibrate
from bsa.core.discovery.engine import Engine
from bsa.core.discovery.findings import Gap, Nomination, Settings
from bsa.core.discovery.fitting import Fitter
from bsa.core.discovery.nomination import nominate, screen
from bsa.core.discovery.rules import RULES, bic_difference
from bsa.core.discovery.score import Score

CATALOGUE = (toy.QUADRATIC, toy.HYSTERESIS, toy.SLOW)


def run(truth, seed=0, catalogue=CATALOGUE, held=True, **settings):
    rng = np.random.default_rng(seed)
    problem, space = toy.problem(rng, truth, held)
    return Engine(problem, space, catalogue, toy.EVIDENCE, Settings(**settings)).run()


@pytest.mark.parametrize("name", ["quadratic", "sign", "slow"])
@pytest.mark.parametrize("held", [True, False])
def test_the_hidden_effect_is_named_and_measured(name, held):
    findings = run({name: 0.01}, held=held)
    assert findings.verdict == "effect-found", findings.reason
    assert findings.best.names == (name,)
    (estimate,) = findings.best.estimates[name]
    assert estimate.value == pytest.approx(0.01, rel=0.1)
    assert estimate.ci95[0] < 0.01 < estimate.ci95[1] or abs(estimate.value - 0.01) < 5e-4
    assert findings.best.adequacy.adequate
    assert findings.best.held_rmse_v < findings.base.held_rmse_v


@pytest.mark.slow
@pytest.mark.parametrize("lagging", [False, True])
def test_an_effect_that_lagged_in_its_short_fit_is_a_rival_of_what_leaves_noise_only(monkeypatch, lagging):
    """A leak of 118 mA was named for an offset of the current of 118 mA, whose short fit had ended far off."""
    twin, marks = toy.effect("twin"), toy.marks

    def more(*of):
        known = marks(*of)
        return known | {"twin": known["quadratic"], "alike": known["quadratic"] + 0.5 * known["sign"]}

    monkeypatch.setattr(toy, "marks", more)

    def late(fitter, before, nomination, *how):
        screen(fitter, before, nomination, *how)
        if nomination.effect is twin and lagging:
            nomination.screened = fitter.at((twin,), np.append(before.fit.u, 1.0)).fit

    monkeypatch.setattr("bsa.core.discovery.engine.screen", late)
    findings = run({"quadratic": 0.01}, catalogue=(*CATALOGUE, twin, toy.effect("alike")))
    assert findings.verdict == "ambiguous"
    assert findings.best.adequacy.adequate
    assert {findings.best.label, *(rival.label for rival in findings.rivals)} == {toy.QUADRATIC.key, twin.key}


@pytest.mark.slow
def test_an_effect_that_its_score_passed_over_is_a_rival_if_its_sensitivity_is_that_of_the_best_one(monkeypatch):
    """An offset of the current was named for a leak of the same charge, whose score promised nothing."""
    twin, marks = toy.effect("twin"), toy.marks
    monkeypatch.setattr(toy, "marks", lambda *of: (known := marks(*of)) | {"twin": known["quadratic"]})

    def misled(*of):
        found = nominate(*of)
        for nomination in found:
            if nomination.effect is twin:
                nomination.score = Score(0.0, -1.0, 0.0)
        return found

    monkeypatch.setattr("bsa.core.discovery.engine.nominate", misled)
    findings = run({"quadratic": 0.01}, catalogue=(*CATALOGUE, twin))
    assert findings.verdict == "ambiguous"
    assert {findings.best.label, *(rival.label for rival in findings.rivals)} == {toy.QUADRATIC.key, twin.key}


@pytest.mark.slow
def test_an_effect_that_lagged_in_the_second_pass_is_a_rival_too(monkeypatch):
    """Where what the scores favour helps little, all others get a short fit, in which a twin may lag by chance."""
    others = [toy.effect(f"close-{number}") for number in range(5)]
    twin, marks = toy.effect("twin"), toy.marks

    def more(*of):
        known = marks(*of)
        near = {one.name: known["quadratic"] + 0.3 * known["slow"] for one in others}
        return known | near | {"twin": known["quadratic"]}

    def misled(*of):
        found = nominate(*of)
        for nomination in found:
            favoured = nomination.effect is toy.HYSTERESIS
            nomination.score = replace(nomination.score, gain=nomination.score.gain * favoured)
        return found

    def late(fitter, before, nomination, *how):
        screen(fitter, before, nomination, *how)
        if nomination.effect is twin:
            nomination.screened = fitter.at((twin,), np.append(before.fit.u, 1.0)).fit

    monkeypatch.setattr(toy, "marks", more)
    monkeypatch.setattr("bsa.core.discovery.engine.nominate", misled)
    monkeypatch.setattr("bsa.core.discovery.engine.screen", late)
    findings = run({"quadratic": 0.01}, catalogue=(*CATALOGUE, *others, twin))
    assert findings.best.adequacy.adequate
    assert {findings.best.label, *(rival.label for rival in findings.rivals)} == {toy.QUADRATIC.key, twin.key}


class CoarseWhereStrong(toy.ToySimulator):
    """Its usual mesh is off where the effect is strong, as a slow wave along the record, and its fine one is not."""

    def one(self, request):
        size = sum(self.felt(added.values(request.candidate)["size"]) for added in request.effects)
        times = request.moments.time
        coarse = (not request.fine) * 0.3 * size * request.moments.averaged(np.sin(times / 150.0))
        return Prediction(super().one(request).voltage + coarse)


@pytest.mark.slow
def test_the_mesh_is_corrected_where_the_best_explanation_ended():
    """The correction of the base model, which lacks the effect, was none: 3 mV of the mesh counted as a misfit."""
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    problem.simulator = CoarseWhereStrong()
    findings = Engine(problem, space, CATALOGUE, toy.EVIDENCE, Settings(max_effects=1)).run()
    assert findings.best.names == ("sign",)
    assert findings.best.adequacy.adequate
    assert findings.best.estimates["sign"][0].value == pytest.approx(0.01, rel=0.1)
    # What is told of the mesh is what was corrected in the end: of the wave there is nothing at the base model.
    assert findings.mesh_v > 1e-3


@pytest.mark.parametrize("held", [True, False])
def test_an_explanation_keeps_the_errors_of_the_hold_out_records_that_its_own_error_is_of(held):
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01}, held)
    found = Engine(problem, space, CATALOGUE, toy.EVIDENCE)._fitter.at((), np.zeros(len(space)))
    assert [len(error) for error in found.held_errors] == [len(one) for one in problem.held_observations]
    for error, observed in zip(found.held_errors, problem.held_observations, strict=True):
        squares = error**2 + observed.noise**2 * (1 - 1 / observed.count)
        assert np.sqrt(np.average(squares, weights=observed.count)) == pytest.approx(found.held_rmse_v)


@pytest.mark.slow
def test_nothing_is_named_where_nothing_is_missing():
    verdicts = [run({}, seed).verdict for seed in range(25)]
    assert verdicts.count("no-missing-effect") == len(verdicts)


@pytest.mark.slow
def test_a_forbidden_sign_is_not_named():
    findings = run({"sign": -0.01}, catalogue=(toy.HYSTERESIS,))
    assert findings.verdict == "unexplained"


@pytest.mark.slow
def test_progress_never_says_that_no_simulation_is_left_where_more_follow():
    lines = []
    problem, space = toy.problem(np.random.default_rng(0), {"sign": -0.01}, True)
    Engine(problem, space, (toy.HYSTERESIS,), toy.EVIDENCE, listener=lines.append).run()
    (place,) = (number for number, line in enumerate(lines) if line.startswith("none explains enough"))
    assert not any(line.startswith("at most 0 simulations") for line in lines)
    assert lines[place + 1].startswith("at most ")


@pytest.mark.slow
@pytest.mark.parametrize("simulator", [toy.ToySimulator, toy.TwoFidelities])
def test_the_last_that_is_said_of_an_effect_is_what_the_verdict_says(simulator):
    lines = []
    problem, space = toy.problem(np.random.default_rng(0), {"quadratic": 0.01, "sign": 0.015})
    problem.simulator = simulator()
    found = Engine(problem, space, CATALOGUE, toy.EVIDENCE, listener=lines.append).run()
    for explanation in found.explanations:
        line = next(line for line in reversed(lines) if line.startswith(f"  {explanation.label}: "))
        assert f"{1e3 * explanation.rmse_v:.2f} mV, held out {1e3 * explanation.held_rmse_v:.2f} mV" in line
        margin = round(bic_difference(found.base, explanation))
        assert f"by {abs(margin)}" in line
    assert not any("fitting 0 effects" in line for line in lines)
    (base,) = (line for line in lines if line.startswith("base model: "))
    assert "held out" in base


def test_a_likelier_explanation_with_a_larger_error_says_why(monkeypatch):
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    said = []
    fitter = Fitter(problem, space, said.append)
    base = fitted(fitter, (), 2)
    monkeypatch.setattr("bsa.core.discovery.judgement.bic_difference", lambda *pair: 7.4)
    fitter.tell(base, replace(base, rmse_v=2 * base.rmse_v))
    fitter.tell(base, replace(base, rmse_v=base.rmse_v))
    monkeypatch.setattr("bsa.core.discovery.judgement.bic_difference", lambda *pair: -0.3)
    fitter.tell(base, base)
    fitter.tell(base, base, unless_told=True)
    assert len(said) == 3
    assert "BIC better by 7, though the error is larger than the base model's" in said[0]
    assert said[1].endswith("BIC better by 7")
    assert said[2].endswith("BIC as that of the base model")


def test_what_the_parameters_imitate_is_no_missing_effect():
    findings = run({"second-resistance": 0.02}, catalogue=(*CATALOGUE, toy.IMITATED))
    assert findings.verdict == "no-missing-effect"


@pytest.mark.slow
def test_an_effect_of_no_catalogue_stays_unexplained():
    findings = run({"outside": 0.01})
    assert findings.verdict == "unexplained"
    assert not findings.best.adequacy.adequate


@pytest.mark.slow
def test_twins_are_ambiguous():
    class Twins(toy.ToySimulator):
        pass

    twin = toy.effect("sign-twin")
    rng = np.random.default_rng(3)
    problem, space = toy.problem(rng, {"sign": 0.01})
    before = toy.marks

    def with_twin(current, time):
        found = before(current, time)
        return found | {"sign-twin": found["sign"]}

    toy.marks = with_twin
    try:
        findings = Engine(problem, space, (*CATALOGUE, twin), toy.EVIDENCE).run()
    finally:
        toy.marks = before
    assert findings.verdict == "ambiguous"
    assert {findings.best.names[0], findings.rivals[0].names[0]} == {"sign", "sign-twin"}


@pytest.mark.slow
def test_a_pair_is_found():
    findings = run({"quadratic": 0.01, "sign": 0.015})
    assert findings.verdict == "effect-found"
    assert findings.best.names == ("quadratic", "sign")


def test_an_effect_that_a_language_model_names_is_fitted_whatever_its_score():
    problem, space = toy.problem(np.random.default_rng(0), {"quadratic": 0.01})
    silent = toy.effect("fade", lacks=lambda evidence: "needs more cycles")
    asked = []
    engine = Engine(
        problem,
        space,
        (*CATALOGUE, silent),
        toy.EVIDENCE,
        preferred=lambda base, found: asked.append(1) or ["slow", "fade"],
    )
    known = engine.shortlist()
    (slow, fade) = (next(n for n in known.nominations if n.effect.name == name) for name in ("slow", "fade"))
    slow.score = Score(0.0, -1.0, 0.0)
    engine.single_effects(known)
    assert asked
    assert slow.screened is not None
    assert not fade.tried


def test_a_short_fit_that_cannot_be_simulated_was_tried(monkeypatch):
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.02})
    fitter = Fitter(problem, space, print)
    base = fitted(fitter, (), 100)
    (nomination,) = nominate(fitter, base, [toy.HYSTERESIS], toy.EVIDENCE)
    monkeypatch.setattr(fitter, "nearest", lambda *_: None)
    assert not nomination.tried
    screen(fitter, base, nomination)
    assert nomination.tried
    assert nomination.screened is None


def test_where_no_effect_could_be_tried_the_reason_says_so():
    findings = run({"quadratic": 0.01}, catalogue=(toy.effect("sign", lacks=lambda evidence: "needs more cycles"),))
    assert (findings.verdict, findings.reason) == ("unexplained", "no effect could be tried")


@pytest.mark.slow
def test_an_effect_that_the_records_cannot_show_is_left_out():
    silent = toy.effect("sign", lacks=lambda evidence: "needs more cycles")
    findings = run({"quadratic": 0.01}, catalogue=(toy.QUADRATIC, silent))
    (row,) = [n for n in findings.nominations if n.effect.name == "sign"]
    assert row.lacks == "needs more cycles"
    assert row.score is None


def test_a_base_fit_that_stopped_short_is_no_missing_effect(monkeypatch):
    def stopped_short(fitter, seed):
        fit = fitter.fit((), np.array([0.2, 4.9, 4.9]), 4)
        return fitter.explain((), fit)

    monkeypatch.setattr("bsa.core.discovery.engine.calibrate", stopped_short)
    monkeypatch.setattr("bsa.core.discovery.engine.temper", lambda fitter, base: base)
    findings = run({})
    assert findings.verdict == "no-missing-effect"
    assert findings.explanations  # it looked like a discrepancy at first


def decided(problem, base, explanations):
    return RULES.decide(Gap(base, base, problem.noise_v, problem.held_noise_v), explanations)


def fitted(fitter, effects, budget):
    start = np.concatenate([[0.2], np.zeros(len(fitter.space_with(effects)) - 1)])
    fit = fitter.fit(effects, start, budget)
    return fitter.explain(effects, fit)


@pytest.mark.slow
def test_two_effects_that_hide_behind_each_other_are_tried_together_whatever_a_score_promises():
    problem, space = toy.problem(np.random.default_rng(0), {"quadratic": 0.01, "sign": 0.015})
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE)
    known = engine.shortlist()
    for nomination in known.nominations:
        # A score on what one effect leaves promises nothing of the other.
        nomination.sensitivity = 0 * nomination.sensitivity
    singles = [fitted(engine._fitter, (effect,), 100) for effect in (toy.HYSTERESIS, toy.QUADRATIC)]
    assert {pair.names for pair in engine.pair(known.base, singles, known.nominations)} == {("quadratic", "sign")}


def test_beside_a_base_model_that_is_lost_an_effect_starts_from_what_is_believed():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.02})
    fitter = Fitter(problem, space, print)
    lost = fitter.at((), np.array([3.0, 9.0, -9.0]))
    lost.fit = replace(lost.fit, jacobian=np.zeros_like(lost.fit.jacobian))  # says nothing of the way back
    (nomination,) = nominate(fitter, lost, [toy.HYSTERESIS], toy.EVIDENCE)
    screen(fitter, lost, nomination)
    assert nomination.promise < 0.05 * lost.cost


def test_an_effect_that_acts_only_where_it_is_strong_is_scored_there():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    problem.simulator = toy.Unfelt()
    known = Engine(problem, space, CATALOGUE, toy.EVIDENCE).shortlist()
    first, second, *_ = known.nominations
    assert first.effect is toy.HYSTERESIS
    assert first.score.amplitude == pytest.approx(10.0)
    assert first.gain > 0.9 * known.refitted.cost
    assert first.gain > 1.5 * second.gain


@pytest.mark.slow
def test_where_what_the_scores_favour_helps_little_the_others_are_fitted_whatever_their_sign():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.02})
    either = toy.effect("sign", lower=-1.0)
    engine = Engine(problem, space, (toy.QUADRATIC, either), toy.EVIDENCE)
    known = engine.shortlist()
    misled = {"quadratic": (1.0, 5.0), "sign": (-1.0, 0.0)}
    for nomination in known.nominations:
        amplitude, gain = misled[nomination.effect.name]
        nomination.score = replace(nomination.score, amplitude=amplitude, gain=gain)
    best = engine.single_effects(known)[0]
    assert best.names == ("sign",)
    assert best.estimates["sign"][0].value == pytest.approx(0.02, rel=0.1)


def test_a_pair_that_had_more_simulations_than_its_member_is_pruned():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE)
    fitter = Fitter(problem, space, print)
    base = fitted(fitter, (), 100)
    single, pair = fitted(fitter, (toy.HYSTERESIS,), 5), fitted(fitter, (toy.HYSTERESIS, toy.QUADRATIC), 100)
    assert pair.adequacy.adequate
    assert not single.adequacy.adequate
    before = decided(problem, base, [pair, single])
    assert before.verdict != "effect-found" or before.best.names != ("sign",)
    after = decided(problem, base, engine.finish(base, [pair, single]))
    assert after.verdict == "effect-found", after.reason
    assert after.best.names == ("sign",)
    assert [e.label for e in after.explanations].count("sign") == 1


def test_the_best_fit_is_gone_on_with_until_it_has_converged():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE)
    fitter = Fitter(problem, space, print)
    stopped = fitted(fitter, (toy.HYSTERESIS,), 5)
    assert not stopped.fit.converged
    (finished,) = engine.finish(fitted(fitter, (), 100), [stopped])
    assert finished.adequacy.adequate


@pytest.mark.slow
def test_a_fit_that_has_not_converged_goes_on_with_the_slopes_of_the_base_model_however_far_behind_it_is():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    problem.simulator = toy.TwoFidelities()
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE)
    calibrate(engine._fitter)
    problem.misfit_v = 0.0
    leader, stopped = fitted(engine._fitter, (toy.QUADRATIC,), 60), fitted(engine._fitter, (toy.HYSTERESIS,), 5)
    assert not stopped.settled
    assert RULES.behind(stopped, leader) > RULES.far_ahead
    best = engine._fitted_on([leader, stopped], engine._fitter.exact)[0]
    assert best.names == ("sign",)
    assert best.settled


def test_an_effect_that_lost_its_way_is_fitted_from_where_the_best_one_ended():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE)
    fitter = Fitter(problem, space, print)
    base = fitted(fitter, (), 100)
    problem.misfit_v = 0.01  # as when neither has come near yet
    leader, lost = fitted(fitter, (toy.QUADRATIC,), 100), fitted(fitter, (toy.HYSTERESIS,), 5)
    assert leader.fit.converged
    assert not lost.fit.converged
    assert lost.rmse_v > leader.rmse_v
    lost.held_rmse_v = 0.5 * leader.held_rmse_v  # it predicts better than it fits, so it may yet lead
    first, second = engine.finish(base, [leader, lost])
    assert first.names == ("sign",)
    assert first.adequacy.adequate
    assert second is leader


def test_a_temperature_has_its_say_in_who_is_fitted_on():
    cold, warm = Nomination(toy.QUADRATIC), Nomination(toy.HYSTERESIS, temperature_misfit=1.0)
    assert cold.promise == np.inf
    problem, space = toy.problem(np.random.default_rng(0), {})
    fit = fitted(Fitter(problem, space, print), (), 100).fit
    cold.screened, cold.temperature_misfit, warm.screened = fit, 25.0, fit
    assert cold.promise - warm.promise == pytest.approx(24.0)


def test_a_pair_that_predicts_data_not_fitted_no_better_than_one_of_its_members_is_not_named():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01, "quadratic": 0.01})
    fitter = Fitter(problem, space, print)
    base = fitted(fitter, (), 100)
    single, pair = fitted(fitter, (toy.HYSTERESIS,), 100), fitted(fitter, (toy.HYSTERESIS, toy.QUADRATIC), 100)
    assert decided(problem, base, [pair, single]).best.names == ("quadratic", "sign")
    pair.held_rmse_v = single.held_rmse_v
    found = decided(problem, base, [pair, single])
    assert found.verdict == "unexplained" or found.best is single


def test_the_better_half_of_a_pair_with_a_needless_effect_is_fitted_until_it_has_converged():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE)
    fitter = Fitter(problem, space, print)
    base = fitted(fitter, (), 100)
    single, pair = fitted(fitter, (toy.HYSTERESIS,), 5), fitted(fitter, (toy.HYSTERESIS, toy.QUADRATIC), 100)
    assert not single.settled
    pair.held_rmse_v = single.held_rmse_v  # so that it predicts no better
    finished = engine.finish(base, [pair, single])
    (better,) = [e for e in finished if e.label == "sign"]
    assert better.settled
    assert better.adequacy.adequate


def test_a_pair_is_not_tried_where_none_could_predict_better(monkeypatch):
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE)
    fitter = Fitter(problem, space, print)
    base, single = fitted(fitter, (), 100), fitted(fitter, (toy.HYSTERESIS,), 100)
    monkeypatch.setattr(engine, "pair", lambda *_: pytest.fail("a pair was tried"))
    assert single.held_rmse_v < 1.1 * problem.held_noise_v
    assert [e.names for e in engine.add_second(base, [single], [])] == [("sign",)]


@pytest.mark.parametrize(("known_v", "tried"), [(0.0, True), (4e-3, False)])
def test_no_pair_is_tried_where_none_could_leave_noise_only(monkeypatch, known_v, tried):
    problem, space = toy.problem(np.random.default_rng(0), {"outside": 0.01})
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE, Settings(known_v=known_v))
    fitter = Fitter(problem, space, print)
    base, single = fitted(fitter, (), 100), fitted(fitter, (toy.HYSTERESIS,), 100)
    assert not single.adequacy.adequate
    asked = []
    monkeypatch.setattr(engine, "add_second", lambda base, singles, nominations: asked.append(1) or list(singles))
    engine._to_the_end(base, [single], [])
    assert bool(asked) is tried


def test_no_second_effect_is_added_to_one_that_is_no_better_than_the_base_model(monkeypatch):
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01, "quadratic": 0.01})
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE)
    fitter = Fitter(problem, space, print)
    base = fitted(fitter, (), 100)
    good, useless = fitted(fitter, (toy.HYSTERESIS,), 100), fitted(fitter, (toy.SLOW,), 100)
    useless.errors = 2 * base.errors
    paired = []
    monkeypatch.setattr(engine, "pair", lambda base, singles, nominations: paired.extend(singles) or [])
    monkeypatch.setattr(engine._fitter, "again", lambda explanation, budget: explanation)
    engine.add_second(base, [good, useless], [])
    assert paired == [good]


@pytest.mark.slow
@pytest.mark.parametrize("truth", [{}, {"sign": 0.01}, {"outside": 0.01}, {"quadratic": 0.01, "sign": 0.015}])
def test_a_cheaper_model_changes_no_answer_and_does_most_of_the_work(truth):
    problem, space = toy.problem(np.random.default_rng(0), truth)
    problem.simulator = toy.TwoFidelities()
    found, known = Engine(problem, space, CATALOGUE, toy.EVIDENCE).run(), run(truth)
    assert (found.verdict, found.best.names) == (known.verdict, known.best.names)
    assert found.best.rmse_v == pytest.approx(known.best.rmse_v, rel=0.02)
    for key, estimates in known.best.estimates.items() if known.verdict == "effect-found" else ():
        assert found.best.estimates[key][0].value == pytest.approx(estimates[0].value, rel=0.02)
    asked = problem.simulator.asked
    assert asked[False] < asked[True]


def test_an_effect_is_no_worse_than_the_base_model_that_it_contains(monkeypatch):
    problem, space = toy.problem(np.random.default_rng(0), {"outside": 0.004})
    said = []
    engine = Engine(problem, space, CATALOGUE, toy.EVIDENCE, listener=said.append)
    problem.misfit_v = 0.0
    poor, stopped = fitted(engine._fitter, (), 2), fitted(engine._fitter, (toy.QUADRATIC,), 2)
    base, (explanation,) = engine._with_better_base(poor, [stopped])
    assert base.rmse_v < stopped.rmse_v
    # A needless parameter costs the logarithm of the number of observations, and no more.
    assert bic_difference(base, explanation) > -1.1 * np.log(len(base.errors))
    assert bic_difference(base, stopped) < -10.0
    # What is said of an effect is measured against the base model that the verdict is.
    assert [line for line in said if "from where quadratic ended" in line]
    assert said[-1].strip().startswith("quadratic: ")
    # Two errors of a base model, the larger of them the later, are told apart.
    assert not any("likelier" in line for line in said)
    farther_off = replace(base, rmse_v=2 * poor.rmse_v)
    monkeypatch.setattr("bsa.core.discovery.engine.without", lambda fitter, known, best: farther_off)
    engine._fitter.again = lambda explanation, budget: explanation
    engine._with_better_base(poor, [stopped])
    assert any("mV (likelier, though farther off than the first fit" in line for line in said)
