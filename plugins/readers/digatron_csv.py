"""Digatron (BM4) csv exports: a preamble, a line of names, a line of units."""

from pathlib import Path

from .generic_csv import GenericCsv
from .source import first_lines, is_text_table


class DigatronCsv(GenericCsv):
    """Reads ``Prog Time``, ``Voltage``, ``Current`` and the first logged temperature; ``[ss.xxx]`` are seconds."""

    def matches(self, path: Path) -> bool:
        """Whether a line near the top names the columns of the format."""
        if not is_text_table(path):
            return False
        return any(
            {"Step", "Status", "Prog Time", "Voltage", "Current"} <= {name.strip() for name in line.split(",")}
            for line in first_lines(path, 60)
        )
