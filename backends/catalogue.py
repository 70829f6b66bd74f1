"""The built-in backends. Factories import their libraries when called, so that listing stays fast."""

from __future__ import annotations
