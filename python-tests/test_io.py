"""Module `io`: laspy and plyfile read what we write, field by field, and we read what they write."""

import errno
import os

import laspy
import numpy as np
import pytest
import scansion

FIELDS = {
    "Intensity": ("intensity", "u2"),
    "ReturnNumber": ("return_number", "u1"),
    "NumberOfReturns": ("number_of_returns", "u1"),
    "Classification": ("classification", "u1"),
    "UserData": ("user_data", "u1"),
    "PointSourceId": ("point_source_id", "u2"),
    "GpsTime": ("gps_time", "f8"),
    "Red": ("red", "u2"),
    "Green": ("green", "u2"),
    "Blue": ("blue", "u2"),
}
N = 1234


def values(kind, top, seed):
    return np.random.default_rng(seed).integers(0, top, N).astype(kind)


def las_of(version, point_format):
    """A LAS file in memory, made by laspy, all fields filled."""
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = [0.001, 0.001, 0.0005], [500_000, 5_000_000, 100]
    header.add_extra_dims([laspy.ExtraBytesParams("Quality", "f4"), laspy.ExtraBytesParams("Strip", "u2")])
    las = laspy.LasData(header)
    random = np.random.default_rng(1)
    las.X, las.Y, las.Z = (random.integers(-(2**30), 2**30, N).astype(np.int32) for _ in range(3))
    for seed, (_, (name, kind)) in enumerate(FIELDS.items()):
        if name in las.point_format.dimension_names:
            las[name] = values(kind, 7 if "return" in name else 31, seed)
    las.Quality, las.Strip = random.random(N).astype("f4"), values("u2", 60_000, 9)
    return las


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize(
    ("version", "point_format"),
    [("1.2", 0), ("1.2", 1), ("1.2", 2), ("1.2", 3), ("1.4", 6), ("1.4", 7), ("1.4", 8)],
)
def test_we_read_what_laspy_writes(tmp_path, suffix, version, point_format):
    las, path = las_of(version, point_format), tmp_path / f"a{suffix}"
    las.write(path)
    cloud = scansion.read(path)
    np.testing.assert_allclose(cloud.xyz, np.column_stack([las.x, las.y, las.z]), rtol=0, atol=1e-9)
    for ours, (theirs, kind) in FIELDS.items():
        if theirs in las.point_format.dimension_names:
            assert cloud[ours].dtype == kind, ours
            np.testing.assert_array_equal(cloud[ours], np.asarray(las[theirs]), err_msg=ours)
    np.testing.assert_array_equal(cloud["Quality"], las.Quality)
    np.testing.assert_array_equal(cloud["Strip"], las.Strip)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_laspy_reads_what_we_write(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    columns = {
        ours: values(kind, 7 if "eturn" in ours else 31, i)
        for i, (ours, (_, kind)) in enumerate(FIELDS.items())
    }
    xyz = np.random.default_rng(0).uniform(0, 1000, (N, 3)) + [500_000, 5_000_000, 0]
    cloud = scansion.PointCloud(xyz, Confidence=np.random.default_rng(1).random(N).astype("f4"), **columns)
    scansion.write(path, cloud)
    las = laspy.read(path)
    assert len(las) == N and str(las.header.version) == "1.4"
    np.testing.assert_allclose(np.column_stack([las.x, las.y, las.z]), xyz, rtol=0, atol=0.00051)
    for ours, (theirs, _) in FIELDS.items():
        np.testing.assert_array_equal(np.asarray(las[theirs]), columns[ours], err_msg=ours)
    np.testing.assert_array_equal(las.Confidence, cloud["Confidence"])


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize(("version", "point_format"), [("1.2", 3), ("1.4", 7)])
def test_rewriting_keeps_every_other_field(tmp_path, suffix, version, point_format):
    las, path, out = las_of(version, point_format), tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    las.write(path)
    labels, confidence = values("u1", 31, 77), np.linspace(0, 1, N, dtype="f4")
    notes = scansion.rewrite(path, out, labels, {"Confidence": confidence})
    assert isinstance(notes, list)
    again = laspy.read(out)
    assert again.point_format.id == point_format and str(again.header.version) == version
    np.testing.assert_array_equal(again.classification, labels)
    np.testing.assert_array_equal(again.Confidence, confidence)
    for name in laspy.read(path).point_format.dimension_names:
        if name != "classification":
            np.testing.assert_array_equal(np.asarray(again[name]), np.asarray(las[name]), err_msg=name)


def test_classes_above_31_promote_old_formats_and_say_so(tmp_path):
    las_of("1.2", 3).write(tmp_path / "a.las")
    notes = scansion.rewrite(tmp_path / "a.las", tmp_path / "b.las", np.full(N, 64))
    assert any("1.4" in note for note in notes)
    assert (laspy.read(tmp_path / "b.las").classification == 64).all()


def test_laspy_data_come_in_and_go_out_exactly():
    las = las_of("1.4", 7)
    cloud = scansion.PointCloud.from_laspy(las)
    back = cloud.to_laspy()
    for name in ("X", "Y", "Z", "intensity", "classification", "gps_time", "red", "Quality", "Strip"):
        np.testing.assert_array_equal(np.asarray(back[name]), np.asarray(las[name]), err_msg=name)


def test_ticks_survive_reading_and_writing(tmp_path):
    las = las_of("1.4", 6)
    las.write(tmp_path / "a.las")
    scansion.write(tmp_path / "b.las", scansion.read(tmp_path / "a.las"))
    again = laspy.read(tmp_path / "b.las")
    assert all((np.asarray(again[axis]) == np.asarray(las[axis])).all() for axis in "XYZ")


def test_ply_goes_both_ways(tmp_path):
    plyfile = pytest.importorskip("plyfile")
    xyz = np.random.default_rng(0).uniform(0, 10, (N, 3)) + [500_000, 5_000_000, 0]
    scansion.write(tmp_path / "a.ply", scansion.PointCloud(xyz, Classification=values("u1", 9, 0)))
    vertex = plyfile.PlyData.read(tmp_path / "a.ply")["vertex"]
    np.testing.assert_array_equal(np.column_stack([vertex["x"], vertex["y"], vertex["z"]]), xyz)
    for text, order in ((True, "="), (False, "<"), (False, ">")):
        path = tmp_path / "b.ply"
        plyfile.PlyData(
            [plyfile.PlyElement.describe(vertex.data, "vertex")], text=text, byte_order=order
        ).write(path)
        cloud = scansion.read(path)
        np.testing.assert_allclose(cloud.xyz, xyz, rtol=1e-12)
        np.testing.assert_array_equal(cloud["Classification"], values("u1", 9, 0))


def test_text_goes_both_ways(tmp_path):
    xyz = np.round(np.random.default_rng(0).uniform(0, 10, (N, 3)), 3)
    scansion.write(tmp_path / "a.txt", scansion.PointCloud(xyz, Classification=values("u1", 9, 0)))
    cloud = scansion.read(tmp_path / "a.txt")
    np.testing.assert_array_equal(cloud.xyz, xyz)
    np.testing.assert_array_equal(cloud["Classification"], values("u1", 9, 0))
    np.savetxt(tmp_path / "b.xyz", xyz)
    np.testing.assert_array_equal(scansion.read(tmp_path / "b.xyz").xyz, xyz)


def test_only_the_asked_columns_are_read(tmp_path):
    las_of("1.4", 7).write(tmp_path / "a.las")
    assert scansion.read(tmp_path / "a.las", ["Classification"]).columns == ["Classification"]
    assert scansion.read(tmp_path / "a.las", []).columns == []


def test_the_header_is_told(tmp_path):
    las_of("1.4", 7).write(tmp_path / "a.laz")
    found = scansion.info(tmp_path / "a.laz")
    assert N in found.values() and "1.4" in str(found)


def test_errors_are_those_that_python_knows(tmp_path):
    with pytest.raises(FileNotFoundError) as caught:
        scansion.read(tmp_path / "absent.las")
    assert caught.value.errno == errno.ENOENT and caught.value.filename.endswith("absent.las")
    (tmp_path / "empty.las").write_bytes(b"")
    with pytest.raises(scansion.FileFormatError, match="empty.las"):
        scansion.read(tmp_path / "empty.las")
    whole = tmp_path / "whole.las"
    las_of("1.4", 7).write(whole)
    (tmp_path / "cut.las").write_bytes(whole.read_bytes()[:-1000])
    with pytest.raises(ValueError, match="cut.las"):
        scansion.read(tmp_path / "cut.las")
    with pytest.raises(OSError):
        scansion.write(tmp_path / "no" / "folder.las", scansion.read(whole))
    with pytest.raises(ValueError):
        scansion.rewrite(whole, tmp_path / "b.las", np.zeros(N - 1, "u1"))
    with pytest.raises(ValueError, match="256"):
        scansion.rewrite(whole, tmp_path / "b.las", np.full(N, 256))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cut.las", "empty.las", "whole.las"]


def test_hostile_files_never_break_python(data):
    for path in sorted(data.glob("hostile/*")):
        if path.is_file():
            try:
                scansion.read(path)
            except (scansion.FileFormatError, ValueError, OSError) as error:
                assert str(error)


def test_a_model_is_not_saved_over_a_scan(tmp_path):
    scan, model = tmp_path / "scan.laz", tmp_path / "my.model"
    scansion.write(scan, np.random.default_rng(1).random((100, 3)))
    before = scan.read_bytes()
    classifier = scansion.PointClassifier.default()
    with pytest.raises(FileExistsError, match="no model"):
        classifier.save(scan)
    assert scan.read_bytes() == before
    classifier.save(model)
    classifier.save(model)


def test_a_picture_is_not_drawn_over_its_cloud(tmp_path):
    cloud = tmp_path / "a.png"
    (tmp_path / "a.ply").touch()
    scansion.write(tmp_path / "a.ply", np.random.default_rng(1).random((100, 3)))
    (tmp_path / "a.ply").rename(cloud)
    before = cloud.read_bytes()
    with pytest.raises(ValueError, match="another name"):
        scansion.render(cloud, cloud)
    with pytest.raises(ValueError, match=r"\.png"):
        scansion.render(cloud, tmp_path / "a.laz")
    assert cloud.read_bytes() == before


def test_an_output_that_cannot_be_written_is_found_before_points_are_read(tmp_path):
    bad = tmp_path / "bad.xyz"
    bad.write_text("1 2 3\n" * 1000 + "1 2 three\n")
    with pytest.raises(OSError, match="folder does not exist"):
        scansion.convert(bad, tmp_path / "absent" / "o.ply")
    with pytest.raises(OSError, match="folder does not exist"):
        scansion.merge([bad, bad], tmp_path / "absent" / "o.ply")
    with pytest.raises(scansion.FileFormatError, match="name it o.laz"):
        scansion.convert(bad, tmp_path / "o.copc.laz")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_pipes_devices_and_folders_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, "/dev/zero"):
        for call in (scansion.read, scansion.info, lambda p: scansion.convert(p, tmp_path / "o.ply")):
            with pytest.raises(scansion.FileFormatError, match="a pipe|a folder|a device"):
                call(path)
    for path in (tmp_path, "/dev/zero"):
        with pytest.raises(scansion.FileFormatError, match="a folder|a device"):
            scansion.PointClassifier.load(path)
        with pytest.raises(scansion.FileFormatError, match="a folder|a device"):
            scansion.PointClassifier(recipe=path).fit(np.random.default_rng(1).random((100, 3)), np.zeros(100, "u1"))


