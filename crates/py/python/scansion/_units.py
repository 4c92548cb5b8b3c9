"""Units of coordinates."""

from __future__ import annotations

METRES = {9001: 1.0, 9002: 0.3048, 9003: 1200 / 3937}
"""Metres per unit by EPSG code."""
