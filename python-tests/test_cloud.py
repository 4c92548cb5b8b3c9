"""The cloud as an object: columns that can be written, selection, tables, concatenation; files in scikit-learn's tools."""

import pickle

import numpy as np
import pytest
import scansion
from conftest import street


@pytest.fixture
def cloud():
    return scansion.PointCloud(
        [[0, 0, 1], [1, 0, 7], [2, 1, 3]], Classification=np.array([2, 6, 2], np.uint8), Height=[0.5, np.nan, 2.0]
    )


def test_what_is_written_into_a_column_is_in_the_cloud(cloud, tmp_path):
    cloud["Classification"][cloud.z > 5] = 9
    cloud["Height"] += 1
    heights = cloud["Height"]
    heights[0] = 30
    assert cloud["Classification"].tolist() == [2, 9, 2] and cloud["Height"][0] == 30
    scansion.write(tmp_path / "a.laz", cloud)
    found = scansion.read(tmp_path / "a.laz")
    assert found["Classification"].tolist() == [2, 9, 2]
    np.testing.assert_array_equal(found["Height"], [30, np.nan, 3])
    for other in (cloud.copy(), pickle.loads(pickle.dumps(cloud)), cloud[:], cloud[[True] * 3]):
        other["Classification"][0] = 5
        assert other["Classification"].tolist() == [5, 9, 2] and cloud["Classification"][0] == 2
    cloud["Classification"] = [1, 1, 1]
    assert cloud["Classification"].tolist() == [1, 1, 1]
    del cloud["Height"]
    assert cloud.columns == ["Classification"]
    with pytest.raises(KeyError, match="Height"):
        cloud["Height"]


def test_coordinates_say_that_they_cannot_be_written(cloud):
    assert cloud.x.tolist() == [0, 1, 2] and cloud.y.tolist() == [0, 0, 1] and cloud.z.tolist() == [1, 7, 3]
    for values in (cloud.xyz, cloud.x, cloud.z):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 5
    array = np.asarray(cloud)
    np.testing.assert_array_equal(array, cloud.xyz)
    array[0] = 8
    assert np.array(cloud, dtype=np.float32).dtype == np.float32 and cloud.x[0] == 0
    assert cloud.shape == (3, 3) and np.shape(cloud) == (3, 3)


def test_points_are_selected_as_in_numpy(cloud):
    for key, expected in [
        (cloud.z > 2, [1, 2]),
        (slice(None, None, -1), [2, 1, 0]),
        ([-1, 0], [2, 0]),
        (np.array([1], np.uint8), [1]),
        (1, [1]),
        (np.array([], int), []),
    ]:
        part = cloud[key]
        assert part.x.tolist() == expected and part["Classification"].tolist() == [[2, 6, 2][i] for i in expected]
    for wrong, error in [(5, IndexError), ([0.5], TypeError), ([True], ValueError), (None, TypeError)]:
        with pytest.raises(error):
            cloud[wrong]
    with pytest.raises(TypeError, match="some points"):
        cloud[cloud.z > 2] = 1


def test_a_cloud_is_a_table_for_people_and_pandas(cloud):
    lines = repr(cloud).splitlines()
    assert lines[0] == "PointCloud: 3 points" and lines[1].split() == ["X", "Y", "Z", "Classification", "Height"]
    assert lines[3].split() == ["1", "1.000", "0.000", "7.000", "6", "nan"]
    xyz, labels = street(0, 400)
    many = repr(scansion.PointCloud(xyz, Classification=labels, **{f"C{i:02}": labels for i in range(12)}))
    assert "400 points; and 4 more columns: C08, C09" in many and many.count("\n") == 7 and "399" in many
    assert repr(scansion.PointCloud(np.zeros((0, 3)))).startswith("PointCloud: 0 points")
    assert "<td>7.000</td>" in cloud._repr_html_()
    pandas = pytest.importorskip("pandas")
    frame = cloud.to_pandas()
    assert frame.columns.tolist() == ["X", "Y", "Z", "Classification", "Height"]
    assert frame.dtypes["Classification"] == np.uint8
    again = scansion.concatenate([frame])
    assert again.columns == cloud.columns and again.z.tolist() == [1, 7, 3]
    np.testing.assert_array_equal(pandas.DataFrame(cloud).to_numpy(), cloud.xyz)
    with pytest.raises(ValueError, match="table: expected the fields X, Y, Z"):
        scansion.write("absent.laz", pandas.DataFrame({"a": [1], "b": [2]}))
    nameless = pandas.DataFrame(np.arange(8.0).reshape(2, 4))
    with pytest.raises(ValueError, match="found 0, 1, 2, 3; rename the fields of the coordinates, or give a table of these"):
        scansion.concatenate([nameless])
    for right in (nameless[[0, 1, 2]], nameless.rename(columns=dict(enumerate("xyz")))):
        np.testing.assert_array_equal(scansion.concatenate([right]).xyz, nameless.to_numpy()[:, :3])
    # Numbers, and parts of "xyz", are names of columns like others.
    odd = nameless.rename(columns=dict(enumerate("xyz"))).assign(xy=[7.0, 8.0])
    found = scansion.concatenate([odd])
    assert found.columns == ["3", "xy"] and found["3"].tolist() == [3, 7] and found["xy"].tolist() == [7, 8]


