"""What a model does not depend on is not searched, and whoever names it is told."""

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.record import Record
from bsa.core.task import CellModel, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.tasks.influence import simulated_models, without_use
from bsa.experiments.tasks.measured_cell import CellRequest
from bsa.experiments.tasks.record_request import RecordRequest
from bsa.experiments.tasks.records import build_task

SEPARATOR = "Separator thickness [m]"
RECORD = Record(
    "r",
    Trajectory(
        np.linspace(0.0, 7200.0, 61),
        np.full(61, 2.5),
        np.linspace(4.0, 2.6, 61),
        None,
        (Step(StepKind.CC_DISCHARGE, 0, 61, 1),),
    ),
)


def task(search, model: str = "SPM", **settings) -> Task:
    return build_task("t", CellRequest("Chen2020", model, search=search, **settings), [RecordRequest(RECORD)])


@pytest.mark.slow
@pytest.mark.parametrize("protocol", [None, (("Discharge at 1C until 2.6 V",),)])
def test_a_preset_leaves_out_what_the_model_does_not_depend_on_and_says_so_once(protocol) -> None:
    built = build_task(
        "t", CellRequest("Chen2020", "SPM", search="geometry"), [RecordRequest(RECORD, protocol=protocol)]
    )
    assert SEPARATOR not in built.space
    assert len(built.space) == 4
    (said,) = (note for note in built.notes if "does not depend on" in note)
    assert "The model SPM" in said
    assert "not searched: Separator thickness, Negative electrode porosity, " in said
    (said,) = (note for note in task("cell").notes if "does not depend on" in note)
    assert said.endswith("Electrolyte conductivity, Electrolyte diffusivity, Thermodynamic factor.")
    whole = build_task(
        "t", CellRequest("Chen2020", "SPMe", search="geometry"), [RecordRequest(RECORD, protocol=protocol)]
    )
    assert len(whole.space) == 9
    assert not any("does not depend on" in note for note in whole.notes)


@pytest.mark.parametrize("name", [SEPARATOR, "Electrolyte conductivity [S.m-1] factor", "Cell volume [m3]"])
def test_a_parameter_without_influence_that_a_person_names_is_refused(name: str) -> None:
    with pytest.raises(BsaError, match=r"has no influence in the model SPM with contact resistance=true") as caught:
        task({"Negative particle radius [m]": {"factors": [0.5, 2.0]}, name: {"factors": [0.5, 2.0]}})
    assert f'"{name}"' in caught.value.message
    assert "leave it out" in caught.value.hint


def test_a_lumped_cell_has_a_volume() -> None:
    name = "Cell volume [m3]"
    assert name in task({name: {"factors": [0.5, 2.0]}}, options={"thermal": "lumped"}).space


def test_a_spectrum_is_simulated_with_double_layers() -> None:
    cell = CellModel("Chen2020", "SPM")
    alone, both, none = (simulated_models(cell, *given) for given in ((False, True), (True, True), (False, False)))
    assert [len(alone), len(both)] == [1, 2]
    assert alone[0].options == both[1].options == {"surface form": "differential"}
    assert both[0] == none[0] == cell


def test_a_value_that_replaces_one_the_model_does_not_depend_on_is_named() -> None:
    given = [SEPARATOR, "Nominal cell capacity [A.h]", "Negative electrode thickness [m]"]
    (said,) = without_use(CellModel("Chen2020", "SPM"), given)
    assert said.endswith(f'gives it: "{SEPARATOR}".')
    assert without_use(CellModel("Chen2020", "DFN"), given) == []
