"""The package in a notebook: what the commands do, as functions whose results display themselves."""

from .calibration import calibrate as calibrate
from .calibration_result import Calibration as Calibration
from .measured import read_record as read_record
