"""Supervoxels, regions, objects and the ground: against numpy, by definition, and through the public functions."""

import numpy as np
import pytest
import scansion
from scansion import evaluation, features, graph, neighbours, segmentation, terrain

METHODS = [
    "cut-pursuit",
    "merge",
    "felzenszwalb",
    "riemannian",
    "local-graph",
    "slic",
    "vccs",
    "region-growing",
    "octree-region-growing",
    "clusters",
]


@pytest.fixture(scope="module")
def village():
    """A field with two flat roofs and a hedge: coordinates and classes 2, 6, 5."""
    random = np.random.default_rng(0)
    grid = np.arange(0.0, 40.0, 0.5)
    xyz = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    code = np.full(len(xyz), 2)
    for x, y in [(5, 5), (22, 22)]:
        roof = (xyz[:, 0] >= x) & (xyz[:, 0] < x + 10) & (xyz[:, 1] >= y) & (xyz[:, 1] < y + 10)
        xyz[roof, 2], code[roof] = 6.0, 6
    hedge = (np.abs(xyz[:, 0] - 30) < 3) & (xyz[:, 1] < 15)
    xyz[hedge, 2], code[hedge] = random.uniform(0.3, 3.0, hedge.sum()), 5
    return xyz, code


def test_normals_and_variation_are_those_of_numpy(village):
    xyz = np.random.default_rng(1).uniform(0, 5, (300, 3)) * [1, 1, 0.2]
    found, variation = features.normals(xyz, k=12)
    near, _ = neighbours.knn(xyz, 12)
    for i in range(len(xyz)):
        values, vectors = np.linalg.eigh(np.cov(xyz[[i, *near[i]]].T, bias=True))
        assert variation[i] == pytest.approx(values[0] / values.sum(), abs=1e-4)
        if values[1] - values[0] > 0.05 * values[2]:
            assert abs(found[i] @ vectors[:, 0]) == pytest.approx(1, abs=1e-3)
    assert (found[:, 2] >= 0).all()
    inward, _ = features.normals(village[0], orientation=(20.0, 20.0, -50.0))
    assert (inward[:, 2] <= 0).mean() > 0.95
    with pytest.raises(ValueError, match="2..=32"):
        features.normals(xyz, k=40)


def test_felzenszwalb_follows_its_definition():
    random = np.random.default_rng(2)
    for _ in range(20):
        edges = random.integers(0, 30, (80, 2))
        edges = np.unique(np.sort(edges[edges[:, 0] != edges[:, 1]], 1), axis=0)
        weights = random.uniform(0, 1, len(edges)).astype(np.float32)
        of, internal = np.arange(30), np.zeros(30)
        for e in np.argsort(weights, kind="stable"):
            a, b = of[edges[e]]
            size = np.bincount(of, minlength=30)
            if a != b and weights[e] <= min(internal[a] + 0.4 / size[a], internal[b] + 0.4 / size[b]):
                of[of == b] = a
                internal[a] = weights[e]
        found, count = graph.felzenszwalb(30, edges, weights, k=0.4)
        assert count == len(np.unique(of))
        assert len({(int(a), int(b)) for a, b in zip(found, of, strict=True)}) == count
        alike, _ = graph.felzenszwalb(30, edges, 1 - weights, k=0.4, meaning="similarity")
        assert len(np.unique(alike)) == pytest.approx(count, abs=1), "1 - w rounds"


@pytest.mark.parametrize("method", ["slic", "vccs"])
def test_supervoxels_are_small_and_numbered(village, method):
    xyz, _ = village
    labels = segmentation.supervoxels(xyz, method=method, size=3.0, voxel=1.0 if method == "vccs" else None)
    assert labels.dtype == np.int64 and labels.min() >= -1
    for label in range(labels.max() + 1):
        members = xyz[labels == label]
        assert 0 < len(members) and np.ptp(members, axis=0).max() < 12


