"""Names of columns as people spell them: PDAL's, laspy's, with or without capitals and underscores."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from scansion import _core

LASPY = {
    "intensity": "Intensity",
    "return_number": "ReturnNumber",
    "number_of_returns": "NumberOfReturns",
    "synthetic": "Synthetic",
    "key_point": "KeyPoint",
    "withheld": "Withheld",
    "overlap": "Overlap",
    "scanner_channel": "ScanChannel",
    "scan_direction_flag": "ScanDirectionFlag",
    "edge_of_flight_line": "EdgeOfFlightLine",
    "classification": "Classification",
    "user_data": "UserData",
    "point_source_id": "PointSourceId",
    "gps_time": "GpsTime",
    "red": "Red",
    "green": "Green",
    "blue": "Blue",
    "nir": "Infrared",
}
"""laspy's dimension names and ours (PDAL's)."""


def _folded(name: str) -> str:
    return name.replace("_", "").lower()


_OURS = {_folded(name): ours for theirs, ours in LASPY.items() for name in (theirs, ours)}
"""Our names by the folded ones of both."""


def meant(name: str, columns: Iterable[str]) -> str:
    """The column that a name means: itself, else one that differs in capitals and underscores only, else our name for it.

    >>> meant("return_number", ["ReturnNumber"]), meant("nir", []), meant("height", ["Height", "height"]), meant("mine", [])
    ('ReturnNumber', 'Infrared', 'height', 'mine')
    """
    columns = list(columns)
    if name in columns:
        return name
    ours = _OURS.get(_folded(name), name)
    alike = [column for column in columns if _folded(column) in (_folded(name), _folded(ours))]
    return alike[0] if len(alike) == 1 else ours


def our_names(names: Iterable[str]) -> dict[str, str]:
    """Our name of each column, unless another column has it.

    >>> our_names(["gps_time", "red", "Red"])
    {'gps_time': 'GpsTime', 'red': 'red', 'Red': 'Red'}
    """
    names = list(names)
    ours = {name: meant(name, []) for name in names}
    taken = list(ours.values())
    return {name: name if taken.count(our) > 1 else our for name, our in ours.items()}


def asked(names: list[str]) -> list[str]:
    """Columns to read from a file: these, and ours that they may mean."""
    if isinstance(names, str):
        raise TypeError(f"columns: found {names!r}, expected a list of names, as in [{names!r}]")
    return list(dict.fromkeys([*names, *map(translated, names)]))


def translated(name: str) -> str:
    """The name that the core gives to a column which is called so in a file.

    >>> translated("r"), translated("scan_angle_rank"), translated("mine")
    ('Red', 'ScanAngle', 'mine')
    """
    return _core.column_name(name)


def read_as(name: str, columns: Iterable[str]) -> str:
    """The column of a file that a name means: as `meant`, else the translated name."""
    columns = list(columns)
    called = meant(name, columns)
    return called if called in columns else translated(name)


def axis(name: str) -> int | None:
    """The coordinate with this name, 0 to 2."""
    at = "xyz".find(name.lower())
    return at if at >= 0 and len(name) == 1 else None


def missing(name: str, columns: list[str]) -> KeyError:
    """The error for a column that is absent, with a name that is like it."""
    return KeyError(f"no column {name!r}{_hint(name, columns)}; the cloud has: {', '.join(columns) or 'none'}")


def unknown(names: list[str], columns: list[str]) -> ValueError:
    """The error for names of columns that a file does not have."""
    found = ", ".join(f"{name!r}{_hint(name, columns)}" for name in names)
    return ValueError(f"columns: found {found}, expected columns of the file: {', '.join(columns) or 'it has none'}")


def _hint(name: str, columns: list[str]) -> str:
    """The columns of the values of an array with this name; else the column whose name is like it, as a question."""
    if parts := _parts(name, columns):
        return f" (its values are the columns {', '.join(map(repr, parts))})"
    near = get_close_matches(_folded(name), [_folded(column) for column in columns], 1)
    return next((f" (did you mean {column!r}?)" for column in columns if _folded(column) in near), "")


def _parts(name: str, columns: list[str]) -> list[str]:
    """The columns of the two or three values of an array in LAS.

    >>> _parts("normal", ["normal0", "normal1", "normal2", "q1"]), _parts("q", ["normal0", "q1"])
    (['normal0', 'normal1', 'normal2'], [])
    """
    numbered = [f"{name}{i}" for i in range(3)]
    found = [part for part in numbered if part in columns]
    return found if len(found) > 1 and found == numbered[: len(found)] else []
