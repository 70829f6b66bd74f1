"""Effects on the open-circuit potential."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

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


def _hysteresis_at_rest(current: Any, charge: Any, capacity: float, p: Mapping[str, float]) -> Any:
    kept = np.exp(-p["decay"] * np.abs(np.diff(charge, prepend=charge[0])) / capacity)
    signs = np.sign(current)
    state, states = 0.0, []
    for share, sign in zip(kept, signs, strict=True):
        state = sign + (state - sign) * share
        states.append(state)
    return -p["half_gap"] * np.array(states)


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
    physics=PyBaMMPart(voltage=_hysteresis_voltage, at_rest=_hysteresis_at_rest),
    lacks=_hysteresis_lacks,
)


def _shape(which: str, known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    name = f"{which} electrode OCP [V]"
    potential = known[name]

    def corrected(x: Any) -> Any:
        distance = np.log(x / (1 - x)) - np.log(p["stoichiometry"] / (1 - p["stoichiometry"]))
        return potential(x) + p["height"] * np.exp(-0.5 * (distance / 0.9) ** 2)

    return {name: corrected}


ocp_shapes = tuple(
    Effect(
        name="ocp-shape",
        variant=f"{electrode} electrode",
        title=f"another shape of the {electrode} electrode's open-circuit potential",
        equation="U(x) -> U(x) + a exp(-(logit x - logit x0)^2 / (2 0.9^2))",
        parameters=(
            EffectParameter("height", "V", 0.0, -0.15, 0.15, 5e-3),
            EffectParameter("stoichiometry", "", 0.5, 0.01, 0.99, 0.5),
        ),
        signature="an offset over part of the charge, the same at every rate and at rest, on charge and on discharge",
        citation="Chen et al., J. Electrochem. Soc. 167 (2020) 080534, doi:10.1149/1945-7111/ab9050",
        physics=PyBaMMPart(values=partial(_shape, electrode.capitalize())),
        on_request=True,
    )
    for electrode in ("negative", "positive")
)

EFFECTS = (ocp_hysteresis, *ocp_shapes)
