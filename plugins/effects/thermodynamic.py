"""Effects on the open-circuit potential."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...core.effect import Effect, EffectParameter, Evidence
from ..pybamm.augmentation import PyBaMMPart

_HYSTERETIC = ("current sigmoid", "one-state hysteresis", "one-state differential capacity hysteresis")


def _hysteresis_lacks(evidence: Evidence) -> str:
    chosen = evidence.options.get("open-circuit potential", "single")
    names = chosen if isinstance(chosen, (tuple, list)) else (chosen,)
    return "the base model has hysteresis already" * any(str(name) in _HYSTERETIC for name in names)


def _hysteresis_voltage(model: Any, p: Mapping[str, Any]) -> Any:
    import pybamm

    state = pybamm.Variable("Hysteresis state of the cell")
    current = model.variables["Current [A]"]
    capacity = pybamm.Parameter("Nominal cell capacity [A.h]")
    model.rhs[state] = p["decay"] / (3600 * capacity) * (current - abs(current) * state)
    model.initial_conditions[state] = pybamm.Scalar(0)
    model.variables["Hysteresis state of the cell"] = state
    return -p["half_gap"] * state


ocp_hysteresis = Effect(
    name="ocp-hysteresis",
    title="hysteresis of the open-circuit voltage (one state)",
    equation="V -> V - M h, dh/dt = gamma/Q (I - |I| h)",
    parameters=(
        EffectParameter("half_gap", "V", 0.0, 0.0, 0.15, 3e-3),
        EffectParameter("decay", "", 20.0, 2.0, 400.0, 20.0, "log"),
    ),
    signature="an offset with the sign of the last current that builds up over a few percent of charge, does not "
    "grow with the rate and stays at rest",
    citation="Plett, J. Power Sources 134 (2004) 262, doi:10.1016/j.jpowsour.2004.02.032",
    physics=PyBaMMPart(voltage=_hysteresis_voltage),
    lacks=_hysteresis_lacks,
)

EFFECTS = (ocp_hysteresis,)
