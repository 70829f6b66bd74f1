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
from .layered import layered_table
from .source import head, load_text
from .table import Table, find_table

SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".bdf", ".mpt", ".dta")


class GenericCsv:
    """Reads tables parted by commas, semicolons, tabs or white space, also gzipped.

    Columns are recognised by common names (``Time [s]``, ``voltage_V``, ``I[A]``), or said with ``columns``;
    a table without names has columns ``1``, ``2``, ... Neware's layered exports and Gamry's ``.DTA`` are read too.
    """

    def matches(self, path: Path) -> bool:
        """Whether the name is that of a text table."""
        return is_text_table(path)

    def read(self, path: Path, options: ReadOptions) -> Samples | ImpedanceSpectrum:
        """Read the table; see `Reader.read`. It is a spectrum where the options name columns of one."""
        source = shown(path.name)
        if options.sheet is not None:
            raise BsaError(
                f'{source} is a text file; it has no sheet "{shown(options.sheet)}".',
                "leave out --sheet, or #PART behind the file's name; --where COLUMN=VALUE chooses rows.",
            )
        text, notes = load_text(path)
        table = layered_table(text, source) or gamry_table(text, source, options) or find_table(text, source)
        if _is_named_a_spectrum(table, options):
            from .impedance import spectrum_of  # which reads such tables too, and takes what is below from here

            return spectrum_of(table, options, notes=notes)
        return read_table(table, options, notes)


def _is_named_a_spectrum(table: Table, options: ReadOptions) -> bool:
    """Whether the options name columns of an impedance that the table has, or that can be meant in it alone."""
    said = set(options.impedance_columns.values())
    return bool(said) and (not said.isdisjoint(table.header) or named(table.header, NAMES["time"]) is None)


def is_text_table(path: Path) -> bool:
    """Whether the name, without ``.gz``, ends like that of a text table."""
    plain = Path(path.stem) if path.suffix.lower() == ".gz" else path
    return plain.suffix.lower() in SUFFIXES and path.is_file()


def first_lines(path: Path, count: int) -> list[str]:
    """The first lines of a text file, for a reader's ``matches``; none of a binary one."""
    data = head(path)
    if b"\0" in data:
        return []
    return data.decode("utf-8-sig", errors="replace").splitlines()[:count]
