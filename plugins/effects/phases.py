"""Which electrodes have particles of one phase, whose mean stoichiometry an effect can use."""

from ...core.effect import Evidence


def one_phase_lacks(which: str, evidence: Evidence) -> str:
    """Why an effect on the particles of an electrode, ``"negative"`` or ``"positive"``, cannot be; empty if it can."""
    options = evidence.options
    if which == "negative" and options.get("working electrode") == "positive":
        return "the model has no negative electrode of particles"
    phases = options.get("particle phases", "1")
    of_both = tuple(phases) if isinstance(phases, (list, tuple)) else (phases, phases)
    if of_both[which == "positive"] != "1":
        return f"the {which} electrode has particles of several phases, each with its own exchange of lithium"
    return ""
