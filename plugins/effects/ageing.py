"""Effects that change the cell from cycle to cycle, and the leak that empties it."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from ...core.effect import Effect, EffectParameter, Evidence
from ..pybamm.augmentation import PyBaMMPart

FEWEST_CYCLES = 3
"""Cycles of a record from which effects that age a cell are considered."""

_FEWEST_OF_A_LIFE = 50
"""Cycles from which what only a whole life can tell is considered: below, it would be one more rival."""


def _needs_cycles(option: str, evidence: Evidence) -> str:
    present = str(evidence.options.get(option, "none"))
    if present not in ("none", "false"):
        return f'the base model has the option "{option}" already'
    return _too_few(evidence)


def _too_few(evidence: Evidence) -> str:
    few = evidence.cycles < FEWEST_CYCLES
    return f"no record has {FEWEST_CYCLES} cycles, so that nothing can be seen to age" * few


def _needs_a_life(option: str, evidence: Evidence) -> str:
    few = evidence.cycles < _FEWEST_OF_A_LIFE
    return f"no record has {_FEWEST_OF_A_LIFE} cycles" * few or _needs_cycles(option, evidence)


def _rate(name: str, unit: float, known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    return {name: unit * p["rate"]}


def _sei_on_cracks(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    usual = known["Negative electrode cracking rate"]

    def cracking(temperature: Any) -> Any:
        return p["cracking"] * (usual(temperature) if callable(usual) else usual)

    return {"SEI solvent diffusivity [m2.s-1]": 2.5e-22 * p["rate"], "Negative electrode cracking rate": cracking}


def _cracks_lack(evidence: Evidence) -> str:
    unlike = f"PyBaMM's {evidence.model} takes no lithium from the particles for the SEI on cracks; its DFN does"
    return _needs_a_life("SEI", evidence) or unlike * (evidence.model != "DFN")


_SEI_CITATION = "Marquis, PhD thesis, Oxford 2020; Single et al., ChemSusChem 11 (2018), doi:10.1002/cssc.201800077"

sei_reaction = Effect(
    name="sei-growth",
    variant="reaction-limited",
    title="SEI growth, limited by its reaction",
    equation="j_SEI = -s j0 exp(-F (phi_s - phi_e - U_SEI) / 2RT), j0 = 1.5e-7 A/m2",
    parameters=(EffectParameter("rate", "", 0.0, 0.0, 500.0, 2.0, of=(1.5e-7, "A.m-2")),),
    signature="capacity lost at a constant pace per hour, most at high state of charge; resistance grows with it",
    citation=_SEI_CITATION,
    physics=PyBaMMPart(
        options={"SEI": "reaction limited"},
        values=partial(_rate, "SEI reaction exchange current density [A.m-2]", 1.5e-7),
    ),
    lacks=partial(_needs_cycles, "SEI"),
    ages=True,
)

sei_diffusion = Effect(
    name="sei-growth",
    variant="diffusion-limited",
    title="SEI growth, limited by solvent diffusion",
    equation="j_SEI = -s D_sol c_sol F / L_SEI, D_sol = 2.5e-22 m2/s",
    parameters=(EffectParameter("rate", "", 0.0, 0.0, 1e5, 30.0, of=(2.5e-22, "m2.s-1")),),
    signature="capacity lost with the square root of time, at any state of charge; resistance grows with it",
    citation=_SEI_CITATION,
    physics=PyBaMMPart(
        options={"SEI": "solvent-diffusion limited"}, values=partial(_rate, "SEI solvent diffusivity [m2.s-1]", 2.5e-22)
    ),
    lacks=partial(_needs_cycles, "SEI"),
    ages=True,
)

sei_electrons = Effect(
    name="sei-growth",
    variant="electron-migration-limited",
    title="SEI growth, limited by the migration of electrons through it",
    equation="j_SEI = s kappa_SEI (phi_s - phi_e - U_SEI) / L_SEI, kappa_SEI = 8.95e-14 S/m",
    parameters=(EffectParameter("rate", "", 0.0, 0.0, 1e5, 30.0, of=(8.95e-14, "S.m-1")),),
    signature="capacity lost with the square root of time, more at high state of charge; resistance grows with it",
    citation=_SEI_CITATION,
    physics=PyBaMMPart(
        options={"SEI": "electron-migration limited"},
        values=partial(_rate, "SEI electron conductivity [S.m-1]", 8.95e-14),
    ),
    lacks=partial(_needs_a_life, "SEI"),
    ages=True,
)

sei_interstitials = Effect(
    name="sei-growth",
    variant="interstitial-diffusion-limited",
    title="SEI growth, limited by the diffusion of lithium interstitials through it",
    equation="j_SEI = -s D_Li c_Li F exp(-F (phi_s - phi_e) / RT) / L_SEI, D_Li = 1e-20 m2/s",
    parameters=(EffectParameter("rate", "", 0.0, 0.0, 1e6, 300.0, of=(1e-20, "m2.s-1")),),
    signature="capacity lost with the square root of time, far more at high state of charge; resistance grows with it",
    citation=_SEI_CITATION,
    physics=PyBaMMPart(
        options={"SEI": "interstitial-diffusion limited"},
        values=partial(_rate, "SEI lithium interstitial diffusivity [m2.s-1]", 1e-20),
    ),
    lacks=partial(_needs_a_life, "SEI"),
    ages=True,
)

sei_on_cracks = Effect(
    name="sei-growth",
    variant="diffusion-limited on cracks too",
    title="SEI growth, limited by solvent diffusion, on the particles' surface and in cracks that grow with the stress",
    equation="j_SEI = -s D_sol c_sol F / L_SEI on both; d(l_cr)/dt = c k_cr (sigma_t b_cr sqrt(pi l_cr))^m_cr",
    parameters=(
        EffectParameter("rate", "", 0.0, 0.0, 1e5, 3.0, of=(2.5e-22, "m2.s-1")),
        EffectParameter("cracking", "", 1.0, 1e-2, 1e2, 1.0, "log"),
    ),
    signature="capacity lost at a pace that does not sink with time, as cracks open new surface; little new resistance",
    citation="O'Kane et al., Phys. Chem. Chem. Phys. 24 (2022) 7909, doi:10.1039/D2CP00417H",
    physics=PyBaMMPart(
        options={
            "SEI": "solvent-diffusion limited",
            "SEI on cracks": "true",
            "particle mechanics": ("swelling and cracking", "none"),
            # Else the stress would change the new cell's diffusion too.
            "stress-induced diffusion": "false",
        },
        values=_sei_on_cracks,
    ),
    lacks=_cracks_lack,
    ages=True,
)


def _plating(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    rate = 1e-11 * p["rate"]

    def exchange_current(c_e: Any, c_li: Any, temperature: Any) -> Any:
        return 96485.33212 * rate * c_e

    return {"Exchange-current density for plating [A.m-2]": exchange_current}


lithium_plating = Effect(
    name="lithium-plating",
    title="irreversible lithium plating",
    equation="j_Li = -s F k c_e exp(-alpha F (phi_s - phi_e) / RT), k = 1e-11 m/s, alpha = 0.65",
    parameters=(EffectParameter("rate", "", 0.0, 0.0, 1e4, 1.0, of=(1e-11, "m.s-1")),),
    signature="capacity lost during fast or cold charge, where the negative potential nears zero; none otherwise",
    citation="O'Kane et al., J. Electrochem. Soc. 167 (2020) 090540, doi:10.1149/1945-7111/ab90ac",
    physics=PyBaMMPart(
        options={"lithium plating": "irreversible"},
        borrowed={
            "Lithium metal partial molar volume [m3.mol-1]": 1.3e-5,
            "Initial plated lithium concentration [mol.m-3]": 0.0,
            "Typical plated lithium concentration [mol.m-3]": 1000.0,
            "Lithium plating transfer coefficient": 0.65,
        },
        values=_plating,
    ),
    lacks=partial(_needs_cycles, "lithium plating"),
    ages=True,
)


def _lam_rate(losing: str, other: str, known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    area = known["Electrode width [m]"] * known["Electrode height [m]"]
    parallel = known["Number of electrodes connected in parallel to make a cell"]
    full = known[f"{losing} electrode active material volume fraction"]
    charge = 3600 * known["Nominal cell capacity [A.h]"]

    def rate(current_density: Any, temperature: Any) -> Any:
        return -p["loss"] * full * abs(current_density) * area * parallel / charge

    return {f"{losing} electrode current-driven LAM rate": rate, f"{other} electrode current-driven LAM rate": 0.0}


def _lam(which: str, other: str) -> Effect:
    return Effect(
        name="loss-of-active-material",
        variant=f"{which} electrode",
        title=f"loss of active material in the {which} electrode",
        equation="d(eps_s)/dt = -s eps_s0 |I| / Q_nominal",
        parameters=(EffectParameter("loss", "", 0.0, 0.0, 0.05, 5e-4, of=(100.0, "% per nominal capacity passed")),),
        signature="capacity and the place of one electrode's steps shift cycle by cycle; its polarisation grows",
        citation="Reniers et al., J. Electrochem. Soc. 166 (2019) A3189, doi:10.1149/2.0281914jes",
        physics=PyBaMMPart(
            options={"loss of active material": "current-driven"},
            values=partial(_lam_rate, which.capitalize(), other.capitalize()),
        ),
        lacks=partial(_needs_cycles, "loss of active material"),
        ages=True,
    )


def _stressed(which: str, losing: tuple[str, str]) -> Effect:
    return Effect(
        name="loss-of-active-material",
        variant=f"{which} electrode by stress",
        title=f"loss of active material in the {which} electrode, driven by the stress in its particles",
        equation="d(eps_s)/dt = -s beta (sigma_h / sigma_c)^m, beta = 2.78e-7 1/s",
        parameters=(EffectParameter("rate", "", 0.0, 0.0, 500.0, 2.0, of=(2.7778e-7, "s-1")),),
        signature="capacity and the place of one electrode's steps shift, faster as less material carries the current",
        citation="O'Kane et al., Phys. Chem. Chem. Phys. 24 (2022) 7909, doi:10.1039/D2CP00417H",
        physics=PyBaMMPart(
            options={
                "loss of active material": losing,
                "particle mechanics": "swelling only",
                # Else the stress would change the new cell's diffusion too.
                "stress-induced diffusion": "false",
            },
            values=partial(_rate, f"{which.capitalize()} electrode LAM constant proportional term [s-1]", 2.7778e-7),
        ),
        lacks=partial(_needs_a_life, "loss of active material"),
        ages=True,
    )


def _clogging(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    import pybamm

    throughput = pybamm.Variable("Throughput capacity [A.h]") / known["Nominal cell capacity [A.h]"]
    # A soft floor: pores narrow, they never close within the bounds of the loss.
    open_share = pybamm.exp(-p["loss"] * throughput)

    def changed(name: str, law: Any) -> Any:
        value = known[name]

        def function(*arguments: Any) -> Any:
            return law(value(*arguments) if callable(value) else value)

        return function

    # The porosity itself stays, so that the salt which a reaction gives must grow by 1 / open_share; the product of
    # (1 - t+) and the thermodynamic factor, which drives the potential, stays.
    laws = {
        "Electrolyte conductivity [S.m-1]": lambda value: value * open_share**1.5,
        "Electrolyte diffusivity [m2.s-1]": lambda value: value * open_share**0.5,
        "Cation transference number": lambda value: 1 - (1 - value) / open_share,
        "Thermodynamic factor": lambda value: value * open_share,
    }
    return {name: changed(name, law) for name, law in laws.items()}


def _porosity_lacks(evidence: Evidence) -> str:
    if evidence.model == "SPM":
        return "SPM has no electrolyte"
    return _too_few(evidence)


porosity_change = Effect(
    name="porosity-change",
    title="pores that clog with charge throughput",
    equation="eps -> eps exp(-s Q_throughput / Q_nominal): kappa_eff ~ eps^1.5, D_e,eff / eps ~ eps^0.5, salt from "
    "reactions (1 - t+) a j / (F eps)",
    parameters=(EffectParameter("loss", "", 0.0, 0.0, 0.1, 1e-3, of=(100.0, "% per nominal capacity passed")),),
    signature="electrolyte polarisation grows from cycle to cycle, with little loss of capacity at low rate",
    citation="Sikha et al., J. Electrochem. Soc. 151 (2004) A1104, doi:10.1149/1.1759972",
    physics=PyBaMMPart(options={"calculate discharge energy": "true"}, values=_clogging),
    lacks=_porosity_lacks,
    ages=True,
)


def _growing_contact(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    import pybamm

    throughput = pybamm.Variable("Throughput capacity [A.h]") / known["Nominal cell capacity [A.h]"]
    # In units of the resistance that loses 1 mV at 1C, so that one range fits cells of any size.
    unit = 1e-3 / known["Nominal cell capacity [A.h]"]
    return {"Contact resistance [Ohm]": known["Contact resistance [Ohm]"] + p["growth"] * unit * throughput}


def _growth_lacks(evidence: Evidence) -> str:
    # Where it is not asked for, SEI growth is named for it, which makes a resistance grow too.
    return _too_few(evidence) if evidence.life else _needs_a_life("", evidence)


resistance_growth = Effect(
    name="resistance-growth",
    title="contacts whose resistance grows with charge throughput",
    equation="R -> R + s R_1mV Q_throughput / Q_nominal, R_1mV = 1 mV / (1C)",
    parameters=(EffectParameter("growth", "", 0.0, 0.0, 10.0, 0.1, of=(1.0, "mV at 1C per nominal capacity passed")),),
    signature="resistance grows at a constant pace; capacity is lost by the cut-offs alone, less at lower rates",
    citation="Vetter et al., J. Power Sources 147 (2005) 269, doi:10.1016/j.jpowsour.2005.01.006",
    physics=PyBaMMPart(
        options={"contact resistance": "true", "calculate discharge energy": "true"},
        borrowed={"Contact resistance [Ohm]": 0.0},
        values=_growing_contact,
    ),
    lacks=_growth_lacks,
    ages=True,
)


def _leak(measured: Any, p: Mapping[str, Any]) -> Any:
    return measured + p["leak"]


self_discharge = Effect(
    name="self-discharge",
    title="self-discharge (leak current)",
    equation="I -> I + I_leak, I_leak >= 0",
    parameters=(EffectParameter("leak", "A", 0.0, 0.0, 0.5, 5e-3),),
    signature="the voltage sinks at rest and charge goes missing at a constant pace per hour, whatever the current",
    citation="Schmidt et al., J. Power Sources 293 (2015) 409, doi:10.1016/j.jpowsour.2015.05.069",
    physics=PyBaMMPart(current=_leak),
)

EFFECTS = (
    sei_reaction,
    sei_diffusion,
    sei_electrons,
    sei_interstitials,
    sei_on_cracks,
    lithium_plating,
    _lam("negative", "positive"),
    _lam("positive", "negative"),
    _stressed("negative", ("stress-driven", "none")),
    _stressed("positive", ("none", "stress-driven")),
    porosity_change,
    resistance_growth,
    self_discharge,
)
