"""Arrays of every kind, Ctrl-C, fork: the right result or a clear error, never a hang."""

import os
import pickle
import signal
import threading
import time

import numpy as np
import pytest
import scansion
from scansion import (
    RandomForestClassifier,
    evaluation,
    features,
    filters,
    graph,
    nn,
    regularisation,
    segmentation,
    terrain,
)

XYZ = np.random.default_rng(0).uniform(0, 10, (300, 3))


def table(xyz):
    return features.multiscale(xyz, first_scale=0.5, levels=2)


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(np.asfortranarray, id="columns first"),
        pytest.param(lambda x: np.repeat(x, 2, axis=0)[::2], id="strided"),
        pytest.param(lambda x: x[::-1].copy()[::-1], id="negative stride"),
        pytest.param(lambda x: x.astype(">f8"), id="byte-swapped"),
        pytest.param(lambda x: np.frombuffer(x.tobytes()).reshape(-1, 3), id="read-only"),
        pytest.param(lambda x: x.tolist(), id="list"),
        pytest.param(np.ma.asarray, id="without masked values"),
        pytest.param(lambda x: np.ma.masked_less(x, -1), id="with a mask of which nothing is masked"),
        pytest.param(
            lambda x: np.frombuffer(b"\0" + x.tobytes(), np.uint8)[1:].view("f8").reshape(-1, 3),
            id="odd address",
        ),
        pytest.param(lambda x: np.rec.fromarrays(list(x.T), names="x,y,z"), id="structured"),
    ],
)
def test_layouts_of_the_same_numbers_give_the_same_bytes(make):
    assert table(make(XYZ)).tobytes() == table(XYZ.copy()).tobytes()


@pytest.mark.parametrize("kind", ["f2", "f4", "i4", "u1", ">i2", "?", "g"])
def test_other_number_types_are_taken_at_their_value(kind):
    other = XYZ.astype(kind)
    assert table(other).tobytes() == table(other.astype(np.float64)).tobytes()


def test_empty_arrays_give_empty_results():
    for empty in (np.empty((0, 3)), np.empty((0, 3), np.float16), []):
        assert table(empty).shape == (0, 32)


@pytest.mark.parametrize(
    ("bad", "error"),
    [
        (XYZ[:, :2], ValueError),
        (XYZ.ravel(), ValueError),
        (XYZ[None], ValueError),
        (3.0, ValueError),
        (XYZ.astype(object), TypeError),
        (XYZ.astype(str), TypeError),
        (XYZ + 1j, TypeError),
        (None, TypeError),
        (np.zeros(3, dtype=[("a", "f8"), ("b", "f8")]), ValueError),
    ],
)
def test_what_is_no_cloud_is_refused_with_the_shape_and_type_that_are_expected(bad, error):
    with pytest.raises(error, match=r"\(n, 3\)|X, Y, Z"):
        table(bad)


@pytest.mark.parametrize(
    "keywords",
    [
        {"k": 2},
        {"levels": 0},
        {"levels": 99},
        {"first_scale": -0.5},
        {"first_scale": float("nan")},
        {"first_scale": float("inf")},
        {"near_share": 1.0},
        {"column_radius": -1.0},
        {"centre": "median"},
        {"divisor": "n-2"},
        {"column": 3},
        {"n_jobs": 0},
        {"metres_per_unit": -1.0},
    ],
)
def test_parameters_out_of_range_are_named(keywords):
    with pytest.raises(ValueError, match=next(iter(keywords))):
        features.multiscale(XYZ, **keywords)


def test_parameters_of_the_wrong_type_are_refused():
    for keywords in ({"levels": 2.5}, {"k": "ten"}, {"normalise": 3}, {"levels": object()}):
        with pytest.raises((ValueError, TypeError)):
            features.multiscale(XYZ, **keywords)


