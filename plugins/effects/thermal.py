"""Heat, and what temperature does to transport and reaction."""

from collections.abc import Mapping
from typing import Any

from ...core.effect import Effect, EffectParameter, Evidence
from ..pybamm.augmentation import PyBaMMPart


def _self_heating_lacks(evidence: Evidence) -> str:
    isothermal = evidence.options.get("thermal", "isothermal") == "isothermal"
    return "" if isothermal else "the base model has a thermal model already"


def _cooling(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    # The small term keeps the coefficient finite where the effect is absent.
    conductance = 1 / (p["thermal_resistance"] + 1e-2)
    return {"Total heat transfer coefficient [W.m-2.K-1]": conductance / known["Cell cooling surface area [m2]"]}


self_heating = Effect(
    name="self-heating",
    title="self-heating (lumped thermal model)",
    equation="C dT/dt = Q_ohmic + Q_reaction + Q_reversible - (T - T_ambient) / R_th, with R_th = 1 / (h A)",
    parameters=(EffectParameter("thermal_resistance", "K.W-1", 0.0, 0.0, 150.0, 3.0),),
    signature="the measured voltage rises above an isothermal model the longer a high current lasts, by roughly the "
    "square of the rate; recovers over minutes to an hour; nothing at low rate",
    citation="Bernardi et al., J. Electrochem. Soc. 132 (1985) 5, doi:10.1149/1.2113792",
    physics=PyBaMMPart(options={"thermal": "lumped"}, values=_cooling),
    lacks=_self_heating_lacks,
)


def _temperature_lacks(evidence: Evidence) -> str:
    return "the cell was at one temperature as far as is known" * (
        evidence.temperature_span_k < 4.0 and evidence.options.get("thermal", "isothermal") == "isothermal"
    )


def _arrhenius(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    energy = 1e3 * p["activation_energy"] / 8.314462618
    reference = 298.15

    def scaled(value: Any) -> Any:
        def function(*arguments: Any) -> Any:
            # Temperature is the last argument of every transport and kinetic function in PyBaMM.
            base = value(*arguments) if callable(value) else value
            return base * pybamm.exp(energy * (1 / reference - 1 / arguments[-1]))

        return function

    import pybamm

    names = (
        "Negative particle diffusivity [m2.s-1]",
        "Positive particle diffusivity [m2.s-1]",
        "Negative electrode exchange-current density [A.m-2]",
        "Positive electrode exchange-current density [A.m-2]",
        "Electrolyte diffusivity [m2.s-1]",
        "Electrolyte conductivity [S.m-1]",
    )
    return {name: scaled(known[name]) for name in names}


temperature_dependence = Effect(
    name="temperature-dependence",
    title="temperature dependence of transport and kinetics",
    equation="D, j0, kappa -> (D, j0, kappa) exp(E/R (1/298.15 K - 1/T))",
    parameters=(EffectParameter("activation_energy", "kJ.mol-1", 0.0, 0.0, 90.0, 5.0),),
    signature="polarisation too small in the cold and too large in the warm, unbiased at the reference temperature",
    citation="Ecker et al., J. Electrochem. Soc. 162 (2015) A1836, doi:10.1149/2.0551509jes",
    physics=PyBaMMPart(values=_arrhenius),
    lacks=_temperature_lacks,
)

EFFECTS = (self_heating, temperature_dependence)