def test_what_files_say_cannot_act_on_the_terminal(tmp_path):
    path = tmp_path / "a.ply"
    path.write_text("ply\nformat ascii 1.0\nbad\x1b[31m\nend_header\n")
    with pytest.raises(scansion.FileFormatError, match=r"\\u001b\[31m"):
        scansion.read(path)


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("Classification", 300, "0..255"),
        ("Classification", -1, "0..255"),
        ("Classification", np.nan, "0..255"),
        ("UserData", 0.5, "0..255"),
        ("Intensity", 70_000, "0..65535"),
        ("Red", 0.5, "0..65535"),
        ("ReturnNumber", 16, "0..15"),
        ("Withheld", 2, "0..1"),
        ("ScanAngle", 500.0, "-196.6..196.6"),
        ("ScanAngle", np.nan, "-196.6..196.6"),
        ("GpsTime", 2**60 + 1, "exact"),
    ],
)
def test_what_las_cannot_hold_does_not_go_to_laspy(name, value, allowed):
    cloud = scansion.PointCloud(np.eye(2, 3), **{name: np.array([0, value])})
    with pytest.raises(ValueError, match=f"{name}: expected .*{allowed}.*, found {cloud[name][1]} at index 1"):
        cloud.to_laspy()


def test_floats_that_las_holds_go_to_laspy():
    columns = {"Classification": 255.0, "Intensity": 65_535.0, "ReturnNumber": 15.0, "Withheld": 1.0, "GpsTime": np.nan}
    las = scansion.PointCloud(np.eye(1, 3), **{name: [value] for name, value in columns.items()}).to_laspy()
    found = [las.classification[0], las.intensity[0], las.return_number[0], las.withheld[0]]
    assert found == [255, 65_535, 15, 1] and np.isnan(las.gps_time[0])


