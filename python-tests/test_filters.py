"""Noise against scipy, polygons against inequalities, and filtered files as laspy reads them."""

import json

import laspy
import numpy as np
import pytest
import scansion
from scansion import filters, terrain
from scipy.spatial import cKDTree


def noisy(points=5000, seed=0):
    """A rough surface with some points above and below it."""
    random = np.random.default_rng(seed)
    xyz = random.uniform([0, 0, 0], [25, 25, 0.2], (points, 3))
    xyz[::50, 2] = random.uniform(-15, 15, len(xyz[::50]))
    return xyz


def statistical_by_scipy(xyz, neighbours, multiplier):
    distances, _ = cKDTree(xyz).query(xyz, neighbours + 1)
    mean = distances[:, 1:].mean(axis=1)
    return mean, mean.mean() + multiplier * mean.std(ddof=1)


@pytest.mark.parametrize(("neighbours", "multiplier"), [(8, 2.0), (1, 1.0), (30, -0.1)])
def test_statistical_outliers_are_those_of_scipy(neighbours, multiplier):
    xyz = noisy()
    mean, limit = statistical_by_scipy(xyz, neighbours, multiplier)
    found = filters.statistical_outliers(xyz, neighbours, multiplier)
    clear = abs(mean - limit) > 1e-5
    assert clear.mean() > 0.999
    np.testing.assert_array_equal(found[clear], (mean > limit)[clear])
    assert 0 < found.sum() < len(xyz)


@pytest.mark.parametrize(("radius", "min_neighbours"), [(1.0, 2), (0.5, 5), (3.0, 40)])
def test_radius_outliers_are_those_of_scipy(radius, min_neighbours):
    xyz = noisy()
    counts = cKDTree(xyz).query_ball_point(xyz, radius, return_length=True) - 1
    found = filters.radius_outliers(xyz, radius, min_neighbours)
    np.testing.assert_array_equal(found, counts < min_neighbours)
    assert 0 < found.sum() < len(xyz)


def test_outliers_of_a_real_cloud_are_those_of_scipy(data):
    cloud = scansion.read(data / "airborne" / "lidarhd_building.laz")
    xyz = cloud.xyz - cloud.xyz.min(axis=0)
    mean, limit = statistical_by_scipy(xyz, 8, 2.0)
    found = filters.statistical_outliers(cloud)
    clear = abs(mean - limit) > 1e-4
    assert clear.mean() > 0.999
    np.testing.assert_array_equal(found[clear], (mean > limit)[clear])


def test_lengths_are_metres_and_places_without_numbers_are_noise():
    xyz = noisy()
    expected = filters.radius_outliers(xyz)
    np.testing.assert_array_equal(filters.radius_outliers(xyz / 0.3048, metres_per_unit=0.3048), expected)
    odd = np.vstack([xyz, [[np.nan, 0, 0], [1e8, 0, 0]]])
    assert filters.radius_outliers(odd)[-2:].all()
    assert filters.statistical_outliers(odd)[-2:].all()
    for wrong in ({"neighbours": 0}, {"neighbours": 1001}, {"multiplier": np.nan}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            filters.statistical_outliers(xyz, **wrong)
    with pytest.raises(ValueError, match="radius"):
        filters.radius_outliers(xyz, radius=-1.0)
    assert filters.statistical_outliers(np.zeros((0, 3))).shape == (0,)


def test_polygons_come_as_text_files_objects_and_corners(tmp_path):
    xyz = np.random.default_rng(1).uniform([0, 0, 0], [10, 10, 1], (2000, 3))
    x, y = xyz[:, 0], xyz[:, 1]
    ring, hole = [[1, 1], [9, 1], [1, 9], [1, 1]], [[2, 2], [3, 2], [3, 3], [2, 3], [2, 2]]
    triangle = (x > 1) & (y > 1) & (x + y < 10)
    expected = triangle & ~((abs(x - 2.5) < 0.5) & (abs(y - 2.5) < 0.5))
    assert np.array_equal(filters.inside_polygon(xyz, ring), triangle)
    shape = {"type": "Polygon", "coordinates": [ring, hole]}
    collection = {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": shape}]}

    class Shape:
        __geo_interface__ = shape

    (tmp_path / "a.geojson").write_text(json.dumps(collection))
    wkt = "MULTIPOLYGON (((1 1, 9 1, 1 9, 1 1), (2 2, 3 2, 3 3, 2 3, 2 2)))"
    (tmp_path / "a.wkt").write_text(wkt)
    for polygon in (
        shape, collection, Shape(), json.dumps(shape), wkt, tmp_path / "a.geojson", str(tmp_path / "a.wkt"),
    ):  # fmt: skip
        assert np.array_equal(filters.inside_polygon(xyz, polygon), expected), polygon
    with pytest.raises(FileNotFoundError):
        filters.inside_polygon(xyz, tmp_path / "absent.geojson")
    for wrong in ("POLYGON ((0 0, 1 1))", {"type": "Point", "coordinates": [0, 0]}, [[0, 0, 0]] * 3):
        with pytest.raises(ValueError, match="olygon"):
            filters.inside_polygon(xyz, wrong)


def test_points_in_footprints_are_those_of_the_houses():
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0, 20, 0.5), np.arange(0, 20, 0.5)))
    house = (abs(x - 10) <= 4) & (abs(y - 10) <= 3)
    xyz = np.column_stack([x, y, np.where(house, 7.0, 1.0)])
    cloud = scansion.PointCloud(xyz, Classification=np.where(house, 6, 2).astype(np.uint8))
    found = filters.inside_polygon(cloud, terrain.footprints(cloud))
    inner = (abs(x - 10) < 4) & (abs(y - 10) < 3)
    assert found[inner].all() and not found[~house].any()


