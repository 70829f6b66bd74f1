"""``bsa.discover``: what ``bsa discover`` does."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.errors import BsaError
from ...core.printable import shown
from ...core.record import Record
from ..checked_options import as_mapping, as_names, simulation_workers
from ..read_options import readings
from ..run_settings import backend_options
from .discovery_result import DiscoveryResult
from .given_parameters import Parameters, given_parameters
from .measured import Data, listed, records_of, source

if TYPE_CHECKING:
    from ..discovery_case import DiscoverOptions


def discover(
    data: Data | Sequence[Data] | None = None,
    *,
    holdout: Data | Sequence[Data] | None = None,
    reference: Data | Sequence[Data] | None = None,
    column: Mapping[str, str | int] | None = None,
    unit: Mapping[str, str] | None = None,
    where: Mapping[str, Any] | None = None,
    current_sign: str = "charge-positive",
    constant_current: float | Sequence[float] | None = None,
    current_offset: float | Sequence[float] | None = None,
    voltage_lag: float | Sequence[float] | None = None,
    cycles: str | int | None = None,
    sheet: str | None = None,
    reader: str | None = None,
    reader_option: Mapping[str, Any] | None = None,
    temperature: float | Sequence[float] | None = None,
    initial_soc: float | Sequence[float] | None = None,
    life: bool = False,
    fit_cycles: int | None = None,
    parameters: Parameters | None = None,
    model: str = "DFN",
    options: Mapping[str, Any] | None = None,
    override: Mapping[str, float] | None = None,
    search: str | Mapping[str, Any] | None = None,
    scale: bool = True,
    effect: str | Sequence[str] | None = None,
    effect_option: Mapping[str, Any] | None = None,
    max_effects: int = 2,
    seed: int = 0,
    workers: int = 0,
    backend: str | None = None,
    via: str | None = None,
    base_url: str | None = None,
    backend_option: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    resume: str | Path | None = None,
    progress: bool = True,
) -> DiscoveryResult:
    """Find what a model is missing. The options are those of ``bsa discover``, with mappings for ``KEY=VALUE``.

    Parameters
    ----------
    data, holdout : path, pandas.DataFrame or Record, or a sequence of them
        Records to explain, and records that are predicted and never fitted. DataFrames and records are written into
        the folder ``OUT-records`` beside the discovery's, so that it can be resumed.
    reference : path, pandas.DataFrame or Record, or a sequence of them, optional
        Earlier records of the same tests on the same cell, in the order of ``data`` and ``holdout``, once or several
        times: only what has changed since is to be explained.
    reader, reader_option, column, unit, current_sign, where, cycles, sheet
        How files and DataFrames are read; see `read_record`.
    constant_current, current_offset, voltage_lag, temperature : float or sequence of float, optional
        As there; one for all records, or one for each in their order, held-out ones last.
        Without ``voltage_lag`` a voltage that is written late is kept so, for a time lag is one of the effects;
        `read_record` takes it back unless its ``voltage_lag`` is 0.
    initial_soc : float or sequence of float, optional
        State of charge at which a record starts, and its fit, where its first voltage does not tell; one for all
        fitted records, or one for each in their order.
    life : bool
        Whether the record is a cell's whole life, and what is missing is the mechanism that ages it.
    fit_cycles : int, optional
        Of a life fit the first cycles, and hold out the later ones; 60 % of it by default. Implies ``life``.
    parameters : str, path or pybamm.ParameterValues
        What to start from: a PyBaMM parameter set, by name or loaded, a BPX or JSON file, or the folder of a run.
        Loaded values are written into ``OUT-records``, too.
    model : {'DFN', 'SPMe', 'SPM'}
        Base model.
    options, override : mapping, optional
        PyBaMM's model options, and parameters that are known better.
    search : str or mapping, optional
        What is uncertain about the base model: a preset, a YAML file, or factors by name. Left out,
        ``"unchanged"`` with references, ``"measured"`` where the parameters are those of a run, else ``"all"``.
    scale : bool
        Whether the electrode area is scaled to the records' capacity.
    effect : str or sequence of str, optional
        Effect, or effects, to consider; all, if left out.
    effect_option : mapping, optional
        Options of effects.
    max_effects : int
        Effects in one explanation at most.
    seed, workers : int
        Seed for everything random; simulations side by side (0: as many as cores, 4 at most).
    backend : str, optional
        Language model that ranks effects too.
    via, base_url, backend_option : optional
        How it is reached; see `calibrate`.
    out : path, optional
        Folder of the discovery; by default ``runs/<record>-discover-<n>``.
    resume : path, optional
        Go on with the discovery in this folder; all options but ``workers`` are its own.
    progress : bool
        Whether a bar shows what is being done.

    Returns
    -------
    DiscoveryResult

    Raises
    ------
    BsaError
        If data, an option or an effect cannot be used, or the language model could not be had.
    KeyboardInterrupt
        On Ctrl-C, after saying how ``discover(resume=folder)`` goes on.
    """
    if resume is not None:
        from ..discovery_journal import read_options

        return _carried_out(read_options(Path(resume)), workers, progress)
    if data is None or parameters is None:
        missing = "data" if data is None else "parameters"
        raise BsaError(f"{missing} is missing.", 'discover("RECORD.csv", parameters="Chen2020"), for example.')
    from ..discovery_case import discover_options, reading_of_references

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
    records = records_of(data, holdout, reads, initial_soc, life=life, fit_cycles=fit_cycles)
    references = [
        one if isinstance(one, Record) else source(one, reading_of_references(reads).options, number)
        for number, one in enumerate(listed(reference), 1)
    ]
    asked = discover_options(
        records,
        None if out is None else Path(out),
        parameters=given_parameters(parameters),
        model=model,
        options=dict(as_mapping(options, "--options")),
        overrides=dict(as_mapping(override, "--override")),
        scale=scale,
        search=search,
        reference=references,
        effects=None if effect is None else as_names(effect, "--effect"),
        effect_options=dict(as_mapping(effect_option, "--effect-option")),
        backend=backend,
        backend_options=backend_options(as_mapping(backend_option, "--backend-option"), via=via, base_url=base_url),
        max_effects=max_effects,
        seed=seed,
    )
    return _carried_out(asked, workers, progress)


def _carried_out(asked: DiscoverOptions, workers: int, progress: bool) -> DiscoveryResult:
    from ...core.messages import Outage
    from ..discover import discover as find
    from .progress import DiscoveryBar

    go_on = f"discover(resume={str(asked.out)!r})"
    try:
        with DiscoveryBar(progress) as bar:
            found = find(asked, bar.said, simulation_workers(workers))
    except KeyboardInterrupt:
        print(f"Stopped: interrupted. Go on with: {go_on}", file=sys.stderr)
        raise
    except Outage as outage:
        raise BsaError(f"stopped: {shown(outage, 400)}.", f"go on with {go_on}.") from None
    return DiscoveryResult(asked.out, found)