@pytest.mark.parametrize("extension", ["las", "npz"])
@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (1, 0, 2)])
def test_heights_that_differ_are_not_merged_in_any_order(tmp_path, extension, order):
    systems = ["EPSG:26910", "EPSG:26910+5703", "EPSG:26910+6360"]
    paths = [tmp_path / f"{number}.{extension}" for number in range(3)]
    for path, crs in zip(paths, systems, strict=True):
        scansion.write(path, scansion.PointCloud(np.arange(30.0).reshape(10, 3), crs=crs))
    scansion.merge(paths[:2], tmp_path / f"both.{extension}")
    with pytest.raises(ValueError, match="system than"):
        scansion.merge([paths[number] for number in order], tmp_path / f"all.{extension}")


def with_keys(path, keys, wkt=None):
    """A LAS file with GeoTIFF keys, and WKT that counts if ``wkt`` is given, made by laspy."""
    las = las_of("1.4", 6) if wkt else las_of("1.2", 3)
    entries = np.array([[1, 1, 0, len(keys)], *keys], "<u2")
    for number, data in [(34735, entries.tobytes()), (34736, np.array([7.0, 0.25], "<f8").tobytes())]:
        las.header.vlrs.append(laspy.VLR("LASF_Projection", number, record_data=data))
    if wkt:
        las.header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
        las.header.global_encoding.wkt = True
    las.write(path)


