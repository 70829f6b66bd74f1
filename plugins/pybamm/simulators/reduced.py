"""Reduced protocols: the same steps at lower currents, in PyBaMM's words."""

import re
from dataclasses import replace

from ....core.task import Experiment
from ....core.task_reduction import TaskReduction, shortened

_DRIVEN = re.compile(
    r"^(?P<verb>(?:Charge|Discharge) at )"
    r"(?:C/(?P<hours>[\d.]+)|(?P<value>[\d.]+(?:[eE][+-]?\d+)?) ?(?P<unit>mA|A|mW|W|C)\b)"
)


def reduced(experiment: Experiment, reduction: TaskReduction) -> Experiment:
    """An experiment made easier.

    Currents of constant-current steps are lowered; voltages, rests and the current at which a hold ends stay. A
    measured current is lowered and takes so much longer that the charge is the same; its voltages are then
    those of another test and mean nothing.
    """
    short = shortened(experiment, reduction.cycles)
    if reduction.rate == 1.0 or experiment.is_spectrum:
        return short
    if short.protocol is not None:
        protocol = tuple(tuple(slowed(step, reduction.rate) for step in cycle) for cycle in short.protocol)
        return replace(short, protocol=protocol)
    record = short.target
    slow = record.changed(time=record.time / reduction.rate, current=record.current * reduction.rate)
    return replace(short, target=slow)


def slowed(step: str, rate: float) -> str:
    """A step's words at a share of its current.

    ``"Charge at 2C until 4.2 V"`` becomes ``"Charge at 1C until 4.2 V"`` at half the rate. Steps without a current
    of their own stay as they are, and so do timed ones: half the current for the same time would be half the
    charge, which no longer leads where the protocol goes.
    """
    found = _DRIVEN.match(step)
    if found is None or " for " in step:
        return step
    if found["hours"]:
        number = f"{rate / float(found['hours']):.6g}C"
    else:
        number = f"{rate * float(found['value']):.6g}" + ("C" if found["unit"] == "C" else f" {found['unit']}")
    return found["verb"] + number + step[found.end() :]
