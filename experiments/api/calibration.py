"""``bsa.calibrate``: what ``bsa run`` does."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...core.printable import shown
from ...core.reading.part_of_file import file_and_part
from ...core.run.allowance import Allowance
from ...core.run.journal import FILE_NAME, check_run_folder
from ...core.task import Task
from ..checked_options import as_mapping, as_names, simulation_workers
from ..read_options import readings
from ..request import RunRequest, run_request
from ..run_settings import backend_options, given_budgets
from ..task_request import CellChoice
from .calibration_result import CalibrationResult
from .given_parameters import Parameters, given_parameters
from .measured import Data, records_of


def calibrate(
    data: Task | Data | Sequence[Data] | None = None,
    *,
    holdout: Data | Sequence[Data] | None = None,
    column: Mapping[str, str | int] | None = None,
    unit: Mapping[str, str] | None = None,
    current_sign: str = "charge-positive",
    constant_current: float | Sequence[float] | None = None,
    current_offset: float | Sequence[float] | None = None,
    voltage_lag: float | Sequence[float] | None = None,
    where: Mapping[str, Any] | None = None,
    cycles: str | int | None = None,
    sheet: str | None = None,
    reader: str | None = None,
    reader_option: Mapping[str, Any] | None = None,
    temperature: float | Sequence[float] | None = None,
    initial_soc: float | Sequence[float] | None = None,
    parameters: Parameters | None = None,
    start_from: str | Path | None = None,
    model: str | None = None,
    options: Mapping[str, Any] | None = None,
    search: str | Mapping[str, Any] | None = None,
    effect: str | Sequence[str] | None = None,
    ocp: str = "",
    scale: bool = True,
    as_protocol: bool = False,
    life: bool = False,
    fit_cycles: int | None = None,
    weight: str | None = None,
    scaffold: str | None = None,
    rounds: int | None = None,
    warmup: int = 20,
    simulations: int | None = None,
    seed: int = 1234,
    workers: int = 0,
    settings: Mapping[str, Any] | None = None,
    identifiability: bool = True,
    backend: str = "rules",
    via: str | None = None,
    base_url: str | None = None,
    exchange: str | Path | None = None,
    backend_option: Mapping[str, Any] | None = None,
    votes: int = 1,
    review: bool = False,
    max_tokens: int | None = None,
    max_cost: float | None = None,
    out: str | Path | None = None,
    resume: str | Path | None = None,
    progress: bool = True,
) -> CalibrationResult:
    """Calibrate a model. The options are those of ``bsa run``, with mappings for ``KEY=VALUE``.

    Parameters
    ----------
    data : path, pandas.DataFrame, Record, Task or str, or a sequence of records
        What is matched: records with ``parameters``; or a task, the name of one (``"demo"``, ``"regular-134"``) or the
        path of a task file. Left out, the demonstration.
    holdout : one or several records, optional
        Records that are not fitted: the best candidate is scored on them after the search.
    initial_soc : float or sequence of float, optional
        State of charge at which all fitted records, or each, start; where it is searched too, the search starts there.
    reader, reader_option, column, unit, current_sign, where, cycles, sheet
        How files and DataFrames are read; see `read_record`.
    constant_current, current_offset, voltage_lag, temperature : float or sequence of float, optional
        As there; one for all records, or one for each in their order, held-out ones last.
    parameters : str, path or pybamm.ParameterValues
        What to start from; records need it or ``start_from``: a PyBaMM parameter set, by name or loaded, a BPX or JSON
        file, the folder of a run, whose calibrated cell is then the set, or ``"nearest"``: the installed set whose
        positive electrode a slow record is nearest to.
    start_from : path, optional
        Folder of a run: begin at its best values, with its parameters, model, options and search where nothing else is
        given.
    model : {'DFN', 'SPMe', 'SPM'}, optional
        The model, for records; by default DFN.
    options : mapping, optional
        PyBaMM's model options.
    search : str or mapping, optional
        What is searched: a preset, a YAML file, or parameters with bounds as such a file has them; by default
        ``"cell"``, of a life ``"life"``.
    effect : str or sequence of str, optional
        Effect, or effects, of the catalogue to add to the model, ``"ocp-hysteresis"``; their parameters are searched.
    ocp : str
        Whose open-circuit potentials to start from: ``"nearest"`` of the installed sets to the records' slow charge or
        discharge, a set, or two with a slash between them for the negative and the positive electrode; by default
        those of ``parameters``.
    scale : bool
        Whether the electrode area is scaled to the records' capacity.
    as_protocol : bool
        Whether the steps that the records show are simulated, in place of their measured current: charge and current
        are then judged too.
    life : bool
        Whether the records are those of whole lives: capacity by cycle, and the curves of a few cycles, are compared.
    fit_cycles : int, optional
        Of a life fit only the first cycles, and forecast the later ones; implies ``life``.
    weight : {'uniform', 'robust'}, optional
        How errors count: ``"robust"`` keeps what is far off for a short time from deciding the fit; by default the
        task's own, ``"uniform"`` for records.
    scaffold : str, optional
        Scaffold by name, or a YAML file. By default ``"staged"`` for measured currents if the parameters have priors
        and no language model is asked, otherwise ``"hybrid"``.
    rounds, warmup, simulations : int
        Search rounds (by default 80), warm-up simulations, and simulations in all (by default 100), at most.
    seed : int
        Seed for everything random.
    workers : int
        Simulations side by side; 0: as many as cores, 4 at most.
    settings : mapping, optional
        Any other setting, ``{"patience": 5, "feedback.use": "overlay"}`` (``--set`` of the command).
    identifiability : bool
        Whether to find out, after the search, what the record fixes and what to measure next.
    backend : str
        The language model: a preset or ``"litellm:PROVIDER/MODEL"``; by default ``"rules"``, which needs none.
    via : str, optional
        Route by which a preset is reached, ``"ollama"``; by default the first that is ready.
    base_url : str, optional
        Address of a server for the model.
    exchange : path, optional
        Folder where the backend ``"manual"`` puts prompts and finds replies.
    backend_option : mapping, optional
        Further options of the backend.
    votes : int
        How many independent replies are merged in each round.
    review : bool
        Whether a person accepts, edits or refuses each proposal.
    max_tokens : int, optional
        Tokens of prompts and replies at most; once they are used, the run stops and can be resumed.
    max_cost : float, optional
        Price of the tokens at most, in US dollars; likewise.
    out : path, optional
        Folder of the run; by default ``runs/<task>-<scaffold>-<n>``.
    resume : path, optional
        Go on with the run in this folder, to ``simulations`` and ``rounds`` in all where these are given, and with the
        ``patience`` in ``settings``; all other options but ``workers`` and ``identifiability`` are its own, and so are
        ``max_tokens`` and ``max_cost`` where they are left out.
    progress : bool
        Whether a bar shows how far the search is.

    Returns
    -------
    CalibrationResult
        Also of a run that was interrupted (Ctrl-C), which ``calibrate(resume=folder)`` continues.

    Raises
    ------
    BsaError
        If data, an option or a plugin cannot be used.
    """
    if resume is not None:
        from ..another_budget import asked_anew
        from ..run import read_request

        budget = asked_anew(as_mapping(settings, "--set"), simulations=simulations, rounds=rounds)
        asked = RunRequest(*read_request(Path(resume), budget), Path(resume))
    else:
        if out is not None:
            check_run_folder(Path(out))
        reads = readings(
            column,
            unit,
            current_sign,
            constant_current,
            current_offset,
            voltage_lag,
            where,
            cycles,
            sheet,
            reader,
            reader_option,
            temperature,
        )
        budgets = given_budgets(rounds=rounds, warm_up=warmup, simulations=simulations, seed=seed)
        reached = backend_options(
            as_mapping(backend_option, "--backend-option"),
            via=via,
            base_url=base_url,
            exchange=exchange if exchange is None else Path(exchange),
            votes=votes if votes > 1 else None,
            review=review or None,
        )
        named = _task_named(data)
        given: Any = data if named is None else None
        asked = run_request(
            named,
            records_of(given, holdout, reads, initial_soc, as_protocol=as_protocol, life=life, fit_cycles=fit_cycles),
            CellChoice(
                None if parameters is None else given_parameters(parameters),
                model,
                as_mapping(options, "--options"),
                search,
                ocp,
                scale,
                None if start_from is None else Path(start_from),
                as_names(effect, "--effect"),
            ),
            scaffold,
            backend,
            reached,
            budgets | dict(as_mapping(settings, "--set")),
            weight,
            None if out is None else Path(out),
        )
    return _carried_out(asked, workers, max_tokens, max_cost, identifiability, progress, resume is not None)


def _task_named(data: Any) -> Task | None:
    """The task that is given, or has that name; the demonstration where nothing is given, None where records are."""
    from ..tasks.find import find_task
    from ..tasks.task_file import is_task_file

    if isinstance(data, (str, Path)):
        path, _ = file_and_part(data)
        is_named = is_task_file(path) or (not path.suffix and not path.exists())
        return find_task(str(data)) if is_named else None
    if data is None:
        return find_task("demo")
    return data if isinstance(data, Task) else None


def _carried_out(
    asked: RunRequest,
    workers: int,
    max_tokens: int | None,
    max_cost: float | None,
    identifiability: bool,
    progress: bool,
    resumed: bool,
) -> CalibrationResult:
    from ...backends.opening import ready_backend
    from ..cli.exit_codes import STOPPED
    from ..run import Resources, execute_run, larger_allowance
    from .progress import CalibrationBar

    resources = Resources(simulation_workers(workers), Allowance(max_tokens, max_cost))
    begun = (asked.folder / FILE_NAME).exists()
    backend, may_not_answer = ready_backend(asked.config.backend, asked.config.backend_options, begun)
    if may_not_answer:
        print(f"note: {shown(may_not_answer, 400)}", file=sys.stderr)
    try:
        with CalibrationBar(asked.task, asked.config.simulations, progress) as bar:
            result = execute_run(
                asked.task,
                asked.config,
                asked.folder,
                backend,
                resources,
                bar,
                analysing=identifiability,
                rebudgeted=resumed,
            )
    except KeyboardInterrupt:
        _say_how_to_go_on("interrupted", asked.folder)
        raise  # not even the first simulation was finished: there is no result
    if result.status in STOPPED:
        larger = larger_allowance(asked.folder, result.usage)
        _say_how_to_go_on(shown(result.reason or result.status, 400), asked.folder, shown(result.advice, 600), larger)
    elif result.cut_short:
        _say_how_to_go_on("interrupted; the search is finished, and what follows it is not", asked.folder)
    return CalibrationResult.of(asked.folder)


def _say_how_to_go_on(why: str, folder: Path, advice: str = "", larger: Mapping[str, float] | None = None) -> None:
    given = "".join(f", {key}={value}" for key, value in (larger or {}).items())
    print(f"Stopped: {why}. {advice or f'Go on with: calibrate(resume={str(folder)!r}{given})'}", file=sys.stderr)
