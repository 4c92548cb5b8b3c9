"""Lines along the edges of synthetic scenes, their files read by other programs, and bad input."""

import json
import pickle

import numpy as np
import pytest
import scansion
from scansion import contours


@pytest.fixture(scope="module")
def room():
    return contours.synthetic_scene("indoor", random_state=77, rays=80_000)


@pytest.fixture(scope="module")
def found(room):
    return contours.extract(room.cloud)


def test_edges_of_a_room_are_found(room, found):
    factor = found.voxel / 0.1
    score = contours.score(
        found.lines, room.edges, tolerance=0.06 * factor, forgiven=0.03 * factor, step=0.01 * factor
    )
    assert score["precision"] > 0.6 and score["recall"] > 0.3, score
    assert len(found) == len(found.confidence) == len(found.length) == len(found.closed)
    assert found.classes.shape == (len(found), 2)
    assert np.all(np.diff(found.energies) <= 1e-9)
    lengths = [np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in found]
    np.testing.assert_allclose(lengths, found.length, rtol=1e-3, atol=1e-3)


def test_lines_do_not_depend_on_the_number_of_threads(room, found):
    again = contours.extract(room.cloud, n_jobs=1)
    assert len(again) == len(found)
    assert all(np.array_equal(a, b) for a, b in zip(again.lines, found.lines, strict=True))


def test_points_of_some_classes_carry_no_line(room, found):
    codes = room.cloud["Classification"]
    furniture = int(np.bincount(codes).argmax())
    fewer = contours.extract(room.cloud, without=[furniture])
    assert 0 < len(fewer) < len(found)
    with pytest.raises(ValueError, match="classes"):
        contours.extract(room.cloud.xyz, without=[6])
    of_floats = contours.extract(room.cloud, without=np.unique([float(furniture)] * 2))
    assert len(of_floats) == len(fewer) and np.array_equal(of_floats.confidence, fewer.confidence)
    with pytest.raises(ValueError, match=r"without: found np.float64\(2.5\), expected a whole number"):
        contours.extract(room.cloud, without=np.array([2.5]))
    with pytest.raises(ValueError, match=r"without: found 300, expected a whole number in 0..255"):
        contours.extract(room.cloud, without=[300])


def test_classes_of_the_caller_are_codes_and_a_cloud_may_have_points_without_one(room):
    codes = room.cloud["Classification"].astype(np.int16)
    codes[3] = -1
    with pytest.raises(ValueError, match=r"classes: expected whole numbers in 0..255, found -1 at index 3"):
        contours.extract(room.cloud, classes=codes)
    own = room.cloud.copy()
    own["Classification"] = codes
    assert len(contours.extract(own)) > 0


def test_files_hold_all_lines(found, tmp_path):
    for name in ("a.dxf", "a.gpkg", "a.geojson", "a.obj", "a.ply"):
        found.write(tmp_path / name)
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert len(features) == len(found)
    read = np.array(features[0]["geometry"]["coordinates"])
    np.testing.assert_allclose(read, found.lines[0], atol=6e-4)
    assert (tmp_path / "a.dxf").read_text().count("\nPOLYLINE\n") == len(found)
    with pytest.raises(ValueError, match="dxf"):
        found.write(tmp_path / "a.dwg")


def test_lines_survive_pickle(room, found, tmp_path):
    for folder in ("before", "after"):
        (tmp_path / folder).mkdir()
    cloud = room.cloud.copy()
    cloud.crs, cloud.class_names = "EPSG:25832", {int(code): f"mine {code}" for code in np.unique(cloud["Classification"])}
    for lines in (found, contours.extract(cloud), contours.extract(room.cloud.xyz)):
        again = pickle.loads(pickle.dumps(lines))
        for name in ("closed", "length", "confidence", "classes", "voxel", "n_seeds", "n_candidates", "energies", "warnings"):
            np.testing.assert_array_equal(getattr(again, name), getattr(lines, name), err_msg=name)
        assert all(np.array_equal(a, b) for a, b in zip(again.lines, lines.lines, strict=True))
        for name in ("a.geojson", "a.dxf"):
            lines.write(tmp_path / "before" / name)
            again.write(tmp_path / "after" / name)
            assert (tmp_path / "after" / name).read_bytes() == (tmp_path / "before" / name).read_bytes()


