"""A column of the results table is one declaration: files, page and tables take it from there."""

import csv
import json
import re

import pytest
from bsa.experiments.campaign import page, results, tables
from bsa.experiments.campaign.columns import COLUMNS, Column
from bsa.experiments.campaign.running import run_campaign
from doc_tables.columns import cell_columns

from .conftest import Here, Quiet

ADDED = Column(
    "calls_a_simulation",
    float,
    "calls of the language model for each simulation",
    lambda facts: facts.result["llm_calls"] / facts.result["simulations"] if facts.result else None,
    page="Calls a simulation",
)


@pytest.fixture
def with_one_more(monkeypatch):
    """The columns with one that nothing else knows of."""
    for module in (results, page):
        monkeypatch.setattr(module, "COLUMNS", (*COLUMNS, ADDED))


@pytest.mark.slow
def test_a_new_column_is_in_the_files_and_on_the_page(make_plan, with_one_more):
    plan = make_plan()
    rows, _ = run_campaign(plan, Here(), Quiet())
    expected = [row["llm_calls"] / row["simulations"] for row in rows]
    assert [row["calls_a_simulation"] for row in rows] == expected
    with (plan.folder / "cells.csv").open() as file:
        assert [float(row["calls_a_simulation"]) for row in csv.DictReader(file)] == expected
    html = page.build_page("toys", plan.store.root).read_text()
    data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)[1])
    place = [column["name"] for column in data["columns"]].index("calls_a_simulation")
    assert data["columns"][place] == {
        "name": "calls_a_simulation",
        "title": "Calls a simulation",
        "numeric": True,
    }
    assert [row[place] for row in data["rows"]] == expected
    parquet = pytest.importorskip("pyarrow.parquet", reason='pip install "battery-sim-agent[cluster]"')
    assert parquet.read_table(plan.folder / "cells.parquet")["calls_a_simulation"].to_pylist() == expected


def test_the_tables_show_the_errors_and_the_effort_that_columns_declare():
    assert {column.name: column.error for column in COLUMNS if column.error} == tables.METRICS
    assert list(tables.EFFORT)[:2] == ["simulations", "failed_simulations"]


def test_names_are_unique_and_every_type_has_one_in_parquet():
    names = [column.name for column in COLUMNS]
    assert len(set(names)) == len(names)
    assert {column.kind for column in COLUMNS} == {str, int, float}


def test_what_every_column_holds_is_told_in_the_documentation():
    told = cell_columns(None).splitlines()[2:]
    assert [line.split("`")[1] for line in told] == [column.name for column in COLUMNS]
    assert all(line.count(" | ") == 2 and len(column.words) > 5 for line, column in zip(told, COLUMNS, strict=True))
