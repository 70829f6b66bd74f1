"""The report of a run: one self-contained HTML page, built from the journal alone."""

from .page import build_report

__all__ = ["build_report"]
