"""What a laboratory could run next on a cell: a short list that shows different things."""

from ...core.task import CellModel, Protocol
from .parameter_sets import load

_PULSES = 8


def next_protocols(cell: CellModel) -> dict[str, Protocol]:
    """Candidate protocols by name, from a fully charged cell, between the cell's own voltage cut-offs.

    A slow discharge shows the balance of the electrodes; pulses with rests (as in the galvanostatic intermittent
    titration of Weppner & Huggins, J. Electrochem. Soc. 124 (1977) 1569) show diffusion apart from resistance; a fast
    discharge shows the electrolyte; a rest after it shows how concentrations even out; a constant-current,
    constant-voltage charge shows the other direction and the hold. C-rates refer to the cell's nominal capacity.
    """
    values = load(cell.parameter_set, cell.overrides)
    lowest = f"{float(values['Lower voltage cut-off [V]']):g} V"
    highest = f"{float(values['Upper voltage cut-off [V]']):g} V"
    pulse = (f"Discharge at 1C for 6 minutes or until {lowest}", "Rest for 30 minutes")
    return {
        "slow discharge at C/20": ((f"Discharge at C/20 until {lowest}",),),
        "pulses of 1C with rests": (pulse * _PULSES,),
        "discharge at 2C": ((f"Discharge at 2C until {lowest}",),),
        "discharge at 1C, then a rest of 2 hours": ((f"Discharge at 1C until {lowest}", "Rest for 2 hours"),),
        "discharge at C/3, then a 1C CCCV charge": (
            (
                f"Discharge at C/3 until {lowest}",
                "Rest for 30 minutes",
                f"Charge at 1C until {highest}",
                f"Hold at {highest} until C/20",
                "Rest for 30 minutes",
            ),
        ),
    }
