"""Module `io`: every version and point format of LAS with laspy, the other formats with their own libraries, and the commands
on files."""

import laspy
import numpy as np
import pytest
import scansion

N = 500
VERSIONS = {"1.1": range(2), "1.2": range(4), "1.3": range(6), "1.4": range(11)}
MATRIX = [
    (version, point_format, suffix)
    for version, formats in VERSIONS.items()
    for point_format in formats
    for suffix in (".las", ".laz")
]
#: Dimensions of laspy that are several of ours, or none.
WAVE = ("wavepacket_index", "wavepacket_offset", "wavepacket_size", "return_point_wave_location", "x_t", "y_t", "z_t")


def las_of(version, point_format):
    """A LAS file in memory, made by laspy, every dimension filled."""
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = [0.001, 0.01, 0.0005], [500_000, 5_000_000, 100]
    header.add_extra_dims([laspy.ExtraBytesParams("Quality", "f4"), laspy.ExtraBytesParams("Strip", "u2")])
    las = laspy.LasData(header)
    random = np.random.default_rng(point_format)
    las.X, las.Y, las.Z = (random.integers(-(2**30), 2**30, N).astype(np.int32) for _ in range(3))
    for name in las.point_format.dimension_names:
        if name in ("X", "Y", "Z") or name in WAVE:
            continue
        info = las.point_format.dimension_by_name(name)
        if info.kind == laspy.point.dims.DimensionKind.FloatingPoint:
            las[name] = random.random(N)
        else:
            las[name] = random.integers(0, min(2 ** (info.num_bits - 1), 30_000), N)
    return las


def same(again, las, but=()):
    for name in las.point_format.dimension_names:
        if name not in but:
            np.testing.assert_array_equal(np.asarray(again[name]), np.asarray(las[name]), err_msg=name)


@pytest.mark.parametrize(("version", "point_format", "suffix"), MATRIX)
def test_laspy_finds_only_the_classes_changed_in_every_version_and_format(tmp_path, version, point_format, suffix):
    if suffix == ".laz" and point_format in (4, 5, 9, 10):
        pytest.skip("lazrs writes no waveforms")
    las, source, out = las_of(version, point_format), tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    las.write(source)
    labels = np.arange(N, dtype="u1") % 32
    assert scansion.rewrite(source, out, labels) == []
    again = laspy.read(out)
    assert again.point_format.id == point_format and str(again.header.version) == version
    np.testing.assert_array_equal(again.classification, labels)
    same(again, las, but=("classification",))
    np.testing.assert_array_equal(again.header.scales, las.header.scales)
    found = scansion.diff(source, out)
    assert not found["same"] and [f["name"] for f in found["fields"]] == ["Classification"]
    assert f"{found['fields'][0]['differing']:,}" in found["summary"] or "only Classification" in found["summary"]
    assert sum(c["points"] for c in found["classes"]) == N


@pytest.mark.parametrize(("version", "point_format"), [(v, f) for v, fs in VERSIONS.items() for f in fs])
def test_clouds_of_laspy_agree_column_by_column(tmp_path, version, point_format):
    las = las_of(version, point_format)
    las.write(tmp_path / "a.las")
    cloud = scansion.read(tmp_path / "a.las")
    theirs = scansion.PointCloud.from_laspy(laspy.read(tmp_path / "a.las"))
    np.testing.assert_allclose(cloud.xyz, theirs.xyz, rtol=0, atol=1e-9)
    shared = [name for name in cloud.columns if name in theirs.columns]
    assert {"Intensity", "Classification", "Quality", "Strip", "PointSourceId"} <= set(shared)
    for name in shared:
        np.testing.assert_array_equal(cloud[name], theirs[name], err_msg=name)


def test_laspy_data_go_out_and_come_back_with_all_columns(tmp_path):
    las_of("1.4", 8).write(tmp_path / "a.laz")
    cloud = scansion.read(tmp_path / "a.laz")
    assert cloud.header["version"] == "1.4" and cloud.header["points"] == N
    cloud.crs = 'PROJCS["a",UNIT["metre",1]]'
    again = scansion.PointCloud.from_laspy(cloud.to_laspy())
    assert again.crs == cloud.crs and again.header == {}
    np.testing.assert_array_equal(again.xyz, cloud.xyz)
    for name in cloud.columns:
        np.testing.assert_array_equal(again[name], cloud[name], err_msg=name)


