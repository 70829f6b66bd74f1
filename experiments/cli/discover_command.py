"""The command that looks for what a model lacks on the records of a run."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ...core.task import Task


def discover_command(task: Task, data: Sequence[Path], holdout: Sequence[Path], options: Mapping[str, Any]) -> str:
    """The command for the records of a task, read as they were; empty where none of the fitted ones is over time.

    Impedance spectra, which a discovery does not take, are left out, and with them what was said of each record.
    ``options`` are values by the option's name: a list repeats the option, True is the option alone, None and False
    leave it out.
    """
    spectra = {experiment.name for experiment in (*task.experiments, *task.held_out) if experiment.is_spectrum}
    over_time = [path.name not in spectra for path in (*data, *holdout)]
    fitted, held_out = list(compress(data, over_time)), list(compress(holdout, over_time[len(data) :]))
    if not fitted:
        return ""
    each = [True, *over_time[len(data) :]] if options.get("--join") else over_time
    of_records = [each, each[: len(each) - len(holdout)]]  # What is said of all records, and of the fitted ones alone.
    words = ["bsa", "discover", "--data", *map(str, fitted), *(["--holdout"] if held_out else []), *map(str, held_out)]
    for name, value in options.items():
        words += _as_option(name, _of_kept_records(value, of_records))
    return shlex.join(words)


def _of_kept_records(value: Any, of_records: Sequence[Sequence[bool]]) -> Any:
    """Numbers that are said record by record, without those of spectra; anything else as it is."""
    if not isinstance(value, list) or not all(isinstance(one, float) for one in value):
        return value
    return next((list(compress(value, over)) for over in of_records if len(over) == len(value)), value)


def _as_option(name: str, value: Any) -> list[str]:
    if value is True:
        return [name]
    # A temperature of 0 equals False.
    values = [one for one in (value if isinstance(value, list) else [value]) if one is not None and one is not False]
    return [word for one in values for word in (name, str(one))]
