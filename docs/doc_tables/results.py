"""The rows behind the documentation's tables, and where each file of them comes from."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from bsa.core.errors import BsaError
from bsa.core.validation import explain
from bsa.core.yaml_text import read_yaml
from bsa.experiments.campaign.results import read_table
from pydantic import BaseModel, Field, TypeAdapter, ValidationError

ORIGINS = "origins.yaml"

_NAMES = {"case": "task", "parameter_set": "chemistry", "early_mape": "early_objective"}
"""Columns that earlier versions called otherwise: present names by earlier ones."""


class Origin(BaseModel, extra="forbid"):
    """How a file of rows was made."""

    command: str = Field(description="The command, or several, one a line.")
    version: str | dict[str, str] = Field(
        description="Commit of this package, or the commits between which the rows were made; where the table itself "
        "tells the versions, these by the part of the rows that each made."
    )
    machine: str = Field(description="Cores, and whether other work was done on them.")
    note: str = Field("", description="What else is to be known of these rows, in a sentence.")


@dataclass(frozen=True)
class Results:
    """A folder of rows."""

    folder: Path  # Where the CSV files and `ORIGINS` lie.
    link: str = "results"  # The folder's address as the document being written sees it.

    def rows(self, study: str) -> list[dict[str, Any]]:
        """The rows of a study. Raises `BsaError` if there is no such file."""
        path = self.folder / f"{study}.csv"
        if not path.is_file():
            raise BsaError(f"{path} is missing.", "a table of the documentation is made of it; run its study.")
        return [{_NAMES.get(name, name): value for name, value in row.items()} for row in read_table(path)]

    @cached_property
    def origins(self) -> dict[str, Origin]:
        """Where each file comes from, by study. Raises `BsaError` if the file that says so is not valid."""
        path = self.folder / ORIGINS
        try:
            return TypeAdapter(dict[str, Origin]).validate_python(read_yaml(path))
        except ValidationError as error:
            raise explain(error, str(path), Origin) from None

    def framed(self, studies: str, *parts: str) -> str:
        """Parts of a table below the command that makes its rows, and above what is known of them.

        ``studies`` is one study, or several joined by spaces; commands of the first stand above.
        """
        names = studies.split()
        command = f"```sh\n{self.origin(names[0]).command.strip()}\n```"
        return "\n\n".join([command, *parts, "\n".join(self._line(name) for name in names)])

    def _line(self, study: str) -> str:
        origin = self.origin(study)
        note = f" {origin.note}" if origin.note else ""
        version = origin.version if isinstance(origin.version, str) else "the versions that the table gives"
        return f"*[{study}.csv]({self.link}/{study}.csv): made by {version}; {origin.machine}.*{note}"

    def origin(self, study: str) -> Origin:
        """Where a file comes from. Raises `BsaError` if the origins do not say so."""
        if study not in self.origins:
            raise BsaError(f'{self.folder / ORIGINS} does not say where "{study}" comes from.', "add an entry.")
        return self.origins[study]
