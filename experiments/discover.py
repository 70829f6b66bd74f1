"""``bsa discover``: from records to what the model is missing."""

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager

from ..core.contracts.requests import Prediction, Simulator
from ..core.discovery.closure import fit_closure
from ..core.discovery.discovery import Discovery
from ..core.discovery.explanation import Explanation
from ..core.discovery.findings import Listener, Nomination
from ..core.discovery.localisation import in_words, localise
from ..core.discovery.next_experiment import propose
from ..core.discovery.ranking import Ranking, ask
from ..core.discovery.record_discovery import RecordDiscovery
from ..core.files import write_text
from ..core.inference.problem import Problem
from ..core.messages import Backend, Outage
from ..core.parameters import ParameterSpace
from ..core.rms import rms
from ..core.run.journal import OpenJournal, spent_s
from ..core.run.recorded import RecordedSimulator
from ..core.run.recording import Recorder
from ..core.task import CellModel
from ..plugins.pybamm.augmentation import effects_in
from ..plugins.pybamm.before_search.radial_mesh import RadialMesh
from ..plugins.pybamm.simulators.effect_simulator_pool import EffectSimulatorPool
from .discovery_case import DiscoverOptions, read_case
from .discovery_journal import RESULT, opened
from .discovery_setup import DiscoverySetup, say_notes, set_up
from .misfit_notes import discovery_notes, potentials_note
from .report.page import FILE_NAME as REPORT
from .told_simulations import ToldSimulations


def discover(options: DiscoverOptions, listener: Listener = lambda text: None, workers: int = 1) -> Discovery:
    """Read the records, find what is missing, and write the answer; or go on where the same discovery was stopped.

    ``listener`` is told in one line what is being done. The answer is also written to ``discovery.json``,
    ``report.html`` and ``augmented_model.py`` in ``options.out``, beside the ``journal.jsonl`` of every simulation and
    reply. Over a life the run of its first cycle is in ``cell``. Raises `BsaError` if a record, a parameter set, an
    effect or an option is wrong, or the folder holds something else.
    """
    carry_out = _over_life if options.life else _on_records
    told = ToldSimulations(listener)
    with opened(options) as journal:
        for text in journal.file.warnings:
            listener(text)
        try:
            discovery, page = carry_out(options, journal, told, workers)
        except (KeyboardInterrupt, Outage) as stopped:
            status = "interrupted" if isinstance(stopped, KeyboardInterrupt) else "outage"
            journal.file.append("end", status=status, wall_s=journal.file.open_s)
            raise
        # Said before it is written: a disk that is full by now must not cost the answer.
        told(f"{discovery.verdict}: {', '.join(discovery.names) or discovery.findings.reason}")
        write_text(options.out / RESULT, json.dumps(discovery.to_json(), indent=1, allow_nan=False))
        write_text(options.out / "augmented_model.py", discovery.script)
        write_text(options.out / REPORT, page)
        journal.file.append("end", status=discovery.verdict, wall_s=discovery.wall_s - spent_s(journal.earlier))
    return discovery


def _over_life(
    options: DiscoverOptions, journal: OpenJournal, listener: ToldSimulations, workers: int
) -> tuple[Discovery, str]:
    """What is found in a life, and its page."""
    from .discover_life import discover_over_life
    from .report.life_discovery import render

    discovery = discover_over_life(options, journal, listener, workers)
    discovery.wall_s = journal.wall_s
    return discovery, render(discovery)


def _on_records(
    options: DiscoverOptions, journal: OpenJournal, listener: ToldSimulations, workers: int
) -> tuple[Discovery, str]:
    """What is found in records, and its page."""
    from .report.discovery import render

    with ExitStack() as held:
        recorder = Recorder(journal.file, journal.earlier, say=listener)

        def make_simulator(cell: CellModel, space: ParameterSpace, mesh: RadialMesh) -> Simulator:
            together = (*case.measured_records, *case.held)
            pool = EffectSimulatorPool(cell, space.targets, mesh.usual, mesh.fine, workers, together)
            inner = held.enter_context(closing(pool))
            return RecordedSimulator(inner, Prediction, journal.file, journal.earlier, listener.simulated)

        case = read_case(options)
        backend = held.enter_context(backend_or_none(options, listener, bool(journal.earlier)))
        setup = set_up(case, options, listener, make_simulator, journal)
        asked = None if backend is None else recorder.around(backend)
        discovery = discover_on(setup, options, listener, asked)
        discovery.wall_s = journal.wall_s
        return discovery, render(discovery, setup.problem)


