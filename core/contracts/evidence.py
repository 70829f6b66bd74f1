"""What the records can show at all."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..effect import Evidence
from ..trajectory import StepKind
from .requests import MeasuredRecord


def gather(model: str, options: Mapping[str, Any], measured_records: Sequence[MeasuredRecord]) -> Evidence:
    """Cycles, temperatures and sampling of the records together."""
    temperatures: list[float] = []
    sampling: list[float] = []
    for measured_record in measured_records:
        record = measured_record.record
        if measured_record.ambient_k is not None:
            temperatures.append(measured_record.ambient_k)
        if record.temperature is not None:
            temperatures += [float(np.min(record.temperature)), float(np.max(record.temperature))]
        for step in record.steps:
            if step.kind is not StepKind.REST and step.stop - step.start > 1 and step.start > 0:
                sampling.append(float(np.median(np.diff(record.time[step.start : step.start + 6]))))
    return Evidence(
        model,
        options,
        max(measured_record.full_cycles for measured_record in measured_records),
        max(temperatures) - min(temperatures) if temperatures else 0.0,
        min(sampling) if sampling else float("inf"),
    )
