"""What belongs together: segments of graphs and of clouds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice, column, native, to_json
from scansion._cloud import as_cloud
from scansion._graph import as_edges, as_rows, as_weights

__all__ = [
    "Riemannian",
    "Segments",
    "cut_pursuit",
    "merge",
    "object_features",
    "octree_region_growing",
    "region_growing",
    "riemannian",
    "supervoxels",
]


class Segments(NamedTuple):
    """Segment of each node, mean values of each segment, and the energy that was reached."""

    labels: NDArray[np.uint32]
    centroids: NDArray[np.float64]
    energy: float


def cut_pursuit(
    values: Any,
    edges: Any,
    weights: Any = None,
    *,
    strength: float = 0.1,
    cutoff: float = 0.0,
    node_weights: Any = None,
    coarse_above: int | None = 10_000,
    cycles: int = 2,
    flow_steps: int = 3,
    means_steps: int = 5,
    restarts: int = 3,
    max_iterations: int = 10,
    tolerance: float = 1e-3,
    guard: bool = False,
    backward: bool = True,
    moves: bool = True,
    random_state: int = 0,
    n_jobs: int | None = None,
) -> Segments:
    """Segments by l0 cut pursuit: least sum of squared differences and boundary.

    Landrieu and Obozinski 2017; ``coarse_above=None, cycles=1, moves=False`` is their method.

    Parameters
    ----------
    values : array_like of shape (n, d)
        Of each node, e.g. the features of `scansion.neighbours.optimal`; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    weights : array_like of shape (m,), optional
        Finite, 0 or more; 1 by default.
    strength : float
        What a boundary edge of weight 1 costs, in units of squared difference; larger for fewer, larger segments.
    cutoff : float
        Segments of less weight than this join their best neighbour at the end.
    node_weights : array_like of shape (n,), optional
        How much each node counts; 1 by default.
    coarse_above : int, optional
        Graphs of more nodes than this are cut on a coarser graph, many times faster; None never does so.
    cycles : int
        How often all is done, each time from the result before; 1 or more.
    flow_steps : int
        Minimum cuts per split.
    means_steps : int
        Steps of the 2-means that starts a split.
    restarts : int
        Random starts of the 2-means.
    max_iterations : int
        Most rounds of splitting and merging.
    tolerance : float
        Stop when a round lowers the energy by less than this share of it.
    guard : bool
        Split only where the energy falls at once.
    backward : bool
        Merge segments after each round of splits.
    moves : bool
        Move single nodes across boundaries where the energy falls; the paper does not.
    random_state : int
        Seed of the 2-means.
    n_jobs : int, optional
        Threads; None and -1 take all. The result does not depend on it.

    Examples
    --------
    >>> from scansion import segmentation
    >>> edges = [[0, 1], [1, 2], [2, 3]]
    >>> found = segmentation.cut_pursuit([[0.0], [0.25], [5.0], [5.25]], edges, strength=0.5)
    >>> found.labels.tolist(), found.centroids.ravel().tolist(), found.energy
    ([0, 0, 1, 1], [0.125, 5.125], 0.5625)
    """
    settings = {
        "strength": strength,
        "cutoff": cutoff,
        "coarse_above": 2**32 - 1 if coarse_above is None else coarse_above,
        "cycles": cycles,
        "flow_steps": flow_steps,
        "means_steps": means_steps,
        "restarts": restarts,
        "max_iterations": max_iterations,
        "tolerance": tolerance,
        "guard": guard,
        "backward": backward,
        "moves": moves,
        "seed": random_state,
    }
    return Segments(
        *_core.cut_pursuit(_valued(values, edges, weights, node_weights), to_json(settings), n_jobs)
    )


def merge(
    values: Any,
    edges: Any,
    weights: Any = None,
    *,
    strength: float = 0.1,
    cutoff: float = 0.0,
    node_weights: Any = None,
) -> Segments:
    """Segments by merging, from single nodes, the pairs that gain most, as long as the energy of `cut_pursuit` falls.

    Parameters
    ----------
    values : array_like of shape (n, d)
        Of each node; finite.
    edges : array_like of shape (m, 2)
        Pairs of nodes.
    weights : array_like of shape (m,), optional
        Finite, 0 or more; 1 by default.
    strength : float
        What a boundary edge of weight 1 costs, in units of squared difference; larger for fewer, larger segments.
    cutoff : float
        Segments of less weight than this join their best neighbour at the end.
    node_weights : array_like of shape (n,), optional
        How much each node counts; 1 by default.

    Examples
    --------
    >>> from scansion import segmentation
    >>> edges = [[0, 1], [1, 2], [2, 3]]
    >>> segmentation.merge([[0.0], [0.25], [5.0], [5.25]], edges, strength=0.5).labels.tolist()
    [0, 0, 1, 1]
    """
    settings = to_json({"strength": strength, "cutoff": cutoff})
    return Segments(*_core.merge_regions(_valued(values, edges, weights, node_weights), settings))


class Riemannian(NamedTuple):
    """Segment and supervoxel of each point, and the sizes and seconds of all stages."""

    labels: NDArray[np.uint32]
    supervoxels: NDArray[np.uint32]
    report: dict[str, Any]


def supervoxels(
    xyz: Any,
    *,
    method: str = "slic",
    size: float = 1.2,
    normals: Any = None,
    colours: Any = None,
    spatial_weight: float = 0.4,
    normal_weight: float = 1.0,
    colour_weight: float = 0.1,
    voxel: float | None = None,
    n_jobs: int | None = None,
) -> NDArray[np.int64]:
    """Small pieces of a cloud that are alike in place, normal and colour.

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    method : {"slic", "vccs"}
        On points (Hasanpour Zaryabi et al. 2022), or on voxels that touch, which never crosses a gap (Papon et al. 2013).
    size : float
        Distance of the seeds, metres.
    normals : array_like of shape (n, 3), optional
        Unit normals, as of `scansion.features.normals`.
    colours : array_like of shape (n, 3), optional
        Red, green and blue, 0..1.
    spatial_weight, normal_weight, colour_weight : float
        What the three distances count.
    voxel : float, optional
        "vccs": edge of the voxels, metres; a quarter of the size if it is not given.
    n_jobs : int, optional
        Threads; None and -1 take all. The result does not depend on it.

    Returns
    -------
    labels : array of shape (n,), int64
        Supervoxel of each point; -1 for none.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.arange(0.0, 8.0, 0.25)
    >>> plane = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> labels = segmentation.supervoxels(plane, size=2.0)
    >>> len(np.unique(labels))
    16
    """
    choice(method, "method", ("slic", "vccs"))
    weights = {"spatial": spatial_weight, "normal": normal_weight, "colour": colour_weight}
    settings: dict[str, Any] = {"size": size, "weights": weights}
    if method == "vccs":
        settings["voxel"] = size / 4 if voxel is None else voxel
    elif voxel is not None:
        raise ValueError(f"voxel: found {voxel!r} with method 'slic', expected None")
    cloud = as_cloud(xyz, columns=[])
    sides, rgb = _triples(normals, "normals", len(cloud)), _triples(colours, "colours", len(cloud))
    found = _core.supervoxels(cloud._core, method, to_json(settings), sides, rgb, n_jobs)
    return np.where(found == 2**32 - 1, -1, found.astype(np.int64))


def riemannian(
    xyz: Any,
    *,
    min_depth: int = 6,
    strength: float = 0.1,
    settings: Mapping[str, Any] | None = None,
    n_jobs: int | None = None,
) -> Riemannian:
    """Supervoxels of an adaptive octree and their segments on a Riemannian graph (Li 2020).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    min_depth : int
        Least depth of the octree; the cloud's cube is divided in two on each axis so many times.
    strength : float
        What an edge between segments costs; larger gives fewer, larger segments.
    settings : mapping, optional
        Further settings, as in a recipe: ``{"graph": {"nearest": 12}, "sides": "unsigned"}``.
    n_jobs : int, optional
        Threads; None and -1 take all. The result does not depend on it.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.arange(0.0, 8.0, 0.125)
    >>> floor = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    >>> wall = np.stack(np.meshgrid([0.0], grid, grid + 0.125), -1).reshape(-1, 3)
    >>> found = segmentation.riemannian(np.concatenate([floor, wall]), min_depth=4, strength=0.3)
    >>> bool(found.labels[2000] != found.labels[6000]), found.report["segments"] < found.report["supervoxels"]
    (True, True)
    """
    given: dict[str, Any] = {**(settings or {}), "strength": strength}
    given["octree"] = {"min_depth": min_depth, **given.get("octree", {})}
    points, text = as_cloud(xyz, columns=[])._core, to_json(given)
    clusters, segments, report = _core.riemannian(points, text, n_jobs)
    return Riemannian(segments, clusters, json.loads(report))


def region_growing(
    xyz: Any,
    *,
    k: int = 15,
    angle_deg: float = 10.0,
    variation: float = 0.03,
    min_size: int = 50,
    reference: str = "current",
    n_jobs: int | None = None,
) -> NDArray[np.uint32]:
    """Smooth regions of points (Rabbani, van den Heuvel and Vosselman 2006).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    k : int
        Neighbours that a region grows over and normals are found by; 2..32.
    angle_deg : float
        Greatest angle between normals, degrees.
    variation : float
        Regions grow on from points of a lower surface variation only.
    min_size : int
        Regions of fewer points are given up.
    reference : {"current", "seed"}
        Which normal the next one is compared with: that of the neighbour (regions may bend) or of the first seed (flat).
    n_jobs : int, optional
        Threads; None and -1 take all. The result does not depend on it.

    Returns
    -------
    labels : array of shape (n,), uint32
        Region of each point, from 1; 0 for none.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.arange(0.0, 5.0, 0.25)
    >>> planes = np.stack(np.meshgrid(grid, grid, [0.0, 3.0]), -1).reshape(-1, 3)
    >>> segmentation.region_growing(planes, k=8).max()
    np.uint32(2)
    """
    choice(reference, "reference", ("current", "seed"))
    settings = {"angle_deg": angle_deg, "variation": variation, "min_size": min_size, "reference": reference}
    return _core.region_growing(as_cloud(xyz, columns=[])._core, k, to_json(settings), n_jobs)


def octree_region_growing(
    xyz: Any, *, size: float = 2.0, settings: Mapping[str, Any] | None = None, n_jobs: int | None = None
) -> NDArray[np.uint32]:
    """Flat voxels of an octree, grown and refined at their rims (Vo et al. 2015).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    size : float
        Edge of the largest voxels, metres.
    settings : mapping, optional
        Further settings, as in a recipe: ``{"residual": 0.05, "angle_deg": 15.0}``.
    n_jobs : int, optional
        Threads; None and -1 take all. The result does not depend on it.

    Returns
    -------
    labels : array of shape (n,), uint32
        Region of each point, from 1; 0 for none.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import segmentation
    >>> grid = np.arange(0.0, 8.0, 0.125)
    >>> planes = np.stack(np.meshgrid(grid, grid, [0.5, 5.5]), -1).reshape(-1, 3)
    >>> segmentation.octree_region_growing(planes).max()
    np.uint32(2)
    """
    text = to_json({**(settings or {}), "largest_voxel": size})
    return _core.octree_region_growing(as_cloud(xyz, columns=[])._core, text, n_jobs)


def object_features(
    xyz: Any, labels: Any, *, colours: Any = None, heights: Any = None, n_jobs: int | None = None
) -> tuple[NDArray[np.float32], list[str]]:
    """What each segment is like: its shape, colours and height (Hasanpour Zaryabi et al. 2022, Table 3).

    Parameters
    ----------
    xyz : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        The cloud; all coordinates finite.
    labels : array_like of shape (n,)
        Segment of each point, 0 or more.
    colours : array_like of shape (n, 3), optional
        Red, green and blue, 0..1.
    heights : array_like of shape (n,), optional
        Height of each point above the ground, metres, as of `scansion.terrain.heights`.
    n_jobs : int, optional
        Threads; None and -1 take all. The result does not depend on it.

    Returns
    -------
    features : array of shape (segments, f), float32
        One row a segment, in the order of their first points.
    names : list of str

    Examples
    --------
    >>> from scansion import segmentation
    >>> features, names = segmentation.object_features([[0, 0, 0], [1, 0, 0], [5, 5, 5]], [0, 0, 1])
    >>> features.shape, float(features[0, names.index("Linearity")])
    ((2, 9), 1.0)
    """
    cloud = as_cloud(xyz, columns=[])
    of = native(column(labels, "labels", len(cloud)), np.uint32)
    above = None if heights is None else native(column(heights, "heights", len(cloud)), np.float32)
    return _core.object_features(cloud._core, of, _triples(colours, "colours", len(cloud)), above, n_jobs)


def _triples(values: Any, name: str, length: int) -> NDArray[np.float32] | None:
    if values is None:
        return None
    array = as_rows(values, name)
    if array.shape != (length, 3):
        raise ValueError(f"{name}: expected shape ({length}, 3), found {array.shape}")
    return array


_Valued = tuple[
    NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32] | None, NDArray[np.float32] | None
]


def _valued(values: Any, edges: Any, weights: Any, node_weights: Any) -> _Valued:
    rows, pairs = as_rows(values, "values"), as_edges(edges)
    return rows, pairs, as_weights(weights, len(pairs)), as_weights(node_weights, len(rows), "node_weights")
