"""Terrain products: known scenes, and files as other software reads them."""

import inspect
import json
import pickle
import sqlite3
import struct

import contourpy
import ezdxf
import numpy as np
import pyogrio
import pytest
import scansion
from scansion import terrain


def village(crs=None, unit=1.0):
    """A tilted field of 40 m x 30 m with a box of 12 m x 8 m in class 6, its roof 5 m above the ground below it."""
    random = np.random.default_rng(4)
    x, y = random.uniform(0, 40, 12_000), random.uniform(0, 30, 12_000)
    house = (abs(x - 20) < 6) & (abs(y - 15) < 4)
    z = 100 + 0.1 * x - 0.2 * y
    xyz = np.column_stack([x + 500_000, y + 5_000_000, z + 5 * house]) / unit
    return scansion.PointCloud(xyz, crs=crs, Classification=np.where(house, 6, 2).astype(np.uint8))


def centres(raster):
    rows, columns = np.indices(raster.values.shape) + 0.5
    a, _, west, _, e, north = raster.transform
    return west + a * columns, north + e * rows


def test_a_tilted_plane_is_exact_below_a_house_too():
    dtm = terrain.dtm(village(), cell=0.5)
    x, y = centres(dtm)
    expected = 100 + 0.1 * (x - 500_000) - 0.2 * (y - 5_000_000)
    assert dtm.values.shape == (60, 80)
    assert "class 2" in dtm.ground
    np.testing.assert_allclose(dtm.values[1:-1, 1:-1], expected[1:-1, 1:-1], atol=1e-3)
    np.testing.assert_allclose(dtm.values, expected, atol=0.1)
    inside = (abs(x - 500_020) < 5) & (abs(y - 5_000_015) < 3)
    chm = terrain.chm(village(), cell=0.5)
    assert np.nanmax(abs(chm.values[inside] - 5)) < 0.1
    dsm = terrain.dsm(village(), cell=0.5)
    assert np.array_equal(np.isnan(dsm.values), np.isnan(chm.values))


def test_ground_is_chosen_by_classes_marks_or_the_filter():
    cloud = village()
    marks = cloud["Classification"] == 2
    expected = np.asarray(terrain.dtm(cloud))
    assert np.array_equal(terrain.dtm(cloud, ground=[2]), expected)
    assert np.array_equal(terrain.dtm(cloud, ground=marks), expected)
    assert np.array_equal(terrain.dtm(cloud.xyz, ground=marks), expected)
    found = terrain.dtm(cloud, ground="filter")
    assert "ground filter" in found.ground
    assert np.abs(found - expected).max() < 0.5
    for wrong in ("by eye", [300], marks[1:], [9]):
        with pytest.raises(ValueError, match="ground"):
            terrain.dtm(cloud, ground=wrong)


def test_heights_above_ground_are_in_the_unit_of_the_cloud():
    for unit in (1.0, 0.3048):
        cloud = village(unit=unit)
        heights = terrain.height_above_ground(cloud, metres_per_unit=unit)
        house = cloud["Classification"] == 6
        assert heights.dtype == np.float32
        np.testing.assert_allclose(heights[house] * unit, 5, atol=0.02)
        assert abs(heights[~house] * unit).max() < 0.15


@pytest.mark.parametrize(("crs", "unit"), [("EPSG:25832", 1.0), ("EPSG:2229", 1200 / 3937)])
def test_geotiff_is_read_by_gdal_with_its_place_on_earth(tmp_path, crs, unit):
    rasterio = pytest.importorskip("rasterio")
    chm = terrain.chm(village(crs, unit))
    terrain.write_raster(tmp_path / "chm.tif", chm)
    with rasterio.open(tmp_path / "chm.tif") as read:
        assert read.crs.to_epsg() == int(crs[5:])
        np.testing.assert_allclose(read.transform[:6], chm.transform, rtol=1e-12)
        assert (read.nodata, read.dtypes, read.shape) == (-9999.0, ("float32",), chm.values.shape)
        assert read.units == ("metre" if unit == 1 else "US survey foot",)
        values = read.read(1, masked=True).filled(np.nan)
    assert np.array_equal(values, chm.values.astype(np.float32), equal_nan=True)
    assert abs(np.nanmax(values) * unit - 5) < 0.2
    tifffile = pytest.importorskip("tifffile")
    with tifffile.TiffFile(tmp_path / "chm.tif") as read:
        assert read.pages[0].geotiff_tags["ProjectedCSTypeGeoKey"] == int(crs[5:])