def test_supervoxels_of_voxels_do_not_cross_a_gap():
    grid = np.arange(0.0, 6.0, 0.25)
    plane = np.stack(np.meshgrid(grid, grid, [0.0]), -1).reshape(-1, 3)
    labels = segmentation.supervoxels(np.concatenate([plane, plane + [0, 0, 1.5]]), method="vccs", size=3.0, voxel=0.5)
    assert not set(labels[: len(plane)]) & set(labels[len(plane) :]) - {-1}


@pytest.mark.parametrize("method", METHODS)
def test_every_method_parts_a_cloud_the_same_for_any_threads(village, method):
    xyz, code = village
    cloud = scansion.PointCloud(xyz, Classification=code.astype(np.uint8))
    found = scansion.segment(cloud, method=method, n_jobs=1)
    assert found.cluster_id.min() >= 1 and found.cluster_id.max() == found.report["segments"]
    assert found.report["method"] == method and found.report["oracle_accuracy"] > 0.8
    assert np.array_equal(scansion.segment(cloud, method=method, n_jobs=2).cluster_id, found.cluster_id)


def test_aims_and_sizes_belong_to_methods(village):
    xyz, _ = village
    small = scansion.segment(xyz, method="slic", size=1.5).report["segments"]
    assert scansion.segment(xyz, method="slic", size=4.0).report["segments"] < small
    by_key = scansion.segment(xyz, method="slic", recipe={"objects.slic.size": 4.0}).report["segments"]
    assert by_key < small
    with pytest.raises(ValueError, match="region-growing"):
        scansion.segment(xyz, method="region-growing", strength=0.1)
    with pytest.raises(ValueError, match="size"):
        scansion.segment(xyz, size=2.0)
    with pytest.raises(ValueError, match="bricks"):
        scansion.segment(xyz, method="bricks")
    levels = scansion.segment(xyz, method="riemannian", levels=[3, 4])
    assert len(levels.levels) == 2 and [level["min_depth"] for level in levels.report["levels"]] == [3, 4]


def test_regions_are_the_planes(village):
    xyz, code = village
    labels = segmentation.region_growing(xyz, min_size=100)
    roofs = [labels[(code == 6) & (xyz[:, 0] < 20)], labels[(code == 6) & (xyz[:, 0] > 20)]]
    commonest = [np.bincount(roof).argmax() for roof in roofs]
    assert commonest[0] != commonest[1] and min(commonest) > 0
    assert (segmentation.octree_region_growing(xyz, size=4.0) > 0).mean() > 0.8
    found = segmentation.riemannian(xyz, min_depth=4)
    assert len(found.labels) == len(xyz) and found.report["supervoxels"] == found.supervoxels.max() + 1


def test_object_features_are_those_of_numpy(village):
    xyz, code = village
    random = np.random.default_rng(3)
    colours, heights = random.uniform(0, 1, (len(xyz), 3)), random.uniform(0, 9, len(xyz))
    rows, names = segmentation.object_features(xyz, code, colours=colours, heights=heights)
    assert len(names) == 20 and rows.shape == (len(np.unique(code)), 20)
    order = [code[i] for i in sorted(np.unique(code, return_index=True)[1])]
    for row, c in zip(rows, order, strict=True):
        value = dict(zip(names, row, strict=True))
        mine = xyz[code == c]
        assert value["VarianceZ"] == pytest.approx(np.var(mine[:, 2]), rel=1e-3, abs=1e-6)
        assert value["MeanHeight"] == pytest.approx(heights[code == c].mean(), rel=1e-4)
        assert value["RedRatio"] + value["GreenRatio"] + value["BlueRatio"] == pytest.approx(1, abs=1e-5)
        e = np.sort(np.linalg.eigvalsh(np.cov(mine.T, bias=True)))[::-1]
        assert value["Linearity"] == pytest.approx((e[0] - e[1]) / e[0], abs=1e-3)


