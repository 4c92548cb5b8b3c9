"""Units of coordinates."""

from __future__ import annotations

METRES = {9001: 1.0, 9002: 0.3048, 9003: 1200 / 3937}
"""Metres per unit by EPSG code."""

_NAMES = {METRES[9002]: "foot", METRES[9003]: "US survey foot"}


def local_system(crs: str | None, metres_per_unit: float | None) -> str | None:
    """A reference system that tells only the unit, for clouds that have no other and are not in metres.

    >>> local_system(None, 0.3048)
    'LOCAL_CS["unknown",UNIT["foot",0.3048],AXIS["Easting",EAST],AXIS["Northing",NORTH]]'
    >>> local_system("EPSG:2992", 0.3048), local_system(None, None), local_system(None, 1.0)
    (None, None, None)
    """
    if crs is not None or metres_per_unit is None or metres_per_unit == 1.0:
        return None
    near = (name for metres, name in _NAMES.items() if abs(metres_per_unit - metres) < 1e-9)
    unit = f'UNIT["{next(near, "unit")}",{metres_per_unit!r}]'
    return f'LOCAL_CS["unknown",{unit},AXIS["Easting",EAST],AXIS["Northing",NORTH]]'
