"""Effects of the circuit around and inside the cell."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from ...core.effect import Effect, EffectParameter, Evidence
from ..pybamm.augmentation import PyBaMMPart
from .phases import one_phase_lacks


def _resistance(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    # A base model may have one already: that of a run has the fitted one.
    return {"Contact resistance [Ohm]": known["Contact resistance [Ohm]"] + p["resistance"]}


contact_resistance = Effect(
    name="contact-resistance",
    title="contact (series) resistance",
    equation="V -> V - R I",
    parameters=(EffectParameter("resistance", "Ohm", 0.0, 0.0, 1.0, 2e-3),),
    signature="a voltage error proportional to the current, at once with every current step, the same at every "
    "state of charge, gone at rest",
    citation="Taylor et al., Meas. Sci. Technol. 33 (2022) 105101, doi:10.1088/1361-6501/ac75b4",
    physics=PyBaMMPart(
        options={"contact resistance": "true"}, borrowed={"Contact resistance [Ohm]": 0.0}, values=_resistance
    ),
)


def _double_layer_lacks(evidence: Evidence) -> str:
    if evidence.options.get("surface form") == "differential":
        return "the base model has a double layer already"
    # A double layer relaxes within tenths of a second; sparser samples show nothing of it.
    return "no sample lies within 2 s of a current step" * (evidence.sampling_s > 2.0)


def _double_layer(known: Mapping[str, Any], p: Mapping[str, Any]) -> dict[str, Any]:
    # The surface equation stays differential at the null value, a hundredth of the probe. A thousandth of a second is
    # too short to be seen, and long enough for an integrator that starts afresh every second of a drive cycle.
    capacity = p["capacitance"] + 0.02
    return {
        "Negative electrode double-layer capacity [F.m-2]": capacity,
        "Positive electrode double-layer capacity [F.m-2]": capacity,
    }


double_layer_capacitance = Effect(
    name="double-layer-capacitance",
    title="double-layer capacitance",
    equation="C_dl d(phi_s - phi_e)/dt = i_total - i_reaction, in both electrodes",
    parameters=(EffectParameter("capacitance", "F.m-2", 0.0, 0.0, 200.0, 2.0),),
    signature="the reaction overpotential builds up and decays over fractions of a second to seconds instead of at "
    "once; nothing after that",
    citation="Ong and Newman, J. Electrochem. Soc. 146 (1999) 4360, doi:10.1149/1.1392643",
    physics=PyBaMMPart(options={"surface form": "differential"}, values=_double_layer),
    lacks=_double_layer_lacks,
)


def _fewer_particles(which: str, model: Any, p: Mapping[str, Any]) -> Any:
    import pybamm

    current = model.variables["Current [A]"]
    stoichiometry = model.variables[f"Average {which} particle stoichiometry"]
    fills = current > 0 if which == "positive" else current < 0
    left = fills * (1 - stoichiometry) + (1 - fills) * stoichiometry
    end = 1e-3  # the share below which the resistance rises no further
    share = (left + pybamm.sqrt(left**2 + 4 * end**2)) / 2
    return -p["overpotential"] * current / model.param.Q * (1 / share**2 - 1)


resistive_reactant = tuple(
    Effect(
        name="resistive-reactant",
        variant=f"{electrode} electrode",
        title=f"particles of the {electrode} electrode that are connected unequally well and react one after another",
        equation="V -> V - eta I / I_1C (1 / s^2 - 1), s: share of the particles that have not reacted, 1 - x in an "
        "electrode that fills and x in one that empties; 1 / s^2 where conductances are distributed evenly from zero "
        "on and the best connected particles react first",
        parameters=(EffectParameter("overpotential", "V", 0.0, 0.0, 0.2, 2e-3),),
        signature="a resistance that grows as the electrode fills or empties: the voltage falls early and gradually "
        "at the end of a discharge, in proportion to the current, and sharply at a low rate",
        citation="Safari and Delacourt, J. Electrochem. Soc. 158 (2011) A63, doi:10.1149/1.3515902; as a variable "
        "resistance: J. Appl. Electrochem. 48 (2018) 663, doi:10.1007/s10800-018-1189-z",
        physics=PyBaMMPart(voltage=partial(_fewer_particles, electrode)),
        lacks=partial(one_phase_lacks, electrode),
        on_request=True,
    )
    for electrode in ("negative", "positive")
)

EFFECTS = (contact_resistance, double_layer_capacitance, *resistive_reactant)
