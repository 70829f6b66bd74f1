"""Effects of the instrument: real records have them, and they pass for physics."""

from collections.abc import Mapping
from typing import Any

from ...core.effect import Effect, EffectParameter, Measurement, Values
from ...core.trajectory import FloatArray
from ..pybamm.augmentation import PyBaMMPart

_CITATION = "Bjorck et al. on cycler error budgets; Taylor et al. 2022, doi:10.1088/1361-6501/ac75b4"


def _gain(measured: Any, p: Mapping[str, Any]) -> Any:
    return measured * p["gain"]


current_gain = Effect(
    name="current-gain",
    title="wrong gain of the current sensor",
    equation="I_true = g I_measured",
    parameters=(EffectParameter("gain", "", 1.0, 0.85, 1.15, 1.01),),
    signature="charge and polarisation wrong by one share at every rate; as a cell of another size",
    citation=_CITATION,
    physics=PyBaMMPart(current=_gain),
)


def _offset(measured: Any, p: Mapping[str, Any]) -> Any:
    return measured + p["offset"]


current_offset = Effect(
    name="current-offset",
    title="offset of the current sensor",
    equation="I_true = I_measured + I_0",
    parameters=(EffectParameter("offset", "A", 0.0, -0.5, 0.5, 5e-3),),
    signature="charge that appears or goes missing at a constant pace per hour, also at rest",
    citation=_CITATION,
    physics=PyBaMMPart(current=_offset),
)


def _shifted(voltage: FloatArray, current: FloatArray, values: Values) -> FloatArray:
    return voltage + values["offset"]


voltage_offset = Effect(
    name="voltage-offset",
    title="offset of the voltage sensor",
    equation="V_measured = V_true + V_0",
    parameters=(EffectParameter("offset", "V", 0.0, -0.1, 0.1, 2e-3),),
    signature="the same error at every current and state of charge, at rest too",
    citation=_CITATION,
    measurement=Measurement(voltage=_shifted),
)


def _late(time: FloatArray, values: Values) -> FloatArray:
    return time - values["lag"]


time_lag = Effect(
    name="time-lag",
    title="lag between the clocks of voltage and current",
    equation="V_measured(t) = V_true(t - tau)",
    parameters=(EffectParameter("lag", "s", 0.0, -20.0, 20.0, 0.2),),
    signature="large errors of opposite sign at the edges of current steps and in drive cycles, none in long steps",
    citation=_CITATION,
    measurement=Measurement(clock=_late),
)

EFFECTS = (current_gain, current_offset, voltage_offset, time_lag)
