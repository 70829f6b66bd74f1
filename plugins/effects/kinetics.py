"""Effects on the rate of the intercalation reaction."""

from collections.abc import Mapping
from typing import Any

from ...core.effect import Effect, EffectParameter, Evidence
from ..pybamm.augmentation import PyBaMMPart


def _marcus_lacks(evidence: Evidence) -> str:
    chosen = str(evidence.options.get("intercalation kinetics", "symmetric Butler-Volmer"))
    return f"the base model uses {chosen} kinetics" * ("Marcus" in chosen)


def _marcus(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    import pybamm

    # In the limit of a large reorganisation energy Marcus is Butler-Volmer, but PyBaMM's form is not normalised:
    # it carries a factor exp(-lambda / 4kT), which belongs to the exchange current. At another temperature than the
    # cell's it would be off by an activation energy of lambda / 4.
    energy = 1 / (p["inverse_reorganisation_energy"] + 0.05)
    values: dict[str, Any] = {}
    for which in ("Negative", "Positive"):
        name = f"{which} electrode exchange-current density [A.m-2]"
        value = known[name]

        def function(*arguments: Any, value: Any = value) -> Any:
            # Temperature is the last argument of every exchange-current density in PyBaMM.
            thermal = 8.617333262e-5 * arguments[-1]
            return (value(*arguments) if callable(value) else value) * pybamm.exp(energy / (4 * thermal))

        values[name] = function
        values[f"{which} electrode reorganization energy [eV]"] = energy
    return values


kinetics_marcus = Effect(
    name="kinetics-marcus",
    title="Marcus kinetics",
    equation="j = j0 [exp(-(lambda - eta)^2 / 4 lambda kT) - exp(-(lambda + eta)^2 / 4 lambda kT)] e^(lambda / 4kT)",
    parameters=(EffectParameter("inverse_reorganisation_energy", "eV-1", 0.0, 0.0, 25.0, 1.0),),
    signature="reaction overpotential that grows faster than Butler-Volmer at high rate and in the cold, equal at low "
    "rate",
    citation="Sripad et al., J. Chem. Phys. 153 (2020) 194701, doi:10.1063/5.0023611",
    physics=PyBaMMPart(options={"intercalation kinetics": "Marcus"}, values=_marcus),
    lacks=_marcus_lacks,
)

EFFECTS = (kinetics_marcus,)