def test_clouds_become_one(cloud, tmp_path):
    xyz, labels = street(0, 400)
    scansion.write(tmp_path / "a.laz", scansion.PointCloud(xyz, Classification=labels))
    whole = scansion.read(tmp_path / "a.laz")
    both = scansion.concatenate([whole[:100], tmp_path / "a.laz"])
    ticks = whole._core.ticks()
    assert len(both) == len(whole) + 100 and both._core.ticks()[1:] == ticks[1:] and both.scheme == "asprs"
    np.testing.assert_array_equal(both._core.ticks()[0][100:], ticks[0])
    other = scansion.PointCloud([[5, 5, 5]], Intensity=[7])
    with pytest.raises(ValueError, match=r"Classification \(not in cloud 1\).*Intensity \(not in cloud 0\)"):
        scansion.concatenate([cloud, other])
    assert scansion.concatenate([cloud, other], columns="common").columns == []
    every = scansion.concatenate([cloud, other], columns="all")
    assert every["Classification"].tolist() == [2, 6, 2, 0] and np.isnan(every["Height"][3])
    with pytest.raises(ValueError, match="reference systems"):
        scansion.concatenate([cloud, scansion.PointCloud(cloud, crs="EPSG:2056")], columns="common")
    feet = scansion.PointCloud([[5, 5, 5]])
    feet.metres_per_unit = 0.3048
    scansion.write(tmp_path / "feet.laz", feet)
    assert scansion.read(tmp_path / "feet.laz").crs.startswith("LOCAL_CS")
    assert scansion.concatenate([feet, tmp_path / "feet.laz"], columns="common").metres_per_unit == 0.3048
    with pytest.raises(ValueError, match="reference systems"):
        scansion.concatenate([feet, scansion.PointCloud([[5, 5, 5]])])
    with pytest.raises(ValueError, match="none"):
        scansion.concatenate([])


SMALL = {"features.pyramid.first_scale": 0.5, "features.pyramid.levels": 2, "forest.trees": 5, "regularise.method": "none"}


def test_files_and_points_go_through_scikit_learn(tmp_path):
    selection = pytest.importorskip("sklearn.model_selection")
    files = []
    for seed in range(4):
        xyz, labels = street(seed, 1200)
        files.append(tmp_path / f"{seed}.laz")
        scansion.write(files[-1], scansion.PointCloud(xyz, Classification=labels))
    model = scansion.PointClassifier(SMALL).fit(files[:2])
    each = [model.score(path) for path in files[2:]]
    assert abs(model.score(files[2:]) - np.mean(each)) < 1e-9 and min(each) > 0.9
    grid = {"recipe": [SMALL, {**SMALL, "forest.max_depth": 1, "forest.trees": 1}]}
    search = selection.GridSearchCV(scansion.PointClassifier(), grid, cv=2).fit(files)
    scores = search.cv_results_["mean_test_score"]
    assert search.best_index_ == 0 and scores[0] > 0.9 > scores[1]
    cloud = scansion.read(files[0])
    folds = scansion.SpatialKFold(3)
    found = selection.cross_val_score(scansion.PointClassifier(SMALL), cloud, cloud["Classification"], cv=folds)
    assert len(found) == 3 and np.median(found) > 0.9
    parts = list(folds.split(cloud))
    assert sorted(np.concatenate([test for _, test in parts]).tolist()) == list(range(len(cloud)))
    with pytest.raises(ValueError, match="squares"):
        list(scansion.SpatialKFold(3, block=1000.0).split(cloud))


