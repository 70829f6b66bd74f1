"""The Jacobian with its full rows apart is CasADi's own, and takes fewer sweeps."""

import casadi
import numpy as np
import pybamm
import pytest
from bsa.plugins.pybamm.modelling.fresh_integrator import FreshIntegrator
from bsa.plugins.pybamm.modelling.sparse_jacobian import sparse_jacobian
from hypothesis import given, settings
from hypothesis import strategies as st


def matrix(function, states, *point):
    found = function(*point)
    assert found.shape == (states.shape[0], states.shape[0])
    return np.asarray(found.full())


@settings(max_examples=50, deadline=None)
@given(
    count=st.integers(2, 40),
    full_rows=st.lists(st.integers(0, 39), max_size=4, unique=True),
    full_column=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_equals_the_jacobian_of_casadi_with_any_rows_full(count, full_rows, full_column, seed):
    y = casadi.MX.sym("y", count)
    rows = []
    for row in range(count):
        if row in full_rows:
            rows.append(casadi.sum1(casadi.sin(y)) * (row + 1))
        else:
            rows.append(y[row] * y[(row + 1) % count] + (y[0] ** 2 if full_column else 0))
    expression = casadi.vertcat(*rows)
    point = np.random.default_rng(seed).normal(size=count)
    sparse = casadi.Function("sparse", [y], [sparse_jacobian(expression, y)])
    plain = casadi.Function("plain", [y], [casadi.jacobian(expression, y)])
    assert sparse.sparsity_out(0) == plain.sparsity_out(0)
    np.testing.assert_allclose(matrix(sparse, y, point), matrix(plain, y, point), rtol=1e-12)


def sweeps(jacobian):
    """How much work an evaluation is, by the length of the function."""
    return len(casadi.Function("jacobian", casadi.symvar(jacobian), [jacobian]).serialize())


@pytest.fixture(scope="module")
def lumped():
    """Equations and states of a cell whose temperature depends on all points, and all diffusivities on that."""
    model = pybamm.lithium_ion.SPMe({"thermal": "lumped"})
    simulation = pybamm.Simulation(model, parameter_values=pybamm.ParameterValues("OKane2022"))
    simulation.build()
    built = simulation.built_model
    t, y = casadi.MX.sym("t"), casadi.MX.sym("y", built.len_rhs_and_alg)
    return built.concatenated_rhs.to_casadi(t, y, inputs={}), y


def test_a_warming_cell_takes_a_third_of_the_work(lumped):
    assert sweeps(sparse_jacobian(*lumped)) < sweeps(casadi.jacobian(*lumped)) / 3


def test_without_full_rows_it_is_casadis_own():
    y = casadi.MX.sym("y", 30)
    assert sweeps(sparse_jacobian(y**2, y)) == sweeps(casadi.jacobian(y**2, y))


def test_the_model_of_a_solve_is_left_as_it_was():
    simulation = pybamm.Simulation(
        pybamm.lithium_ion.SPM(), parameter_values=pybamm.ParameterValues("Chen2020"), solver=FreshIntegrator()
    )
    simulation.solve([0, 60])
    assert "build_casadi_jacobian" not in vars(simulation.built_model)
