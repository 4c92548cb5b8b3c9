"""What a file keeps of a cloud besides its points, and what it loses."""

from __future__ import annotations

import os
from math import isclose

import numpy as np

from scansion import _core
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
        return [*_lost_unit(cloud, _core_unit(cloud._core.wkt())), *_lost_records(cloud)]
    system = ["the coordinate reference system"] if cloud.crs is not None else []
    return [*system, *_lost_unit(cloud, None)]


def _ending(path: str) -> str:
    return os.path.splitext(path)[1].lower()


def _core_unit(system: str | None) -> float | None:
    """Metres per unit of a reference system."""
    empty = _core.Cloud.from_xyz(np.empty((0, 3)))
    empty.crs = system
    return empty.metres_per_unit


def _lost_unit(cloud: PointCloud, kept: float | None) -> list[str]:
    metres = cloud.metres_per_unit
    # A file without a unit is taken to be in metres.
    same = metres is None or isclose(metres, 1.0 if kept is None else kept, rel_tol=1e-6)
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