def test_a_regularisation_is_chosen_when_classes_are_asked_for(labelled):
    model = scansion.PointClassifier(SMALL).fit(labelled)
    for method in ("none", "local"):
        expected = model.classify(labelled, regularize=method, divided=False, probabilities=True)
        assert (model.predict(labelled, regularize=method) == expected.codes).all()
        assert (model.predict_proba(labelled, regularize=method) == expected.probabilities).all()


def test_progress_is_reported_and_its_errors_end_the_work(labelled, capsys):
    stages = []
    model = scansion.PointClassifier({**SMALL, "forest.trees": 200})
    model.fit(labelled, progress=lambda stage, done, total: stages.append((stage, done, total)))
    assert stages and all(isinstance(stage, str) and stage and done >= 0 and total >= 0 for stage, done, total in stages)
    count = len(stages)
    model.fit(labelled)
    assert len(stages) == count

    class Enough(Exception):
        pass

    def stop(*_):
        raise Enough

    with pytest.raises(Enough), scansion.progress(stop):
        model.fit(labelled)
    with scansion.progress():
        scansion.segment(labelled)
    assert scansion.segment(labelled, progress=False).report["segments"] > 0


def test_columns_are_found_however_they_are_spelled(tmp_path):
    cloud = scansion.PointCloud(np.eye(3), classification=np.array([2, 6, 2], np.uint8), Height=[1, 2, 3])
    assert cloud.columns == ["Classification", "Height"] and "classification" in cloud and "Z" not in cloud.columns
    cloud["classification"][0] = 9
    cloud["height"] += 1
    assert cloud["Classification"].tolist() == [9, 6, 2] and cloud["Height"].tolist() == [2, 3, 4]
    assert cloud["Z"].tolist() == cloud["z"].tolist() == cloud.z.tolist()
    for name, wanted in [("clasification", "did you mean 'Classification'"), ("absent", "the cloud has: Class")]:
        with pytest.raises(KeyError, match=wanted):
            cloud[name]
    with pytest.raises(ValueError, match="coordinates cannot be written"):
        cloud["Z"] = [1, 2, 3]
    scansion.write(tmp_path / "a.laz", cloud)
    assert scansion.read(tmp_path / "a.laz", columns=["classification", "gps_time"]).columns == ["Classification", "GpsTime"]
    pandas = pytest.importorskip("pandas")
    lower = cloud.to_pandas().rename(columns=str.lower)
    assert scansion.concatenate([lower]).columns == ["Classification", "height"]
    both = pandas.DataFrame({"x": [0], "y": [0], "z": [0], "red": [1], "Red": [2]})
    assert scansion.concatenate([both]).to_pandas().iloc[0].tolist() == [0, 0, 0, 1, 2]
    del cloud["HEIGHT"]
    assert cloud.columns == ["Classification"]


def test_a_table_with_names_in_lower_case_trains(labelled):
    pytest.importorskip("pandas")
    lower = labelled.to_pandas().rename(columns=str.lower)
    assert scansion.PointClassifier(SMALL).fit(lower).classes_.tolist() == [2, 5, 6]


def test_one_number_goes_to_all_points(cloud):
    cloud["Classification"] = 7
    assert cloud["Classification"].tolist() == [7, 7, 7] and cloud["Classification"].dtype == np.uint8
    cloud["Classification"] = 300
    assert cloud["Classification"].tolist() == [300, 300, 300]
    cloud["New"] = 0.5
    assert cloud["New"].tolist() == [0.5] * 3
    with pytest.raises(TypeError, match="New: expected a one-dimensional array of numbers"):
        cloud["New"] = "a"