def write_las(path, xyz):
    header = laspy.LasHeader(version="1.4", point_format=7)
    header.offsets, header.scales = [500_000, 5_000_000, 0], [0.001] * 3
    header.add_extra_dim(laspy.ExtraBytesParams(name="Own", type=np.float64))
    las = laspy.LasData(header)
    las.x, las.y, las.z = (xyz + [500_000, 5_000_000, 0]).T
    las.gps_time = np.arange(len(xyz)) * 1e-3
    las.classification = np.where(xyz[:, 2] > 1, 5, 2)
    las.return_number = 1 + np.arange(len(xyz)) % 2
    las.number_of_returns = np.full(len(xyz), 2)
    las.Own = np.sqrt(np.arange(len(xyz)))
    las.red = np.arange(len(xyz)) % 65_536
    las.vlrs.append(laspy.VLR("somebody", 7, "notes", b"kept as they are"))
    las.write(path)


def test_a_filtered_file_has_every_field_of_its_points(tmp_path):
    xyz = noisy()
    write_las(tmp_path / "a.laz", xyz)
    noise = filters.statistical_outliers(tmp_path / "a.laz")
    report = filters.filter_file(tmp_path / "a.laz", tmp_path / "b.laz", statistical=True)
    assert (report["points"], report["kept"]) == (len(xyz), int((~noise).sum()))
    assert report["steps"] == [{"filter": "statistical outliers", "removed": int(noise.sum()), "marked": 0}]
    whole, part = laspy.read(tmp_path / "a.laz"), laspy.read(tmp_path / "b.laz")
    assert np.array_equal(part.points.array, whole.points.array[~noise])
    assert [vlr.record_data for vlr in part.vlrs if vlr.user_id == "somebody"] == [b"kept as they are"]
    counts = [(part.return_number == r).sum() for r in (1, 2)]
    assert list(part.header.number_of_points_by_return[:2]) == counts
    assert np.allclose(part.header.maxs, np.asarray(part.xyz).max(axis=0))
    scansion.rewrite(tmp_path / "a.laz", tmp_path / "c.laz", keep=~noise)
    assert (tmp_path / "c.laz").read_bytes() == (tmp_path / "b.laz").read_bytes()
    filters.filter_file(tmp_path / "a.laz", tmp_path / "m.laz", statistical={"neighbours": 8}, mark=True)
    marked = laspy.read(tmp_path / "m.laz")
    assert np.array_equal(np.asarray(marked.classification) == 7, noise)
    for name in whole.point_format.dimension_names:
        if name != "classification":
            assert np.array_equal(marked[name], whole[name]), name


