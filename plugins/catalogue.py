"""The built-in plugins. Imports stand inside the hooks and factories, so that listing stays fast."""

from collections.abc import Iterable

from ..core.cell import CELL
from ..core.hooks import Entry, hookimpl


@hookimpl
def bsa_simulators() -> Iterable[Entry]:
    """PyBaMM."""
    from .pybamm.simulators.simulator import PyBaMMOptions, PyBaMMSimulator

    summary = "PyBaMM's SPM, SPMe and DFN, compiled once a run."
    yield Entry("pybamm", PyBaMMSimulator, summary, PyBaMMOptions, api=1, domain=CELL)


@hookimpl
def bsa_feedback_builders() -> Iterable[Entry]:
    """A number, structured features, or a picture as well."""
    from .feedback.overlay import OverlayFeedback
    from .feedback.structured import ScalarFeedback, StructuredFeedback

    yield Entry("scalar", ScalarFeedback, "The total error and nothing else.", api=1)
    yield Entry("structured", StructuredFeedback, "Residuals by signal, features by step, events.", api=1)
    yield Entry("overlay", OverlayFeedback, "Structured feedback with a PNG of simulated over measured.", api=1)


@hookimpl
def bsa_memories() -> Iterable[Entry]:
    """What was tried, what was learnt, what was known."""
    from .memory.history import HistoryMemory, HistoryOptions
    from .memory.priors import Priors
    from .memory.sensitivities import SensitivityMemory

    yield Entry("history", HistoryMemory, "The best and the latest trials, as a table.", HistoryOptions, api=1)
    yield Entry("sensitivities", SensitivityMemory, "What the warm-up showed each parameter to do.", api=1)
    yield Entry("priors", Priors, "Bounds and domain rules, given before the first simulation.", api=1)


@hookimpl
def bsa_warm_ups() -> Iterable[Entry]:
    """Random perturbations, ones that the model proposes, or each parameter alone."""
    from .warm_up.each_alone import EachAloneWarmUp
    from .warm_up.proposed import ProposedWarmUp
    from .warm_up.random import RandomWarmUp, RandomWarmUpOptions

    yield Entry("random", RandomWarmUp, "Random perturbations of all parameters.", RandomWarmUpOptions, api=1)
    yield Entry("proposed", ProposedWarmUp, "Perturbations that the model proposes.", api=1)
    yield Entry("each-alone", EachAloneWarmUp, "Each parameter alone, by a typical step.", api=1)


@hookimpl
def bsa_proposers() -> Iterable[Entry]:
    """Who says what to try next."""
    from .agent.proposer import AgentOptions, AgentProposer
    from .proposers.bayesian import BayesianOptions, BayesianProposer, MultiObjectiveProposer
    from .proposers.cma_es import CmaEsOptions, CmaEsProposer
    from .proposers.default import DefaultProposer
    from .proposers.descent import DescentOptions
    from .proposers.differential_evolution import (
        DifferentialEvolutionOptions,
        DifferentialEvolutionProposer,
        WeightedDifferentialEvolutionOptions,
        WeightedDifferentialEvolutionProposer,
    )
    from .proposers.hybrid.proposer import HybridOptions, HybridProposer
    from .proposers.least_squares import LeastSquaresProposer
    from .proposers.random import RandomOptions, RandomProposer
    from .proposers.staged import StagedOptions, StagedProposer

    yield Entry(
        "agent",
        AgentProposer,
        "Asks the backend for a hypothesis and a change.",
        AgentOptions,
        api=1,
        asks_model=True,
    )
    yield Entry(
        "hybrid",
        HybridProposer,
        "The agent picks what to try beside a least-squares fit.",
        HybridOptions,
        api=1,
        asks_model=True,
    )
    yield Entry(
        "least-squares", LeastSquaresProposer, "Levenberg-Marquardt on step-aligned residuals.", DescentOptions, api=1
    )
    yield Entry(
        "staged", StagedProposer, "Least squares in stages, each on the data that inform it.", StagedOptions, api=1
    )
    yield Entry("default", DefaultProposer, "No fit: the parameter set as it is.", api=1)
    yield Entry("random", RandomProposer, "Random search over the whole space.", RandomOptions, api=1)
    yield Entry("bo", BayesianProposer, "Bayesian optimisation by Ax (extra: bo).", BayesianOptions, api=1)
    yield Entry("cma-es", CmaEsProposer, "CMA-ES by pycma.", CmaEsOptions, api=1)
    yield Entry(
        "de", DifferentialEvolutionProposer, "Differential evolution by SciPy.", DifferentialEvolutionOptions, api=1
    )
    yield Entry(
        "weighted-de",
        WeightedDifferentialEvolutionProposer,
        "Differential evolution on a weighted sum of the errors of charge, current and voltage.",
        WeightedDifferentialEvolutionOptions,
        api=1,
    )
    yield Entry(
        "qnehvi", MultiObjectiveProposer, "Multi-objective optimisation by Ax (extra: bo).", BayesianOptions, api=1
    )


@hookimpl
def bsa_readers() -> Iterable[Entry]:
    """Files of cyclers."""
    from .readers.arbin_res import ArbinRes
    from .readers.arbin_xlsx import ArbinXlsx
    from .readers.bdf import BdfCsv, BdfParquet
    from .readers.biologic import BioLogicMpr
    from .readers.digatron_csv import DigatronCsv
    from .readers.generic_csv import GenericCsv
    from .readers.impedance import ImpedanceCsv, ImpedanceOptions
    from .readers.maccor import MaccorText
    from .readers.matlab import MatlabMat, MatlabOptions
    from .readers.neware import Neware

    yield Entry(
        "bdf-csv", lambda options: BdfCsv(), "Battery Data Format: Test Time / s, Voltage / V, Current / A.", api=1
    )
    yield Entry("bdf-parquet", lambda options: BdfParquet(), "Battery Data Format as Parquet (extra: readers).", api=1)
    yield Entry("arbin-xlsx", lambda options: ArbinXlsx(), "Arbin workbooks, or a folder of them.", api=1)
    yield Entry("arbin-res", lambda options: ArbinRes(), "Arbin .res databases (extra: readers).", api=1)
    yield Entry("digatron-csv", lambda options: DigatronCsv(), "Digatron exports: Prog Time, Voltage, Current.", api=1)
    yield Entry(
        "impedance-csv",
        ImpedanceCsv,
        "Impedance spectra as text: Digatron, BioLogic, any frequency, real and imaginary part.",
        ImpedanceOptions,
        api=1,
    )
    yield Entry("neware", lambda options: Neware(), "Neware .nda and .ndax (extra: readers).", api=1)
    yield Entry("biologic-mpr", lambda options: BioLogicMpr(), "BioLogic .mpr (extra: biologic).", api=1)
    yield Entry("maccor-text", lambda options: MaccorText(), "Maccor exports: Rec#, Amps, Volts, State.", api=1)
    yield Entry("matlab", MatlabMat, "MATLAB .mat: structs of columns, at any depth.", MatlabOptions, api=1)
    yield Entry(
        "generic-csv", lambda options: GenericCsv(), "Any text table (.csv, .txt, .gz), with column mapping.", api=1
    )


@hookimpl
def bsa_effects() -> Iterable[Entry]:
    """What a model may lack; one entry an effect or variant."""
    from .effects.catalogue import entries

    yield from entries()
