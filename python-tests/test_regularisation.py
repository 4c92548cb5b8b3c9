"""Modules `regularisation` and `segmentation`: against all labellings of small problems, and on a noisy picture."""

import itertools

import numpy as np
import pytest
from scansion import _graph, graph, neighbours, regularisation, segmentation


def grid(side):
    node = np.arange(side * side).reshape(side, side)
    return np.concatenate(
        [np.c_[node[:, :-1].ravel(), node[:, 1:].ravel()], np.c_[node[:-1].ravel(), node[1:].ravel()]]
    )


def problem(seed, labels, side=3):
    random = np.random.default_rng(seed)
    edges = grid(side)
    return random.integers(0, 20, (side * side, labels)), edges, random.integers(0, 8, len(edges))


def cost(labels, unary, edges, weights, distances, label_costs):
    labels = np.asarray(labels)
    ends = labels[edges]
    used = np.unique(labels)
    pairs = (weights * distances[ends[:, 0], ends[:, 1]]).sum()
    return unary[np.arange(len(labels)), labels].sum() + pairs + label_costs[used].sum()


def optimum(unary, edges, weights, distances, label_costs):
    nodes, labels = unary.shape
    return min(
        cost(each, unary, edges, weights, distances, label_costs)
        for each in itertools.product(range(labels), repeat=nodes)
    )


@pytest.mark.parametrize("seed", range(5))
def test_two_labels_are_solved_exactly(seed):
    unary, edges, weights = problem(seed, 2)
    best = optimum(unary, edges, weights, 1 - np.eye(2), np.zeros(2))
    for solve in (regularisation.alpha_expansion, regularisation.alpha_beta_swap):
        found = solve(unary, edges, weights)
        assert found.energy == best and found.converged
        assert found.labels.dtype == np.uint16
        assert regularisation.energy(found.labels, unary, edges, weights) == best


@pytest.mark.parametrize("seed", range(3))
def test_more_labels_metrics_and_label_costs_stay_near_the_optimum(seed):
    unary, edges, weights = problem(seed, 3)
    line = np.abs(np.subtract.outer(np.arange(3), np.arange(3))).astype(float)
    costs = np.array([5.0, 0.0, 9.0])
    found = regularisation.alpha_expansion(unary, edges, weights, distances=line, label_costs=costs)
    assert found.energy == cost(found.labels, unary, edges, weights, line, costs)
    assert found.energy == regularisation.energy(
        found.labels, unary, edges, weights, distances=line, label_costs=costs
    )
    best = optimum(unary, edges, weights, line, costs)
    assert best <= found.energy <= 1.1 * best
    assert regularisation.icm(unary, edges, weights, distances=line).converged


@pytest.mark.parametrize("solve", ["alpha_expansion", "alpha_beta_swap", "icm"])
def test_a_large_common_cost_of_a_node_does_not_hide_its_differences(solve):
    search = getattr(regularisation, solve)
    found = search([[1e8, 1e8 - 1]], [])
    assert found.labels.tolist() == [1] and found.energy == 1e8 - 1
    assert search([[1e8, 1e8 - 1, 1e12]], []).labels.tolist() == [1]
    unary, edges, weights = problem(7, 3)
    offsets = 1e8 * np.arange(9)[:, None] - 3e8
    expected = search(unary, edges, weights)
    found = search(unary + offsets, edges, weights)
    assert found.labels.tolist() == expected.labels.tolist()
    assert found.energy == expected.energy + offsets.sum()
    assert regularisation.energy(found.labels, unary + offsets, edges, weights) == found.energy
    costs = np.array([5.0, 0.0, 9.0])
    assert regularisation.energy(found.labels, unary + offsets, edges, weights, label_costs=costs) == pytest.approx(
        cost(found.labels, unary + offsets, edges, weights, 1 - np.eye(3), costs), abs=1e-4
    )