def test_a_system_with_heights_and_one_without_a_code_reach_gdal(tmp_path):
    rasterio = pytest.importorskip("rasterio")
    from rasterio.crs import CRS

    values = np.array([[1.5, np.nan], [2.5, -3.25]])
    terrain.write_raster(
        tmp_path / "a.tif", terrain.Raster(values, (85_000.0, 447_000.0), 0.5, "EPSG:7415", 1.0)
    )
    with rasterio.open(tmp_path / "a.tif") as read:
        assert "28992" in read.crs.to_wkt()
    local = "+proj=tmerc +lat_0=1 +lon_0=2 +k=0.9 +x_0=3 +y_0=4 +ellps=GRS80 +units=m"
    own = CRS.from_proj4(local).to_wkt(version="WKT1_GDAL")
    terrain.write_raster(tmp_path / "b.tif", terrain.Raster(values, (0.0, 2.0), 1.0, own, 1.0))
    with rasterio.open(tmp_path / "b.tif") as read:
        found = read.crs.to_dict()
        assert (found["proj"], found["lon_0"], found["k"]) == ("tmerc", 2, 0.9)
    terrain.write_raster(tmp_path / "c.tif", terrain.Raster(values, (0.0, 2.0), 1.0))
    with rasterio.open(tmp_path / "c.tif") as read:
        assert read.crs is None
    terrain.write_raster(tmp_path / "c.asc", terrain.Raster(values, (0.0, 2.0), 1.0))
    with rasterio.open(tmp_path / "c.asc") as read:
        assert np.array_equal(read.read(1, masked=True).filled(np.nan), values, equal_nan=True)
        assert read.transform[:6] == (1.0, 0.0, 0.0, 0.0, -1.0, 2.0)


def test_geotiff_tells_the_system_of_heights_degrees_and_a_unit_alone(tmp_path):
    rasterio = pytest.importorskip("rasterio")
    tifffile = pytest.importorskip("tifffile")

    def keys(*place):
        path = tmp_path / "a.tif"
        path.unlink(missing_ok=True)
        terrain.write_raster(path, terrain.Raster(np.ones((2, 2)), (7.0, 48.0), 0.5, *place))
        with tifffile.TiffFile(path) as read:
            found = read.pages[0].geotiff_tags
        with rasterio.open(path) as read:
            return found, read.crs, read.units

    found, system, units = keys("EPSG:26910+6360", 1.0)
    assert (found["ProjectedCSTypeGeoKey"], found["VerticalCSTypeGeoKey"]) == (26910, 6360)
    assert (found["ProjLinearUnitsGeoKey"], found["VerticalUnitsGeoKey"]) == (9001, 9003)
    assert units == ("US survey foot",) and "26910" in system.to_wkt()
    found, system, _ = keys("EPSG:4326")
    assert (found["GTModelTypeGeoKey"], found["GeographicTypeGeoKey"]) == (2, 4326)
    assert system.is_geographic and system.to_epsg() == 4326
    found, system, _ = keys("EPSG:4807")
    assert (found["GeographicTypeGeoKey"], found["GeogAngularUnitsGeoKey"]) == (4807, 9105)
    assert system.is_geographic and system.to_epsg() == 4807
    found, _, units = keys(None, 0.3048)
    assert found["ProjLinearUnitsGeoKey"] == 9002 and units == ("foot",)


@pytest.mark.parametrize("height", [-9999.0, 1e39])
def test_heights_that_a_raster_file_cannot_hold_are_refused(tmp_path, height):
    for name in ("a.tif", "a.asc"):
        with pytest.raises(ValueError, match="row 1 from the north, column 0"):
            terrain.write_raster(tmp_path / name, terrain.Raster(np.array([[1.0], [height]]), (0.0, 2.0), 1.0))
        assert not (tmp_path / name).exists()


