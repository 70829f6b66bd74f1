"""The table of the columns of ``cells.csv``."""

from bsa.experiments.campaign.columns import COLUMNS

from .results import Results

_KINDS = {str: "text", int: "integer", float: "number"}


def cell_columns(_results: Results) -> str:
    """What each column of the results table of a grid or study holds."""
    rows = [f"| `{column.name}` | {_KINDS[column.kind]} | {column.words} |" for column in COLUMNS]
    return "\n".join(["| column | type | what it holds |", "| --- | --- | --- |", *rows])
