"""The domain that tasks have by default: a lithium-ion cell under a cycler."""

from pathlib import Path
from typing import Any

from .domain import Domain
from .signals import Signal
from .trajectory import StepKind
from .yaml_text import read_yaml

_HERE = Path(__file__).parent

CURRENT = Signal(
    "current", "A", tolerance=1e-2, role="driven", relative=True, shown_unit="%", observed_in=(StepKind.CV_HOLD,)
)
VOLTAGE = Signal("voltage", "V", tolerance=1e-3, shown_unit="mV", shown_scale=1e3)

TEMPERATURE = Signal("temperature", "K", tolerance=0.2, optional=True, settles_s=3600.0)
"""Of a cell whose simulation has one. Models of measured cells end about ten tolerances off: at 10 mV, and, with one
temperature for the whole cell against a sensor on the can, at 2 K. Cylindrical and pouch cells of some ampere hours
cool with a time constant of 5 to 20 minutes: what they show after an hour of rest is the room, whose changes no model
has."""

FREQUENCY = Signal("frequency", "Hz", role="driven", optional=True)

_PART_OF_IMPEDANCE: dict[str, Any] = {
    "unit": "Ohm",
    # Models of measured cells end about ten tolerances off here as elsewhere: at a tenth of the impedance.
    "tolerance": 1e-2,
    "shown_unit": "mohm",
    "shown_scale": 1e3,
    "relative": True,
    "share_of": "impedance",
    "optional": True,
}

RESISTANCE = Signal("resistance", **_PART_OF_IMPEDANCE)
REACTANCE = Signal("reactance", **_PART_OF_IMPEDANCE)
"""Of a capacitor positive: the negative imaginary part."""

SPECTRUM = (FREQUENCY, RESISTANCE, REACTANCE)
"""Of an impedance spectrum in place of current and voltage: what was asked, and what the cell answered."""

CELL = Domain(
    name="lithium-ion cell",
    expert="""\
You are an expert in lithium-ion cells and their physics-based models. You calibrate a PyBaMM model so that its
simulated record matches a measured one: the durations of the steps, the capacity, and the shape of the voltage.""",
    signals=(CURRENT, VOLTAGE),
    metric="paper",
    brief_s=60.0,
    signals_told=False,
    rules=tuple(read_yaml(_HERE / "cell_rules.yaml") + read_yaml(_HERE / "ageing" / "rules.yaml")),
    drives="currents",
    gentler="""\
fit a gentler cell first (a failing or vanished step comes back), then return. "reduce_rate_percent" below 100 lowers \
the currents until the cell runs and raises them again; "reduce_cycles" fits the record's first cycles before all.""",
    start_of_next="from a fully charged cell",
    accuracy="PyBaMM's number of mesh points and tight tolerances",
    search_accuracy="Errors during the search come from the search mesh and may differ slightly from the final scores "
    "above.",
    sign_note="Current is positive on discharge.",
    errors_note="Total MAPE is the sum of its three parts.",
    driven_note="The measured current drives the simulation, so charge and current do not judge the fit; percentages "
    "of values near zero can be large.",
    export_note="`best_parameters.py` beside this page needs PyBaMM alone and draws the best curve: "
    "`python best_parameters.py --plot`.",
)