@pytest.mark.parametrize("solve", [segmentation.cut_pursuit, segmentation.merge])
def test_a_large_offset_of_the_values_does_not_hide_their_differences(solve):
    side = 20
    values = np.c_[np.arange(side * side) % side * 3 // side, np.random.default_rng(0).integers(0, 8, side * side) / 64]
    expected = solve(values, grid(side))
    found = solve(values + [1e8, -3e9], grid(side))
    assert found.labels.tolist() == expected.labels.tolist() and len(expected.centroids) == 3
    np.testing.assert_allclose(found.centroids, expected.centroids + [1e8, -3e9], rtol=1e-15)
    assert found.energy == pytest.approx(expected.energy)
    aim = segmentation.PartitionParams(strength=0.1, method="merge" if solve is segmentation.merge else "cut-pursuit")
    assert segmentation.partition(values + 1e8, grid(side), aim).labels.tolist() == expected.labels.tolist()


def test_offsets_are_subtracted_only_where_they_are_large():
    ordinary = np.random.default_rng(2).integers(1, 50, (500, 3)) / 7
    even = np.full((3, 2), -np.log(0.5))
    for table in (ordinary, even, even + [[0, 1e-16]], ordinary.astype(np.float32), np.zeros((0, 3))):
        for relative in (_graph.relative_to_columns, _graph.relative_to_rows):
            rows, offsets = relative(table, "unary")
            np.testing.assert_array_equal(rows, table.astype(np.float32))
            assert not offsets.any() and rows.dtype == np.float32 and offsets.dtype == np.float64
    for kind in (np.float32, np.float64, np.int64):
        rows, offsets = _graph.relative_to_rows(np.array([[2**20, 2**20 + 3], [7, 9]], kind), "unary")
        assert rows.tolist() == [[0, 3], [7, 9]] and offsets.tolist() == [2**20, 0]
    for wrong in (np.nan, np.inf, -np.inf):
        with pytest.raises(ValueError, match=str(wrong)[-3:].replace("nan", "NaN")):
            regularisation.icm([[1e8, 1e8 - 1, wrong]], [])
        with pytest.raises(ValueError, match=str(wrong)[-3:].replace("nan", "NaN")):
            segmentation.merge([[1e8], [1e8 + 1], [wrong]], [])


def test_a_noisy_picture_becomes_clean():
    side = 60
    truth = (np.add.outer(np.arange(side), np.arange(side)) // 40).ravel()
    random = np.random.default_rng(4)
    seen = np.where(random.random(side * side) < 0.3, random.integers(0, 3, side * side), truth)
    probabilities = np.full((side * side, 3), 0.1)
    probabilities[np.arange(side * side), seen] = 0.8
    unary, edges = -np.log(probabilities), grid(side)
    right = {
        "seen": (seen == truth).mean(),
        "local": (regularisation.local_smoothing(probabilities, edges).argmax(axis=1) == truth).mean(),
        "icm": (regularisation.icm(unary, edges).labels == truth).mean(),
        "expansion": (regularisation.alpha_expansion(unary, edges).labels == truth).mean(),
    }
    assert right["seen"] < right["local"] < right["expansion"] and right["seen"] < right["icm"]
    assert right["expansion"] > 0.98
    one = regularisation.alpha_expansion(unary, edges, n_jobs=1)
    assert one.labels.tobytes() == regularisation.alpha_expansion(unary, edges, n_jobs=3).labels.tobytes()


def test_segments_of_a_picture_of_three_colours():
    side = 40
    truth = (np.arange(side * side) % side) * 3 // side
    values = truth[:, None] * 1.0 + np.random.default_rng(0).normal(0, 0.1, (side * side, 1))
    for solve in (segmentation.cut_pursuit, segmentation.merge):
        found = solve(values, grid(side), strength=0.1)
        assert found.centroids.shape == (3, 1) and found.labels.dtype == np.uint32
        assert (np.unique(np.c_[truth, found.labels], axis=0)[:, 0] == [0, 1, 2]).all()
        means = [values[truth == t].mean() for t in range(3)]
        np.testing.assert_allclose(np.sort(found.centroids.ravel()), means, rtol=1e-4, atol=1e-4)
        fit = ((values.astype(np.float32) - found.centroids[found.labels]) ** 2).sum()
        boundary = (found.labels[grid(side)[:, 0]] != found.labels[grid(side)[:, 1]]).sum()
        assert found.energy == pytest.approx(fit + 0.1 * boundary, rel=1e-6)


def test_cut_pursuit_without_additions_is_the_published_method():
    published = {"coarse_above": None, "cycles": 1, "attempts": 1, "moves": False}
    chain = [[0, 1], [1, 2], [2, 3]]
    found = segmentation.cut_pursuit([[0.0], [0.25], [5.0], [5.25]], chain, strength=0.5, **published)
    assert found.labels.tolist() == [0, 0, 1, 1] and found.energy == pytest.approx(0.5625)


def test_results_are_arrays_of_what_they_are_above_all():
    for found in (
        regularisation.alpha_expansion(UNARY, EDGES),
        segmentation.cut_pursuit(UNARY, EDGES),
        segmentation.partition(UNARY, EDGES),
    ):
        assert (np.asarray(found) == found.labels).all() and np.unique(found).size == np.unique(found.labels).size


def squares(side=48, field=12):
    """A field of squares with values of their own, one point a metre."""
    at = np.arange(side * side)
    number = at % side // field + at // side // field * (side // field)
    values = (number * 7 % 16) / 16 + np.random.default_rng(1).uniform(0, 0.02, at.size)
    return values[:, None], np.c_[at % side, at // side, np.zeros_like(at)].astype(float), number


@pytest.mark.parametrize("method", ["cut-pursuit", "merge"])
def test_partitions_are_found_by_what_they_are_for(method):
    values, xyz, number = squares()
    few = np.where(np.arange(number.size) % 7 == 0, number % 5, -1)
    aims = {
        "segments_per_hectare": (16 / 0.2304, {"xyz": xyz}),
        "smallest_object": (10.0, {"xyz": xyz}),
        "smallest_object_points": (100.0, {}),
        "oracle_loss": (0.0, {"labels": few}),
    }
    counts = {}
    for name, (value, known) in aims.items():
        params = segmentation.PartitionParams(**{name: value}, method=method)
        found = segmentation.partition(values, grid(48), params, **known)
        assert found.strength in [t["strength"] for t in found.trials]
        sizes = np.bincount(found.labels)
        assert sizes[sizes < 100].sum() <= 0.05 * number.size, name
        counts[name] = sizes.size
    assert counts["segments_per_hectare"] == 16 and counts["smallest_object"] >= 16
    named = [np.unique(few[(found.labels == s) & (few >= 0)]).size for s in range(found.labels.max() + 1)]
    assert max(named) == 1 and counts["oracle_loss"] <= 16
    edges = grid(48)
    given = segmentation.PartitionParams(strength=found.strength, method=method)
    again = segmentation.partition(values, edges, given)
    assert (again.labels == found.labels).all() and len(again.trials) == 1
    by_name = segmentation.cut_pursuit if method == "cut-pursuit" else segmentation.merge
    assert (by_name(values, edges, strength=found.strength).labels == again.labels).all()


def test_from_points_to_segments():
    random = np.random.default_rng(1)
    floor = np.c_[random.uniform(0, 10, (2000, 2)), random.normal(0, 0.01, 2000)]
    wall = np.c_[random.uniform(0, 10, 2000), random.normal(10, 0.01, 2000), random.uniform(0, 6, 2000)]
    xyz = np.concatenate([floor, wall])
    _, features = neighbours.optimal(xyz, k_max=40)
    edges, weights = graph.knn_graph(xyz, k=8, weights="inverse")
    found = segmentation.cut_pursuit(features, edges, weights, strength=1.0)
    largest = np.bincount(found.labels[:2000]).argmax(), np.bincount(found.labels[2000:]).argmax()
    assert largest[0] != largest[1]


UNARY, EDGES = [[0.0, 1.0], [1.0, 0.0]], [[0, 1]]


def parted(xyz=None, labels=None, **params):
    return segmentation.partition(UNARY, EDGES, segmentation.PartitionParams(**params), xyz=xyz, labels=labels)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: regularisation.alpha_expansion([[np.nan, 0.0]], []), "NaN"),
        (lambda: regularisation.alpha_expansion([0.0, 1.0], []), "unary"),
        (lambda: regularisation.alpha_expansion(UNARY, EDGES, strength=-1.0), "strength"),
        (lambda: regularisation.alpha_expansion(UNARY, EDGES, max_rounds=0), "max_rounds"),
        (lambda: regularisation.alpha_expansion(UNARY, EDGES, distances=[[0, 1]]), "distances"),
        (lambda: regularisation.alpha_expansion(UNARY, EDGES, distances=[[0, 1], [2, 0]]), "distance"),
        (lambda: regularisation.alpha_expansion(UNARY, EDGES, label_costs=[1.0]), "label costs"),
        (lambda: regularisation.alpha_expansion(UNARY, EDGES, label_costs=[1.0, -1.0]), "label_costs"),
        (lambda: regularisation.alpha_expansion(UNARY, [[0, 0]]), "0-0"),
        (lambda: regularisation.alpha_expansion(UNARY, EDGES, [-1.0]), "weight"),
        (lambda: regularisation.energy([0, 2], UNARY, EDGES), "label 2"),
        (lambda: regularisation.energy([0], UNARY, EDGES), "1 labels"),
        (lambda: regularisation.energy([0.5, 1.0], UNARY, EDGES), "labels"),
        (lambda: segmentation.cut_pursuit(UNARY, EDGES, strength=-1.0), "strength"),
        (lambda: segmentation.cut_pursuit(UNARY, EDGES, cycles=0), "cycles"),
        (lambda: segmentation.cut_pursuit(UNARY, EDGES, attempts=0), "attempts"),
        (lambda: segmentation.cut_pursuit([[np.inf]], []), "inf"),
        (lambda: segmentation.merge(UNARY, EDGES, node_weights=[1.0]), "node_weights"),
        (lambda: parted(strength=1.0, oracle_loss=0.1), "at most one"),
        (lambda: parted(segments_per_hectare=5.0), "positions"),
        (lambda: parted(oracle_loss=0.1), "label"),
        (lambda: parted(oracle_loss=0.1, labels=[300, 2]), "300"),
        (lambda: parted(oracle_loss=0.1, labels=[0.5, 2]), "labels"),
        (lambda: parted(smallest_object=5.0, xyz=[[0.0, 0.0, 0.0]]), "1 points"),
        (lambda: parted(method="halves"), "halves"),
        (lambda: parted(trials=0), "trials"),
    ],
)
def test_nonsense_is_refused_with_the_value_found(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_neighbours_agree_as_by_alpha_expansion_on_the_graph():
    random = np.random.default_rng(3)
    xyz = random.random((600, 3)) * 2
    truth = (xyz[:, 0] > 1).astype(int)
    votes = random.dirichlet([1, 1, 1], 600).astype(np.float32)
    votes[np.arange(600), truth] += 0.3
    votes /= votes.sum(1, keepdims=True)
    found = regularisation.regularize(
        xyz, votes, method="point-crf", strength=0.7, settings={"near": np.inf, "neighbours": 6}, n_jobs=1
    )
    edges, _ = graph.knn_graph(xyz, k=6)
    unary = -np.log((0.99 * votes + 0.01 / 3).astype(np.float32))
    expected = regularisation.alpha_expansion(unary, edges, strength=0.7)
    assert (found.labels == expected.labels).mean() > 0.999
    assert found.energy == pytest.approx(expected.energy, rel=1e-4)
    assert (found.labels == truth).mean() > (votes.argmax(1) == truth).mean() + 0.1
    alone = regularisation.regularize(xyz, votes, method="none")
    np.testing.assert_array_equal(np.asarray(alone), votes.argmax(1))
    np.testing.assert_allclose(alone.probabilities, 0.99 * votes + 0.01 / 3, atol=1e-6)
    segments = regularisation.regularize(xyz, votes)
    assert segments.probabilities.shape == (600, 3) and segments.energy is not None
    with pytest.raises(ValueError, match="did you mean `strength`"):
        regularisation.regularize(xyz, votes, settings={"strenght": 1})
    with pytest.raises(ValueError, match="argument too"):
        regularisation.regularize(xyz, votes, strength=1, settings={"strength": 1})
    with pytest.raises(ValueError, match="probabilities"):
        regularisation.regularize(xyz, votes[1:])


@pytest.mark.parametrize("method", regularisation.METHODS)
def test_a_strength_is_refused_by_methods_that_do_not_use_it(method):
    xyz, votes = np.random.default_rng(0).random((60, 3)), np.random.default_rng(1).dirichlet([1, 1], 60)
    for given in ({"strength": 1}, {"settings": {"strength": 1}}):
        if method.endswith("crf"):
            regularisation.regularize(xyz, votes, method=method, **given)
            continue
        with pytest.raises(ValueError, match=f"strength: found 1, expected none: the method '{method}' does not use it"):
            regularisation.regularize(xyz, votes, method=method, **given)
    regularisation.regularize(xyz, votes, method=method, strength=None)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_probabilities_are_finite(wrong):
    votes, message = [[0.5, 0.5], [wrong, 1]], f"probabilities: expected finite numbers, found {wrong} at index 1, 0"
    with pytest.raises(ValueError, match=message):
        regularisation.local_smoothing(votes, EDGES)
    for method in regularisation.METHODS:
        with pytest.raises(ValueError, match=message):
            regularisation.regularize(np.eye(2, 3), votes, method=method)
