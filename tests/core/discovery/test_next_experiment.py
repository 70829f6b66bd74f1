"""The experiment that would tell two explanations apart."""

from types import SimpleNamespace

import numpy as np
from bsa.core.contracts.requests import Prediction
from bsa.core.discovery.next_experiment import PROTOCOLS, propose


class _ApartOnShortPulses:
    """A stand-in by which two explanations differ on one protocol only."""

    def predict(self, requests):
        sign = 1e-2 * (requests[0].soc == 0.6)
        size = len(requests[0].measured_record.record.time)
        bend = np.linspace(-1.0, 1.0, size)
        return [Prediction(3.7 + bend * sign * place) for place in range(len(requests))]


def test_a_proposal_says_at_which_state_of_charge_it_starts():
    explanations = [SimpleNamespace(effects=(), fit=SimpleNamespace(candidate={}), label=name) for name in ("a", "b")]
    found = propose(_ApartOnShortPulses(), *explanations, 5.0, 1e-3)
    assert found.title == "short pulses of four rates"
    assert found.start_soc == 0.6


class _Apart:
    """Two explanations differ all along one protocol, below the noise, and for a moment on another one, above it."""

    def predict(self, requests):
        size = len(requests[0].measured_record.record.time)
        along = {0.6: 2.5e-3 * np.where(np.arange(size) % 2, 1.0, -1.0), 0.2: 9e-3 * (np.arange(size) == 50)}
        return [Prediction(3.7 + place * along.get(requests[0].soc, 0.0)) for place in range(len(requests))]


def test_a_protocol_that_separates_is_proposed_before_one_with_a_larger_mean_difference():
    explanations = [SimpleNamespace(effects=(), fit=SimpleNamespace(candidate={}), label=name) for name in ("a", "b")]
    found = propose(_Apart(), *explanations, 5.0, 1e-3)
    assert (found.title, found.enough) == ("pulses near the empty cell", True)
    far_noisier = propose(_Apart(), *explanations, 5.0, 1e-2)
    assert (far_noisier.start_soc, far_noisier.enough) == (0.6, False)


def test_a_title_counts_its_depths_rightly():
    (depths,) = (protocol for protocol in PROTOCOLS if "depths" in protocol.title)
    assert "two depths" in depths.title
    assert sum(step.startswith("Discharge at 3C") for step in depths.steps) == 2