@contextmanager
def backend_or_none(
    options: DiscoverOptions, listener: Listener = lambda text: None, begun: bool = False
) -> Iterator[Backend | None]:
    """The backend that is asked for, for as long as it is needed, or none where none is named; see `ready_backend`."""
    if options.backend is None:
        yield None
        return
    from ..backends.opening import ready_backend

    found, may_not_answer = ready_backend(options.backend, options.backend_options, begun)
    with closing(found) as backend:
        if may_not_answer:
            listener(may_not_answer)
        yield backend


def discover_on(
    setup: DiscoverySetup,
    options: DiscoverOptions,
    listener: Listener = lambda text: None,
    backend: Backend | None = None,
) -> RecordDiscovery:
    """Find what is missing with all that was set up for it; writes nothing."""
    from ..plugins.pybamm.export.augmented_script import augmented_script

    problem, case = setup.problem, setup.case
    asked: list[Ranking] = []

    def preferred(base: Explanation, nominations: Sequence[Nomination]) -> Sequence[str]:
        words = None if backend is None else setup.discrepancy(base)
        if backend is None or words is None:
            return ()
        possible = [n.effect for n in nominations if not n.lacks]
        asked.append(ask(backend, words, possible, options.seed, options.hide_names))
        listener("backend: " + (", ".join(r.key for r in asked[-1].ranked) or asked[-1].note))
        return [r.key for r in asked[-1].ranked[:3]]

    findings = setup.engine(listener, preferred).run()
    before = problem.errors(_predicted(problem, findings.gap.nearest))
    predictions = _predicted(problem, findings.best)
    noise = findings.gap.noise_v
    places = localise(problem.observations, before, setup.capacity_ah)
    remarks = [
        f"{name}: {soc:.3f}, as fitted, is outside 0 to 1, the window between the parameter set's empty and full cell. "
        "Its potentials or its capacity may not be those of the measured cell."
        for name, soc in findings.best.beyond_window.items()
    ]
    left = problem.errors(predictions)
    considered = {effect.name for effect in (*(n.effect for n in findings.nominations), *effects_in(case.cell))}
    remarks += discovery_notes(problem.observations, left, considered)
    if findings.verdict == "unexplained" and not (case.known_v or case.references):
        remarks.append(potentials_note(options.parameters))
    say_notes(remarks, listener)
    discovery = RecordDiscovery(
        findings,
        places,
        localise(problem.observations, left, setup.capacity_ah),
        in_words(places, noise),
        setup.capacity_ah,
        ranking=asked[-1] if asked else None,
        notes=[*setup.notes, *(f"not built: {name}: {why}" for name, why in setup.simulator.refused.items()), *remarks],
        restricted=options.effects is not None,
    )
    best = findings.best
    others = (one for one in findings.explanations if one is not best and one.names != best.names)
    rival = next(iter([*findings.rivals, *others]), None)
    if findings.verdict in ("ambiguous", "unexplained") and (rival or findings.best.effects):
        # Where one explanation alone came near, the test is whether it is any better than none.
        rival = rival or findings.base
        listener(f"looking for an experiment that separates {findings.best.label} and {rival.label}")
        ambient = case.measured_records[0].ambient_k
        discovery.next_experiment = propose(setup.simulator, findings.best, rival, setup.capacity_ah, noise, ambient)
    if findings.verdict == "unexplained":
        discovery.closure = fit_closure(problem.observations, before, setup.capacity_ah)
    errors = problem.temperature_errors(predictions)
    discovery.temperature_rms_k = {name: rms(error) for name, error in errors.items()}
    discovery.script = augmented_script(
        case.cell, best.effects, best.fit.candidate, setup.space.targets, case.measured_records, setup.mesh.fine
    )
    discovery.simulations = setup.simulator.simulations
    return discovery


def _predicted(problem: Problem, explanation: Explanation) -> list[Prediction]:
    predictions = problem.predict(explanation.effects, explanation.fit.candidate)
    assert predictions is not None, "a fit ends where it could be simulated"
    return predictions