def test_dxf_and_geopackage_are_read_by_other_programs(found, tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    found.write(tmp_path / "a.dxf")
    drawing = ezdxf.readfile(tmp_path / "a.dxf")
    assert not drawing.audit().errors
    lines = [entity for entity in drawing.modelspace() if entity.dxftype() == "POLYLINE"]
    assert len(lines) == len(found) and all(line.is_3d_polyline for line in lines)


def test_geopackage_and_ply_are_read_by_other_programs(found, tmp_path):
    pyogrio = pytest.importorskip("pyogrio")
    found.write(tmp_path / "a.gpkg")
    (layer,) = pyogrio.list_layers(tmp_path / "a.gpkg")
    meta, _, shapes, fields = pyogrio.raw.read(tmp_path / "a.gpkg")
    assert len(shapes) == len(found) and layer[1] == "LineString Z"
    confidence = fields[list(meta["fields"]).index("confidence")]
    np.testing.assert_allclose(np.sort(confidence), np.sort(found.confidence), atol=6e-4)
    plyfile = pytest.importorskip("plyfile")
    found.write(tmp_path / "a.ply")
    ply = plyfile.PlyData.read(tmp_path / "a.ply")
    pieces = sum(len(line) - 1 for line in found)
    assert len(ply["edge"]) == pieces and ply["edge"]["vertex1"].max() < len(ply["vertex"])


def test_confident_lines_are_kept_and_precision_rises_with_the_threshold(room, found, tmp_path):
    kept = contours.extract(room.cloud, min_confidence=0.8)
    assert len(kept) == (found.confidence >= 0.8).sum() < len(found)
    found.write(tmp_path / "a.geojson", min_confidence=0.8)
    assert len(json.loads((tmp_path / "a.geojson").read_text())["features"]) == len(kept)
    curve = contours.precision_recall(found, room.edges, [0.0, 0.5, 0.9, 2.0], tolerance=0.6 * found.voxel)
    assert np.all(np.diff(curve[:, 2]) <= 1e-9) and curve[2, 1] > curve[0, 1] and np.isnan(curve[3, 1])
    with pytest.raises(ValueError, match="min_confidence"):
        contours.extract(room.cloud, min_confidence=2)
    for wrong in (np.nan, 80, -0.1):
        with pytest.raises(ValueError, match="min_confidence: found .*, expected a share in 0..1"):
            found.write(tmp_path / "b.geojson", min_confidence=wrong)
    assert not (tmp_path / "b.geojson").exists()


def test_stages_draw_lines_with_several_settings():
    scene = contours.synthetic_scene("indoor", random_state=2, rays=50_000)
    rated = contours.stages(scene.cloud)
    whole = contours.extract(scene.cloud)
    assert all(np.array_equal(a, b) for a, b in zip(rated.lines(), whole, strict=True))
    assert len(rated.lines({"trace": {"field": {"bias": 1.0}}})) <= len(rated.lines({"trace.field.bias": -2.0}))
    lengths = [rated.lines({"trace.parts.least": least}).length.sum() for least in (0.0, 0.5, 0.8, 1.0)]
    assert lengths == sorted(lengths, reverse=True) and lengths[0] > lengths[2] > 0
    assert lengths[1] == whole.length.sum()
    for key in ("candidates.seeds.threshold", "voxel", "trace", "tracer.bias"):
        with pytest.raises(ValueError, match=f"settings: found {key}, expected keys below trace; others need new stages"):
            rated.lines({"trace.field.bias": 1.0, key: 1})
    feet = scene.cloud.xyz / 0.3048
    assert contours.stages(feet, metres_per_unit=0.3048).voxel == pytest.approx(rated.voxel, rel=1e-6)
    assert contours.stages(feet, settings={"voxel": 0.5}).voxel == 0.5


def test_scores_do_not_depend_on_the_place_on_earth():
    line = np.array([[0.0, 0, 0], [1, 0, 0]])
    far = np.array([690_000.123, 5_330_000.456, 500.0])
    beside = line + [0, 0.04, 0]
    here = contours.score([beside], [line])
    assert contours.score([beside + far], [line + far]) == here
    assert here["precision"] == here["recall"] == 1
    assert contours.score([], [line])["f1"] == 0 and contours.score([], [])["f1"] is None
    both = contours.score([beside, line + 5], [line], unsure=[line + 5])
    assert both["precision"] == 1 and both["unsure"] == 51
    points = far + np.column_stack([np.arange(20) * 0.01, np.zeros(20), np.zeros(20)])
    marks = contours.score_points(points, np.arange(20) < 5, np.ones(20, bool), forgiven=0.0301)
    assert (marks["correct"], marks["false_negatives"]) == (5, 3)
    with pytest.raises(ValueError, match="marks"):
        contours.score_points(points, [True], np.ones(20, bool))


def test_simpler_methods_find_a_strong_row():
    x, y = np.meshgrid(np.arange(0, 3, 0.05), np.arange(0, 1, 0.05))
    cloud = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    strengths = np.clip(1 - np.abs(y.ravel() - 0.5) / 0.2, 0, 1)
    for method in ("threshold", "canny"):
        (line,) = contours.baseline(cloud, strengths >= 0.99, method)
        np.testing.assert_allclose(line[:, 1], 0.5, atol=1e-6)
    assert len(contours.baseline(cloud, strengths, "canny", settings={"high": 1.0, "low": 0.99})) == 1
    for bad in ({"method": "sobel"}, {"settings": {"nonsense": 1}}):
        with pytest.raises(ValueError, match=next(iter(bad.values())) if "method" in bad else "nonsense"):
            contours.baseline(cloud, strengths, **bad)
    with pytest.raises(ValueError, match="strengths"):
        contours.baseline(cloud, strengths[1:])


def test_lines_are_drawn_over_the_cloud(room, found):
    plain = scansion.render(room.cloud, width=300, legend=False)
    lined = scansion.render(room.cloud, width=300, legend=False, contours=found)
    assert plain.shape == lined.shape and (plain != lined).any(axis=2).sum() > 100
    with pytest.raises(ValueError, match="contours"):
        scansion.render(room.cloud, contours=[[0, 1, 2]])


def test_scenes_without_edges_and_bad_input():
    x, y = np.meshgrid(np.arange(0, 20, 0.1), np.arange(0, 20, 0.1))
    plane = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    noisy = plane + np.random.default_rng(0).normal(0, 0.002, plane.shape)
    found = contours.extract(noisy)
    assert found.length.sum() < 8
    assert repr(found).startswith("Contours(")
    for cloud in (np.zeros((0, 3)), np.full((3, 3), np.nan)):
        with pytest.raises(ValueError, match="point"):
            contours.extract(cloud)
    contours.extract(np.repeat([[1.0, 2.0, 3.0]], 50, axis=0))
    with pytest.raises(ValueError, match="voxel"):
        contours.extract(plane, voxel=-1)
    with pytest.raises(ValueError, match="contours"):
        contours.extract(plane, scansion.PointClassifier.default())
    with pytest.raises(ValueError, match="kind"):
        contours.synthetic_scene("moon")
    with pytest.raises(TypeError, match="random_state"):
        contours.synthetic_scene("indoor", seed=1)
    with pytest.raises(ValueError, match="reference system"):
        contours.labels(plane, [[[1e6, 0, 0], [1e6, 1, 0]]])


def test_a_model_learns_from_lines(room):
    labels = contours.labels(room.cloud, room.edges[room.edge_spacing < 0.1])
    assert set(np.unique(labels)) == {-1, 0, 1}
    recipe = {
        "recipe": "contours",
        "forest.trees": 5,
        "candidate_forest.trees": 5,
        "training.max_samples": 5000,
    }
    model = scansion.PointClassifier(recipe).fit(room.cloud, labels)
    assert len(contours.extract(room.cloud, model)) > 10
    assert (model.predict(room.cloud)[labels >= 0] == labels[labels >= 0]).mean() > 0.8


def test_marks_are_not_made_of_numbers():
    points = np.eye(3)
    for marks in (([2, 0, 0], [True] * 3), ([True] * 3, [np.nan] * 3)):
        with pytest.raises(TypeError, match="(found|reference): expected an array of bool"):
            contours.score_points(points, *marks)
