import numpy as np
from bsa.core.record import Record
from bsa.core.trajectory import Trajectory


def test_a_record_is_short_in_a_notebook_and_its_notes_are_no_markup() -> None:
    trajectory = Trajectory(np.arange(5.0), np.zeros(5), np.ones(5))
    record = Record("a<b>.csv", trajectory, ("row <3> was left out",), 298.15)
    assert repr(record) == (
        "<Record a<b>.csv: 5 samples of current, voltage; 4 s; ambient temperature 25.0 degC; 1 note>"
    )
    page = record._repr_html_()
    assert "<b>a&lt;b&gt;.csv</b>: 5 samples" in page
    assert "<ul><li>row &lt;3&gt; was left out</li></ul>" in page
    assert "<ul>" not in Record("a.csv", trajectory)._repr_html_()