def test_the_ground_and_heights_above_it(village):
    xyz, code = village
    slope = xyz + np.stack([0 * xyz[:, 0], 0 * xyz[:, 0], 0.1 * xyz[:, 0]], -1)
    ground = terrain.ground_points(slope)
    assert (ground[code != 5] == (code == 2)[code != 5]).all()
    published = {"slope": 0.15, "window": 18.0, "threshold": 0.5, "scaling": 1.25}
    ground = terrain.ground_points(slope, method="morphological", **published)
    assert (ground[code != 5] == (code == 2)[code != 5]).all()
    above = terrain.heights(slope, code == 2)
    assert np.median(above[code == 6]) == pytest.approx(6.0, abs=0.2)
    with pytest.raises(ValueError, match="shape"):
        terrain.heights(xyz, [True])


def test_the_ground_of_the_isprs_samples_has_the_errors_of_the_docs(data):
    errors = {}
    for path in sorted((data / "ground").glob("*samp*.npz")):
        sample = np.load(path)
        truth = sample["classification"] == 2
        errors[path.stem[-2:]] = 100 * (terrain.ground_points(sample["xyz"]) != truth).mean()
    assert len(errors) == 8
    assert np.mean(list(errors.values())) < 4.0
    assert max(errors.values()) == errors["11"] < 9.0


def test_segmentation_error_is_nought_for_the_truth_and_one_without_edges(village):
    xyz, code = village
    assert evaluation.segmentation_error(xyz, code, code, cell=0.5)["error"] == 0
    assert evaluation.segmentation_error(xyz, np.zeros(len(xyz)), code, cell=0.5)["error"] == 1


def test_objects_are_learned_and_named(village, tmp_path):
    xyz, code = village
    recipe = {"segments.slic.size": 2.0, "training.share": 1.0}
    classifier = scansion.ObjectClassifier(recipe, random_state=0).fit(xyz, code)
    assert (classifier.predict(xyz) == code).mean() > 0.93
    assert classifier.report_["by_point"] is None and "MeanHeight" in list(classifier.feature_names_in_)
    classifier.save(tmp_path / "objects.model")
    again = scansion.ObjectClassifier.load(tmp_path / "objects.model")
    assert np.array_equal(again.predict(xyz), classifier.predict(xyz))
    part = scansion.ObjectClassifier({**recipe, "training.share": 0.5, "classifier": "gbt"}, random_state=0)
    assert part.fit(xyz, code).report_["by_segment"]["points"] > 0
    with pytest.raises(ValueError, match="Red"):
        scansion.ObjectClassifier({"segments.colour": True}).fit(xyz, code)


def test_colours_of_objects_and_supervoxels_are_shares():
    xyz = np.eye(3)

    def features_of_objects(xyz, **given):
        return segmentation.object_features(xyz, [0, 0, 1], **given)

    for wrong in (np.nan, 1.5, -0.5):
        colours = np.full((3, 3), 0.5)
        colours[1, 2] = wrong
        for call in (segmentation.supervoxels, features_of_objects):
            with pytest.raises(ValueError, match="colours: expected numbers in 0..1, found .* at index 1, 2"):
                call(xyz, colours=colours)


def test_supervoxels_go_on_to_the_functions_of_segments(village):
    """Also if some points are in none: here two points far from all others."""
    xyz, code = village
    xyz, code = np.concatenate([xyz, [[300, 300, 0], [300, 390, 9]]]), np.append(code, [2, 2])
    labels = segmentation.supervoxels(xyz, size=3.0)
    assert (labels == -1).any()
    count = labels.max() + 1
    edges, _ = graph.knn_graph(xyz, k=4)
    assert len(segmentation.segment_shapes(xyz, labels).points) == count
    assert len(segmentation.object_features(xyz, labels)[0]) == count
    assert len(evaluation.purities(labels, code)) == count
    assert segmentation.segment_graph(edges, labels)[0].max() < count
    assert evaluation.boundary_scores(edges, labels, code)["recall"] > 0.5
    assert evaluation.segmentation_error(xyz, labels, code, cell=0.5)["error"] < 0.5
    assert scansion.segment_colours(labels).shape == (len(xyz), 3)


