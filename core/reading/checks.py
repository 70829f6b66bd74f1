"""What is done to the samples of any reader: checks, and the few repairs that are safe, each with a note."""

from dataclasses import replace

from scipy.constants import zero_Celsius

from ..errors import BsaError
from ..printable import counted, rounded
from ..record import ReadOptions, Record
from ..segmentation import segment
from ..trajectory import Trajectory, with_offset
from .ambient import HOT_C, ambient_of, measured_ambient
from .charge import charge_notes, counted_charge
from .clock import check_order, with_clock
from .counters import with_switches_counted
from .current_sign import with_sign
from .gaps import with_gaps_noted
from .joining import carried_on
from .lag import without_lag
from .largest_charge import check_charge
from .samples import Samples
from .still_voltage import still_voltage_note
from .temperature import KELVIN, with_usable_temperature
from .time_unit import with_doubtful_unit_noted
from .values import check_range, check_size, check_units, without_glitches, without_missing

MIN_SAMPLES = 10
"""A record with fewer samples says nothing about a cell."""


def to_record(samples: Samples, options: ReadOptions) -> Record:
    """Check the samples, repair what is safe, turn the current and cut the record into steps.

    The options tell the sign of the current, the cycles to keep, and the ambient temperature. Raises `BsaError` naming
    the file, the row or column at fault and its value.
    """
    check_size(samples)
    samples = with_usable_temperature(without_missing(samples))
    _enough(samples)
    check_units(samples)
    check_order(samples)
    samples = with_clock(carried_on(samples, options.join))
    samples = without_glitches(samples)
    check_range(samples)
    samples = with_doubtful_unit_noted(samples)
    check_charge(samples, options)
    samples = with_switches_counted(with_sign(samples, options))
    samples = _without_offset(samples, options.current_offset_a)
    samples = without_lag(samples, options.voltage_lag_s)
    samples = with_gaps_noted(samples)
    _enough(samples)
    # `+ 0.0` turns the -0.0 of a rest into 0.0.
    measured = Trajectory(
        samples.time, samples.current + 0.0, samples.voltage, samples.temperature, inserted=samples.inserted
    )
    extra = samples.extra
    trajectory = segment(measured, extra.get("step"), extra.get("cycle"), extra.get("test"))
    counter = counted_charge(samples, trajectory)
    for note in (*charge_notes(samples, trajectory, counter), *still_voltage_note(samples)):
        samples = samples.noted(note)
    chosen = _selected(trajectory, options, samples.source)
    ambient, words = _ambient(samples, chosen, options)
    if words:
        samples = samples.noted(words)
    if options.ambient_c is None and ambient is not None and ambient - zero_Celsius > HOT_C:
        samples = samples.noted(
            f"the ambient temperature of {ambient - zero_Celsius:.1f} degC is a high one. Is it in degF? Then say "
            "--unit temperature=degF, or with --temperature what it was in degC."
        )
    if ambient is not None and not KELVIN[0] <= ambient <= KELVIN[1]:
        raise BsaError(
            f"{samples.source}: an ambient temperature of {ambient - zero_Celsius:.4g} degC ({ambient:.4g} K) cannot "
            f"be: cells are measured between {KELVIN[0] - zero_Celsius:.0f} and {KELVIN[1] - zero_Celsius:.0f} degC.",
            "say with --temperature what it was, in degC.",
        )
    if options.cycles is not None:
        trajectory = trajectory.slice(chosen.start, chosen.stop)
    charged_s = () if counter is None else tuple(samples.time[counter.silent].tolist())
    return Record(samples.source, trajectory, samples.notes, ambient, charged_s)


def _without_offset(samples: Samples, offset_a: float | None) -> Samples:
    """The samples less what the instrument adds to the current wherever one passes."""
    if not offset_a:
        return samples
    current = with_offset(samples.current, offset_a)  # positive on discharge by now
    return replace(samples, current=current).noted(
        f"{rounded(1e3 * offset_a, 3)} mA are taken off the current, as was asked."
    )


def _enough(samples: Samples) -> None:
    if len(samples) < MIN_SAMPLES:
        raise BsaError(
            f"{samples.source} has only {counted(len(samples), 'sample')}; at least {MIN_SAMPLES} are needed.",
            "is it the stub of a test that was stopped? Give the whole record.",
        )


def _ambient(samples: Samples, chosen: slice, options: ReadOptions) -> tuple[float | None, str]:
    """The temperature around the cell in the chosen samples, K, and a note on where it comes from."""
    if options.ambient_c is not None:
        return options.ambient_c + zero_Celsius, ""
    if "ambient_k" in samples.extra:
        ambient, words = measured_ambient(samples.extra["ambient_k"][chosen], samples.current[chosen])
        if ambient is not None:
            return ambient, words
    if samples.ambient_k is None and samples.temperature is not None:
        return ambient_of(samples.time[chosen], samples.temperature[chosen])
    return samples.ambient_k, ""


def _selected(trajectory: Trajectory, options: ReadOptions, source: str) -> slice:
    """The samples of the cycles that are asked for."""
    if options.cycles is None:
        return slice(0, len(trajectory))
    first, last = options.cycles
    present = trajectory.cycles
    if first not in present or last not in present:
        raise BsaError(
            f"{source} has cycles {present[0]} to {present[-1]}, not {first} to {last}.",
            "choose among them with --cycles.",
        )
    steps = [step for step in trajectory.steps if first <= step.cycle <= last]
    return slice(steps[0].start, steps[-1].stop)