def test_pye57_scans_with_poses_are_read(tmp_path):
    pye57 = pytest.importorskip("pye57")
    random = np.random.default_rng(0)
    path, turn = tmp_path / "a.e57", np.array([np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)])
    file = pye57.E57(str(path), mode="w")
    points = random.uniform(-10, 10, (2, 300, 3))
    for scan, move in zip(points, ([1000.0, 2000.0, 5.0], [0.0, 0.0, 0.0]), strict=True):
        columns = {f"cartesian{axis}": scan[:, i].copy() for i, axis in enumerate("XYZ")}
        columns["intensity"] = np.arange(300) / 300
        file.write_scan_raw(columns, rotation=turn, translation=np.array(move))
    file.close()
    cloud = scansion.read(path)
    theirs = pye57.E57(str(path))
    scans = [theirs.read_scan(i, intensity=True, ignore_missing_fields=True) for i in range(2)]
    expected = np.concatenate([np.column_stack([s[f"cartesian{a}"] for a in "XYZ"]) for s in scans])
    np.testing.assert_allclose(cloud.xyz, expected, rtol=0, atol=1e-6)
    np.testing.assert_allclose(cloud["Intensity"], np.concatenate([s["intensity"] for s in scans]), atol=1e-6)
    np.testing.assert_array_equal(cloud["ScanIndex"], np.repeat([0, 1], 300))


def test_pypcd4_and_we_read_each_other(tmp_path):
    pypcd4 = pytest.importorskip("pypcd4")
    xyz = np.random.default_rng(0).uniform(0, 10, (N, 3)).astype("f4")
    intensity = np.arange(N, dtype="f4")
    cloud = scansion.PointCloud(xyz, Intensity=intensity, Ring=np.arange(N, dtype="u2") % 7)
    scansion.write(tmp_path / "a.pcd", cloud)
    theirs = pypcd4.PointCloud.from_path(tmp_path / "a.pcd")
    np.testing.assert_array_equal(theirs.numpy(("x", "y", "z")), xyz)
    np.testing.assert_array_equal(theirs.numpy(("Ring",))[:, 0], cloud["Ring"])
    for encoding in ("ASCII", "BINARY", "BINARY_COMPRESSED"):
        theirs.save(tmp_path / "b.pcd", encoding=getattr(pypcd4.Encoding, encoding))
        again = scansion.read(tmp_path / "b.pcd")
        np.testing.assert_allclose(again.xyz, xyz, rtol=1e-6)
        np.testing.assert_array_equal(again["Intensity"], intensity)
        np.testing.assert_array_equal(again["Ring"], cloud["Ring"])


def test_numpy_reads_our_npz_and_we_read_numpys(tmp_path):
    cloud = scansion.PointCloud(np.random.default_rng(0).normal(size=(N, 3)), Classification=np.full(N, 6, "u1"))
    scansion.write(tmp_path / "a.npz", cloud)
    with np.load(tmp_path / "a.npz") as archive:
        np.testing.assert_array_equal(archive["xyz"], cloud.xyz)
        np.testing.assert_array_equal(archive["Classification"], cloud["Classification"])
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "b.npz", xyz=cloud.xyz, Classification=cloud["Classification"])
        again = scansion.read(tmp_path / "b.npz")
        np.testing.assert_array_equal(again.xyz, cloud.xyz)
        np.testing.assert_array_equal(again["Classification"], cloud["Classification"])