METRES = [(1024, 0, 1, 1), (3072, 0, 1, 26910), (3076, 0, 1, 9001)]


@pytest.mark.parametrize(
    ("keys", "wkt", "unit"),
    [
        (METRES, None, 1.0),
        ([*METRES, (4096, 0, 1, 6360)], None, 1.0),
        ([*METRES, (4099, 0, 1, 9003)], None, 1.0),
        ([(1024, 0, 1, 1), (3072, 0, 1, 2229), (4099, 0, 1, 9001)], None, 1200 / 3937),
        ([(1024, 0, 1, 1), (3076, 0, 1, 32767), (3077, 34736, 1, 1)], None, 0.25),
        ([(1024, 0, 1, 1), (3076, 0, 1, 9096)], None, 0.9144),
        ([(1024, 0, 1, 2), (2048, 0, 1, 4326), (3076, 0, 1, 9001)], None, None),
        ([(1024, 0, 1, 2), (2048, 0, 1, 32767), (2054, 0, 1, 9105)], None, None),
        (METRES, 'LOCAL_CS["own",UNIT["foot",0.3048]]', 0.3048),
        ([], None, None),
    ],
)
@pytest.mark.filterwarnings("ignore:.*heights in units:UserWarning")
def test_laspy_clouds_have_the_system_and_units_of_the_file(tmp_path, keys, wkt, unit):
    with_keys(tmp_path / "a.las", keys, wkt)
    ours = scansion.read(tmp_path / "a.las")
    theirs = scansion.PointCloud.from_laspy(laspy.read(tmp_path / "a.las"))
    assert (theirs.crs, theirs.metres_per_unit) == (ours.crs, ours.metres_per_unit)
    assert theirs.metres_per_unit == (None if unit is None else pytest.approx(unit, rel=1e-12))


