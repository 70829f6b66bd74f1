"""What an assistant says about records and cells: the options of the Python functions, described for its reading."""

from typing import Any

from pydantic import BaseModel, Field

from ...core.errors import BsaError
from ...core.printable import shown
from ...core.run.journal import FILE_NAME as JOURNAL
from .folders import Folders


class Reading(BaseModel, extra="forbid"):
    """How files of cyclers are read; needed only for what their headers do not say."""

    column: dict[str, str] | None = Field(
        None, description='Column of a signal (time, voltage, current, temperature): {"voltage": "Ecell/V"}.'
    )
    unit: dict[str, str] | None = Field(None, description='Unit of a signal: {"current": "mA"}.')
    current_sign: str = Field(
        "charge-positive", description="charge-positive (as cyclers write), discharge-positive or auto."
    )
    constant_current: float | None = Field(None, description="Current of a file without a current column, A.")
    current_offset: float | None = Field(
        None,
        description="What the instrument adds to the current, A, positive on charge; left out, what a record shows "
        "that does not bring its charge back.",
    )
    voltage_lag: float | None = Field(
        None, description="How much later than the current the voltage is written, s; left out, what the record shows."
    )
    where: dict[str, str] | None = Field(None, description='Keep only the rows with these values: {"test_id": "1"}.')
    cycles: str | None = Field(None, description='Cycles to use: "1" or "2-4".')
    sheet: str | None = Field(None, description="Sheet of a workbook.")
    reader: str | None = Field(None, description="Reader to use; left out, the one that recognises the file.")
    temperature: float | None = Field(None, description="Ambient temperature in place of what the records say, degC.")


class Cell(BaseModel, extra="forbid"):
    """Which model of which cell, and which of its parameters are searched; left out for a task, which has its own."""

    parameters: str | None = Field(
        None, description="Parameter set to start from: Chen2020 (NMC811), Marquis2019 (LCO), Prada2013 (LFP), ..."
    )
    model: str = Field("DFN", description="DFN, SPMe or SPM; SPM is the fastest.")
    options: dict[str, Any] | None = Field(None, description='Model options of PyBaMM: {"thermal": "lumped"}.')
    search: str | dict[str, Any] | None = Field(
        None, description="What is searched: a preset (cell, geometry, sei), or parameters with their bounds."
    )
    scale: bool = Field(True, description="Whether the electrode area is scaled to the records' capacity.")

    def given(self, folders: Folders) -> dict[str, Any]:
        """As keyword arguments of `bsa.calibrate` and `bsa.discover`; files are looked for in the folders alone."""
        found = self.model_dump(exclude_defaults=True)
        if isinstance(self.search, str) and not is_name(self.search):
            raise BsaError(
                f"search is {shown(repr(self.search))}, which is no preset.",
                "name a preset, or give parameters with their bounds.",
            )
        if self.parameters is not None and (
            not is_name(self.parameters) or (folders.first / self.parameters / JOURNAL).is_file()
        ):
            found["parameters"] = str(folders.inside(self.parameters))
        return found


def is_name(text: str) -> bool:
    """Whether a text is the name of a task, a preset, a set or a scaffold, and no path; ``silicon-cell`` is one."""
    return text.replace("-", "_").isidentifier()


class Arguments(BaseModel):
    """What the tools share: where a mistyped key of theirs is looked up."""

    cell: Cell = Cell()
    reading: Reading = Reading()
