"""`bsa.discover`: what `bsa discover` does, from Python."""

import inspect
import json
from dataclasses import replace

import bsa
import numpy as np
import pandas as pd
import pybamm
import pytest
from bsa.core.errors import BsaError
from bsa.core.messages import Outage
from bsa.experiments.cli.discover import discover as command
from bsa.experiments.discovery_case import read_case
from bsa.experiments.discovery_journal import opened
from bsa.experiments.tasks.find import PACKAGED
from bsa.experiments.tasks.parameter_source import parameter_source
from bsa.plugins.pybamm.cells.parameter_sets import load

DEMO = PACKAGED / "demo.csv"


def test_options_and_their_defaults_are_those_of_the_command() -> None:
    def options(function, *without):
        found = inspect.signature(function).parameters.values()
        return {one.name: one.default for one in found if one.name not in without}

    assert options(bsa.discover, "progress") == options(command, "context", "as_json", "join")  # join: read_record


@pytest.mark.parametrize(
    ("data", "options", "words"),
    [
        (None, {"parameters": "Chen2020"}, "data is missing"),
        (DEMO, {}, "parameters is missing"),
        ([], {"parameters": "Chen2020"}, "data is empty"),
        (3, {"parameters": "Chen2020"}, "int is no record"),
        ("no_such.csv", {"parameters": "Chen2020"}, "no_such.csv"),
        (DEMO, {"parameters": "Chen2020", "options": ["thermal=lumped"]}, "--options is"),
        (DEMO, {"parameters": "Chen2020", "override": "x=1"}, "--override is"),
        (DEMO, {"parameters": "Chen2020", "max_effects": 9}, "max_effects"),
        (DEMO, {"parameters": "Chen2020", "fit_cycles": 0}, "fit_cycles"),
        (DEMO, {"parameters": "Chen2020", "life": True, "holdout": DEMO}, "--holdout cannot be given with --life"),
        ([DEMO, DEMO], {"parameters": "Chen2020", "life": True}, "2 lives were given"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(data, options, words, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BsaError, match=words):
        bsa.discover(data, progress=False, **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("stop", "raised"), [(KeyboardInterrupt, KeyboardInterrupt), (Outage("gone"), BsaError)])
def test_what_stops_it_says_how_it_goes_on(stop, raised, tmp_path, monkeypatch, capsys) -> None:
    def fail(*arguments):
        raise stop

    monkeypatch.setattr("bsa.experiments.discover.discover", fail)
    with pytest.raises(raised) as caught:
        bsa.discover(DEMO, parameters="Chen2020", out=tmp_path / "found")
    said = capsys.readouterr().err + getattr(caught.value, "hint", "")
    assert f"discover(resume={str(tmp_path / 'found')!r})" in said


def test_a_record_becomes_a_file_that_reads_the_same(tmp_path, monkeypatch) -> None:
    asked = []

    def stop(options, *arguments):
        asked.append(options)
        raise KeyboardInterrupt

    monkeypatch.setattr("bsa.experiments.discover.discover", stop)
    record = bsa.read_record(pd.read_csv(DEMO), temperature=25, name="a/b c")
    with pytest.raises(KeyboardInterrupt):
        bsa.discover(
            record,
            holdout=DEMO,
            reference=[record, DEMO],
            parameters="Chen2020",
            out=tmp_path / "found",
            progress=False,
        )
    (options,) = asked
    assert [file.path.name for file in options.reference] == ["3-b-c.csv", "demo.csv"]
    assert options.search == "unchanged"
    again = bsa.read_record(options.reference[0].path)
    np.testing.assert_array_equal(again.trajectory.voltage, record.trajectory.voltage)
    written = bsa.read_record(options.data[0].path)
    assert options.data[0].path.parent == tmp_path / "found-records"
    np.testing.assert_array_equal(written.trajectory.voltage, record.trajectory.voltage)
    np.testing.assert_array_equal(written.trajectory.current, record.trajectory.current)
    assert written.ambient_k == record.ambient_k == 298.15
    assert options.holdout[0].path == DEMO


def test_the_notes_of_a_record_are_told_of_its_copy_once(tmp_path, monkeypatch) -> None:
    asked = []
    monkeypatch.setattr("bsa.experiments.api.discovery._carried_out", lambda options, *others: asked.append(options))
    read = bsa.read_record(DEMO, current_offset=0.01)
    record = replace(read, notes=(*read.notes, "it was mended."))
    bsa.discover(record, parameters="Chen2020", model="SPM", out=tmp_path / "found")
    notes = read_case(asked[0]).notes
    assert "1-demo.csv: it was mended." in notes
    assert any(note.startswith("1-demo.csv: 10 mA are taken off the current") for note in notes)
    assert len(notes) == len(set(notes))


def test_another_frame_leaves_the_records_of_an_earlier_discovery_alone(tmp_path, monkeypatch) -> None:
    def stop(options, *arguments):
        with opened(options):
            raise KeyboardInterrupt

    monkeypatch.setattr("bsa.experiments.discover.discover", stop)
    frame = pd.read_csv(DEMO)
    asked = {"parameters": "Chen2020", "temperature": 25, "out": tmp_path / "found", "progress": False}
    with pytest.raises(KeyboardInterrupt):
        bsa.discover(frame, **asked)
    (written,) = (tmp_path / "found-records").iterdir()
    before = written.read_bytes()
    with pytest.raises(BsaError, match="found belongs to a discovery with other records"):
        bsa.discover(frame.iloc[:-5], **asked)
    assert written.read_bytes() == before
    for again in ({"data": frame, **asked}, {"resume": tmp_path / "found", "progress": False}):
        with pytest.raises(KeyboardInterrupt):
            bsa.discover(**again)


@pytest.mark.slow
def test_a_hidden_resistance_is_found_and_shown(resistive_cell, tmp_path) -> None:
    found = bsa.discover(
        resistive_cell,
        current_sign="discharge-positive",
        parameters="Chen2020",
        model="SPM",
        temperature=25,
        scale=False,
        effect=["contact-resistance", "voltage-offset"],
        out=tmp_path / "found",
    )
    assert found.effects == ("contact-resistance",)
    assert found.to_json() == json.loads((tmp_path / "found" / "discovery.json").read_text())
    errors = found.errors["Voltage RMSE [mV]"]
    assert errors["best"] < errors["initial"]
    (interval,) = found.intervals.values()
    assert interval[0] < 0.02 < interval[1]
    page = found._repr_html_()
    assert page.count("data:image/svg+xml") == 1
    assert "contact-resistance" in page
    assert "Cyclable lithium factor" in page
    values, model = found.parameter_values, found.model
    assert interval[0] <= values["Contact resistance [Ohm]"] <= interval[1]
    assert model.options["contact resistance"] == "true"
    assert values["Lower voltage cut-off [V]"] == 2.5
    assert bsa.discover(resume=found.folder, progress=False).parameters == found.parameters


def test_loaded_parameter_values_become_a_file_beside_the_discovery(tmp_path, monkeypatch) -> None:
    asked = []
    monkeypatch.setattr("bsa.experiments.api.discovery._carried_out", lambda options, *others: asked.append(options))
    bsa.discover(DEMO, parameters=pybamm.ParameterValues("Marquis2019"), out=tmp_path / "found")
    source = parameter_source(asked[0].parameters)
    assert asked[0].parameters == str(tmp_path / "found-records" / "parameters.json")
    assert load(source)["Electrode width [m]"] == 0.207


def test_one_effect_may_stand_without_a_list(tmp_path, monkeypatch) -> None:
    asked = []
    monkeypatch.setattr("bsa.experiments.api.discovery._carried_out", lambda options, *others: asked.append(options))
    bsa.discover(DEMO, parameters="Chen2020", effect="contact-resistance", out=tmp_path / "found")
    assert asked[0].effects == ["contact-resistance"]


def test_each_record_is_read_as_it_is_said_in_its_place(tmp_path, monkeypatch) -> None:
    asked = []
    monkeypatch.setattr("bsa.experiments.api.discovery._carried_out", lambda options, *others: asked.append(options))
    bsa.discover(
        ["a.csv", "b.csv"], holdout="c.csv", parameters="Chen2020", temperature=[25, 10, 0], current_offset=0.01,
        out=tmp_path / "found",
    )  # fmt: skip
    (options,) = asked
    files = [*options.data, *options.holdout]
    assert [file.read.ambient_c for file in files] == [25, 10, 0]
    assert {file.read.current_offset_a for file in files} == {0.01}
    assert options.ambient_c is None
