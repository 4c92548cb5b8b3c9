"""Features within a radius against jakteristics, clusters at four levels against their definitions."""

import numpy as np
import pytest
import scansion
from conftest import street
from scansion import features, segmentation


def scene(points=6000):
    """A street near the origin, so that float32 metres keep the distances of float64."""
    return street(points=points)[0] - [500_000, 5_000_000, 0]


@pytest.mark.parametrize("radius", [0.6, 1.0, 2.5])
def test_features_within_a_radius_are_those_of_jakteristics(radius):
    jakteristics = pytest.importorskip("jakteristics")
    xyz = scene()
    names = features.radius_names()
    ours = features.radius(xyz, radius)
    peer = jakteristics.compute_features(xyz, search_radius=radius, feature_names=names)
    assert names == list(jakteristics.FEATURE_NAMES)
    of = dict(zip(names, ours.T, strict=True))
    theirs = dict(zip(names, peer.T, strict=True))
    # A point at the very rim may be counted differently in float32.
    same = of["number_of_neighbors"] == theirs["number_of_neighbors"]
    assert same.mean() > 0.999
    # Eigenvectors need three points, and eigenvalues that differ.
    gap = np.minimum(theirs["linearity"], theirs["planarity"])
    clear = same & (theirs["number_of_neighbors"] > 3) & (gap > 0.02)
    assert clear.mean() > 0.5
    solid = same & (theirs["number_of_neighbors"] > 3)
    scalars = names[:11]
    for name in scalars + ["eigenvalue1", "eigenvalue2", "eigenvalue3"]:
        rows = clear if name == "verticality" else solid
        np.testing.assert_allclose(of[name][rows], theirs[name][rows], rtol=2e-4, atol=2e-6, err_msg=name)
    for axis in "xyz":
        np.testing.assert_allclose(np.abs(of[f"n{axis}"][clear]), np.abs(theirs[f"n{axis}"][clear]), atol=2e-3)
        assert (of[f"eigenvector3{axis}"] == of[f"n{axis}"]).all()
    for i in (1, 2, 3):
        cosine = sum(of[f"eigenvector{i}{axis}"] * theirs[f"eigenvector{i}{axis}"] for axis in "xyz")
        assert np.abs(cosine[clear]).min() > 0.999


def test_cylinders_radii_and_divisors_are_those_of_numpy():
    xyz = scene(800)
    found = features.radius(xyz, [0.8, 2.0], ["number_of_neighbors", "eigenvalue_sum"], shape="cylinder", divisor="n")
    apart = np.hypot(*(xyz[:, None, :2] - xyz[None, :, :2]).transpose(2, 0, 1))
    for r, radius in enumerate([0.8, 2.0]):
        near = apart <= radius
        assert (found[:, 2 * r] == near.sum(1)).mean() > 0.999
        for i in range(0, len(xyz), 40):
            expected = xyz[near[i]].var(0).sum()
            assert abs(found[i, 2 * r + 1] - expected) <= 1e-4 * max(expected, 1e-3)


def test_radii_and_names_that_are_wrong_are_refused():
    xyz = scene(400)
    for radii in (0.0, -1.0, [], [1.0, np.nan]):
        with pytest.raises(ValueError, match="radii"):
            features.radius(xyz, radii)
    assert features.radius(xyz, 1.0, []).shape == (len(xyz), 0) and features.radius(xyz[:0], 1.0, []).shape == (0, 0)
    with pytest.raises(ValueError, match="surface_variation"):
        features.radius(xyz, 1.0, ["roughness"])
    with pytest.raises(ValueError, match="NaN"):
        features.radius(np.vstack([xyz, [np.nan] * 3]), 1.0)


def test_parameters_scale_with_the_cloud():
    one = segmentation.automatic_parameters(scene())
    ten = segmentation.automatic_parameters(10 * scene())
    assert ten.radius == pytest.approx(10 * one.radius, rel=1e-4)
    assert ten.offset == pytest.approx(10 * one.offset, rel=1e-2)
    assert ten.min_size == one.min_size
    assert ten.angle_deg == pytest.approx(one.angle_deg, abs=0.1)
    assert [reason.split()[0] for reason in one.reasons] == ["radius", "least", "angle", "offset"]