UNUSED = [("cutoff", method) for method in METHODS if method not in ("cut-pursuit", "merge")]
UNUSED += [("k_min", method) for method in METHODS if method not in ("cut-pursuit", "merge", "felzenszwalb")]


@pytest.mark.parametrize(("option", "method"), UNUSED)
def test_options_that_the_method_does_not_use_are_refused(village, option, method, tmp_path):
    xyz = village[0]
    file = tmp_path / "own.toml"
    file.write_text(f"# method = \"merge\"\n method = '{method}'  # Mine.\n[partition]\nmethod = \"merge\"\n")
    choices = [{"method": method}, {"recipe": method}, {"recipe": {"method": method}}, {"recipe": {"recipe": method}}]
    for choice in [*choices, {"recipe": file}, {"recipe": file.read_text()}, {"recipe": "merge", "method": method}]:
        with pytest.raises(ValueError, match=f"method.*{method}.*one of cut-pursuit, merge.*{option}"):
            scansion.segment(xyz, **choice, **{option: 20})


def test_options_that_the_method_uses_have_an_effect(village):
    xyz = village[0][::4] + np.random.default_rng(1).normal(0, 0.1, (1600, 3))
    for option, methods in [("cutoff", ("cut-pursuit", "merge")), ("k_min", ("cut-pursuit", "merge", "felzenszwalb"))]:
        for method in methods:
            plain = scansion.segment(xyz, method=method).cluster_id
            assert not np.array_equal(scansion.segment(xyz, method=method, **{option: 40}).cluster_id, plain)
    for recipe in (None, "merge", "cut-pursuit-paper", "neighbours = 8\n", {"neighbours": 8}, {"recipe": "merge"}):
        assert scansion.segment(xyz, recipe=recipe, cutoff=20, k_min=12).report["segments"] > 0
    with pytest.raises(ValueError, match="bricks"):
        scansion.segment(xyz, method="bricks", cutoff=20)
    assert scansion.suggest(xyz, 2, method="slic", k_min=12).segments != scansion.suggest(xyz, 2, method="slic").segments


def test_seeds_reach_the_clusters(village):
    xyz = village[0] + np.random.default_rng(1).normal(0, 0.1, (6400, 3))
    few = {"clusters.automatic.sample": 50}

    def radius(**given):
        return scansion.segment(xyz, method="clusters", **given).report["clusters"]["automatic"]["radius"]

    assert radius(recipe=few, random_state=7) == radius(recipe={**few, "clusters.seed": 7}) != radius(recipe=few)


@pytest.mark.parametrize(
    "options",
    [
        {"k_min": 20.5},
        {"k_min": np.inf},
        {"k_min": "20"},
        {"random_state": 1.5},
        {"random_state": -1},
        {"levels": [3, 4.7], "method": "riemannian"},
    ],
)
def test_numbers_of_segmentation_are_not_cut(village, options):
    name, calls = next(iter(options)), [scansion.segment] if "levels" in options else [scansion.segment, scansion.suggest]
    for call in calls:
        with pytest.raises(ValueError, match=f"^{name}: found .*, expected a whole number"):
            call(village[0], **options)
    numbers = {"k_min": np.int32(20), "random_state": np.uint8(3)}
    found = scansion.segment(village[0], **numbers)
    assert found.report["segments"] > 0
    floats = {"k_min": np.float64(20), "random_state": 3.0}
    assert np.array_equal(scansion.segment(village[0], **floats).cluster_id, found.cluster_id)
    assert scansion.segment(village[0], k_min=120.0).report == scansion.segment(village[0], k_min=120).report
