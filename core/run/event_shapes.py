"""What the events of a journal look like; every reader may rely on it."""

from functools import cache
from typing import Any, Literal

from ..comparison.record_errors import RecordErrors, SignalError, StepErrors
from ..encoding import TrialRecord
from ..inference.identifiability import Combination, Interval
from ..inference.measure_next import Suggestion
from ..inference.prediction import Band
from ..messages import Usage
from ..shape import check_json, list_of, mapping_with
from ..trial import Phase


@cache
def _shapes() -> dict[str, Any]:
    """The shapes by kind of event."""
    turn = mapping_with(role=str, text=str, images=int)
    ballot = mapping_with(problem=str, changes=dict[str, Any])
    predicted = mapping_with(
        record=str,
        signals=dict[str, SignalError],
        steps=list[StepErrors],
        failure=str,
        bands=dict[str, Band],
        simulations=int,
        curve=dict[str, Any] | None,
    )
    analysis = mapping_with(
        base=int,
        intervals=dict[str, Interval],
        combinations=list[Combination],
        correlated=list[list[str]],
        noise=float,
        points=int,
        unknown=list[str],
        unsettled=list[str],
        worst=str,
        measure_next=list[Suggestion],
        simulations=int,
        reused=int,
        seconds=float,
    )
    return {
        "run": mapping_with(
            config=(dict[str, Any], {}),
            task=(dict[str, Any], {}),
            versions=(dict[str, str], {}),
            to_discover=(str, ""),
        ),
        "trial": TrialRecord,
        "reply": mapping_with(
            text=str, usage=Usage, model=str, structured_by=str, notes=list[str], prompt=list_of(turn)
        ),
        "lost-call": mapping_with(reason=str, prompt=list_of(turn), refused=(bool, False)),
        "vote": mapping_with(text=str, rule=str, ballots=list_of(ballot)),
        "review": mapping_with(text=str, verdict=Literal["accept", "edit", "refuse"]),
        "proposal": mapping_with(
            phase=Phase,
            round=int,
            hypothesis=str,
            rationale=str,
            action=str,
            updates=dict[str, str],
            details=dict[str, Any],
            lost=str,
            finished=bool,
        ),
        # Earlier versions did not raise the patience.
        "budget": mapping_with(simulations=int, rounds=int, patience=(int | None, None), proposals=int),
        "allowance": mapping_with(max_tokens=int | None, max_cost_usd=float | None),
        "score": mapping_with(index=int, metrics=dict[str, float | None] | None, records=(list[RecordErrors], [])),
        "appraisal": mapping_with(appraisal=analysis),
        # Of how many draws of the posterior bands are made; earlier versions did not write it.
        "held-out": mapping_with(base=int, predictions=list_of(predicted), draws=(int | None, None)),
        "appraisal-simulation": mapping_with(experiments=list[str], candidate=dict[str, float], outcome=dict[str, Any]),
        "low-fidelity": mapping_with(candidate=dict[str, float], residuals=str | None, seconds=float),
        # What a discovery has settled before its first simulation; no shift where it could not be simulated.
        "settled": mapping_with(spreads=dict[str, tuple[float, float, float]], radial_points=int, shift_v=float | None),
        # Voltage and temperature are those of a measured record, residuals those of a life. Earlier versions wrote no
        # time since the journal was opened, here and at the end.
        "simulation": mapping_with(
            key=str,
            wall_s=(float, 0.0),
            voltage=(str | None, None),
            temperature=(str | None, None),
            residual=(str | None, None),
        ),
        "refused": mapping_with(effect=str, why=str),
        "note": mapping_with(text=str),
        "end": mapping_with(status=str, wall_s=(float, 0.0)),
    }


def check_event(kind: str, line: bytes) -> None:
    """Hold an event to its shape; a kind that is not known here passes.

    ``line`` is the event as it stands in the journal. Raises `ValueError` if a field is missing or of another type,
    with its name.
    """
    if kind in _shapes():
        check_json(_shapes()[kind], line)
