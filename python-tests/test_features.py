"""Module `features`: the definitions against numpy, and against jakteristics and pgeof with their conventions."""

import numpy as np
import pytest
import scansion
from scansion import features, neighbours, segmentation

K = 10


def eigen(points, centre):
    difference = points - centre
    values, vectors = np.linalg.eigh(difference.T @ difference / len(points))
    return np.clip(values[::-1], 0, None), vectors[:, ::-1]


def medoid(points):
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    return points[distances.sum(axis=1).argmin()]


def voxel_means(xyz, scale):
    cells = np.floor(xyz / scale).astype(np.int64)
    _, inverse = np.unique(cells, axis=0, return_inverse=True)
    inverse = inverse.ravel()
    count = np.bincount(inverse)
    return np.column_stack([np.bincount(inverse, xyz[:, a]) / count for a in range(3)])


def oracle(xyz, scale):
    """14 of the 16 features of one level, by brute force in float64 (all but the two that need level normals)."""
    level = voxel_means(xyz, scale)
    rows = []
    for p in xyz:
        nearest = level[np.argsort(np.linalg.norm(level - p, axis=1), kind="stable")[: K - 1]]
        members = np.concatenate([nearest, [p]])
        (l1, l2, l3), vectors = eigen(members, medoid(members))
        along = (members - p) @ vectors[:, 1]
        column = level[np.linalg.norm(level[:, :2] - p[:2], axis=1) <= scale][:, 2]
        low, high = min([p[2], *column]), max([p[2], *column])
        rows.append(
            {
                "Sum": l1 + l2 + l3,
                "Omnivariance": (l1 * l2 * l3) ** (1 / 3),
                "Eigenentropy": -sum(v * np.log(v) for v in (l1, l2, l3) if v > 0),
                "Anisotropy": (l1 - l3) / l1,
                "Planarity": (l2 - l3) / l1,
                "Linearity": (l1 - l2) / l1,
                "SurfaceVariation": l3 / (l1 + l2 + l3),
                "Sphericity": l3 / l1,
                "Verticality": 1 - abs(vectors[2, 2]),
                "FirstMoment": along.sum() ** 2 / (along**2).sum(),
                "SecondMoment": (along**2).sum(),
                "VerticalRange": high - low,
                "HeightBelow": p[2] - low,
                "HeightAbove": high - p[2],
            }
        )
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def test_the_definitions_hold_by_brute_force():
    xyz = np.random.default_rng(3).uniform(0, 4, (600, 3))
    table = features.multiscale(xyz, first_scale=0.4, levels=2)
    names = features.names(first_scale=0.4, levels=2)
    for scale, suffix in ((0.4, "r0p4"), (0.8, "r0p8")):
        for name, expected in oracle(xyz, scale).items():
            found = table[:, names.index(f"{name}_{suffix}")]
            near = np.isclose(found, expected, rtol=1e-3, atol=2e-4)
            # A tie of two medoids or neighbours may fall either way in float32.
            assert near.mean() > 0.995, (
                name,
                suffix,
                np.flatnonzero(~near)[:5],
                found[~near][:5],
                expected[~near][:5],
            )


def clusters():
    """Groups of 20 points far apart: the 20 nearest points and those within a radius are the same."""
    random = np.random.default_rng(5)
    centres = np.stack(np.meshgrid(np.arange(4), np.arange(4), np.arange(3)), -1).reshape(-1, 3) * 8.0
    shapes = random.uniform(0.02, 0.5, (len(centres), 1, 3))
    return (centres[:, None] + shapes * random.uniform(-1, 1, (len(centres), 20, 3))).reshape(-1, 3)


def one_level(xyz, preset):
    keywords = {**features.preset(preset), "first_scale": 0.001, "levels": 1, "k": 20}
    table = features.multiscale(xyz, **keywords)
    names = [name.rsplit("_r")[0] for name in features.names(first_scale=0.001, levels=1)]
    return dict(zip(names, table.T, strict=True))


def test_jakteristics_agrees_under_its_own_convention():
    jakteristics = pytest.importorskip("jakteristics")
    xyz = clusters()
    pairs = {
        "eigenvalue_sum": "Sum",
        "omnivariance": "Omnivariance",
        "eigenentropy": "Eigenentropy",
        "anisotropy": "Anisotropy",
        "planarity": "Planarity",
        "linearity": "Linearity",
        "surface_variation": "SurfaceVariation",
        "sphericity": "Sphericity",
        "verticality": "Verticality",
    }
    peer = jakteristics.compute_features(xyz, search_radius=2.5, feature_names=list(pairs))
    ours = one_level(xyz, "jakteristics")
    for i, name in enumerate(pairs.values()):
        np.testing.assert_allclose(ours[name], peer[:, i], rtol=2e-3, atol=2e-4, err_msg=name)


def test_pgeof_agrees_under_its_own_convention():
    pgeof = pytest.importorskip("pgeof")
    xyz = clusters()
    neighbours = np.arange(len(xyz)).reshape(-1, 20).repeat(20, axis=0)
    pointers = np.arange(0, neighbours.size + 1, 20)
    peer = pgeof.compute_features(
        xyz.astype(np.float32),
        neighbours.ravel().astype(np.uint32),
        pointers.astype(np.uint32),
        verbose=False,
    )
    ours = one_level(xyz, "pgeof")
    # pgeof takes roots of eigenvalues in linearity, planarity and scattering and adds 1e-3 below; its entropy and its
    # surface variation follow our formulas.
    roots = np.sqrt(np.column_stack([ours["Linearity"], ours["Planarity"], ours["Sphericity"]]).clip(0))
    first = np.ones(len(xyz))
    second = np.sqrt((ours["Planarity"] + ours["Sphericity"]).clip(0))
    third = roots[:, 2]
    np.testing.assert_allclose(peer[:, 0], first - second, atol=2e-2)
    np.testing.assert_allclose(peer[:, 1], second - third, atol=2e-2)
    np.testing.assert_allclose(peer[:, 2], third, atol=2e-2)