def test_withheld_points_are_left_out():
    cloud = village()
    marks = np.zeros(len(cloud), "u1")
    marks[cloud["Classification"] == 6] = 1
    cloud["Withheld"] = marks
    count = int(marks.sum())
    dtm, dsm = terrain.dtm(cloud), terrain.dsm(cloud)
    assert dtm.ground.endswith(f"; {count} withheld points are left out")
    assert dsm.ground == f"{count} withheld points are left out"
    # The house is withheld: nothing stands above the ground.
    assert np.nanmax(terrain.chm(cloud).values) < 1
    assert terrain.footprints(cloud)["features"] == []


def test_a_house_has_its_outline(tmp_path):
    found = terrain.footprints(village("EPSG:25832"))
    json.dumps(found)
    (house,) = found["features"]
    ring = np.array(house["geometry"]["coordinates"][0])
    assert np.array_equal(ring[0], ring[-1])
    assert np.abs(np.ptp(ring, axis=0) - [12, 8]).max() < 0.5
    assert 96 - 40 * 0.32 < house["properties"]["area"] <= 96
    assert abs(house["properties"]["height_median"] - 5) < 0.02
    assert found["crs"]["properties"]["name"].endswith("EPSG::25832")
    assert terrain.footprints(village(), min_area=200)["features"] == []
    with pytest.raises(ValueError, match="class 17"):
        terrain.footprints(village(), classes=[17])
    with pytest.raises(ValueError, match="classes of the buildings"):
        terrain.footprints(village(), ground=np.ones(12_000, dtype=bool))


def test_height_contours_are_those_of_contourpy(tmp_path):
    rows, columns = np.indices((60, 80))
    values = 3 * np.sin(0.31 * columns) + 2 * np.cos(0.43 * rows + 0.1 * columns) + 0.02 * columns
    values[20:25, 30:34] = np.nan
    dtm = terrain.Raster(values, (500_000.0, 5_000_030.0), 0.5, crs="EPSG:25832", metres_per_unit=1.0)
    found = terrain.contours(dtm, interval=0.25, base=0.1, min_length=0.0)
    x, y = centres(dtm)
    peer = contourpy.contour_generator(x[0], y[:, 0], np.ma.masked_invalid(values), corner_mask=False)

    def length(lines):
        return sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines)

    levels = np.unique(found.heights)
    steps = (levels - 0.1) / 0.25
    assert len(levels) > 40 and np.allclose(steps, np.round(steps))
    for level in levels:
        own = [line for line, height in zip(found.lines, found.heights) if height == level]
        theirs = peer.lines(level)
        assert len(own) == len(theirs)
        assert length(own) == pytest.approx(length(theirs), abs=1e-6)
    assert length(found.lines) == pytest.approx(found.length.sum())
    assert all(np.array_equal(line[0], line[-1]) == closed for line, closed in zip(found.lines, found.closed))
    for name in ("h.gpkg", "h.geojson"):
        found.write(tmp_path / name)
        meta, _, geometry, fields = pyogrio.raw.read(tmp_path / name)
        assert "25832" in meta["crs"] and len(geometry) == len(found)
        elevation = fields[list(meta["fields"]).index("elevation")]
        assert np.allclose(elevation, found.heights, atol=1e-9)
    found.write(tmp_path / "h.dxf")
    lines = list(ezdxf.readfile(tmp_path / "h.dxf").modelspace())
    assert len(lines) == len(found) and {line.dxf.layer for line in lines} == {"CONTOUR", "INDEX-CONTOUR"}
    none = terrain.contours(dtm, interval=100.0, base=50.0)
    assert none.lines == [] == pickle.loads(pickle.dumps(none)).lines
    again = pickle.loads(pickle.dumps(found))
    for name in ("heights", "closed", "length"):
        np.testing.assert_array_equal(getattr(again, name), getattr(found, name))
    assert all(np.array_equal(a, b) for a, b in zip(again.lines, found.lines, strict=True))
    again.write(tmp_path / "again.dxf")
    assert (tmp_path / "again.dxf").read_bytes() == (tmp_path / "h.dxf").read_bytes()
    for wrong in ({"interval": 0.0}, {"base": 1e300}):
        with pytest.raises(ValueError, match="interval"):
            terrain.contours(dtm, **wrong)
    with pytest.raises(ValueError, match="two dimensions"):
        terrain.contours(terrain.Raster(np.zeros(3), (0.0, 0.0), 1.0))


