"""Where fitted records start: at their rest voltage and a correction that is searched, or at a state of charge."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...core.parameters import Parameter, ParameterSpace
from ...core.target import ALIKE_V, INITIAL_SOC, InitialSoc, InitialVoltage, initial_voltage_name, soc_name
from ...core.task import Experiment


@dataclass(frozen=True)
class KnownStart:
    """What is known of where a record starts."""

    soc: float  # State of charge: as given, or that of the parameter set's cell at the first open-circuit voltage.
    rest_v: float | None = None  # That voltage, V, where the record starts at rest; None where it does not.
    soc_per_v: float = 0.0  # Change of the state of charge with it, 1/V, the larger one of both sides.


def with_searched_starts(
    space: ParameterSpace,
    experiments: Sequence[Experiment],
    starts: Sequence[KnownStart | None],
    given: bool,
    alone: bool,
) -> tuple[ParameterSpace, list[Experiment]]:
    """The space with a parameter for each start that is searched, and the experiments that start by them.

    Records that start at rest start where the cell has their rest voltage, corrected by what is searched. Records
    whose rest voltages are alike share one correction: what an open-circuit curve is off by there is the same for all,
    and with a state of charge each, a fit would make up for wrong losses of its fast records by more or less charge.
    A correction for one rest voltage that a person names stays as it is. On a flat open-circuit curve (LFP), where the
    prior of the correction leaves more of the state of charge open than the prior of the state of charge does, a record
    has the latter. One searched ``Initial state of charge`` becomes one for each such record, and for each that begins
    under load, when it is not alone. Spectra have neither: each is that of the cell at a known voltage.

    Parameters
    ----------
    starts : sequence of KnownStart or None
        Of each experiment; None where nothing is known of it.
    given : bool
        Whether a person said at which state of charge the search starts.
    alone : bool
        Whether there is one experiment, spectra counted.
    """
    at_rest = {
        place: start.rest_v
        for place, start in enumerate(starts)
        if start is not None and start.rest_v is not None and _by_voltage(start, space)
    }
    started = [
        replace(experiment, initial_soc=None, initial_voltage=at_rest[place]) if place in at_rest else experiment
        for place, experiment in enumerate(experiments)
    ]
    templates = [parameter for parameter in space if parameter.target == InitialVoltage()]
    corrections = [one for template in templates for one in _corrections(template, list(at_rest.values()))]
    socs = {
        experiments[place].name: start.soc
        for place, start in enumerate(starts)
        if start is not None and place not in at_rest
    }
    states = _states(space[INITIAL_SOC], socs, given, alone) if INITIAL_SOC in space else []
    if INITIAL_SOC in space and experiments and not any(starts):
        states = [space[INITIAL_SOC]]
    others = [p for p in space if p.name != INITIAL_SOC and p.target != InitialVoltage()]
    return ParameterSpace((*others, *corrections, *states)), started


def _by_voltage(start: KnownStart, space: ParameterSpace) -> bool:
    """Whether a rest voltage says where a record starts, and the state of charge follows."""
    corrections = [parameter for parameter in space if isinstance(parameter.target, InitialVoltage)]
    if not corrections or INITIAL_SOC not in space:
        return bool(corrections)
    return corrections[0].length * start.soc_per_v <= space[INITIAL_SOC].length


def _corrections(template: Parameter, rests: Sequence[float]) -> list[Parameter]:
    """One correction for each group of rest voltages that are alike."""
    found = np.sort(np.array(rests))
    groups = np.split(found, np.flatnonzero(np.diff(found) > ALIKE_V) + 1) if len(found) else []
    middles = [round(float(np.mean(group)), 2) for group in groups]
    return [replace(template, name=initial_voltage_name(near), target=InitialVoltage(near)) for near in middles]


def _states(template: Parameter, socs: dict[str, float], given: bool, alone: bool) -> list[Parameter]:
    """One state of charge for each record that does not start at rest."""
    starts = {name: template.initial if given else template.project(soc) for name, soc in socs.items()}
    if alone:
        return [replace(template, initial=start) for start in starts.values()]
    return [
        replace(template, name=soc_name(name), initial=start, target=InitialSoc(name)) for name, start in starts.items()
    ]
