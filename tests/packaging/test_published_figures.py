"""What the documentation publishes is what its rows say."""

from pathlib import Path

import pytest
from doc_tables.rebuild import RESULTS, documents, rebuild
from doc_tables.results import Results

ROOT = Path(__file__).parents[2]
OPEN, CLOSE = "<!-- table: ", "<!-- end of table -->"


def test_every_table_is_what_its_rows_say():
    changed = rebuild(ROOT, write=False)
    assert not changed, "python docs/make_tables.py writes them again"


def test_every_file_of_rows_has_an_origin_and_stands_in_a_table():
    text = "".join(path.read_text(encoding="utf-8") for path in documents(ROOT))
    stored = {path.stem for path in (ROOT / RESULTS).glob("*.csv")}
    assert stored == set(Results(ROOT / RESULTS).origins)
    assert {name for name in stored if f"{name}.csv)" not in text} == set()


@pytest.mark.parametrize("path", documents(ROOT), ids=lambda path: path.name)
def test_a_mean_with_its_spread_stands_in_a_table_that_is_made(path):
    outside = "".join(part.rpartition(CLOSE)[2] for part in path.read_text(encoding="utf-8").split(OPEN))
    verdicts = ("± 5 %", "± 25 %")  # limits that the verdicts on intervals are defined by
    for words in verdicts:
        outside = outside.replace(words, "")
    assert "±" not in outside
