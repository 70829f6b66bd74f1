"""Base parameters that are loaded already."""

from pathlib import Path

import numpy as np
import pybamm
import pytest
from bsa.core.errors import BsaError
from bsa.core.task import ParameterFile
from bsa.experiments.api.given_parameters import given_parameters
from bsa.plugins.pybamm.cells.parameter_sets import load


def test_a_name_and_a_path_are_text():
    assert given_parameters("Chen2020") == "Chen2020"
    assert given_parameters(Path("cell.json")) == "cell.json"


def test_parameter_values_are_a_file_with_their_numbers_and_functions():
    values = pybamm.ParameterValues("Chen2020")
    values["Electrode width [m]"] = 0.7
    found = given_parameters(values)
    assert isinstance(found, ParameterFile)
    read = load(found)
    assert read["Electrode width [m]"] == 0.7
    name, stoichiometry = "Negative electrode OCP [V]", pybamm.Scalar(0.3)
    np.testing.assert_allclose(read[name](stoichiometry).evaluate(), values[name](stoichiometry).evaluate())


def test_a_function_that_is_no_expression_is_refused_with_a_reason():
    values = pybamm.ParameterValues("Chen2020")
    values["Negative electrode OCP [V]"] = lambda sto: 0.1 if sto > 0.5 else 0.2
    with pytest.raises(BsaError, match="cannot be written as JSON"):
        given_parameters(values)


def test_anything_else_is_refused():
    with pytest.raises(BsaError, match="parameters is a dict") as found:
        given_parameters({"Electrode width [m]": 0.7})
    assert "pybamm.ParameterValues" in found.value.hint