def test_columns_must_fit_the_points():
    cloud = scansion.PointCloud(XYZ)
    with pytest.raises(ValueError, match=r"\(300,\)"):
        cloud["Intensity"] = np.zeros(299)
    with pytest.raises(TypeError, match="object"):
        cloud["Intensity"] = np.zeros(300, dtype=object)
    with pytest.raises(KeyError, match="Intensity"):
        cloud["Intensity"]


def test_columns_keep_their_type():
    cloud = scansion.PointCloud(XYZ[:3])
    for kind in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"):
        cloud[kind] = np.array([1, 2, 3], dtype=kind)
        assert cloud[kind].dtype == np.dtype(kind) and cloud[kind].tolist() == [1, 2, 3]
    cloud["half"] = np.array([1, 2, 3], dtype="f2")
    cloud["swapped"] = np.array([1, 2, 300], dtype=">u2")[::-1]
    assert cloud["half"].dtype == np.float32 and cloud["swapped"].tolist() == [300, 2, 1]


def test_clouds_survive_pickle_and_copies_are_their_own():
    cloud = scansion.PointCloud(
        XYZ, crs="EPSG:2056", metres_per_unit=0.3048, Classification=np.ones(300, "u1")
    )
    again = pickle.loads(pickle.dumps(cloud))
    assert (again.xyz == cloud.xyz).all() and again.columns == cloud.columns
    assert (again.crs, again.metres_per_unit) == ("EPSG:2056", 0.3048)
    other = cloud.copy()
    other["Classification"] = np.zeros(300, "u1")
    del other["Classification"]
    assert cloud["Classification"].all() and "Classification" not in other


def interrupted_after(seconds, work):
    """Seconds from Ctrl-C to the exception."""
    sent = []

    def press():
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    # Where tests run in the background Ctrl-C may be ignored from the start.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(seconds, press)
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
        return time.monotonic() - sent[0]
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)


def test_ctrl_c_ends_features_within_a_fifth_of_a_second():
    xyz = np.random.default_rng(0).uniform(0, 300, (1_500_000, 3)) * [1, 1, 0.1]
    assert interrupted_after(0.7, lambda: features.multiscale(xyz, first_scale=0.4)) < 0.2


def test_ctrl_c_ends_a_forest_within_a_fifth_of_a_second():
    random = np.random.default_rng(0)
    X, y = random.normal(size=(200_000, 40)).astype(np.float32), random.integers(0, 5, 200_000)
    assert interrupted_after(0.7, lambda: RandomForestClassifier(500).fit(X, y)) < 0.2


def interruptible():
    """Long functions of every room, each of some seconds."""
    random = np.random.default_rng(0)
    nodes = 3_000_000
    xyz = random.uniform(0, 300, (nodes, 3)) * [1, 1, 0.1]
    edges = random.integers(0, nodes, (12_000_000, 2), dtype=np.uint32)
    edges = edges[edges[:, 0] != edges[:, 1]]
    costs = random.uniform(size=(nodes, 3)).astype(np.float32)
    codes = random.integers(0, 4, nodes).astype(np.uint8)
    cloud = scansion.PointCloud(xyz, Classification=codes)
    return {
        "components": lambda: graph.connected_components(nodes, edges),
        "felzenszwalb": lambda: graph.felzenszwalb(nodes, edges, np.ones(len(edges))),
        "spanning tree": lambda: graph.minimum_spanning_tree(nodes, edges),
        "smoothing": lambda: regularisation.local_smoothing(costs, edges),
        "expansion": lambda: regularisation.alpha_expansion(costs, edges, strength=0.1),
        "merge": lambda: segmentation.merge(costs, edges, strength=0.1),
        "normals": lambda: features.normals(xyz),
        "regions": lambda: segmentation.region_growing(xyz),
        "segments": lambda: scansion.segment(cloud, method="riemannian"),
        "ground": lambda: terrain.ground_points(cloud, cell=0.5),
        "predict": lambda: scansion.PointClassifier.default().predict(cloud),
    }


