"""Tables that show the rows of one study and say nothing beside."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bsa.experiments.campaign.text_tables import Entry, table_of

from .results import Results


@dataclass(frozen=True)
class Plain:
    """A table with a line for each row of a study."""

    study: str
    text_columns: int  # How many columns hold text, before those of numbers.
    columns: Mapping[str, Entry]  # By their heads; see `table_of`.

    def __call__(self, results: Results) -> str:
        """The table in Markdown."""
        return results.framed(self.study, table_of(results.rows(self.study), self.columns, self.text_columns))


def as_printed(study: str, table: Callable[[Sequence[Mapping[str, Any]]], str]) -> Callable[[Results], str]:
    """The table that a study's command prints of its rows."""
    return lambda results: results.framed(study, table(results.rows(study)))
