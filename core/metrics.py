"""How well a simulation matches a record: the paper's metric, and the honest ones beside it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Metrics:
    """Errors of one trial, averaged over the experiments of its task.

    Attributes
    ----------
    objective : float
        The number that "best" means: ``mape`` where a protocol was simulated, ``v_rmse_mv`` where the
        measured current drove the cell (current and charge then match by construction).
    mape : float
        The paper's total: ``q_mape + i_mape + v_mape``, in percent.
    q_mape, i_mape, v_mape : float
        Mean absolute percentage error of charge, current and voltage.
    rmse : float
        Sum of the three root-mean-square errors (A.h, A, V), as in the paper.
    v_rmse_mv : float
        Root-mean-square voltage error over the time both records cover, in mV.
    step_duration_error : float
        Mean over the steps of ``|ln(simulated duration / measured duration)|``.
    capacity_error : float
        Relative error of the discharged capacity of the scored part.
    """

    objective: float
    mape: float
    q_mape: float
    i_mape: float
    v_mape: float
    rmse: float
    v_rmse_mv: float
    step_duration_error: float
    capacity_error: float
