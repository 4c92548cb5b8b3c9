"""Labels picked by hand, spread over segments."""

import json

import numpy as np
import pytest
import scansion


def scene():
    rng = np.random.default_rng(3)
    flat = np.column_stack([rng.uniform(0, 10, (600, 2)), np.zeros(600)])
    roof = np.column_stack([rng.uniform(0, 4, (200, 2)) + 3, np.full(200, 5.0)])
    return np.vstack([flat, roof])


def test_labels_of_tables_and_polygons(tmp_path):
    xyz = scene()
    table = tmp_path / "picked.csv"
    table.write_text(f"x,y,z,class\n{xyz[700, 0]},{xyz[700, 1]},{xyz[700, 2]},6\n")
    ring = [[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]]
    feature = {"type": "Feature", "properties": {"class": 2}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    areas = tmp_path / "areas.geojson"
    areas.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    found = scansion.picked_labels(xyz, [table, areas])
    inside = (xyz[:, :2] >= 0).all(1) & (xyz[:, :2] < 2).all(1)
    assert found.dtype == np.int16 and found[700] == 6
    np.testing.assert_array_equal(found == 2, inside)
    assert (found[~inside & (np.arange(800) != 700)] == -1).all()
    with pytest.raises(ValueError, match="within"):
        scansion.picked_labels(xyz, table, within=0)
    feature["properties"] = {"name": "meadow"}
    areas.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    with pytest.raises(ValueError, match="Classification"):
        scansion.picked_labels(xyz, areas)


def test_spread_labels_are_the_majority_of_each_segment():
    rng = np.random.default_rng(4)
    segments = rng.integers(0, 40, 2000).astype(np.uint32)
    labels = np.where(rng.random(2000) < 0.05, rng.integers(2, 5, 2000), -1)
    found = scansion.spread_labels(labels, segments)
    for segment in range(1, 40):
        own = segments == segment
        votes = np.bincount(labels[own & (labels >= 0)], minlength=5)
        best = np.flatnonzero(votes == votes.max())
        expected = labels[own] if votes.max() == 0 or len(best) > 1 else np.full(own.sum(), best[0])
        np.testing.assert_array_equal(found[own], expected)
    np.testing.assert_array_equal(found[segments == 0], labels[segments == 0])
    with pytest.raises(ValueError, match="segments"):
        scansion.spread_labels([1, 2], [1])


def test_segments_have_colours_of_their_own():
    colours = scansion.segment_colours(np.arange(50))
    assert colours.shape == (50, 3) and len(np.unique(colours, axis=0)) == 50


def test_recipes_of_one_stage_learn_from_arrays():
    xyz = scene()
    labels = np.where(xyz[:, 2] > 1, 6, 2)
    for recipe in ("clusters", "spheres"):
        model = scansion.PointClassifier(recipe=recipe).fit(xyz, labels)
        assert (model.predict(xyz) == labels).mean() > 0.95


def test_points_of_no_segment_keep_their_labels():
    assert scansion.spread_labels([6, -1, -1, 2], [-1, -1, 1, 1]).tolist() == [6, -1, 2, 2]
    assert scansion.spread_labels([6, -1], [1.0, 1.0]).tolist() == [6, 6]
    for wrong in (1.5, np.nan, -2):
        with pytest.raises(ValueError, match="segments: expected whole numbers .* at index 1"):
            scansion.spread_labels([6, -1], [1, wrong])
