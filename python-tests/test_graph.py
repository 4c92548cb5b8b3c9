"""Modules `graph` and `neighbours`: against scipy and brute force."""

import numpy as np
import pytest
from scansion import graph, neighbours
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree


def cloud(seed=0, points=3000):
    return np.random.default_rng(seed).uniform(0, 20, (points, 3))


def matrix(edges, weights, nodes):
    return sparse.coo_matrix((weights, edges.T), shape=(nodes, nodes)).tocsr()


def test_the_nearest_are_those_of_scipy():
    xyz = cloud().astype(np.float32).astype(np.float64)
    indices, distances = neighbours.knn(xyz, k=7)
    expected, near = cKDTree(xyz).query(xyz, 8)
    assert indices.dtype == np.uint32 and distances.dtype == np.float32
    np.testing.assert_allclose(distances, expected[:, 1:], rtol=1e-5)
    assert (indices == near[:, 1:]).mean() > 0.999


def test_the_points_within_a_radius_are_those_of_scipy():
    xyz = cloud().astype(np.float32).astype(np.float64)
    others = cloud(4, 500).astype(np.float32).astype(np.float64)
    tree = cKDTree(xyz)
    for queries, asked in ((xyz, None), (others, others)):
        for radius in (0.3, 1.7, 6.0):
            offsets, indices, distances = neighbours.within(xyz, radius, asked)
            assert indices.dtype == offsets.dtype == np.uint32 and distances.dtype == np.float32
            groups = [set(part) for part in np.split(indices, offsets[1:-1])]
            expected = [set(part) for part in tree.query_ball_point(queries, radius)]
            # Points at the radius itself may fall on either side in float32.
            differing = sum(len(found ^ wanted) for found, wanted in zip(groups, expected, strict=True))
            assert differing <= 1e-4 * len(indices), (radius, differing)
            own = np.repeat(np.arange(len(queries)), np.diff(offsets))
            np.testing.assert_allclose(
                distances, np.linalg.norm(queries[own] - xyz[indices], axis=1), rtol=1e-4, atol=1e-4
            )
            assert all(np.all(np.diff(part) >= 0) for part in np.split(distances, offsets[1:-1]))
    with pytest.raises(ValueError, match="radius"):
        neighbours.within(xyz, -1.0)


def test_the_radius_is_in_metres():
    feet = cloud(1, 100)
    one = neighbours.within(feet, 3.0, feet[:10], metres_per_unit=1.0)
    other = neighbours.within(feet, 3.0 * 0.3048, feet[:10], metres_per_unit=0.3048)
    np.testing.assert_array_equal(one[1], other[1])


def test_distances_are_metres():
    feet = cloud(1, 100)
    _, one = neighbours.knn(feet, k=3)
    _, other = neighbours.knn(feet, k=3, metres_per_unit=0.3048)
    np.testing.assert_allclose(other, one * 0.3048, rtol=1e-4)


def test_edges_are_the_pairs_of_neighbours_each_once():
    xyz = cloud()
    indices, distances = neighbours.knn(xyz, k=5)
    pairs = np.sort(np.c_[np.repeat(np.arange(len(xyz)), 5), indices.ravel()], axis=1)
    expected, first = np.unique(pairs, axis=0, return_index=True)
    edges, weights = graph.knn_graph(xyz, k=5)
    assert edges.dtype == np.uint32 and weights.dtype == np.float32
    assert (edges == expected).all() and (weights == 1).all()
    lengths = distances.ravel()[first].astype(float)
    mean = lengths.mean()
    for kind, formula in (
        ("inverse", 1 / (0.5 + lengths / mean)),
        ("exponential", np.exp(-lengths / (2 * mean))),
    ):
        found, weights = graph.knn_graph(xyz, k=5, weights=kind, offset=0.5, scale=2.0)
        np.testing.assert_allclose(weights, formula, rtol=1e-5)
    found, _ = graph.knn_graph(xyz, k=5, prune=1.5)
    assert (found == expected[lengths <= 1.5 * mean]).all()
    _, weights = graph.knn_graph(xyz, k=5, multiplicity="count")
    assert weights.sum() == pairs.shape[0] and set(weights.tolist()) == {1.0, 2.0}