def test_bad_rasters_and_parameters_are_refused(tmp_path):
    with pytest.raises(ValueError, match="two dimensions"):
        terrain.write_raster(tmp_path / "a.tif", terrain.Raster(np.zeros(3), (0.0, 0.0), 1.0))
    with pytest.raises(ValueError, match="cell"):
        terrain.write_raster(tmp_path / "a.tif", terrain.Raster(np.zeros((1, 1)), (0.0, 0.0), 0.0))
    with pytest.raises(ValueError, match="ESRI"):
        terrain.write_raster(tmp_path / "a.png", terrain.Raster(np.zeros((1, 1)), (0.0, 0.0), 1.0))
    with pytest.raises(ValueError, match="reach"):
        terrain.dtm(village(), reach=-1.0)
    with pytest.raises(ValueError, match="finite coordinates"):
        terrain.dtm(np.zeros((0, 3)))
    assert not list(tmp_path.iterdir())


def test_products_take_the_defaults_of_the_ground_filter():
    own = {name: p.default for name, p in inspect.signature(terrain.ground_points).parameters.items()}
    x, y = (v.ravel() for v in np.meshgrid(np.arange(104.0), np.arange(104.0)))
    hall = (abs(x - 52) < 22) & (abs(y - 52) < 22)
    xyz = np.column_stack([x, y, 0.02 * x + 6 * hall])
    given = terrain.height_above_ground(xyz, ground="filter", slope=own["slope"], window=own["window"])
    found = terrain.height_above_ground(xyz, ground="filter")
    np.testing.assert_array_equal(found, given)
    assert np.median(found[hall]) > 5


def test_roofs_wider_than_the_window_are_found_by_their_walls():
    x, y = (v.ravel() for v in np.meshgrid(np.arange(120.0), np.arange(120.0)))
    hall = (abs(x - 60) < 36) & (abs(y - 60) < 36)
    xyz = np.column_stack([x, y, 6.0 * hall])
    assert np.median(terrain.height_above_ground(xyz, ground="filter")[hall]) > 5
    # Neither without the search for walls, nor for walls that are higher.
    for wall in (0.0, 7.0):
        assert np.median(terrain.height_above_ground(xyz, ground="filter", wall=wall)[hall]) == 0
        assert np.median(terrain.dtm(xyz, ground="filter", wall=wall).values[55:65, 55:65]) == 6
    with pytest.raises(ValueError, match="wall"):
        terrain.dtm(xyz, ground="filter", wall=-1.0)


def read_geopackage(path):
    """Rows of the only layer, after the checks of SQLite and of the keys between the tables."""
    with sqlite3.connect(path) as base:
        assert base.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        assert base.execute("PRAGMA foreign_key_check").fetchall() == []
        assert base.execute("PRAGMA application_id").fetchone() == (0x47504B47,)
        (layer,) = base.execute("SELECT table_name FROM gpkg_contents WHERE data_type = 'features'").fetchone()
        names = [column[1] for column in base.execute(f'PRAGMA table_info("{layer}")')]
        rows = base.execute(f'SELECT * FROM "{layer}" ORDER BY fid').fetchall()
        (system,) = base.execute("SELECT srs_id FROM gpkg_geometry_columns").fetchone()
        known = base.execute("SELECT organization FROM gpkg_spatial_ref_sys WHERE srs_id = ?", (system,)).fetchone()
    return layer, [dict(zip(names, row, strict=True)) for row in rows], (system, *known)