def test_filters_of_files_are_those_of_masks(tmp_path):
    xyz = noisy()
    write_las(tmp_path / "a.las", xyz)
    cloud = scansion.read(tmp_path / "a.las")
    heights = terrain.height_above_ground(cloud)
    square = np.array([[500_005, 5_000_005], [500_020, 5_000_020]])
    corners = [square[0], [square[1][0], square[0][1]], square[1], [square[0][0], square[1][1]]]
    runs = [
        ({"classes": [5]}, cloud["Classification"] == 5),
        ({"drop_classes": [5]}, cloud["Classification"] != 5),
        ({"radius": {"radius": 0.5, "min_neighbours": 3}}, ~filters.radius_outliers(cloud, 0.5, 3)),
        ({"height": (2, None)}, heights >= 2),
        ({"height": (-0.5, 0.5)}, abs(heights) <= 0.5),
        ({"bounds": square}, ((cloud.xyz[:, :2] >= square[0]) & (cloud.xyz[:, :2] <= square[1])).all(axis=1)),
        ({"polygon": corners, "outside": True}, ~filters.inside_polygon(cloud, corners)),
    ]
    for arguments, keep in runs:
        report = filters.filter_file(tmp_path / "a.las", tmp_path / "b.las", **arguments)
        assert 0 < report["kept"] == keep.sum(), arguments
        found = scansion.read(tmp_path / "b.las")
        assert np.array_equal(found["Own"], cloud.select(keep)["Own"]), arguments
    with pytest.raises(ValueError, match="mark"):
        filters.filter_file(tmp_path / "a.las", tmp_path / "b.las", classes=[2], mark=True)
    with pytest.warns(UserWarning, match="no point is left"):
        filters.filter_file(tmp_path / "a.las", tmp_path / "b.las", bounds=[[0, 0], [1, 1]])


def test_points_are_selected_with_their_exact_coordinates(tmp_path):
    write_las(tmp_path / "a.las", noisy(200))
    cloud = scansion.read(tmp_path / "a.las")
    part = cloud.select(np.arange(200) % 3 == 1)
    scansion.write(tmp_path / "b.las", part)
    assert np.array_equal(laspy.read(tmp_path / "b.las").X, laspy.read(tmp_path / "a.las").X[1::3])
    assert len(cloud.select([])) == 0
    for wrong, error in (([200], IndexError), ([-1], IndexError), ([0.5], IndexError), ([True], ValueError)):
        with pytest.raises(error, match="points"):
            cloud.select(wrong)
    with pytest.raises(ValueError, match="marks"):
        scansion.rewrite(tmp_path / "a.las", tmp_path / "b.las", keep=[True])


def test_only_the_open_ends_of_a_range_of_heights_are_infinite(tmp_path):
    write_las(tmp_path / "a.las", noisy())
    for open_end, none in [((2, np.inf), (2, None)), ((-np.inf, 0.5), (None, 0.5))]:
        found = [filters.filter_file(tmp_path / "a.las", tmp_path / "b.las", height=h) for h in (open_end, none)]
        assert found[0] == found[1]
    for wrong in ((np.nan, 5), (2, np.nan), (np.inf, 5), (2, -np.inf)):
        with pytest.raises(ValueError, match="height: found"):
            filters.filter_file(tmp_path / "a.las", tmp_path / "b.las", height=wrong)


def test_numbers_do_not_switch_filters_of_outliers_on(tmp_path):
    write_las(tmp_path / "a.las", noisy())
    for wrong in ({"radius": 0.1}, {"statistical": 3}, {"statistical": "yes"}):
        with pytest.raises(TypeError, match="expected True, False or a dict"):
            filters.filter_file(tmp_path / "a.las", tmp_path / "b.las", **wrong)
    for off in (False, np.False_, None):
        assert filters.filter_file(tmp_path / "a.las", tmp_path / "b.las", radius=off)["steps"] == []


def test_the_ground_is_found_anew_if_an_option_says_how(tmp_path):
    xyz = noisy()
    cloud = scansion.PointCloud(xyz, HeightAboveGround=np.full(len(xyz), 50.0), Classification=np.full(len(xyz), 1, np.uint8))
    scansion.write(tmp_path / "a.las", cloud)

    def kept(**options):
        return filters.filter_file(tmp_path / "a.las", tmp_path / "b.las", height=(0, 5), **options)["kept"]

    with pytest.warns(UserWarning, match="no point is left"):
        assert kept() == 0
    anew = [{"ground": "filter"}, {"cell": 1}, {"cell": 1.0}, {"cell": 0.5}, {"noise": [7]}, {"slope": 0.2}, {"window": 20.0}]
    for options in [*anew, {"wall": 2.0}]:
        assert kept(**options) > len(xyz) / 4, options
        with pytest.raises(ValueError, match="ground, cell, noise, slope, window and wall need height"):
            filters.filter_file(tmp_path / "a.las", tmp_path / "b.las", **options)
    assert kept(cell=1) == kept(ground="filter")
