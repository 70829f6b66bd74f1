"""The published tasks, read from where they lie: three YAML files that are not part of this package."""

import os
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from ...core.errors import BsaError
from ...core.validation import explain
from ...core.yaml_text import read_yaml
from .case import SuiteCase

FILES = {
    "regular": "simulated_data_setting_multi_new_filtered.yaml",
    "extreme": "simulated_data_setting_single_new_filtered.yaml",
    "sei": "simulated_data_setting_SEI.yaml",
}

SEI_CYCLES = 200
"""Cycles of the paper's ageing tasks."""

FOLDER_VARIABLE = "BSA_PUBLISHED_SUITE"
"""Environment variable that names the folder of the published files."""

_BESIDE_THE_REPOSITORY = Path(__file__).resolve().parents[3] / "shared" / "reference-suite"


class PublishedEntry(BaseModel):
    """One entry of a published file."""

    # Its key "model_name" would otherwise count as one of pydantic's own.
    model_config = ConfigDict(extra="forbid", protected_namespaces=())

    charge_c_rate: float = Field(gt=0, description="C-rate of the charge.")
    discharge_c_rate: float = Field(gt=0, description="C-rate of the discharge.")
    model_name: str = Field(description="The model; DFN everywhere.")
    param_name: str = Field(description="The base parameter set.")
    parameter_change: dict[str, float] = Field(description="The true values that differ from the set.")


def find_reference_suite(folder: Path | None = None) -> Path:
    """The folder of the published files.

    By default what ``BSA_PUBLISHED_SUITE`` names, else ``../shared/reference-suite`` beside the repository. Raises
    `BsaError` if they are not there.
    """
    named = os.environ.get(FOLDER_VARIABLE)
    place = folder or (Path(named) if named else _BESIDE_THE_REPOSITORY)
    if not all((place / name).is_file() for name in FILES.values()):
        raise BsaError(
            f"the published tasks are not in {place}; they are not part of this package.",
            f"set {FOLDER_VARIABLE} to the folder that holds {', '.join(FILES.values())}. Without them: the task demo; "
            "for studies, --suite generated.",
        )
    return place


def published_cases(folder: Path | None = None, sei_cycles: int = SEI_CYCLES) -> dict[str, SuiteCase]:
    """The published cases by key (``regular-134``, ``extreme-12``, ``sei-3``).

    The folder is as in `find_reference_suite`. Raises `BsaError` if a file is missing or an entry makes no sense.
    """
    place = find_reference_suite(folder)
    cases: dict[str, SuiteCase] = {}
    for mode, name in FILES.items():
        try:
            entries = TypeAdapter(dict[int, PublishedEntry]).validate_python(read_yaml(place / name))
        except ValidationError as error:
            raise explain(error, str(place / name), PublishedEntry) from None
        for number, entry in entries.items():
            case = SuiteCase(
                mode,
                number,
                entry.param_name,
                entry.charge_c_rate,
                entry.discharge_c_rate,
                entry.parameter_change,
                cycles=sei_cycles if mode == "sei" else 2,
            )
            cases[case.key] = case
    return cases
