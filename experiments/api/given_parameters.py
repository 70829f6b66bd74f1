"""Base parameters as a person has them in Python: a name, a path, or PyBaMM's parameter values."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from ...core.errors import BsaError
from ...core.printable import shown, with_article
from ...core.task import ParameterFile, ParameterSource

if TYPE_CHECKING:
    import pybamm

Parameters: TypeAlias = "str | Path | pybamm.ParameterValues"
"""A parameter set by name, a parameter file or the folder of a run by path, or a set that is loaded already."""


def given_parameters(given: Parameters) -> ParameterSource:
    """What the commands take for it: text, or PyBaMM's values as a parameter file.

    Raises `BsaError` if it is neither, or the values cannot be written as JSON, or are no whole set.
    """
    if isinstance(given, str | Path):
        return str(given)
    from ...plugins.pybamm.cells.parameter_sets import pybamm

    if not isinstance(given, pybamm.ParameterValues):
        raise BsaError(
            f"parameters is {with_article(type(given).__name__)}.",
            "give the name of a set, the path of a parameter file or of a run, or a pybamm.ParameterValues.",
        )
    return _as_file(given)


def _as_file(values: pybamm.ParameterValues) -> ParameterFile:
    from ...plugins.pybamm.cells.parameter_files import as_json, parsed

    try:
        text = as_json(values)
    except Exception as error:  # whatever the functions of the set raise when they get symbols
        reason = " ".join(str(error).split())
        raise BsaError(
            f"these parameter values cannot be written as JSON ({type(error).__name__}: {shown(reason, 200)}).",
            "write their functions with PyBaMM's expressions (pybamm.exp, no if), or begin with an installed set and "
            "search or override what differs.",
        ) from None
    return parsed("ParameterValues", text)
