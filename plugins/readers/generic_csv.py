"""Any text table with a time, a voltage and a current column."""

from pathlib import Path

from ...core.errors import BsaError
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from ...core.spectrum import ImpedanceSpectrum
from .assembly import read_table
from .columns import NAMES, named
from .gamry import gamry_table
from .impedance import spectrum_of
from .impedance_columns import spectrum_columns
from .layered import layered_table
from .source import is_text_table, load_text
from .table import Table, find_table


class GenericCsv:
    """Reads tables parted by commas, semicolons, tabs or white space, also gzipped.

    Columns are recognised by common names (``Time [s]``, ``voltage_V``, ``I[A]``), or said with ``columns``;
    a table without names has columns ``1``, ``2``, ... Neware's layered exports and Gamry's ``.DTA`` are read too.
    """

    def matches(self, path: Path) -> bool:
        """Whether the name is that of a text table."""
        return is_text_table(path)

    def read(self, path: Path, options: ReadOptions) -> Samples | ImpedanceSpectrum:
        """Read the table; see `Reader.read`. It may be a spectrum that `ImpedanceCsv` did not recognise."""
        source = shown(path.name)
        if options.sheet is not None:
            raise BsaError(
                f'{source} is a text file; it has no sheet "{shown(options.sheet)}".',
                "leave out --sheet, or #PART behind the file's name; --where COLUMN=VALUE chooses rows.",
            )
        text, notes = load_text(path)
        table = layered_table(text, source) or gamry_table(text, source, options) or find_table(text, source)
        if _is_spectrum(table, options):
            return spectrum_of(table, options, notes=notes)
        return read_table(table, options, notes)


def _is_spectrum(table: Table, options: ReadOptions) -> bool:
    """Whether the options name columns of an impedance that the table has, or it has no time and is meant to be one."""
    said = set(options.impedance_columns.values())
    if not said.isdisjoint(table.header):
        return True
    meant = bool(said) or spectrum_columns(table.header, {}) is not None
    return meant and named(table.header, NAMES["time"]) is None
