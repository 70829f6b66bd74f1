"""PyBaMM's integrator, whose answers do not depend on what it solved before."""

import threading
import time
from typing import Any

from ..cells.parameter_sets import pybamm
from .machine_code import MachineCode
from .sparse_jacobian import sparse_jacobian

_COMPILED = pybamm.solvers.idaklu_solver.idaklu
_make_solvers, _read_function = _COMPILED.create_casadi_solver_group, _COMPILED.generate_function
_SETTING_UP = threading.Lock()  # While an integrator is set up, PyBaMM calls other functions than these two.

_CALLED_OFTEN = ("rhs_alg", "jac_times_cjmass", "mass_action", "events", "alg_res", "alg_jac")
"""The functions that an integration calls, beside the output variables; the others are for sensitivities."""


class FreshIntegrator(pybamm.IDAKLUSolver):  # type: ignore[misc]
    """Integrates each time with memory of its own; what is compiled is kept.

    Algebraic equations are made consistent by a factorisation whose pivots PyBaMM keeps for the next solve, until a
    matrix is so ill-conditioned that it chooses others. After a cell that ran empty all later voltages were up to a
    tenth of a millivolt off, and fits in two worker processes ended elsewhere than in one. Making it takes 0.2 ms.

    A model that is solved often is solved by machine code after some time; see `MachineCode`. Its Jacobian is made by
    `sparse_jacobian`.
    """

    _parts: dict[str, Any]
    _code: MachineCode

    def set_up(self, model: Any, *arguments: Any, **how: Any) -> Any:
        """See `pybamm.BaseSolver.set_up`; notes what PyBaMM makes the compiled integrator of."""
        texts: dict[int, str] = {}

        def converted(text: str) -> Any:
            function = _read_function(text)
            texts[id(function)] = text
            return function

        def noted(**parts: Any) -> Any:
            self._parts = parts
            functions = [*(parts[name] for name in _CALLED_OFTEN), *parts["var_fcns"]]
            self._code = MachineCode([texts[id(function)] for function in functions])
            return _make_solvers(**parts)

        if not model.switching_control_variables:  # Those PyBaMM differentiates in a way of their own.
            model.build_casadi_jacobian = sparse_jacobian
        with _SETTING_UP:
            _COMPILED.create_casadi_solver_group, _COMPILED.generate_function = noted, converted
            try:
                return super().set_up(model, *arguments, **how)
            finally:
                _COMPILED.create_casadi_solver_group, _COMPILED.generate_function = _make_solvers, _read_function
                vars(model).pop("build_casadi_jacobian", None)

    def _integrate(self, *arguments: Any, **how: Any) -> Any:
        made = self._code.made(_read_function)
        if made is not None:
            count = len(_CALLED_OFTEN)
            self._parts |= {**dict(zip(_CALLED_OFTEN, made, strict=False)), "var_fcns": made[count:]}
        self._setup["solver"] = _make_solvers(**self._parts)
        start = time.perf_counter()
        try:
            return super()._integrate(*arguments, **how)
        finally:
            self._code.spent(time.perf_counter() - start)