def test_a_table_keeps_what_a_cloud_has_besides_its_points(cloud, tmp_path):
    pytest.importorskip("pandas")
    cloud.crs, cloud.metres_per_unit, cloud.scheme, cloud.class_names = "EPSG:2992", 0.3048, "asprs", {15: "pole"}
    frame = cloud.to_pandas()
    for part in (frame, frame[frame["Classification"] == 2], frame.iloc[[2, 0]], frame[["X", "Y", "Z"]]):
        again = scansion.concatenate([part])
        assert (again.crs, again.metres_per_unit, again.scheme) == ("EPSG:2992", 0.3048, "asprs")
        assert scansion._cloud.as_cloud(part).class_names == {15: "pole"}
    assert pickle.loads(pickle.dumps(cloud)).class_names == {15: "pole"}
    scansion.write(tmp_path / "a.laz", frame)
    assert scansion.info(tmp_path / "a.laz")["metres_per_unit"] == 0.3048
    frame.attrs = {}
    assert scansion.concatenate([frame]).crs is None


def test_clouds_that_become_one_keep_the_names_of_their_classes(cloud):
    first, second = cloud.copy(), cloud.copy()
    first.class_names = {15: "pole"}
    second.class_names = {15: "mast", 16: "wire"}
    assert scansion.concatenate([first, second]).class_names == {15: "pole", 16: "wire"}
    assert scansion.concatenate([second, first]).class_names == {15: "mast", 16: "wire"}


def test_one_number_takes_a_type_that_holds_it(cloud):
    for number, like, kind in [
        (0.1, np.uint8, np.float64),
        (2.0, np.uint8, np.float64),
        (np.nan, np.int32, np.float64),
        (-1, np.uint8, np.int16),
        (0.1, np.float32, np.float32),
        (70_000, np.float32, np.float32),
        (np.inf, np.float32, np.float32),
        ((1 << 24) + 1, np.float32, np.float64),
        (1e300, np.float32, np.float64),
    ]:
        cloud["Mine"] = np.zeros(3, like)
        cloud["Mine"] = number
        np.testing.assert_array_equal(cloud["Mine"], np.full(3, number, kind))
        assert cloud["Mine"].dtype == kind


@pytest.mark.parametrize("kind", [np.int8, np.int16, np.int32, np.int64])
def test_short_indices_select_in_long_clouds(kind):
    cloud = scansion.PointCloud(np.repeat(np.arange(40_000.0), 3).reshape(-1, 3))
    assert cloud[np.array([3, -1], kind)].x.tolist() == [3, 39_999]


def test_columns_do_not_have_names_of_coordinates():
    for name in ("X", "y", "Z"):
        with pytest.raises(ValueError, match=f"{name}: found the name of a coordinate"):
            scansion.PointCloud(np.eye(3), **{name: [1, 2, 3]})


def test_folds_of_a_table_are_those_of_its_coordinates_and_its_unit():
    pandas = pytest.importorskip("pandas")
    random = np.random.default_rng(4)
    # 0.001 metres per unit: squares of a metre are 1000 units wide.
    xyz = random.uniform(0, 20_000, (600, 3))
    cloud = scansion.PointCloud(xyz, metres_per_unit=0.001, Intensity=random.random(600))
    folds = scansion.SpatialKFold(3, block=1.0)
    expected = folds.folds(cloud)
    squares = np.unique(np.floor(xyz[:, :2] / 1000), axis=0, return_inverse=True)[1].reshape(-1)
    assert (np.unique(np.column_stack([squares, expected]), axis=0)[:, 0] == np.arange(squares.max() + 1)).all()
    frame = cloud.to_pandas()
    for order in (["X", "Y", "Z", "Intensity"], ["Intensity", "Z", "Y", "X"], ["Z", "X", "Y"]):
        assert (folds.folds(frame[order]) == expected).all(), order
    small = frame[["Intensity", "Z", "Y", "X"]].rename(columns=str.lower).assign(kind="text")
    assert (folds.folds(small) == expected).all()
    with pytest.raises(ValueError, match="expected the fields X, Y, Z or x, y, z"):
        folds.folds(pandas.DataFrame(random.random((9, 4)), columns=list("abcd")))
    wide = scansion.SpatialKFold(3, block=1000.0)
    assert (wide.folds(np.column_stack([xyz, xyz])) == wide.folds(xyz)).all()