def test_ctrl_c_ends_every_room_long_before_it_has_a_result():
    for work in interruptible().values():
        waited = interrupted_after(0.2, work)
        # A function that does not look for signals ends by itself: it would be ready long before this second one.
        interrupted_after(0.2 + 3 * waited, work)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_process_that_forks_after_use_works_in_the_child():
    expected = table(XYZ).tobytes()
    child = os.fork()
    if child == 0:
        os._exit(0 if table(XYZ).tobytes() == expected else 1)
    for _ in range(200):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            assert status == 0
            return
        time.sleep(0.05)
    os.kill(child, signal.SIGKILL)
    pytest.fail("the child hangs")


def test_other_threads_run_while_the_core_works():
    xyz = np.random.default_rng(0).uniform(0, 100, (200_000, 3))
    ticks, stop = [], threading.Event()

    def tick():
        while not stop.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.005)

    thread = threading.Thread(target=tick)
    thread.start()
    features.multiscale(xyz, first_scale=0.4, levels=5, n_jobs=1)
    stop.set()
    thread.join()
    assert len(ticks) > 10


def test_codes_above_255_are_refused_with_the_argument_that_maps_them():
    labels = np.full(len(XYZ), 1002)
    cloud = scansion.PointCloud(XYZ, Classification=labels)
    for work in (
        lambda: scansion.PointClassifier().fit(cloud),
        lambda: scansion.PointClassifier().fit(XYZ, labels),
        lambda: scansion.search(cloud),
    ):
        with pytest.raises(ValueError, match='class_map="1002=5"'):
            work()
    for pair, option in [((labels, labels // 501), "map_truth"), ((labels // 501, labels), "map_predicted")]:
        with pytest.raises(ValueError, match=option):
            scansion.evaluation.scores(*pair)
    with pytest.raises(ValueError, match="found 1002$"):
        scansion.evaluation.purities(labels, labels)


def test_messages_name_arguments_of_python(tmp_path):
    (tmp_path / "a.xyz").write_text("".join(f"{i} {i % 7} 0 1 2 3 4\n" for i in range(20)))
    with pytest.warns(UserWarning, match="text_columns names them"):
        scansion.read(tmp_path / "a.xyz")
    degrees = scansion.PointCloud(XYZ, crs="EPSG:4326")
    with pytest.raises(ValueError, match=r"which \(metres_per_unit\)"):
        scansion.segment(degrees)


def test_wrong_settings_are_named():
    with pytest.raises(ValueError, match="random_state: found 1.5"):
        scansion.segmentation.cut_pursuit(np.ones((3, 1)), [[0, 1]], random_state=1.5)
    for wrong, shown in ((1.5, "1.5"), (-1, "-1"), ("1", '"1"'), (None, "None")):
        with pytest.raises(ValueError, match=f"^steps.restarts: found {shown}, expected a whole number, 0 or more$"):
            scansion.segmentation.cut_pursuit(np.ones((3, 1)), [[0, 1]], restarts=wrong)
    for wrong, shown in (("a", '"a"'), (None, "None"), (True, "True"), ([1.0], "a list")):
        with pytest.raises(ValueError, match=f"^cell: found {shown}, expected a number$"):
            terrain.dtm(XYZ, cell=wrong)
    for wrong in (-1, 0, 1001, 2.5, "a", None):
        with pytest.raises(ValueError, match=f"^neighbours: found {wrong!r}, expected a whole number in 1..1000$"):
            filters.statistical_outliers(XYZ, wrong)
        with pytest.raises(ValueError, match=f"^min_neighbours: found {wrong!r}, expected a whole number in 1..1000$"):
            filters.radius_outliers(XYZ, min_neighbours=wrong)


def test_whole_numbers_beyond_those_of_the_core_are_refused():
    assert len(nn.Sites(np.array([[2**51], [0]], np.uint64))) == 2
    for wrong in (2**63, 2**64 - 1):
        with pytest.raises(ValueError, match=rf"coordinates: expected whole numbers below 2\^63, found {wrong} at index 1, 0"):
            nn.Sites(np.array([[0], [wrong]], np.uint64))
    for values in ([[2**64]], np.array([[0.5]], object), [["1"]], [[1j]]):
        with pytest.raises(TypeError, match="coordinates: expected whole numbers, found dtype"):
            nn.Sites(values)


def masked(values, *at):
    """The array, in which the first value, or that at an index, is masked."""
    found = np.ma.array(values)
    found[at or 0] = np.ma.masked
    return found


CODES = np.repeat([2, 6], 150)
EDGES = [[0, 1], [1, 2]]
COLUMN = masked(np.ones(300))
ROWS = masked(XYZ, 5, 2)
TENSOR = nn.SparseTensor.from_dense(np.eye(3)[None, None])
KERNEL = np.ones((1, 1, 3, 3))
RASTER = terrain.Raster(masked(np.ones((3, 3)), 1, 1), (0.0, 3.0), 1.0)
FOREST = RandomForestClassifier(n_estimators=2).fit(XYZ, CODES)
MASKED = {
    "coordinates": [
        lambda: table(ROWS),
        lambda: scansion.PointCloud(ROWS),
        lambda: scansion.PointCloud([*map(np.ma.array, XYZ[:5].tolist()), ROWS[5]]),
        lambda: scansion.SpatialKFold(2).folds(ROWS),
    ],
    "x": [lambda: table(np.ma.array(np.rec.fromarrays(list(XYZ.T), names="x,y,z"), mask=[(1, 0, 0), *[(0, 0, 0)] * 299]))],
    "X": [
        lambda: scansion.SpatialKFold(2).folds(masked(np.ones((300, 4)), 0, 3)),
        lambda: FOREST.predict(ROWS),
        lambda: nn.VoxelClassifier("mnist").fit(masked(np.ones((4, 12, 12)), 0, 0, 0), [0, 0, 1, 1]),
        lambda: nn.VoxelClassifier().fit([ROWS, XYZ], [0, 1]),
    ],
    "Height": [
        lambda: scansion.PointCloud(XYZ, Height=COLUMN),
        lambda: scansion.PointCloud(XYZ).__setitem__("Height", COLUMN),
        lambda: scansion.PointCloud(XYZ).__setitem__("Height", np.ma.masked),
    ],
    "points": [
        lambda: scansion.PointCloud(XYZ)[COLUMN > 0],
        lambda: scansion.PointCloud(XYZ).select(masked([1, 2])),
        lambda: scansion.contours.score_points(ROWS, CODES == 2, CODES == 2),
    ],
    "labels": [
        lambda: scansion.PointClassifier().fit(XYZ, masked(CODES)),
        lambda: scansion.PointClassifier(unlabelled=[]).fit(XYZ, masked(CODES)),
        lambda: scansion.PointClassifier().fit(XYZ, masked(CODES.astype(str))),
        lambda: scansion.PointClassifier.default().score(XYZ, masked(CODES)),
        lambda: scansion.suggest(XYZ, labels=masked(CODES)),
        lambda: scansion.spread_labels(masked(CODES), CODES),
        lambda: segmentation.segment_shapes(XYZ, masked(CODES)),
        lambda: regularisation.energy(masked([0, 1, 0]), np.ones((3, 2)), EDGES),
    ],
    "y": [
        lambda: RandomForestClassifier().fit(XYZ, masked(CODES)),
        lambda: FOREST.score(XYZ, masked(CODES)),
        lambda: nn.VoxelClassifier("mnist").fit(np.ones((4, 12, 12)), masked([0, 0, 1, 1])),
    ],
    "sample_weight": [
        lambda: RandomForestClassifier().fit(XYZ, CODES, COLUMN),
        lambda: FOREST.score(XYZ, CODES, COLUMN),
        lambda: scansion.PointClassifier().fit(XYZ, CODES, sample_weight=COLUMN),
    ],
    "truth": [lambda: evaluation.scores(masked(CODES), CODES), lambda: evaluation.scores(masked(["a", "b"]), ["a", "b"])],
    "predicted": [lambda: evaluation.report(CODES, masked(CODES))],
    "segments": [lambda: scansion.segment_colours(masked(CODES))],
    "uncertainty": [lambda: scansion.suggest(XYZ, uncertainty=COLUMN)],
    "ground": [lambda: terrain.heights(XYZ, COLUMN > 0), lambda: terrain.dtm(XYZ, ground=COLUMN > 0)],
    "heights": [lambda: segmentation.object_features(XYZ, CODES, heights=COLUMN)],
    "colours": [lambda: segmentation.supervoxels(XYZ, colours=masked(np.ones((300, 3)), 0, 0))],
    "raster": [lambda: terrain.contours(RASTER), lambda: terrain.write_raster("absent/a.asc", RASTER)],
    "values": [lambda: segmentation.merge(masked(np.ones((3, 1)), 0, 0), EDGES)],
    "edges": [lambda: segmentation.merge(np.ones((3, 1)), masked(EDGES, 0, 0))],
    "weights": [
        lambda: segmentation.merge(np.ones((3, 1)), EDGES, masked([1.0, 2.0])),
        lambda: nn.submanifold_convolution([[0]], [[1.0]], masked(np.ones((3, 1, 1)), 0, 0, 0)),
        lambda: nn.sparse_convolution(TENSOR, masked(np.ones((1, 1, 3, 3)), 0, 0, 0, 0)),
    ],
    "tensor.keys": [
        lambda: nn.sparse_convolution(TENSOR._replace(keys=masked(TENSOR.keys)), KERNEL),
        lambda: nn.sparse_convolution_gradient(TENSOR._replace(keys=masked(TENSOR.keys)), KERNEL, TENSOR),
    ],
    "tensor.values": [lambda: nn.sparse_convolution(TENSOR._replace(values=masked(TENSOR.values)), KERNEL)],
    "gradient.keys": [lambda: nn.sparse_convolution_gradient(TENSOR, KERNEL, TENSOR._replace(keys=masked(TENSOR.keys)))],
    "gradient.values": [lambda: nn.sparse_convolution_gradient(TENSOR, KERNEL, TENSOR._replace(values=masked(TENSOR.values)))],
    "features": [lambda: nn.submanifold_convolution([[0]], masked([[1.0]], 0, 0), np.ones((3, 1, 1)))],
    "strengths": [lambda: scansion.contours.baseline(XYZ, COLUMN)],
    "line 1": [lambda: scansion.contours.labels(XYZ, [XYZ[:2], ROWS], voxel=1.0)],
    "contours": [lambda: scansion.render(XYZ, contours=[ROWS])],
    "polygon": [lambda: filters.inside_polygon(XYZ, masked([[0.0, 0], [1, 0], [0, 1]], 0, 0))],
    "vertices": [lambda: nn.sample_surface(ROWS, [[0, 1, 2]], 5)],
}


@pytest.mark.parametrize(("name", "call"), [(name, call) for name, calls in MASKED.items() for call in calls])
def test_masked_values_are_refused_not_used(name, call):
    with pytest.raises(ValueError, match=rf"^{name}: found 1 masked values, expected none: \.filled\(value\)"):
        call()


@pytest.mark.parametrize("rows", [[[0, 1, 2], [np.ma.masked, 0, 0]], [[0, 1, 2], list(np.ma.array([5, 6, 7], mask=[0, 1, 0]))]])
def test_masked_values_in_lists_of_lists_are_refused(rows):
    with pytest.warns(UserWarning, match="masked element"), pytest.raises(ValueError, match="coordinates: found 1 masked values"):
        scansion.PointCloud(rows)
    assert np.isnan(scansion.PointCloud([[0, 1, 2], [np.nan, 0, 0]]).x[1])
