"""The bars of notebooks and terminals."""

import bsa
import pytest
from bsa.core.errors import BsaError
from bsa.core.messages import Usage
from bsa.experiments.api.progress import CalibrationBar, DiscoveryBar
from bsa_toy_cell import toy_task


def test_a_discovery_that_is_refused_draws_no_bar(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BsaError, match="no_such_file"):
        bsa.discover("no_such_file.csv", parameters="Chen2020")
    assert capsys.readouterr().err == ""
    with DiscoveryBar(True) as bar:
        bar.said("fits the base model")
    assert "fits the base model" in capsys.readouterr().err


def test_a_calibration_says_what_it_waits_for(capsys) -> None:
    with CalibrationBar(toy_task(), 5, True) as bar:
        assert "first simulation" in capsys.readouterr().err
        bar.asked(Usage())
    assert "waiting for the language model" in capsys.readouterr().err
