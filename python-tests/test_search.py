"""Settings of all kinds, cross-validation of recipes, and measures of segments."""

import numpy as np
import pytest
import scansion
from conftest import street
from scansion import evaluation, graph, segmentation
from scipy.sparse.csgraph import minimum_spanning_tree
from sklearn.base import clone
from sklearn.metrics import recall_score
from sklearn.model_selection import GridSearchCV, GroupKFold

RECIPE = {
    "features": {"pyramid": {"first_scale": 0.5, "levels": 2}},
    "forest.trees": 8,
    "training.voxel": 0.2,
    "regularise.method": "none",
}


def test_a_grid_over_any_key_is_searched_on_a_small_scene():
    xyz, labels = street(points=3000)
    found = scansion.search(xyz, labels, grid={"forest.max_depth": [1, 12]}, recipe=RECIPE, folds=3)
    assert found.best == {"forest.max_depth": 12}
    assert [t["settings"]["forest.max_depth"] for t in found.tried] == [1, 12]
    assert all(t["scores"]["points"] == 3000 for t in found.tried)
    assert found.block < 20
    with pytest.raises(ValueError, match="squares of 500 m"):
        scansion.search(xyz, labels, recipe=RECIPE, block=500.0)


def test_scikit_learns_grid_search_takes_a_point_classifier():
    xyz, labels = street(points=3000)
    squares = (xyz[:, 0] // 5).astype(int)
    recipes = [{**RECIPE, "forest.max_depth": depth} for depth in (1, 12)]
    search = GridSearchCV(scansion.PointClassifier(), {"recipe": recipes}, cv=GroupKFold(2))
    search.fit(xyz, labels, groups=squares)
    assert search.best_params_["recipe"]["forest.max_depth"] == 12
    assert search.predict(xyz).shape == labels.shape
    assert clone(search.best_estimator_).recipe == search.best_params_["recipe"]


def test_settings_are_nested_or_dotted_and_nothing_is_overridden_in_silence():
    xyz, _ = street(points=2000)
    found = segmentation.riemannian(xyz, min_depth=3, settings={"strength": 50.0})
    assert found.report["segments"] < segmentation.riemannian(xyz, min_depth=3).report["segments"]
    nested = segmentation.riemannian(xyz, settings={"octree": {"min_depth": 3}, "strength": 50.0})
    dotted = segmentation.riemannian(xyz, settings={"octree.min_depth": 3, "strength": 50.0})
    np.testing.assert_array_equal(nested.labels, found.labels)
    np.testing.assert_array_equal(dotted.labels, found.labels)
    segmentation.riemannian(xyz, settings={"octree.stop.absolute": 0.5})
    with pytest.raises(ValueError, match="strength"):
        segmentation.riemannian(xyz, strength=0.1, settings={"strength": 50.0})
    with pytest.raises(ValueError, match="largest_voxel"):
        segmentation.octree_region_growing(xyz, size=2.0, settings={"largest_voxel": 1.0})
    by_recipe = scansion.segment(xyz, recipe={"method": "slic", "objects": {"slic": {"size": 3.0}}})
    assert by_recipe.report["method"] == "slic"
    assert scansion.segment(xyz, recipe="riemannian-paper").report["method"] == "riemannian"


def test_infinite_strengths_give_the_connected_components():
    edges = [[0, 1], [1, 2], [3, 4]]
    values = [[0.0], [5.0], [9.0], [1.0], [2.0]]
    for found in (
        segmentation.cut_pursuit(values, edges, strength=np.inf),
        segmentation.merge(values, edges, strength=float("inf")),
        segmentation.partition(values, edges, segmentation.PartitionParams(strength=np.inf)),
    ):
        assert found.labels.tolist() == [0, 0, 0, 1, 1]
    components, count = graph.felzenszwalb(5, edges, [0.5, 9.0, 0.1], k=np.inf)
    assert (components.tolist(), count) == ([0, 0, 0, 1, 1], 2)
    with pytest.raises(ValueError, match="strength"):
        segmentation.merge(values, edges, strength=np.nan)
    xyz, labels = street(points=1500)
    recipe = {**RECIPE, "regularise.method": "point-crf", "regularise.strength": np.inf}
    model = scansion.PointClassifier(recipe).fit(xyz, labels)
    assert "strength = inf" in model.recipe_


def test_edges_that_are_given_twice_count_once():
    assert graph.felzenszwalb(2, [[0, 1], [1, 0]], [0.3, 0.3], k=0.4)[1] == 1
    assert graph.felzenszwalb(2, [[0, 1], [1, 0]], [0.7, 0.7], k=0.4, meaning="similarity")[1] == 1
    random = np.random.default_rng(3)
    pairs = random.integers(0, 12, (80, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    weights = random.uniform(0.1, 1.0, len(pairs)).astype(np.float32)
    # Of parallel edges the shortest, which is what scipy, like any matrix, cannot choose by itself.
    lengths = np.full((12, 12), np.inf)
    np.minimum.at(lengths, tuple(np.sort(pairs, axis=1).T), weights)
    expected = minimum_spanning_tree(np.where(np.isinf(lengths), 0, lengths)).sum()
    assert graph.minimum_spanning_tree(12, pairs, weights)[1].sum() == pytest.approx(expected, rel=1e-5)


def test_the_graph_and_the_shapes_of_segments_are_those_of_numpy():
    random = np.random.default_rng(4)
    xyz = random.uniform(0, 10, (300, 3)) + [500_000, 5_000_000, 0]
    labels = random.integers(0, 6, 300)
    pairs = random.integers(0, 300, (900, 2))
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    first = list(dict.fromkeys(labels.tolist()))
    place = {label: i for i, label in enumerate(first)}
    expected = {}
    for a, b in labels[pairs]:
        if a != b:
            key = tuple(sorted((place[a], place[b])))
            expected[key] = expected.get(key, 0) + 1
    edges, weights = segmentation.segment_graph(pairs, labels)
    assert {tuple(e): w for e, w in zip(edges.tolist(), weights.tolist(), strict=True)} == expected
    shapes = segmentation.segment_shapes(xyz, labels)
    for i, label in enumerate(first):
        members = xyz[labels == label]
        assert shapes.points[i] == len(members)
        np.testing.assert_allclose(shapes.centroid[i], members.mean(axis=0), atol=1e-4)
        np.testing.assert_allclose(shapes.low[i], members.min(axis=0), atol=1e-4)
        np.testing.assert_allclose(shapes.high[i], members.max(axis=0), atol=1e-4)
        along = (members - shapes.centre[i]) @ shapes.axes[i].T
        assert (np.abs(along) <= shapes.sides[i] / 2 + 1e-3).all()


def test_measures_of_segments_and_classes_are_those_of_numpy():
    random = np.random.default_rng(5)
    truth, predicted = random.integers(2, 5, (2, 400))
    for row in evaluation.one_vs_rest(truth, predicted):
        is_class, named = truth == row["code"], predicted == row["code"]
        assert row["sensitivity"] == pytest.approx(recall_score(is_class, named))
        assert row["specificity"] == pytest.approx(recall_score(~is_class, ~named))
        assert row["accuracy"] == pytest.approx((is_class == named).mean())
    labels = random.integers(0, 20, 400)
    order = list(dict.fromkeys(labels.tolist()))
    expected = [np.bincount(truth[labels == s]).max() / (labels == s).sum() for s in order]
    np.testing.assert_allclose(evaluation.purities(labels, truth), expected)
    pairs = np.column_stack([np.arange(399), np.arange(1, 400)])
    scores = evaluation.boundary_scores(pairs, labels, truth, hops=0)
    true = truth[1:] != truth[:-1]
    cut = labels[1:] != labels[:-1]
    assert scores["recall"] == pytest.approx((true & cut).sum() / true.sum())
    assert scores["precision"] == pytest.approx((true & cut).sum() / cut.sum())
