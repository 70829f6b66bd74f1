"""The package in a notebook: what the commands do, as functions whose results display themselves."""

from .calibration import calibrate as calibrate
from .calibration_result import CalibrationResult as CalibrationResult
from .discovery import discover as discover
from .discovery_result import DiscoveryResult as DiscoveryResult
from .measured import read_record as read_record