def test_levels_are_nested_and_their_features_are_their_ranks():
    xyz = scene()
    found = segmentation.cluster_levels(xyz)
    assert found.labels.shape == (4, len(xyz)) and found.labels.dtype == np.uint32
    for fine, coarse in [(0, 1), (1, 2), (0, 3)]:
        pairs = np.unique(found.labels[[fine, coarse]], axis=1)
        assert len(np.unique(pairs[0])) == pairs.shape[1]
    sizes = np.bincount(found.labels[0])[1:]
    assert (np.diff(sizes) <= 0).all() and sizes.min() >= found.automatic.min_size
    assert found.labels.max(1).tolist() == found.counts
    maker = scansion.ClusterFeatures(set="a")
    table = maker.fit_transform(xyz)
    for level in range(3):
        expected = found.labels[level] / np.float64(found.counts[level])
        np.testing.assert_allclose(table[:, level], expected, rtol=1e-6)
    np.testing.assert_array_equal(table[:, 3], found.centrality)
    assert maker.automatic_ == found.automatic and maker.counts_ == found.counts


def test_the_sets_have_the_sizes_of_the_paper():
    xyz = scene(3000)
    colour = {name: np.arange(len(xyz)).astype(np.uint16) for name in ("Red", "Green", "Blue")}
    cloud = scansion.PointCloud(xyz, **colour)
    for name, width in {"a": 4, "b": 73, "c": 17}.items():
        for with_colour in (False, True):
            maker = scansion.ClusterFeatures(set=name, colour=with_colour)
            table = maker.fit_transform(cloud)
            assert table.shape == (len(xyz), width + 3 * with_colour)
            assert len(set(maker.feature_names_out_)) == table.shape[1] and np.isfinite(table).all()
    assert scansion.ClusterFeatures(set="a", form="descriptor").fit_transform(xyz).shape == (len(xyz), 8)


def test_sets_forms_and_settings_that_are_wrong_are_refused():
    xyz = scene(400)
    with pytest.raises(ValueError, match="'d'"):
        scansion.ClusterFeatures(set="d").fit_transform(xyz)
    with pytest.raises(ValueError, match="growth"):
        scansion.ClusterFeatures(settings={"growth": 1.0}).fit_transform(xyz)
    with pytest.raises(ValueError, match="grwth"):
        scansion.ClusterFeatures(settings={"grwth": 1.5}).fit_transform(xyz)
    with pytest.raises(ValueError, match="Red"):
        scansion.ClusterFeatures(colour=True).fit_transform(xyz)


def test_cluster_features_have_the_parameters_of_an_estimator():
    base = pytest.importorskip("sklearn.base")
    from sklearn.exceptions import NotFittedError
    from sklearn.utils import get_tags

    maker = scansion.ClusterFeatures(set="a", settings={"seed": 3})
    assert maker.get_params() == {
        "set": "a",
        "form": "rank",
        "colour": False,
        "settings": {"seed": 3},
        "metres_per_unit": None,
        "n_jobs": None,
    }
    with pytest.raises(NotFittedError, match="Call 'fit_transform'"):
        maker.get_feature_names_out()
    xyz = scene(400)
    table = maker.fit_transform(xyz)
    again = base.clone(maker)
    assert again.get_params() == maker.get_params() and not hasattr(again, "feature_names_out_")
    names = maker.get_feature_names_out()
    assert names.dtype == object and names.tolist() == maker.feature_names_out_ and len(names) == table.shape[1]
    assert again.set_params(form="descriptor").fit_transform(xyz).shape[1] == len(again.get_feature_names_out()) == 8
    with pytest.raises(ValueError, match="Invalid parameter 'radius'.*Valid parameters are.*'settings'"):
        maker.set_params(radius=3)
    assert repr(maker) == "ClusterFeatures(set='a', settings={'seed': 3})"
    assert get_tags(maker).transformer_tags is not None and not base.is_classifier(maker)
