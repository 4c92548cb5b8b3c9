"""Clouds: points and their columns."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import column, coordinates, mask, native

_LASPY_NAMES = {
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

_SCAN_ANGLE = "ScanAngle"
_SCAN_ANGLE_UNIT = 0.006
"""Degrees in one unit of the scan angle of point formats 6 to 10 (LAS 1.4 R15)."""


class PointCloud:
    """Points with named columns, one value a point.

    Coordinates of LAS files are kept as the integers in the file, so that writing gives the same bytes.

    Parameters
    ----------
    xyz : array_like of shape (n, 3)
        Coordinates in the unit of the reference system.
    crs : str, optional
        Coordinate reference system, as WKT or ``EPSG:n``; it defines the unit.
    metres_per_unit : float, optional
        Metres per unit of the coordinates (0.3048 for feet).
    **columns : array_like of shape (n,)
        One column each, e.g. ``Classification=...``. Names are PDAL's if it has one.

    Examples
    --------
    >>> import numpy as np
    >>> import scansion
    >>> cloud = scansion.PointCloud(np.zeros((2, 3)), Classification=np.array([2, 6], dtype=np.uint8))
    >>> len(cloud), cloud.columns
    (2, ['Classification'])
    >>> cloud["Classification"]
    array([2, 6], dtype=uint8)
    """

    __slots__ = ("_core", "_header", "_path")

    def __init__(
        self,
        xyz: ArrayLike,
        *,
        crs: str | None = None,
        metres_per_unit: float | None = None,
        **columns: ArrayLike,
    ) -> None:
        self._core = _core.Cloud.from_xyz(coordinates(xyz))
        self._path: str | None = None
        self._header: dict[str, Any] | None = None
        self._fill(crs, metres_per_unit, columns)

    def _fill(self, crs: str | None, metres_per_unit: float | None, columns: Mapping[str, ArrayLike]) -> None:
        self._core.crs = crs
        if metres_per_unit is not None:
            self._core.metres_per_unit = metres_per_unit
        for name, values in columns.items():
            self[name] = values

    @classmethod
    def _wrap(cls, core: _core.Cloud, path: str | None = None) -> PointCloud:
        cloud = cls.__new__(cls)
        cloud._core, cloud._path, cloud._header = core, path, None
        return cloud

    @property
    def xyz(self) -> NDArray[np.float64]:
        """Coordinates, a new ``(n, 3)`` array."""
        return self._core.xyz()

    @property
    def columns(self) -> list[str]:
        """Names of the columns, in the order of the file."""
        return self._core.columns()

    @property
    def header(self) -> dict[str, Any]:
        """Header information of the cloud's file, as from `scansion.info` at the first access; empty for a cloud that was
        made in memory."""
        if self._header is None:
            self._header = {} if self._path is None else json.loads(_core.inspect(self._path))
        return self._header

    @property
    def crs(self) -> str | None:
        """Coordinate reference system as the file states it (WKT, or ``EPSG:n``)."""
        return self._core.crs

    @crs.setter
    def crs(self, crs: str | None) -> None:
        self._core.crs = crs

    @property
    def metres_per_unit(self) -> float | None:
        """Metres per unit of the coordinates, if the file states it."""
        return self._core.metres_per_unit

    @metres_per_unit.setter
    def metres_per_unit(self, metres: float | None) -> None:
        self._core.metres_per_unit = metres

    @property
    def scheme(self) -> str:
        """The class list of the codes in the column Classification: ``"asprs"`` (LAS: 0 and 1 are unlabelled),
        ``"semantic3d"`` (0 is) or ``"own"`` (every code is a class). Set by readers; may be changed."""
        return self._core.scheme

    @scheme.setter
    def scheme(self, scheme: str) -> None:
        self._core.scheme = scheme

    def __len__(self) -> int:
        return len(self._core)

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __getitem__(self, name: str) -> NDArray[Any]:
        values = self._core.column(name)
        if values is None:
            raise KeyError(f"no column {name!r}; the cloud has: {', '.join(self.columns) or 'none'}")
        return values

    def __setitem__(self, name: str, values: ArrayLike) -> None:
        self._core.set_column(name, column(values, name, len(self)))

    def __delitem__(self, name: str) -> None:
        if not self._core.remove_column(name):
            raise KeyError(f"no column {name!r}; the cloud has: {', '.join(self.columns) or 'none'}")

    def __repr__(self) -> str:
        return f"PointCloud({len(self)} points; columns: {', '.join(self.columns) or 'none'})"

    def __reduce__(self) -> tuple[Any, ...]:
        columns = {name: self[name] for name in self.columns}
        ticks = self._core.ticks()
        return _restore, (self.xyz if ticks is None else ticks, self.crs, self.metres_per_unit, columns, self.scheme)

    def copy(self) -> PointCloud:
        """An independent copy."""
        return self._wrap(self._core.copy(), self._path)

    def select(self, points: ArrayLike) -> PointCloud:
        """Some of the points, with all their columns.

        Parameters
        ----------
        points : array_like of shape (n,), bool, or of indices
            Whether each point is selected, or the selected points in this order.

        Examples
        --------
        >>> import numpy as np
        >>> import scansion
        >>> cloud = scansion.PointCloud(np.eye(3), Classification=[2, 6, 2])
        >>> cloud.select(cloud["Classification"] == 2).xyz.tolist()
        [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
        >>> cloud.select([1, 0])["Classification"].tolist()
        [6, 2]
        """
        array = np.asarray(points)
        if array.dtype == np.bool_:
            array = np.flatnonzero(mask(array, "points", len(self)))
        array = column(array, "points")
        if array.size and (array.dtype.kind not in "iu" or array.min() < 0 or array.max() >= len(self)):
            raise IndexError(f"points: expected bool or indices below {len(self)}")
        return self._wrap(self._core.select(native(array, np.uint32)), self._path)

    @classmethod
    def from_laspy(cls, las: Any) -> PointCloud:
        """A cloud from a ``laspy.LasData``: its exact integers, its dimensions and its reference system."""
        ticks = np.column_stack([np.asarray(las.X), np.asarray(las.Y), np.asarray(las.Z)]).astype(np.int32)
        scale, offset = (
            tuple(float(v) for v in values) for values in (las.header.scales, las.header.offsets)
        )
        cloud = cls._wrap(_core.Cloud.from_ticks(np.ascontiguousarray(ticks), scale, offset))
        for name in las.point_format.dimension_names:
            if name in ("X", "Y", "Z"):
                continue
            values = np.asarray(las[name])
            if name in ("scan_angle", "scan_angle_rank"):
                unit = _SCAN_ANGLE_UNIT if name == "scan_angle" else 1.0
                # As the core does: both factors in single precision.
                cloud[_SCAN_ANGLE] = values.astype(np.float32) * np.float32(unit)
            elif values.ndim == 1 and values.dtype.kind in "fiub":
                cloud[_LASPY_NAMES.get(name, name)] = values
        cloud.scheme = "asprs"
        parsed = _laspy_crs(las.header)
        cloud.crs = parsed
        return cloud

    def to_laspy(self) -> Any:
        """The cloud as ``laspy.LasData`` of LAS 1.4; needs the extra ``scansion[las]``."""
        import laspy

        colour, infrared = "Red" in self, "Infrared" in self
        header = laspy.LasHeader(version="1.4", point_format=8 if infrared else 7 if colour else 6)
        ticks = self._core.ticks()
        xyz = self.xyz
        if ticks is not None:
            header.scales, header.offsets = np.array(ticks[1]), np.array(ticks[2])
        else:
            header.scales, header.offsets = (np.array(values) for values in self._core.las_frame())
        if (wkt := self._core.wkt()) is not None:
            header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
            header.global_encoding.wkt = True
        las = laspy.LasData(header)
        las.x, las.y, las.z = xyz[:, 0], xyz[:, 1], xyz[:, 2]
        if ticks is not None:
            las.X, las.Y, las.Z = ticks[0][:, 0], ticks[0][:, 1], ticks[0][:, 2]
        known = {ours: theirs for theirs, ours in _LASPY_NAMES.items()}
        for name in self.columns:
            values = self[name]
            if name == _SCAN_ANGLE:
                las.scan_angle = np.round(values / _SCAN_ANGLE_UNIT).astype(np.int16)
            elif known.get(name) in set(header.point_format.dimension_names):
                las[known[name]] = values
            else:
                las.add_extra_dim(laspy.ExtraBytesParams(name=name, type=values.dtype))
                las[name] = values
        return las


def _restore(
    place: Any,
    crs: str | None,
    metres_per_unit: float | None,
    columns: Mapping[str, NDArray[Any]],
    scheme: str = "own",
) -> PointCloud:
    """The inverse of ``PointCloud.__reduce__``."""
    core = _core.Cloud.from_ticks(*place) if isinstance(place, tuple) else _core.Cloud.from_xyz(place)
    cloud = PointCloud._wrap(core)
    cloud._fill(crs, metres_per_unit, columns)
    cloud.scheme = scheme
    return cloud


def _laspy_crs(header: Any) -> str | None:
    for vlr in header.vlrs:
        text = getattr(vlr, "string", None)
        if getattr(vlr, "record_id", None) == 2112 and text:
            return str(text).rstrip("\0")
    keys = [vlr.geo_keys for vlr in header.vlrs if getattr(vlr, "record_id", None) == 34735]
    values = {key.id: key.value_offset for key in (keys[0] if keys else []) if key.tiff_tag_location == 0}
    code = values.get(3072, values.get(2048) if values.get(1024) == 2 else None)
    return f"EPSG:{code}" if code not in (None, 0, 32767) else None


def measured(points: Any, columns: list[str], metres_per_unit: float | None) -> PointCloud:
    """`as_cloud` with another unit, if one is given; the caller's cloud is not changed."""
    cloud = as_cloud(points, columns=columns)
    if metres_per_unit is None:
        return cloud
    cloud = cloud.copy()
    cloud.metres_per_unit = metres_per_unit
    return cloud


def as_cloud(points: Any, *, columns: list[str] | None = None) -> PointCloud:
    """Anything that holds points as a `PointCloud`.

    Parameters
    ----------
    points : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        A structured array needs the fields X, Y, Z (or x, y, z); its other fields become columns.
    columns : list of str, optional
        Columns to read if ``points`` is a path; all by default.
    """
    if isinstance(points, PointCloud):
        return points
    if isinstance(points, (str, os.PathLike)):
        name = os.fspath(points)
        return PointCloud._wrap(_core.read(name, (columns, None, None, [])), name)
    if hasattr(points, "point_format") and hasattr(points, "header") and hasattr(points, "X"):
        return PointCloud.from_laspy(points)
    fields = getattr(getattr(points, "dtype", None), "names", None)
    if fields is None:
        return PointCloud(points)
    for axes in ("XYZ", "xyz"):
        if all(axis in fields for axis in axes):
            cloud = PointCloud(np.column_stack([np.asarray(points[axis], dtype=np.float64) for axis in axes]))
            for name in fields:
                if name not in axes:
                    cloud[name] = points[name]
            return cloud
    raise ValueError(f"structured array: expected the fields X, Y, Z or x, y, z, found {', '.join(fields)}")
