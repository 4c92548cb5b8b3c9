"""Exchange with laspy: its dimensions, exact integers and reference systems."""

from __future__ import annotations

from itertools import chain, count
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import check_whole, refuse
from scansion._names import LASPY

if TYPE_CHECKING:
    from scansion._cloud import PointCloud

_SCAN_ANGLE = "ScanAngle"
_SCAN_ANGLE_UNIT = 0.006
"""Degrees in one unit of the scan angle of point formats 6 to 10 (LAS 1.4 R15)."""

_LARGEST_ANGLE = 196.6
"""Degrees that 16 bits hold in this unit."""
_TIME = "GpsTime"
"""The only dimension of floats."""


def from_laspy(kind: type[PointCloud], las: Any) -> PointCloud:
    """A cloud from a ``laspy.LasData``: its exact integers, its dimensions and its reference system."""
    ticks = np.column_stack([np.asarray(las.X), np.asarray(las.Y), np.asarray(las.Z)]).astype(np.int32)
    scale, offset = (tuple(float(v) for v in values) for values in (las.header.scales, las.header.offsets))
    cloud = kind._wrap(_core.Cloud.from_ticks(np.ascontiguousarray(ticks), scale, offset))
    for name in las.point_format.dimension_names:
        if name in ("X", "Y", "Z"):
            continue
        values = np.asarray(las[name])
        if name in ("scan_angle", "scan_angle_rank"):
            unit = _SCAN_ANGLE_UNIT if name == "scan_angle" else 1.0
            # As the core does: both factors in single precision.
            cloud[_SCAN_ANGLE] = values.astype(np.float32) * np.float32(unit)
        elif values.dtype.kind in "fiub":
            # As the core does: each value of an array is a column.
            arrays = values.ndim == 2
            for number, part in enumerate(values.T if arrays else [values]):
                cloud._put(_free(f"{name}{number}" if arrays else LASPY.get(name, name), cloud.columns), part)
    cloud.scheme = "asprs"
    cloud._native.take_las_records(_system_records(las), bool(las.header.global_encoding.wkt))
    return cloud


def _free(name: str, taken: list[str]) -> str:
    """The name itself, or with the smallest number from 2 on that no column has."""
    numbered = (f"{name}_{number}" for number in count(2))
    return next(free for free in chain([name], numbered) if free not in taken)


def to_laspy(cloud: PointCloud) -> Any:
    """The cloud as ``laspy.LasData`` of LAS 1.4; a value that its LAS dimension cannot hold is a ValueError."""
    import laspy

    core = cloud._core
    colour, infrared = "Red" in cloud, "Infrared" in cloud
    header = laspy.LasHeader(version="1.4", point_format=8 if infrared else 7 if colour else 6)
    ticks = core.ticks()
    xyz = cloud.xyz
    if ticks is not None:
        header.scales, header.offsets = np.array(ticks[1]), np.array(ticks[2])
    else:
        header.scales, header.offsets = (np.array(values) for values in core.las_frame())
    if (wkt := core.las_wkt()) is not None:
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
        header.global_encoding.wkt = True
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz[:, 0], xyz[:, 1], xyz[:, 2]
    if ticks is not None:
        las.X, las.Y, las.Z = ticks[0][:, 0], ticks[0][:, 1], ticks[0][:, 2]
    known = {ours: theirs for theirs, ours in LASPY.items()}
    for name in cloud.columns:
        values = cloud[name]
        if name == _SCAN_ANGLE:
            las.scan_angle = _angle_steps(values)
        elif known.get(name) in set(header.point_format.dimension_names):
            las[known[name]] = _held(values, name, header.point_format.dimension_by_name(known[name]).max)
        else:
            las.add_extra_dim(laspy.ExtraBytesParams(name=name, type=values.dtype))
            las[name] = values
    return las


def _angle_steps(degrees: NDArray[Any]) -> NDArray[np.int16]:
    """Scan angles in the unit of LAS, rounded."""
    wrong = ~((degrees >= -_LARGEST_ANGLE) & (degrees <= _LARGEST_ANGLE))
    refuse(wrong, degrees, f"{_SCAN_ANGLE}: expected degrees in -{_LARGEST_ANGLE}..{_LARGEST_ANGLE}")
    return np.round(degrees / _SCAN_ANGLE_UNIT).astype(np.int16)


def _held(values: NDArray[Any], name: str, high: float) -> NDArray[Any]:
    """The values of a LAS dimension of numbers up to ``high``, if it can hold them."""
    if name != _TIME:
        check_whole(values, name, int(high))
        return values.astype(np.uint16, copy=False)
    if values.dtype.kind == "f":
        return values
    found = values.astype(np.float64)
    with np.errstate(invalid="ignore"):
        wrong = found.astype(values.dtype) != values
    refuse(wrong, values, f"{name}: expected numbers that are exact as 64-bit floats")
    return found


def _system_records(las: Any) -> list[tuple[int, bytes]]:
    """Numbers and contents of the records that tell the reference system, as the file has them."""
    records = chain(las.header.vlrs, getattr(las, "evlrs", None) or [])
    return [(record.record_id, record.record_data_bytes()) for record in records if record.user_id == "LASF_Projection"]
