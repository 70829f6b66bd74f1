"""Measured cells: a right name or no name, never a wrong one. Slow: several minutes each."""

from pathlib import Path

import pytest
from bsa.experiments.discover import DiscoverOptions, discover

DATA = Path(__file__).parents[2].parent / "shared" / "data"
NASA, LGM50 = DATA / "nasa_pcoe", DATA / "lgm50"


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not NASA.exists(), reason="../shared/data/nasa_pcoe is absent")
def test_nasa_b0005_lacks_a_series_resistance_or_nothing_is_named(tmp_path):
    def discharge(test):
        return {"path": NASA / "B0005_discharges.csv.gz", "read": {"where": {"test_id": test}}}

    charge = {"path": NASA / "B0005_charges_every20th.csv.gz", "read": {"where": {"test_id": "2"}}}
    options = DiscoverOptions(
        data=[discharge("1"), charge],
        holdout=[discharge("5")],
        parameters="Ai2020",
        model="SPMe",
        ambient_c=24.0,
        out=tmp_path,
    )
    found = discover(options)
    assert found.verdict != "no-missing-effect"
    if found.verdict == "effect-found":
        assert "contact-resistance" in found.names


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not LGM50.exists(), reason="../shared/data/lgm50 is absent")
def test_lgm50_at_2c_lacks_self_heating_or_nothing_is_named(tmp_path):
    options = DiscoverOptions(
        data=[LGM50 / "Cell796_2C_25degC.csv"], parameters="ORegan2022", model="SPMe", ambient_c=25.0, out=tmp_path
    )
    found = discover(options)
    assert found.verdict != "no-missing-effect"
    if found.verdict == "effect-found":
        assert "self-heating" in found.names
        assert max(found.temperature_rms_k.values()) < 4.0