def rings_of(blob):
    """The rings of a polygon in GeoPackage binary."""
    assert blob[:2] == b"GP" and blob[3] == 3
    at, rings = 8 + 32, []
    assert struct.unpack_from("<BI", blob, at) == (1, 3)
    (count,) = struct.unpack_from("<I", blob, at + 5)
    at += 9
    for _ in range(count):
        (corners,) = struct.unpack_from("<I", blob, at)
        ring = np.frombuffer(blob, "<f8", 2 * corners, at + 4).reshape(-1, 2)
        rings.append(ring)
        at += 4 + 16 * corners
    assert at == len(blob)
    low, high = np.concatenate(rings).min(axis=0), np.concatenate(rings).max(axis=0)
    assert struct.unpack_from("<4d", blob, 8) == (low[0], high[0], low[1], high[1])
    return rings


def test_footprints_are_a_layer_that_sqlite_and_gis_read(tmp_path):
    found = terrain.footprints(village("EPSG:25832"))
    terrain.write_footprints(tmp_path / "houses.gpkg", found)
    layer, (row,), system = read_geopackage(tmp_path / "houses.gpkg")
    (house,) = found["features"]
    assert (layer, system) == ("houses", (25832, "EPSG"))
    assert {name: row[name] for name in house["properties"]} == house["properties"]
    np.testing.assert_array_equal(rings_of(row["geom"])[0], house["geometry"]["coordinates"][0])
    before = (tmp_path / "houses.gpkg").read_bytes()
    terrain.write_footprints(tmp_path / "houses.gpkg", found)
    assert (tmp_path / "houses.gpkg").read_bytes() == before
    terrain.write_footprints(tmp_path / "again.geojson", found)
    assert json.loads((tmp_path / "again.geojson").read_text()) == found
    terrain.write_footprints(tmp_path / "none.gpkg", {"type": "FeatureCollection", "features": []})
    assert read_geopackage(tmp_path / "none.gpkg")[1:] == ([], (-1, "NONE"))
    with pytest.raises(ValueError, match="gpkg"):
        terrain.write_footprints(tmp_path / "a.shp", found)