@pytest.mark.parametrize("name", ["a.las", "a.laz", "a.ply", "a.pcd", "a.npz", "a.xyz"])
def test_blocks_together_are_the_cloud(tmp_path, name):
    xyz = np.round(np.random.default_rng(0).uniform(0, 100, (N, 3)), 3)
    scansion.write(tmp_path / name, scansion.PointCloud(xyz, Classification=np.arange(N, dtype="u1") % 9))
    whole, blocks = scansion.read(tmp_path / name), list(scansion.blocks(tmp_path / name, 99))
    assert [len(block) for block in blocks] == [99] * 5 + [5]
    np.testing.assert_array_equal(np.concatenate([b.xyz for b in blocks]), whole.xyz)
    classes = np.concatenate([b["Classification"] for b in blocks])
    np.testing.assert_array_equal(classes, whole["Classification"])
    low, high = [20, 20, 0], [60, 90, 100]
    inside = ((whole.xyz >= low) & (whole.xyz <= high)).all(axis=1)
    np.testing.assert_array_equal(scansion.read(tmp_path / name, bounds=(low, high)).xyz, whole.xyz[inside])
    plan = scansion.blocks(tmp_path / name, 99, [], bounds=(low[:2], high[:2]))
    assert sum(map(len, plan)) == inside.sum()
    with pytest.raises(ValueError, match="size"):
        scansion.blocks(tmp_path / name, 0)
    with pytest.raises(FileNotFoundError):
        scansion.blocks(tmp_path / "absent.las")
    with pytest.raises(ValueError, match="resolution"):
        scansion.read(tmp_path / name, resolution=1.0)
    with pytest.raises(ValueError, match="shape"):
        scansion.read(tmp_path / name, bounds=[1, 2, 3])


def test_levels_of_copc_thin_the_cloud(data, tmp_path):
    path = data / "scale" / "lone-star.copc.laz"
    octree = scansion.info(path)["octree"]
    coarse = scansion.read(path, [], resolution=octree["spacing"])
    assert len(coarse) == octree["points_per_level"][0]
    notes = scansion.convert(path, tmp_path / "a.laz", resolution=octree["spacing"])
    assert any("octree" in note for note in notes)
    np.testing.assert_array_equal(scansion.read(tmp_path / "a.laz", []).xyz, coarse.xyz)
    np.testing.assert_array_equal(laspy.read(tmp_path / "a.laz").x, coarse.xyz[:, 0])


def test_files_are_joined_salvaged_and_counted(tmp_path):
    las_of("1.4", 7).write(tmp_path / "a.las")
    las_of("1.4", 7).write(tmp_path / "b.laz")
    scansion.merge([tmp_path / "a.las", tmp_path / "b.laz"], tmp_path / "all.laz")
    assert scansion.info(tmp_path / "all.laz")["points"] == 2 * N
    found = scansion.info(tmp_path / "all.laz", stats=True)
    assert found["stats"]["duplicates"] == N and found["stats"]["outside_bounds"] == 0
    assert sum(count for _, count in found["stats"]["classes"]) == 2 * N
    (tmp_path / "cut.las").write_bytes((tmp_path / "a.las").read_bytes()[:-1000])
    losses = scansion.salvage(tmp_path / "cut.las", tmp_path / "saved.las")
    assert losses["lost"] > 0 and losses["notes"]
    assert len(laspy.read(tmp_path / "saved.las")) == losses["read"] == N - losses["lost"]
    assert scansion.diff(tmp_path / "a.las", tmp_path / "a.las")["same"]


