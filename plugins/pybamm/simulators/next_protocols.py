"""What a laboratory could run next on a cell: a short list that shows different things."""

from ....core.task import CellModel, Protocol
from ..cells.nameplate import CAPACITY, labelled
from ..cells.parameter_sets import load, voltage_window

_PULSES = 8


def next_protocols(cell: CellModel) -> dict[str, Protocol]:
    """Candidate protocols by name, from a fully charged cell, between the cell's own voltage cut-offs.

    A slow discharge shows the balance of the electrodes; pulses with rests (as in the galvanostatic intermittent
    titration of Weppner & Huggins, J. Electrochem. Soc. 124 (1977) 1569) show diffusion apart from resistance; a fast
    discharge shows the electrolyte; a rest after it shows how concentrations even out; a constant-current,
    constant-voltage charge shows the other direction and the hold. C-rates refer to the cell's nominal capacity, which
    need not be the parameter set's: steps are in ampere.
    """
    values = labelled(load(cell.parameter_set, cell.overrides), cell)
    lowest, highest = (f"{limit:g} V" for limit in voltage_window(values))
    slow, third, one, two = (f"{rate * float(values[CAPACITY]):.4g} A" for rate in (1 / 20, 1 / 3, 1.0, 2.0))
    pulse = (f"Discharge at {one} for 6 minutes or until {lowest}", "Rest for 30 minutes")
    return {
        "slow discharge at C/20": ((f"Discharge at {slow} until {lowest}",),),
        "pulses of 1C with rests": (pulse * _PULSES,),
        "discharge at 2C": ((f"Discharge at {two} until {lowest}",),),
        "discharge at 1C, then a rest of 2 hours": ((f"Discharge at {one} until {lowest}", "Rest for 2 hours"),),
        "discharge at C/3, then a 1C CCCV charge": (
            (
                f"Discharge at {third} until {lowest}",
                "Rest for 30 minutes",
                f"Charge at {one} until {highest}",
                f"Hold at {highest} until {slow}",
                "Rest for 30 minutes",
            ),
        ),
    }