def test_the_same_bytes_for_any_number_of_threads():
    xyz = np.random.default_rng(1).uniform(0, 30, (20_000, 3))
    first = features.multiscale(xyz, first_scale=0.4, levels=4, n_jobs=1).tobytes()
    assert all(
        features.multiscale(xyz, first_scale=0.4, levels=4, n_jobs=n).tobytes() == first
        for n in (2, 3, 8, -1)
    )


def test_a_plane_is_flat_on_every_level():
    plane = np.stack(np.meshgrid(np.arange(30.0), np.arange(30.0), [7.0]), -1).reshape(-1, 3)
    table = features.multiscale(plane, first_scale=1.0, levels=3)
    for name in ("SurfaceVariation_r1", "Verticality_r2", "VerticalRange_r4"):
        assert np.abs(table[:, features.names(first_scale=1.0, levels=3).index(name)]).max() == 0


def test_points_that_are_not_finite_get_rows_of_nan():
    xyz = np.random.default_rng(2).uniform(0, 5, (500, 3))
    xyz[7, 1], xyz[9, 2] = np.nan, np.inf
    table = features.multiscale(xyz, first_scale=0.4, levels=3)
    assert np.flatnonzero(np.isnan(table).all(axis=1)).tolist() == [7, 9]
    assert np.isfinite(np.delete(table, [7, 9], axis=0)).all()


def test_features_of_the_point_itself_need_their_columns():
    cloud = scansion.PointCloud(
        np.random.default_rng(0).uniform(0, 5, (50, 3)), Intensity=np.arange(50, dtype="u2")
    )
    table = features.multiscale(cloud, first_scale=0.4, levels=1, intensity=True)
    assert table.shape == (50, 17) and table[:, 16].max() <= 1
    assert features.names(first_scale=0.4, levels=1, intensity=True)[16] == "RelativeIntensity"
    with pytest.raises(ValueError, match="Red"):
        features.multiscale(cloud, colour=True)


def test_names_are_unique_and_the_definitions_are_whole():
    names = features.names(colour=True, intensity=True, returns=True)
    assert len(set(names)) == len(names) == 144 + 7
    keys = {"name", "group", "formula", "range", "unit", "missing", "reach"}
    definitions = features.definitions()
    assert all(d.keys() == keys and all(d.values()) for d in definitions)
    assert {name.rsplit("_r")[0] for name in names} <= {d["name"] for d in definitions}
    _, segments = segmentation.object_features([[0, 0, 0]], [0], colours=[[0, 0, 0]], heights=[0])
    assert segments == [d["name"] for d in definitions if d["group"].startswith("segment-")]
    assert features.names(first_scale=0.4)[4] == "Planarity_r0p4"


def limits(text):
    """Lowest and highest value of a range of the registry; k is 10, the factor of verticality 1."""
    known = {"any": (-np.inf, np.inf), ">= 0": (0, np.inf), "0, 0.5, 1": (0, 1)}
    ends = {"1": 1, "1/3": 1 / 3, "1000": 1000, "k": 10, "ln 3": np.log(3), "factor": 1}
    return known[text] if text in known else (0, ends[text.removeprefix("0..")])


def test_values_lie_in_the_ranges_of_the_registry():
    random = np.random.default_rng(9)
    ground = np.c_[random.uniform(0, 20, (2000, 2)), np.zeros(2000)]
    tree, pile = random.uniform(4, 9, (800, 3)), np.full((50, 3), 12.0)
    xyz = np.concatenate([ground, tree, pile])
    labels = np.repeat([0, 1, 2], [2000, 800, 50])
    heights = np.where(labels == 2, np.nan, xyz[:, 2])
    colours = random.uniform(0, 1, xyz.shape)
    levels = features.multiscale(xyz, first_scale=0.5, levels=3)
    shapes = neighbours.optimal(xyz, k_max=30)[1]
    segments, names = segmentation.object_features(xyz, labels, colours=colours, heights=heights)
    definitions = features.definitions()
    of_level = [d for d in definitions if d["group"] in ("covariance", "contour", "height")]
    optimal = [d for d in definitions if d["group"] == "optimal"]
    of_segment = [d for d in definitions if d["group"].startswith("segment-")]
    assert names == [d["name"] for d in of_segment]
    columns = [*zip(3 * of_level, levels.T, strict=True), *zip(optimal, shapes.T, strict=True)]
    for d, values in [*columns, *zip(of_segment, segments.T, strict=True)]:
        low, high = limits(d["range"])
        missing = np.isnan(values)
        assert d["missing"] == "NaN" if missing.any() else True, d
        known = values[~missing]
        assert known.min() >= low - 1e-5 and known.max() <= high * (1 + 1e-5), (d, known.min(), known.max())


def test_the_first_scale_comes_from_the_spacing_if_asked():
    xyz = np.random.default_rng(2).uniform(0, 50, (5000, 3)) * [1, 1, 0]
    assert features.multiscale(xyz, first_scale=None, levels=3).shape == (5000, 48)
