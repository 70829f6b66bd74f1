"""Markers in a document, and the rows that fill what stands between them."""

import pytest
from bsa.core.errors import BsaError
from bsa.core.files import write_csv
from doc_tables.rebuild import rebuild

ROWS = [{"case": "regular-1", "mape": 0.05}, {"case": "extreme-2", "mape": 0.1}]
BLOCK = "<!-- table: noise -->\n{}<!-- end of table -->\n"
ORIGIN = "{command: bsa bench suite, version: abc1234, machine: two free cores}"


@pytest.fixture
def checkout(tmp_path):
    """A folder as `rebuild` takes it, with the rows of one table."""
    results = tmp_path / "docs" / "results"
    write_csv(results / "noise.csv", ROWS)
    write_csv(results / "published.csv", [{**row, "mape": row["mape"] / 10} for row in ROWS])
    (results / "origins.yaml").write_text(f"noise: {ORIGIN}\n")
    (tmp_path / "README.md").write_text("nothing here\n")
    (tmp_path / "docs" / "one.md").write_text("before\n" + BLOCK.format("") + "after\n")
    return tmp_path


def test_a_table_is_made_of_its_rows_once_and_stands_between_its_markers(checkout):
    assert rebuild(checkout) == [checkout / "docs" / "one.md"]
    text = (checkout / "docs" / "one.md").read_text()
    assert text.startswith("before\n<!-- table: noise -->\n```sh\nbsa bench suite\n```\n")
    assert text.endswith("<!-- end of table -->\nafter\n")
    assert "| with noise, 60 simulations | 0.05 | 0.1 |" in text
    assert "*[noise.csv](results/noise.csv): made by abc1234; two free cores.*" in text
    assert rebuild(checkout) == []


def test_a_document_that_differs_is_named_and_left_alone_by_a_check(checkout):
    rebuild(checkout)
    document = checkout / "docs" / "one.md"
    edited = document.read_text().replace("| 0.05 |", "| 0.04 |")
    document.write_text(edited)
    assert rebuild(checkout, write=False) == [document]
    assert document.read_text() == edited


def test_the_readme_links_to_rows_from_where_it_lies(checkout):
    (checkout / "README.md").write_text(BLOCK.format(""))
    rebuild(checkout)
    assert "(docs/results/noise.csv)" in (checkout / "README.md").read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<!-- table: nois -->\n<!-- end of table -->", 'did you mean "noise"'),
        ("\n\n<!-- table: noise -->\n", "one.md:3: markers of tables do not pair"),
        ("<!-- end of table -->\n", "do not pair"),
        ("<!-- table: noise -->\n<!-- table: noise -->\n<!-- end of table -->", "do not pair"),
        ("<!-- table: noise -->\n<!-- end of table -->\n<!-- end of table -->", "do not pair"),
        (BLOCK.format("").replace("noise", "baselines"), "baselines.csv is missing"),
    ],
)
def test_what_cannot_be_made_is_an_error_and_nothing_is_written(checkout, text, words):
    (checkout / "docs" / "one.md").write_text(text)
    with pytest.raises(BsaError) as caught:
        rebuild(checkout)
    assert words in f"{caught.value}"
    assert (checkout / "docs" / "one.md").read_text() == text


def test_rows_without_an_origin_make_no_table(checkout):
    (checkout / "docs" / "results" / "origins.yaml").write_text("other: " + ORIGIN)
    with pytest.raises(BsaError, match='does not say where "noise" comes from'):
        rebuild(checkout)


def test_a_folder_without_documentation_is_refused(tmp_path):
    with pytest.raises(BsaError, match="checkout"):
        rebuild(tmp_path)
