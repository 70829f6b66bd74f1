"""BioLogic ``.mpr`` files, records and impedance spectra, decoded by galvani."""

from pathlib import Path

import numpy as np

from ...core.errors import BsaError
from ...core.extras import require
from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from ...core.spectrum import ImpedanceSpectrum
from .arrays import ArrayTable
from .assembly import read_table
from .impedance import holds_spectrum, spectrum_of
from .source import MAX_BYTES, decoding


class BioLogicMpr:
    """Reads what EC-Lab and BT-Lab save; a file with frequencies and impedances is a spectrum."""

    def matches(self, path: Path) -> bool:
        """Whether the name ends in ``.mpr``."""
        return path.suffix.lower() == ".mpr" and path.is_file()

    def read(self, path: Path, options: ReadOptions) -> Samples | ImpedanceSpectrum:
        """Read the file; see `Reader.read`."""
        source = shown(path.name)
        if path.stat().st_size > MAX_BYTES:
            raise BsaError(f"{source} holds more than {MAX_BYTES // 2**20} MiB.", "export the record as text (.mpt).")
        galvani = require("galvani", "biologic", f"{source} (BioLogic)")
        with decoding(source, "BioLogic file that is understood", "export it as text (.mpt) from EC-Lab."):
            file = galvani.BioLogic.MPRfile(str(path))
            names = tuple(file.data.dtype.names)
            columns = [np.asarray(file.data[name], dtype=np.float64) for name in names]
            if "time/s" in names and hasattr(file, "timestamp"):
                start = np.datetime64(file.timestamp).astype("datetime64[ms]").astype(np.float64) / 1e3
                columns.append(start + columns[names.index("time/s")])
                names = (*names, "Unix Time / s")
        table = ArrayTable(source, names, columns)
        return spectrum_of(table, options) if holds_spectrum(names) else read_table(table, options)