def test_laspy_clouds_warn_of_heights_in_another_unit_and_keep_it(tmp_path):
    with_keys(tmp_path / "a.las", [*METRES, (4099, 0, 1, 9003)])
    for cloud_of in (scansion.read, lambda path: scansion.PointCloud.from_laspy(laspy.read(path))):
        with pytest.warns(UserWarning, match=r"units of 1 m, heights in units of 0\.3048006"):
            cloud = cloud_of(tmp_path / "a.las")
        assert f'UNIT["US survey foot",{1200 / 3937}]' in cloud.crs and '"26910"' in cloud.crs


def test_a_system_that_laspy_does_not_get_is_told():
    xyz = np.arange(30.0).reshape(10, 3)
    for crs, metres, told in [
        ("EPSG:64000", None, "not kept"),
        ("EPSG:26910+5103", None, "5103"),
        ("EPSG:26910", 0.3048, "0.3048 m"),
    ]:
        with pytest.warns(UserWarning, match=told):
            scansion.PointCloud(xyz, crs=crs, metres_per_unit=metres).to_laspy()


@pytest.mark.parametrize("metres", [0.0, -1.0, np.nan, np.inf])
def test_a_unit_of_a_cloud_that_is_no_length_is_an_error(metres):
    cloud = scansion.PointCloud(np.eye(3), metres_per_unit=0.3048)
    with pytest.raises(ValueError, match="metres_per_unit: .*above 0"):
        cloud.metres_per_unit = metres
    with pytest.raises(ValueError, match="metres_per_unit: .*above 0"):
        scansion.PointCloud(np.eye(3), metres_per_unit=metres)
    assert cloud.metres_per_unit == 0.3048


def test_a_second_vertical_system_is_an_error(tmp_path):
    xyz = np.arange(30.0).reshape(10, 3)
    cloud = scansion.PointCloud(xyz, crs="EPSG:7405")
    for wrong, advice in [
        ("EPSG:7405+5703", r"EPSG:27700\+5703"),
        ("EPSG:4979+5703", "three axes"),
        ("EPSG:2154+x", r"after the \+"),
    ]:
        with pytest.raises(ValueError, match=f"crs: .*{advice}"):
            scansion.PointCloud(xyz, crs=wrong)
        with pytest.raises(ValueError, match=advice):
            cloud.crs = wrong
        raster = scansion.terrain.Raster(np.zeros((2, 2)), (0.0, 0.0), 1.0, wrong, 1.0)
        with pytest.raises(ValueError, match=advice):
            scansion.terrain.write_raster(tmp_path / "a.tif", raster)
    assert cloud.crs == "EPSG:7405" and not (tmp_path / "a.tif").exists()
    for fine in ["EPSG:7405", "EPSG:7405+5701", "EPSG:27700+5703", "my own"]:
        assert scansion.PointCloud(xyz, crs=fine).crs == fine