@pytest.mark.parametrize(("houses", "corners"), [(1, 50_000), (40, 400), (5000, 8), (60_000, 5)])
def test_layers_of_many_pages_and_long_rows_are_sound(tmp_path, houses, corners):
    random = np.random.default_rng(houses)
    turn = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    features = []
    for number in range(houses):
        places = random.uniform(0, 1e6, 2) + np.column_stack([np.cos(turn), np.sin(turn)]) * random.uniform(1, 9)
        ring = np.vstack([places, places[:1]]).round(3).tolist()
        properties = {"id": number + 1, "name": "é" * (number % 200), "part": 0.5 * number, "none": None}
        geometry = {"type": "Polygon", "coordinates": [ring, ring[:3] + ring[:1]]}
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    terrain.write_footprints(tmp_path / "a.gpkg", {"type": "FeatureCollection", "features": features})
    _, rows, _ = read_geopackage(tmp_path / "a.gpkg")
    assert [row["fid"] for row in rows] == list(range(1, houses + 1))
    for row, feature in zip(rows, features, strict=True):
        assert {name: row[name] for name in feature["properties"]} == feature["properties"]
    for number in {0, houses // 2, houses - 1}:
        outer, hole = rings_of(rows[number]["geom"])
        np.testing.assert_array_equal(outer, features[number]["geometry"]["coordinates"][0])
        assert len(hole) == 4


def test_the_road_and_the_position_with_respect_to_it(data):
    from scansion import neighbours

    cloud = scansion.read(data / "oakland" / "part_14.laz", columns=["Classification"])
    truth = cloud["Classification"] == 2
    features = np.asarray(neighbours.optimal(cloud, k_step=10)[1])
    labels = np.full(len(cloud), -1)
    picked = np.random.default_rng(0).choice(len(cloud), 100, replace=False)
    labels[picked] = truth[picked]
    road = terrain.road_points(features, labels, random_state=0)
    assert 2 * (road & truth).sum() / (road.sum() + truth.sum()) > 0.93
    found = terrain.road_position(cloud, road)
    assert set(np.unique(found.position).tolist()) == {0.0, 0.5, 1.0} and found.area > 100 and found.border_length > 40
    smaller = terrain.road_position(cloud, road, alpha=0.5)
    assert smaller.area < found.area
    with pytest.raises(ValueError, match="labels"):
        terrain.road_points(features, truth * 2)
    with pytest.raises(ValueError, match="are road"):
        terrain.road_points(features, np.where(labels > 0, 1, -1))
    with pytest.raises(ValueError, match="alpha"):
        terrain.road_position(cloud, road, alpha=0.0)


def test_a_mask_is_not_made_of_codes_or_nan():
    xyz = np.random.default_rng(0).uniform(0, 10, (200, 3))
    for wrong in (np.full(200, 2), np.full(200, np.nan)):
        with pytest.raises(TypeError, match="ground: expected an array of bool"):
            terrain.heights(xyz, wrong)
        with pytest.raises(TypeError, match="road: expected an array of bool"):
            terrain.road_position(xyz, wrong)
    with pytest.raises(ValueError, match=r"road: expected shape \(200,\)"):
        terrain.road_position(xyz, [True])


def test_descriptors_of_the_road_are_finite():
    features, labels = np.random.default_rng(0).random((200, 4)), np.arange(200) % 2
    for wrong in (np.nan, np.inf):
        features[5, 2] = wrong
        with pytest.raises(ValueError, match=f"features: expected finite numbers, found {wrong} at index 5, 2"):
            terrain.road_points(features, labels)


def test_codes_beyond_a_byte_are_not_ground_beside_marks():
    cloud = village()
    marks = cloud["Classification"] == 2
    plain = scansion.PointCloud(cloud.xyz, Classification=np.where(marks, 2, 1))
    expected = np.asarray(terrain.dtm(plain, ground=marks))
    for code in (258, 263, -254, np.nan):
        other = scansion.PointCloud(cloud.xyz, Classification=np.where(marks, 2, code))
        assert np.array_equal(terrain.dtm(other, ground=marks), expected)


def test_marks_that_are_numbers_are_not_read_as_classes():
    cloud = village()
    marks = (cloud["Classification"] == 2).astype(int)
    with pytest.raises(ValueError, match=r"ground: found class [01] \d+ times.*astype\(bool\)"):
        terrain.dtm(cloud, ground=marks)
    with pytest.raises(ValueError, match="noise: found class 7 2 times, expected each class once$"):
        terrain.dtm(cloud, noise=[7, 7])


def test_stray_points_are_named_and_are_no_ground():
    clean = village()
    strayed = scansion.PointCloud(
        np.vstack([clean.xyz, np.zeros(3)]), Classification=np.append(clean["Classification"], 2).astype(np.uint8)
    )
    with pytest.warns(UserWarning, match="number 12000 at 0, 0, 0"):
        ground = terrain.ground_points(strayed)
    assert not ground[-1]
    np.testing.assert_array_equal(ground[:-1], terrain.ground_points(clean))
    with pytest.warns(UserWarning, match="number 12000 at 0, 0, 0"):
        heights = terrain.heights(strayed, ground)
    np.testing.assert_allclose(heights[:-1], terrain.heights(clean, ground[:-1]), atol=1e-5)
    for product in (terrain.dtm, terrain.dsm, terrain.chm):
        with pytest.warns(UserWarning, match="number 12000 at 0, 0, 0"):
            found = product(strayed, cell=1.0)
        assert found.values.shape == product(clean, cell=1.0).values.shape


@pytest.mark.parametrize("method", ["slic", "vccs"])
def test_supervoxels_leave_a_stray_point_out_and_name_it(method):
    clean = village().xyz
    with pytest.warns(UserWarning, match="number 12000 at 0, 0, 0.*left out"):
        found = scansion.segmentation.supervoxels(np.vstack([clean, np.zeros(3)]), method=method)
    assert found[-1] == -1 and np.array_equal(found[:-1], scansion.segmentation.supervoxels(clean, method=method))
