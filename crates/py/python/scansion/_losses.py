"""What a file keeps of a cloud besides its points, and what it loses."""

from __future__ import annotations

import os
from math import isclose

from scansion._cloud import PointCloud

_LAS = (".las", ".laz")
_WHOLE = (".npz", ".labels")
"""Formats that keep system and unit, or of which nobody expects it."""
_CARRIED = ("laszip encoded", "LASF_Projection", "LASF_Spec 4", "copc")
"""Records of LAS files whose content is in a cloud or is made anew."""


def losses(cloud: PointCloud, path: str) -> list[str]:
    """What the file at this path will not keep of the cloud, in words."""
    if _ending(path) in _WHOLE:
        return []
    if _ending(path) in _LAS:
        return _lost_records(cloud)  # The core tells of system and unit.
    system = ["the coordinate reference system"] if cloud.crs is not None else []
    return [*system, *_lost_unit(cloud)]


def _ending(path: str) -> str:
    return os.path.splitext(path)[1].lower()


def _lost_unit(cloud: PointCloud) -> list[str]:
    metres = cloud.metres_per_unit
    # A file without a unit is taken to be in metres.
    same = metres is None or isclose(metres, 1.0, rel_tol=1e-6)
    return [] if same else [f"the unit of {metres:g} m"]


def _lost_records(cloud: PointCloud) -> list[str]:
    """Records of the LAS file from which the cloud came."""
    if cloud._path is None or not os.path.isfile(cloud._path):
        return []
    try:
        records = cloud.header.get("vlrs", [])
    except (OSError, ValueError):
        return []  # The file has changed since.
    return [f"record {name}" for name in records if not name.startswith(_CARRIED)]