def test_of_repeated_edges_the_smallest_weight_counts():
    for weights, least in [(None, 1.0), ([1, 1], 1.0), ([3, 4], 3.0)]:
        assert graph.minimum_spanning_tree(2, [[0, 1], [1, 0]], weights)[1].tolist() == [least]


def test_components_and_spanning_trees_are_those_of_scipy():
    xyz = cloud()
    edges, _ = graph.knn_graph(xyz, k=2)
    components, count = graph.connected_components(len(xyz), edges)
    expected, labels = csgraph.connected_components(
        matrix(edges, np.ones(len(edges)), len(xyz)), directed=False
    )
    assert count == expected > 1
    assert (components == labels).all()
    weights = np.linalg.norm(xyz[edges[:, 0]] - xyz[edges[:, 1]], axis=1).astype(np.float32)
    tree, tree_weights = graph.minimum_spanning_tree(len(xyz), edges, weights)
    peer = csgraph.minimum_spanning_tree(matrix(edges, weights.astype(float), len(xyz)))
    assert len(tree) == len(xyz) - count == peer.nnz
    assert tree_weights.sum(dtype=float) == pytest.approx(peer.sum())


def test_the_same_bytes_for_any_number_of_threads():
    xyz = cloud(points=20_000)
    first = [a.tobytes() for a in graph.knn_graph(xyz, k=6, weights="inverse", n_jobs=1)]
    assert [a.tobytes() for a in graph.knn_graph(xyz, k=6, weights="inverse", n_jobs=3)] == first


def test_the_optimal_neighbourhood_of_a_plane_is_flat_and_of_a_line_linear():
    plane = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [3.0]), -1).reshape(-1, 3)
    k, features = neighbours.optimal(plane, k_max=40)
    assert k.min() >= 10 and k.max() <= 40 and features.shape == (400, 4)
    assert abs(features[:, 2:]).max() == 0
    line = np.c_[np.zeros((50, 2)), np.arange(50.0)]
    _, features = neighbours.optimal(line, k_min=5, k_max=20)
    np.testing.assert_allclose(features, np.tile([1, 0, 0, 1], (50, 1)), atol=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: neighbours.knn(cloud(points=5), k=5), "k: found 5"),
        (lambda: neighbours.knn([[np.nan, 0, 0], [1, 0, 0]], k=1), "NaN"),
        (lambda: neighbours.optimal(cloud(), k_min=50, k_max=20), "k_min"),
        (lambda: neighbours.optimal(cloud(), eigenvalues="cube"), "eigenvalues"),
        (lambda: graph.knn_graph(cloud(), weights="heavy"), "weights"),
        (lambda: graph.knn_graph(cloud(), weights="inverse", offset=0.0), "offset"),
        (lambda: graph.knn_graph(cloud(), prune=-1.0), "prune"),
        (lambda: graph.connected_components(2, [[0, 2]]), "0-2"),
        (lambda: graph.connected_components(2, [[0, -1]]), "edges"),
        (lambda: graph.connected_components(2, [0, 1, 2]), "edges"),
        (lambda: graph.connected_components(2**40, np.zeros((0, 2), "u4")), "at most 4294967295"),
        (lambda: graph.felzenszwalb(2**40, np.zeros((0, 2), "u4"), []), "at most 4294967295"),
        (lambda: graph.minimum_spanning_tree(2**40, np.zeros((0, 2), "u4")), "at most 4294967295"),
        (lambda: graph.minimum_spanning_tree(2, [[0, 1]], [np.nan]), "weight"),
        (lambda: graph.minimum_spanning_tree(2, [[0, 1]], [1.0, 2.0]), "weights"),
    ],
)
def test_nonsense_is_refused_with_the_value_found(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_no_points_and_one():
    assert graph.connected_components(0, [])[1] == 0
    edges, weights = graph.knn_graph([[1.0, 2.0, 3.0]], k=3)
    assert edges.shape == (0, 2) and weights.shape == (0,)