@pytest.mark.parametrize("name", ["a.las", "a.laz", "a.ply", "a.pcd", "a.npz", "a.txt"])
def test_damaged_files_raise_what_python_knows(tmp_path, name):
    path, random = tmp_path / name, np.random.default_rng(1)
    scansion.write(path, scansion.PointCloud(random.uniform(0, 9, (50, 3)), Intensity=np.arange(50, dtype="u2")))
    sound, raised = path.read_bytes(), 0
    for _ in range(300):
        mutant = bytearray(sound)
        for place in random.integers(0, min(len(mutant), 600), 3):
            mutant[place] = random.integers(0, 256)
        path.write_bytes(mutant[: random.integers(len(mutant) // 2, len(mutant) + 1)])
        for work in (scansion.read, scansion.info, scansion.salvage, lambda p: scansion.diff(p, p)):
            try:
                work(path)
            except (scansion.FileFormatError, ValueError, OSError) as error:
                assert str(error)
                raised += 1
    assert raised > 100


def test_units_follow_from_the_reference_system():
    xyz = np.zeros((3, 3))
    assert scansion.PointCloud(xyz, crs="EPSG:32632").metres_per_unit == 1.0
    assert scansion.PointCloud(xyz, crs="EPSG:2229").metres_per_unit == pytest.approx(1200 / 3937, rel=1e-12)
    assert scansion.PointCloud(xyz, crs="EPSG:2229", metres_per_unit=1.0).metres_per_unit == 1.0
    assert scansion.PointCloud(xyz, crs="EPSG:4326").metres_per_unit is None
    cloud = scansion.PointCloud(xyz, crs="EPSG:2229")
    cloud.crs = "EPSG:32632"
    assert cloud.metres_per_unit == 1.0


def test_degrees_are_refused_where_distances_count():
    xyz = np.random.default_rng(0).random((500, 3))
    cloud = scansion.PointCloud(xyz, crs="EPSG:4326", Classification=np.tile([2, 6], 250).astype("u1"))
    for refused in (
        lambda: scansion.segment(cloud),
        lambda: scansion.features.multiscale(cloud),
        lambda: scansion.neighbours.knn(cloud, 3),
        lambda: scansion.PointClassifier.default().predict(cloud),
        lambda: scansion.PointClassifier().fit(cloud),
    ):
        with pytest.raises(ValueError, match="degrees"):
            refused()
    assert len(scansion.segment(cloud, metres_per_unit=1.0).cluster_id) == 500
    assert len(scansion.PointClassifier.default().classify(cloud, metres_per_unit=1.0).codes) == 500


def test_steps_of_las_keep_places_apart(tmp_path):
    steps = np.stack(np.meshgrid(np.arange(30), np.arange(30)), -1).reshape(-1, 2) * 6.1e-5
    xyz = np.column_stack([2.35 + steps[:, 0], 48.85 + steps[:, 1], np.arange(900) % 30])
    for crs in (None, "EPSG:4326"):
        scansion.write(tmp_path / "a.laz", scansion.PointCloud(xyz, crs=crs))
        las = laspy.read(tmp_path / "a.laz")
        assert len(np.unique(las.xyz, axis=0)) == 900
        assert np.abs(las.xyz - xyz).max() < 6.1e-8
        again = scansion.PointCloud(xyz, crs=crs).to_laspy()
        assert np.abs(again.xyz - xyz).max() < 6.1e-8
    scansion.write(tmp_path / "a.laz", xyz, scale=0.001)
    assert laspy.read(tmp_path / "a.laz").header.scales.tolist() == [0.001] * 3
    for bad in (0.0, [1.0, 2.0], -1, [1.0, 2.0, np.nan]):
        with pytest.raises(ValueError, match="scale"):
            scansion.write(tmp_path / "a.laz", xyz, scale=bad)
    with pytest.raises(ValueError, match="scale"):
        scansion.convert(tmp_path / "a.laz", tmp_path / "b.laz", scale=0.01)


def test_a_code_of_epsg_is_kept_in_las(tmp_path):
    cloud = scansion.PointCloud(np.random.default_rng(0).random((50, 3)), crs="EPSG:25832")
    scansion.write(tmp_path / "a.las", cloud)
    with laspy.open(tmp_path / "a.las") as las:
        records = [vlr for vlr in las.header.vlrs if vlr.record_id == 2112]
        assert 'AUTHORITY["EPSG","25832"]' in records[0].string and las.header.global_encoding.wkt
    assert scansion.read(tmp_path / "a.las").metres_per_unit == 1.0


def test_points_outside_the_header_are_warned_of(tmp_path):
    xyz = np.random.default_rng(0).integers(0, 1000, (500, 3)) / 100
    scansion.write(tmp_path / "a.las", xyz)
    las = laspy.read(tmp_path / "a.las")
    data = bytearray((tmp_path / "a.las").read_bytes())
    at = las.header.offset_to_point_data + 7 * 30
    data[at : at + 4] = (10**8).to_bytes(4, "little")
    (tmp_path / "a.las").write_bytes(data)
    for work in (
        lambda: scansion.read(tmp_path / "a.las"),
        lambda: list(scansion.blocks(tmp_path / "a.las", 100)),
        lambda: scansion.convert(tmp_path / "a.las", tmp_path / "b.laz"),
        lambda: scansion.diff(tmp_path / "a.las", tmp_path / "a.las"),
    ):
        with pytest.warns(UserWarning, match="1 of 500 points lies outside .* number 7 "):
            work()


def test_a_stray_point_is_set_aside_with_a_warning():
    rng = np.random.default_rng(1)
    clean = np.column_stack([rng.random((2000, 2)) * 40 + [5e5, 5.2e6], rng.random(2000)])
    strayed = np.vstack([clean, np.zeros(3)])
    model = scansion.PointClassifier.default()
    expected = model.classify(clean)
    with pytest.warns(UserWarning, match="number 2000 at 0, 0, 0"):
        found = model.classify(strayed)
    assert np.array_equal(found.codes[:-1], expected.codes) and found.codes[-1] == 7
    assert np.array_equal(found.confidence[:-1], expected.confidence) and found.confidence[-1] == 0
    with pytest.warns(UserWarning, match="far from all others"):
        segments = scansion.segment(strayed).cluster_id
    assert segments[-1] == 0 and np.array_equal(segments[:-1], scansion.segment(clean).cluster_id)
    for method in ("slic", "vccs"):
        with pytest.warns(UserWarning, match="number 2000 .*left out"):
            labels = scansion.segmentation.supervoxels(strayed, method=method, normals=np.tile([0.0, 0.0, 1.0], (2001, 1)))
        alone = scansion.segmentation.supervoxels(clean, method=method, normals=np.tile([0.0, 0.0, 1.0], (2000, 1)))
        assert labels[-1] == -1 and np.array_equal(labels[:-1], alone) and alone.max() > 100
    truth = np.where(clean[:, 0] < 5e5 + 20, 2, 6)
    expected = scansion.evaluation.segmentation_error(clean, alone, truth, cell=1.0)
    with pytest.warns(UserWarning, match="at 0, 0, 0.*left out"):
        error = scansion.evaluation.segmentation_error(strayed, np.append(alone, 0), np.append(truth, 6), cell=1.0)
    assert error == expected and 0 <= error["error"] < 1
    near, _ = scansion.neighbours.knn(strayed, 4)
    assert len(near) == 2001 and np.array_equal(near[:-1], scansion.neighbours.knn(clean, 4)[0])


def test_units_and_systems_are_kept_or_their_loss_is_told(tmp_path, recwarn):
    def losses(name, cloud):
        recwarn.clear()
        scansion.write(tmp_path / name, cloud)
        return [str(warning.message) for warning in recwarn]

    feet = scansion.PointCloud(np.eye(3) * 100, metres_per_unit=0.3048)
    for name in ("a.laz", "a.npz"):
        assert losses(name, feet) == []
        assert scansion.read(tmp_path / name).metres_per_unit == 0.3048
    assert feet.crs is None
    assert "not kept: the unit of 0.3048 m" in losses("a.ply", feet)[0]
    system = scansion.PointCloud(feet.xyz, crs="EPSG:2154")
    assert losses("b.laz", system) == [] and losses("b.labels", scansion.PointCloud(system, Classification=[2, 2, 2])) == []
    assert "the coordinate reference system" in losses("d.txt", system)[0]
    system.metres_per_unit = 0.3048
    assert "the unit of 0.3048 m" in losses("b.laz", system)[0]
    assert losses("c.ply", scansion.PointCloud(feet.xyz, metres_per_unit=1.0)) == []


def test_the_unit_of_a_las_file_survives_and_lost_records_are_told(tmp_path, data):
    cloud = scansion.read(data / "hostile" / "PDAL__autzen__autzen-thin-srs.las")
    with pytest.warns(UserWarning, match="not kept: record liblas 2112; rewrite keeps"):
        scansion.write(tmp_path / "a.laz", cloud)
    assert scansion.info(tmp_path / "a.laz")["metres_per_unit"] == cloud.metres_per_unit == 0.3048
    laspy = pytest.importorskip("laspy")
    las = laspy.read(data / "hostile" / "PDAL__autzen__autzen-thin-srs.las")
    assert scansion.PointCloud.from_laspy(las).metres_per_unit == 0.3048
    cloud.to_laspy().write(tmp_path / "b.las")
    assert scansion.PointCloud.from_laspy(laspy.read(tmp_path / "b.las")).metres_per_unit == 0.3048


def test_a_name_is_not_a_list_of_columns(tmp_path):
    scansion.write(tmp_path / "a.laz", scansion.PointCloud(np.eye(3), Intensity=np.array([1, 2, 3], np.uint16)))
    for read in (scansion.read, scansion.blocks):
        with pytest.raises(TypeError, match=r"columns: found 'Intensity', expected a list"):
            read(tmp_path / "a.laz", columns="Intensity")
    assert scansion.read(tmp_path / "a.laz", columns=["Intensity"]).columns == ["Intensity"]


def test_rewritten_dimensions_are_neither_fields_nor_axes_in_disguise(tmp_path):
    heights = np.array([1.0, 2.0, 3.0])
    scansion.write(tmp_path / "a.laz", scansion.PointCloud(np.eye(3), Intensity=np.ones(3, np.uint16), Height=heights))
    for name, found in [("intensity", "Intensity"), ("return_number", "ReturnNumber"), ("X", "X"), ("y", "y")]:
        with pytest.raises(ValueError, match=f"found {found}, "):
            scansion.rewrite(tmp_path / "a.laz", tmp_path / "b.laz", dimensions={name: [7, 8, 9]})
    scansion.rewrite(tmp_path / "a.laz", tmp_path / "b.laz", dimensions={"height": heights + 1, "New": heights})
    found = scansion.read(tmp_path / "b.laz")
    assert found["Height"].tolist() == [2, 3, 4] and found.columns[-2:] == ["Height", "New"]
    for name in ("a.ply", "a.txt"):
        scansion.write(tmp_path / name, scansion.PointCloud(np.eye(3), Height=heights))
        scansion.rewrite(tmp_path / name, tmp_path / name, dimensions={"height": heights + 1})
        assert scansion.read(tmp_path / name)["Height"].tolist() == [2, 3, 4]
        assert scansion.read(tmp_path / name).columns == ["Height"]


@pytest.mark.parametrize("name", ["a.las", "a.laz", "a.ply", "a.pcd", "a.npz", "a.csv"])
def test_columns_that_a_file_does_not_have_are_named(tmp_path, name):
    cloud = scansion.PointCloud(np.eye(3), Intensity=np.array([1, 2, 3], np.uint16), Height=np.ones(3))
    scansion.write(tmp_path / name, cloud)
    for read in (scansion.read, lambda *given, **named: next(scansion.blocks(*given, **named))):
        with pytest.raises(ValueError, match=r"columns: found 'Nope', 'Higth' \(did you mean 'Height'\?\), .*Intensity.*Height"):
            read(tmp_path / name, columns=["Nope", "Intensity", "Higth"])
        for known in (scansion.info(tmp_path / name)["dimensions"], ["Height", "intensity", "x"]):
            assert {"Intensity", "Height"} <= set(read(tmp_path / name, columns=known).columns)
    scansion.write(tmp_path / name, cloud[:0])
    assert "Height" in scansion.read(tmp_path / name, columns=["Height"])


def test_columns_of_text_are_those_that_were_named(tmp_path):
    (tmp_path / "a.txt").write_text("1 2 3 4 5\n")
    named = {"text_columns": ["x", "y", "z", "quality", "intensity"]}
    assert scansion.read(tmp_path / "a.txt", ["quality"], **named).columns == ["quality"]
    with pytest.raises(ValueError, match="columns: found 'Nope', expected columns of the file: quality, intensity$"):
        scansion.read(tmp_path / "a.txt", ["Nope"], **named)
    (tmp_path / "a.txt").write_text("1 2 3\n")
    with pytest.raises(ValueError, match="it has none$"):
        scansion.read(tmp_path / "a.txt", ["Nope"])


def first_block(path, columns, **named):
    return next(scansion.blocks(path, columns=columns, **named))


@pytest.mark.parametrize("read", [scansion.read, first_block])
def test_columns_of_text_have_the_names_of_the_file_or_ours(tmp_path, read):
    path = tmp_path / "a.csv"
    path.write_text("1 2 3 4 5 6 7\n")
    names = ["x", "y", "z", "r", "g", "b", "label"]
    ours = ["Red", "Green", "Blue", "Classification"]
    assert read(path, names, text_columns=names).columns == read(path, ours, text_columns=names).columns == ours
    names = ["easting", "northing", "height", "r", "My_Value", "b", "label"]
    assert read(path, names, text_columns=names).columns == ["Red", "My_Value", "Blue", "Classification"]
    found = read(path, ["Easting", "myvalue"], text_columns=names)
    assert found.columns == ["My_Value"] and found["my_value"].tolist() == [5]
    with pytest.raises(ValueError, match="columns: found 'elevation' "):
        read(path, ["elevation"], text_columns=names)
    path.write_text("# a note\n\"easting\",northing,height,i,My_Value\n1,2,3,4,5\n")
    assert read(path, ["easting", "i"]).columns == ["Intensity"]
    assert read(path, ["HEIGHT", "myvalue"]).columns == ["My_Value"]
    for absent in ("elevation", "x_2", "easting_2", "i_2"):
        with pytest.raises(ValueError, match=f"columns: found '{absent}'.*: Intensity, My_Value$"):
            read(path, [absent, "i"])


@pytest.mark.parametrize("name", ["label", "r", "nir", "gps_time", "scan_angle_rank", "Synthetic_Flag"])
def test_names_of_other_programs_are_known_in_files(tmp_path, name):
    (tmp_path / "a.csv").write_text(f"x,y,z,{name}\n1,2,3,4\n")
    assert scansion.read(tmp_path / "a.csv", [name]).columns == scansion.read(tmp_path / "a.csv").columns != [name]


@pytest.mark.parametrize("name", ["a.las", "a.laz", "a.ply", "a.pcd", "a.npz", "a.csv"])
@pytest.mark.parametrize("read", [scansion.read, first_block])
def test_capitals_and_underscores_of_columns_do_not_matter(tmp_path, name, read):
    values = {"ScanAngle": np.array([0.0, 6.0, 12.0], np.float32), "Height": np.ones(3), "Red": np.array([1, 2, 3], np.uint16)}
    scansion.write(tmp_path / name, scansion.PointCloud(np.eye(3), **values, Green=values["Red"], Blue=values["Red"]))
    found = read(tmp_path / name, ["scan_angle", "height", "r"])
    assert sorted(found.columns) == ["Height", "Red", "ScanAngle"]
    np.testing.assert_allclose(found["scan_angle"], values["ScanAngle"], atol=0.01)
    assert found["Red"].tolist() == [1, 2, 3]


def test_a_column_comes_without_others_that_its_name_may_mean(tmp_path):
    header = laspy.LasHeader(version="1.4", point_format=7)
    header.add_extra_dims([laspy.ExtraBytesParams("r", "f4"), laspy.ExtraBytesParams("a0", "f4")])
    header.add_extra_dims([laspy.ExtraBytesParams("a", "2u2")])
    las = laspy.LasData(header)
    las.X, las.r, las.a0, las.a = [0, 1], [8, 9], [3, 4], [[5, 6], [7, 8]]
    las.write(tmp_path / "a.las")
    for read in (scansion.read, first_block):
        assert read(tmp_path / "a.las", ["r"])["r"].tolist() == [8, 9]
        for names in (["r"], ["a0"], ["a0_2"], ["a1", "r"]):
            assert sorted(read(tmp_path / "a.las", names).columns) == names
        assert read(tmp_path / "a.las", ["a0_2"])["a0_2"].tolist() == [5, 7]
        with pytest.raises(ValueError, match="found 'a0_3'"):
            read(tmp_path / "a.las", ["a0_3"])
    theirs, ours = scansion.PointCloud.from_laspy(las), scansion.read(tmp_path / "a.las")
    assert theirs.columns[-4:] == ours.columns[-4:] == ["r", "a0", "a0_2", "a1"]
    for name in ours.columns[-4:]:
        np.testing.assert_array_equal(theirs[name], ours[name])


def test_arrays_of_las_are_asked_for_by_their_values(tmp_path):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_extra_dims([laspy.ExtraBytesParams("normal", "3f4"), laspy.ExtraBytesParams("q", "2u1")])
    las = laspy.LasData(header)
    las.X, las.normal, las.q = [0, 1], [[1, 2, 3], [4, 5, 6]], [[7, 8], [9, 10]]
    las.write(tmp_path / "a.las")
    values = "its values are the columns 'normal0', 'normal1', 'normal2'"
    for read in (scansion.read, first_block):
        with pytest.raises(ValueError, match=f"columns: found 'normal' \\({values}\\), expected"):
            read(tmp_path / "a.las", ["normal"])
        with pytest.raises(ValueError, match="found 'q' \\(its values are the columns 'q0', 'q1'\\)"):
            read(tmp_path / "a.las", ["q"])
        assert read(tmp_path / "a.las", ["normal0", "normal2"])["normal2"].tolist() == [3, 6]
    with pytest.raises(KeyError, match=values):
        scansion.read(tmp_path / "a.las")["normal"]


def test_files_without_points_need_no_columns(tmp_path):
    (tmp_path / "a.pts").write_text("0\n")
    assert len(scansion.read(tmp_path / "a.pts", ["Intensity"])) == 0
    assert len(scansion.read(tmp_path / "a.pts", ["quality"], text_columns=["x", "y", "z", "quality"])) == 0
    assert list(scansion.blocks(tmp_path / "a.pts", columns=["Intensity"])) == []


@pytest.mark.parametrize("kind", ["3f4", "2i2", "3f8"])
def test_arrays_of_laspy_are_columns(tmp_path, kind):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_extra_dim(laspy.ExtraBytesParams("normal", kind))
    las = laspy.LasData(header)
    width = int(kind[0])
    las.X, las.normal = np.arange(5), np.arange(5 * width).reshape(5, width)
    las.write(tmp_path / "a.las")
    cloud, ours = scansion.PointCloud.from_laspy(las), scansion.read(tmp_path / "a.las")
    assert cloud.columns[-width:] == [f"normal{i}" for i in range(width)]
    for i in range(width):
        np.testing.assert_array_equal(cloud[f"normal{i}"], np.arange(5) * width + i)
        np.testing.assert_array_equal(ours[f"normal{i}"], cloud[f"normal{i}"])
        assert ours[f"normal{i}"].dtype == cloud[f"normal{i}"].dtype == np.dtype(kind[1:])


def test_rewritten_dimensions_have_names_of_their_own_and_room_in_the_output(tmp_path):
    ones = np.ones(3, np.uint8)
    for name in ("a.laz", "a.npz", "a.ply"):
        scansion.write(tmp_path / name, scansion.PointCloud(np.eye(3), Classification=ones))
        for to in ("b.laz", "b.npz", "b.csv"):
            with pytest.raises(ValueError, match="found Intensity, expected a name that no other dimension"):
                scansion.rewrite(tmp_path / name, tmp_path / to, dimensions={"intensity": ones, "Intensity": ones})
            assert not (tmp_path / to).exists()
        for taken in ("xyz", "crs"):
            with pytest.raises(ValueError, match=f"found {taken}, expected a name that neither"):
                scansion.rewrite(tmp_path / name, tmp_path / "b.npz", dimensions={taken: ones})
            assert not (tmp_path / "b.npz").exists()
        for to in ("b.labels", "b.label"):
            with pytest.raises(ValueError, match="holds classes only, not Own"):
                scansion.rewrite(tmp_path / name, tmp_path / to, dimensions={"Own": ones})
            with pytest.raises(ValueError, match="holds classes only"):
                scansion.filters.filter_file(tmp_path / name, tmp_path / to, classes=[1])
            assert not (tmp_path / to).exists()
        assert scansion.rewrite(tmp_path / name, tmp_path / "c.labels", ones + 1) == ["not kept: all but the classes"]
