"""Lets these tests import the cell that they share as ``discovery_toy``: test folders are no packages."""

import importlib.util
import sys
from pathlib import Path

_spec = importlib.util.spec_from_file_location("discovery_toy", Path(__file__).with_name("toy.py"))
_toy = importlib.util.module_from_spec(_spec)
sys.modules["discovery_toy"] = _toy
_spec.loader.exec_module(_toy)
