"""Effects on transport in the particles and in the electrolyte."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from ...core.effect import Effect, EffectParameter, Evidence
from ..pybamm.augmentation import PyBaMMPart
from .phases import one_phase_lacks


def _electrolyte_lacks(evidence: Evidence) -> str:
    return f"{evidence.model} has electrolyte transport already" * (evidence.model != "SPM")


def _electrolyte(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    resistance = p["resistance_factor"] + 1e-3

    def slowed(value: Any) -> Any:
        def function(*arguments: Any) -> Any:
            return (value(*arguments) if callable(value) else value) / resistance

        return function

    names = ("Electrolyte conductivity [S.m-1]", "Electrolyte diffusivity [m2.s-1]")
    return {name: slowed(known[name]) for name in names}


electrolyte_transport = Effect(
    name="electrolyte-transport",
    title="electrolyte transport (SPM becomes SPMe)",
    equation="kappa -> kappa / s, D_e -> D_e / s in the electrolyte equations; s = 0 is an ideal electrolyte",
    parameters=(EffectParameter("resistance_factor", "", 0.0, 0.0, 6.0, 0.3),),
    signature="polarisation that grows with the rate and, over the first minute or two of a step, with time, then "
    "relaxes as fast",
    citation="Marquis et al., J. Electrochem. Soc. 166 (2019) A3693, doi:10.1149/2.0341915jes",
    physics=PyBaMMPart(model="SPMe", values=_electrolyte),
    lacks=_electrolyte_lacks,
)


def _diffusivity_slope(which: str, known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    import pybamm

    name = f"{which} particle diffusivity [m2.s-1]"
    value = known[name]

    def function(sto: Any, temperature: Any) -> Any:
        base = value(sto, temperature) if callable(value) else value
        return base * pybamm.exp(p["log_slope"] * (sto - 0.5))

    return {name: function}


def _solid_diffusivity(which: str) -> Effect:
    return Effect(
        name="solid-diffusivity-variation",
        variant=f"{which} electrode",
        title=f"diffusivity in the {which} particles that varies with stoichiometry",
        equation="D(theta) -> D(theta) exp(b (theta - 1/2))",
        parameters=(EffectParameter("log_slope", "", 0.0, -8.0, 8.0, 0.5),),
        signature="diffusion polarisation too large at one end of the state of charge and too small at the other, "
        "growing over minutes of a step",
        citation="Kang and Chung, J. Electrochem. Soc. 168 (2021); Ecker et al. 2015, doi:10.1149/2.0551509jes",
        physics=PyBaMMPart(values=partial(_diffusivity_slope, which.capitalize())),
    )


def _coupled(which: str, known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    name = f"{which} particle diffusivity [m2.s-1]"
    value = known[name]

    def function(sto: Any, temperature: Any) -> Any:
        return (value(sto, temperature) if callable(value) else value) * (1 + p["coupling"] * sto)

    return {name: function}


def _stress(which: str) -> Effect:
    return Effect(
        name="stress-induced-diffusion",
        variant=f"{which} electrode",
        title=f"stress-enhanced diffusion in the {which} particles",
        equation="D -> D (1 + s theta), s = 2 Omega^2 E c_max / (9 R T (1 - nu))",
        parameters=(EffectParameter("coupling", "", 0.0, 0.0, 12.0, 0.3),),
        signature="faster diffusion the fuller the particle: as a diffusivity that rises with stoichiometry",
        citation="Zhang et al., J. Electrochem. Soc. 154 (2007) A910, doi:10.1149/1.2759840",
        physics=PyBaMMPart(values=partial(_coupled, which.capitalize())),
        lacks=_stress_lacks,
    )


def _stress_lacks(evidence: Evidence) -> str:
    has = str(evidence.options.get("stress-induced diffusion", "false"))
    return "the base model has stress-induced diffusion already" * (has == "true")


def _distribution_lacks(evidence: Evidence) -> str:
    if evidence.options.get("particle size") == "distribution":
        return "the base model has a distribution of sizes already"
    why = "it is considered with SPM and SPMe only: a DFN takes up to four times as long with it"
    return why * (evidence.model == "DFN")


def _distribution(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    import numpy as np
    import pybamm

    # Sizes from 2.5 deviations of their logarithm below the mean radius to five deviations above it, PyBaMM's own end:
    # few large particles hold much of the material. The floor keeps the density finite where the effect is absent.
    deviation = pybamm.sqrt(p["deviation"] ** 2 + 1e-4)
    log_variance = pybamm.log(1 + deviation**2)
    values: dict[str, Any] = {}
    for which in ("Negative", "Positive"):
        mean = known[f"{which} particle radius [m]"]

        def density(size: Any, mean: Any = mean) -> Any:
            argument = (pybamm.log(size / mean) + log_variance / 2) ** 2 / (2 * log_variance)
            return pybamm.exp(-argument) / (size * pybamm.sqrt(2 * np.pi * log_variance))

        values[f"{which} minimum particle radius [m]"] = mean * pybamm.exp(-2.5 * pybamm.sqrt(log_variance))
        values[f"{which} maximum particle radius [m]"] = mean * (1 + 5 * deviation)
        values[f"{which} area-weighted particle-size distribution [m-1]"] = density
    return values


particle_size_distribution = Effect(
    name="particle-size-distribution",
    title="distribution of particle sizes (log-normal, both electrodes)",
    equation="f(R) log-normal with mean R0 and standard deviation sigma R0, area-weighted",
    parameters=(EffectParameter("deviation", "", 0.0, 0.0, 0.8, 0.2),),
    signature="diffusion polarisation that sets in earlier and ends later than one time constant can; smoother knees",
    citation="Kirk et al., J. Electrochem. Soc. 168 (2021) 060554, doi:10.1149/1945-7111/ac0bf7",
    physics=PyBaMMPart(
        options={"particle size": "distribution", "surface form": "algebraic"},
        points={"R_n": 10, "R_p": 10},
        values=_distribution,
    ),
    lacks=_distribution_lacks,
)


def _slow_share(which: str, model: Any, p: Mapping[str, Any]) -> Any:
    import pybamm

    electrode = model.param.domain_params[which].prim
    mean = model.variables[f"Average {which} particle stoichiometry"]
    surface = model.variables[f"X-averaged {which} particle surface stoichiometry"]
    temperature = model.variables["Volume-averaged cell temperature [K]"]
    middle = electrode.c_max / 2
    # A higher temperature speeds the exchange up as it does diffusion in the particles.
    speed = electrode.D(middle, temperature) / electrode.D(middle, model.param.T_ref)
    slow = pybamm.Variable(f"Stoichiometry of the slow {which} material")
    lag = p["reference_lag"]
    model.rhs[slow] = speed * lag / p["time"] * pybamm.sinh((mean - slow) / lag)
    model.initial_conditions[slow] = pybamm.x_average(pybamm.r_average(electrode.c_init)) / electrode.c_max
    model.variables[f"Stoichiometry of the slow {which} material"] = slow

    end = 1e-3  # the stoichiometry next to 0 and 1 at which a potential begins to run off

    def above_0(stoichiometry: Any) -> Any:
        return (stoichiometry + pybamm.sqrt(stoichiometry**2 + 4 * end**2)) / 2

    def potential(stoichiometry: Any) -> Any:
        within = above_0(1 - above_0(1 - stoichiometry))
        # What is empty or full has no potential of its own: beyond its ends that goes on as a logarithm does there.
        beyond = (within - stoichiometry) * pybamm.constants.R * temperature / pybamm.constants.F / end
        return electrode.U(within, temperature) + beyond

    # What the slow material has not given or taken yet, the other has, whose potential is measured.
    change = potential(surface - p["share"] / (1 - p["share"]) * (slow - mean)) - potential(surface)
    return change if which == "positive" else -change


slow_material = tuple(
    Effect(
        name="slow-active-material",
        variant=f"{electrode} electrode",
        title=f"a part of the {electrode} electrode's active material that exchanges lithium slowly",
        equation="U(x_s) -> U(x_s - w / (1 - w) (z - x)), dz/dt = l / tau(T) sinh((x - z) / l); w: share of the slow "
        "material, x: mean stoichiometry, x_s: at the surface, l: lag beyond which the exchange grows exponentially",
        parameters=(
            EffectParameter("share", "", 0.0, 0.0, 0.5, 0.03),
            EffectParameter("time", "s", 3600.0, 600.0, 1e6, 3600.0, "log"),
            EffectParameter("reference_lag", "", 0.02, 0.001, 1.0, 0.02, "log"),
        ),
        signature="relaxation over hours, largest where the open-circuit potential is steep: in rests of an empty cell "
        "whose negative electrode has silicon beside graphite, or of coarse particles beside fine ones",
        citation="Ai et al., J. Power Sources 527 (2022) 231142, doi:10.1016/j.jpowsour.2022.231142; the rate after "
        "Garofalo: Koebbing et al., ACS Appl. Mater. Interfaces (2024), doi:10.1021/acsami.4c12976",
        physics=PyBaMMPart(voltage=partial(_slow_share, electrode)),
        lacks=partial(one_phase_lacks, electrode),
        on_request=True,
    )
    for electrode in ("negative", "positive")
)

EFFECTS = (
    electrolyte_transport,
    particle_size_distribution,
    _solid_diffusivity("negative"),
    _solid_diffusivity("positive"),
    _stress("negative"),
    _stress("positive"),
    *slow_material,
)
