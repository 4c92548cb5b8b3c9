//! Command line tests of units, scales, damaged files and stray points: exit codes, streams and files.

use scansion_core::Cloud;
use scansion_core::cloud::{Coordinates, Values, names};
use scansion_core::io::{self, WriteOptions};
use scansion_tests::street;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

scansion_tests::program!(ends);

/// A street with classes, far east and north, in whole millimetres, followed by these rows.
fn town(strays: &[[f64; 3]]) -> Cloud {
    let street = street(22.0, 5);
    let place = |i: usize| [0, 1, 2].map(|a| ((street.xyz(i)[a] * 1e3).round() + [5e8, 5.2e9, 4e5][a]) / 1e3);
    let rows: Vec<[f64; 3]> = (0..street.len()).map(place).chain(strays.iter().copied()).collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    let classes = street.column(names::CLASSIFICATION).unwrap().values.to_f64();
    let codes = classes.into_iter().map(|c| c as u8).chain(strays.iter().map(|_| 2)).collect();
    cloud.set_column(scansion_core::cloud::Column::new(names::CLASSIFICATION, Values::U8(codes))).unwrap();
    cloud
}

fn save(folder: &Path, name: &str, cloud: &Cloud) {
    io::write(&folder.join(name), cloud, &WriteOptions::default()).unwrap();
}

fn column(folder: &Path, file: &str, name: &str) -> Vec<f64> {
    io::read(&folder.join(file)).unwrap().column(name).unwrap().values.to_f64()
}

/// A LAS file with one record of GeoTIFF keys, made byte by byte (point format 1, version 1.2).
fn with_keys(path: &Path, cloud: &Cloud, keys: &[[u16; 4]]) {
    let entries = [&[[1, 1, 0, keys.len() as u16]], keys].concat().concat();
    let data: Vec<u8> = entries.into_iter().flat_map(u16::to_le_bytes).collect();
    let mut builder = las::Builder::from((1, 2));
    builder.point_format = las::point::Format::new(1).unwrap();
    builder.transforms = las::Vector {
        x: las::Transform { scale: 0.001, offset: 500_000.0 },
        y: las::Transform { scale: 0.001, offset: 5_200_000.0 },
        z: las::Transform { scale: 0.001, offset: 0.0 },
    };
    builder.vlrs.push(las::Vlr {
        user_id: "LASF_Projection".into(),
        record_id: 34735,
        description: String::new(),
        data,
    });
    let mut writer = las::Writer::from_path(path, builder.into_header().unwrap()).unwrap();
    for i in 0..cloud.len() {
        let [x, y, z] = cloud.xyz(i);
        let (gps_time, classification) = (Some(0.0), las::point::Classification::new(2 + 4 * (i % 2) as u8).unwrap());
        writer.write_point(las::Point { x, y, z, gps_time, classification, ..Default::default() }).unwrap();
    }
    writer.close().unwrap();
}

#[test]
fn info_tells_the_unit_of_a_code_of_epsg() {
    let folder = tempfile::tempdir().unwrap();
    let (f, cloud) = (folder.path(), town(&[]));
    for (code, unit) in [
        (2229, "0.3048006096"),
        (2222, "0.3048 m (foot)"),
        (32632, " metre\n"),
        (25832, " metre\n"),
        (2154, " metre\n"),
    ] {
        with_keys(&f.join("a.las"), &cloud, &[[1024, 0, 1, 1], [3072, 0, 1, code]]);
        let (out, _) = ends(f, &["info", "a.las"], 0);
        assert!(out.contains(unit), "{code}: {out}");
    }
    with_keys(&f.join("a.las"), &cloud, &[[1024, 0, 1, 1], [3072, 0, 1, 32632], [4099, 0, 1, 9003]]);
    let (out, _) = ends(f, &["info", "a.las"], 0);
    assert!(out.contains("heights in units of 0.3048"), "{out}");
}

#[test]
fn a_system_without_a_known_unit_is_taken_as_metres_with_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    for (code, told) in [(12345, true), (32632, false)] {
        with_keys(&f.join("a.las"), &town(&[]), &[[1024, 0, 1, 1], [3072, 0, 1, code]]);
        let (_, err) = ends(f, &["classify", "a.las", "-o", "out.npz", "--force", "--overwrite"], 0);
        assert_eq!(err.contains("tells no unit: metres are assumed"), told, "{code}: {err}");
        let (_, err) = ends(f, &["terrain", "a.las", "-o", "out.tif", "--overwrite"], 0);
        assert_eq!(err.contains("tells no unit: metres are assumed"), told, "{code}: {err}");
    }
}

#[test]
fn features_and_pictures_tell_of_stray_points() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = town(&[[0.0; 3]]);
    save(f, "a.npz", &cloud);
    let number = format!("number {} at 0, 0, 0", cloud.len() - 1);
    for rest in [&[][..], &["--optimal"]] {
        let (_, err) = ends(f, &[&["features", "a.npz", "-o", "f.npy", "--overwrite"], rest].concat(), 0);
        assert!(err.contains(&number), "{rest:?}: {err}");
    }
    let (_, err) = ends(f, &["render", "a.npz", "-o", "r.png"], 0);
    assert!(err.contains("far from all others: 1 (the first is at 0, 0, 0)"), "{err}");
}

#[test]
fn a_scale_that_moves_points_is_told_by_every_verb() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    save(f, "a.npz", &town(&[]));
    save(f, "b.laz", &town(&[]));
    for verb in [
        &["convert", "a.npz", "out.laz"][..],
        &["segment", "a.npz", "-o", "out.laz"],
        &["merge", "a.npz", "b.laz", "-o", "out.laz"],
    ] {
        let (_, err) = ends(f, &[verb, &["--scale", "1", "--overwrite"]].concat(), 0);
        assert!(err.contains("X: rounded in"), "{verb:?}: {err}");
    }
}

#[test]
fn degrees_are_refused_where_distances_count_and_pass_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    with_keys(&f.join("a.las"), &town(&[]), &[[1024, 0, 1, 2], [2048, 0, 1, 4326]]);
    let (out, _) = ends(f, &["info", "a.las"], 0);
    assert!(out.contains("EPSG:4326") && out.contains("degrees"), "{out}");
    ends(f, &["convert", "a.las", "b.laz"], 0);
    ends(f, &["diff", "a.las", "b.laz"], 0);
    ends(f, &["merge", "a.las", "b.laz", "c.laz"], 0);
    for refused in [
        &["classify", "a.las", "-o", "out.las"][..],
        &["segment", "a.las", "-o", "out.las"],
        &["segment", "a.las", "-o", "out.las", "--method", "vccs"],
        &["segment", "a.las", "-o", "out.las", "--method", "clusters"],
        &["train", "a.las", "-o", "out.model", "--unlabelled", "9", "--recipe", "clusters"],
        &["train", "a.las", "-o", "out.model", "--unlabelled", "9", "--recipe", "spheres"],
        &["features", "a.las", "-o", "out.npy"],
        &["suggest", "a.las", "-o", "out.csv"],
        &["train", "a.las", "-o", "out.model", "--unlabelled", "9"],
        &["train", "a.las", "-o", "out.model", "--unlabelled", "9", "--weak"],
        &["train", "a.las", "-o", "out.model", "--unlabelled", "9", "--recipe", "objects"],
    ] {
        let (_, err) = ends(f, refused, 4);
        assert!(err.contains("degrees") && err.contains("--unit"), "{refused:?}: {err}");
    }
    ends(f, &["classify", "a.las", "-o", "out.las", "--unit", "1"], 0);
    ends(f, &["features", "a.las", "-o", "out.npy", "--unit", "1", "--only", "Planarity"], 0);
}

#[test]
fn text_in_degrees_keeps_its_places() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut text = String::from("x y z\n");
    for i in 0..1000 {
        writeln!(
            text,
            "{:.8} {:.8} {:.3}",
            2.35 + f64::from(i % 32) * 6e-5,
            48.85 + f64::from(i / 32) * 6e-5,
            f64::from(i % 30)
        )
        .unwrap();
    }
    std::fs::write(f.join("deg.txt"), text).unwrap();
    for out in ["d.laz", "d.las"] {
        ends(f, &["convert", "deg.txt", out], 0);
        let cloud = io::read(&f.join(out)).unwrap();
        let mut places: Vec<[u64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i).map(f64::to_bits)).collect();
        places.sort_unstable();
        places.dedup();
        assert_eq!(places.len(), 1000);
    }
    let (_, err) = ends(f, &["classify", "deg.txt", "-o", "d.laz"], 0);
    assert!(err.contains("look like degrees"), "{err}");
    ends(f, &["convert", "deg.txt", "d.laz", "--scale", "0.001"], 0);
    let Coordinates::Scaled { scale, .. } = io::read(&f.join("d.laz")).unwrap().coordinates().clone() else { panic!() };
    assert_eq!(scale, [0.001; 3]);
    ends(f, &["convert", "d.laz", "e.laz", "--scale", "0.01"], 2);
    ends(f, &["convert", "deg.txt", "d.laz", "--scale", "1,2"], 2);
}

#[test]
fn a_reference_system_by_code_becomes_wkt_in_las() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    for (code, unit) in [("EPSG:25832", "metre"), ("EPSG:2229", "US survey foot")] {
        let mut cloud = town(&[]);
        cloud.crs = Some(code.into());
        save(f, "a.npz", &cloud);
        let (_, err) = ends(f, &["convert", "a.npz", "a.laz"], 0);
        assert!(!err.contains("not kept: the coordinate"), "{err}");
        let info = io::inspect(&f.join("a.laz")).unwrap();
        assert!(info.crs.unwrap().ends_with(&format!("AUTHORITY[\"EPSG\",\"{}\"]]", &code[5..])));
        let (out, _) = ends(f, &["info", "a.laz"], 0);
        assert!(out.contains(unit), "{out}");
    }
}

#[test]
fn what_las_cannot_tell_of_a_system_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    for (crs, metres, told) in [
        ("EPSG:26910+6360", 1.0, ""),
        ("EPSG:26910+5103", 1.0, "the vertical system EPSG:5103 is not kept: it is not in our table"),
        ("EPSG:64000", 1.0, "the reference system EPSG:64000 is not kept: no WKT of it is known"),
        ("EPSG:26910", 0.3048, "not kept: the unit of 0.3048 m; the file tells a reference system in units of 1 m"),
        ("EPSG:4326", 1.0, "not kept: the unit of 1 m; the file tells a reference system in degrees"),
    ] {
        let mut cloud = town(&[]);
        (cloud.crs, cloud.metres_per_unit) = (Some(crs.into()), Some(metres));
        save(f, "a.npz", &cloud);
        let (_, err) = ends(f, &["convert", "a.npz", "a.laz"], 0);
        let warned = err.contains("not kept");
        assert!(warned != told.is_empty() && err.contains(told), "{crs}: {err}");
        std::fs::remove_file(f.join("a.laz")).unwrap();
    }
}

#[test]
fn a_second_vertical_system_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = town(&[]);
    for (crs, advice) in
        [("EPSG:7405+5703", "expected EPSG:7405 alone, or EPSG:27700+5703"), ("EPSG:2154+x", "after the +")]
    {
        cloud.crs = Some(crs.into());
        save(f, "a.npz", &cloud);
        for verb in [
            &["convert", "a.npz", "b.laz"][..],
            &["terrain", "a.npz", "-o", "b.tif"],
            &["classify", "a.npz", "-o", "b.laz"],
        ] {
            let (_, err) = ends(f, verb, 4);
            assert!(err.contains("a.npz") && err.contains(crs) && err.contains(advice), "{err}");
        }
        assert!(!f.join("b.laz").exists() && !f.join("b.tif").exists());
        let (out, _) = ends(f, &["info", "a.npz"], 0);
        assert!(out.contains(advice), "{out}");
    }
    // Of GeoTIFF keys that of heights counts more.
    with_keys(&f.join("a.las"), &cloud, &[[1024, 0, 1, 1], [3072, 0, 1, 7405], [4096, 0, 1, 5703]]);
    let (out, _) = ends(f, &["info", "a.las"], 0);
    assert!(out.contains("EPSG:27700+5703"), "{out}");
}

#[test]
fn grads_and_geocentric_coordinates_are_called_so() {
    let folder = tempfile::tempdir().unwrap();
    let (f, cloud) = (folder.path(), town(&[]));
    with_keys(&f.join("a.las"), &cloud, &[[1024, 0, 1, 2], [2048, 0, 1, 4807]]);
    let (out, _) = ends(f, &["info", "a.las"], 0);
    assert!(out.contains("grads: to be projected"), "{out}");
    let (_, err) = ends(f, &["classify", "a.las", "-o", "out.las"], 4);
    assert!(err.contains("x and y are grads"), "{err}");
    // A system of degrees without a code, and a length that is not that of x and y.
    with_keys(&f.join("a.las"), &cloud, &[[1024, 0, 1, 2], [2048, 0, 1, 32767], [3076, 0, 1, 9001]]);
    let (_, err) = ends(f, &["classify", "a.las", "-o", "out.las"], 4);
    assert!(err.contains("x and y are degrees"), "{err}");
    with_keys(&f.join("a.las"), &cloud, &[[1024, 0, 1, 3], [2048, 0, 1, 4978]]);
    let (out, _) = ends(f, &["info", "a.las"], 0);
    assert!(out.contains("EPSG:4978") && out.contains("z is no height"), "{out}");
    let (_, err) = ends(f, &["features", "a.las", "-o", "out.npy", "--only", "Planarity"], 0);
    assert!(err.contains("z is no height"), "{err}");
}

#[test]
fn points_outside_the_header_are_told_by_every_verb() {
    let folder = tempfile::tempdir().unwrap();
    let (f, cloud) = (folder.path(), town(&[]));
    save(f, "a.las", &cloud);
    save(f, "clean.las", &cloud);
    let mut bytes = std::fs::read(f.join("a.las")).unwrap();
    // The 100th point, 40 m up.
    let at = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize + 30 * 100 + 8;
    let z = i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    bytes[at..at + 4].copy_from_slice(&(z + 40_000).to_le_bytes());
    std::fs::write(f.join("a.las"), bytes).unwrap();
    for verb in [
        &["convert", "a.las", "b.laz"][..],
        &["convert", "a.las", "b.ply"],
        &["merge", "a.las", "clean.las", "c.laz"],
        &["diff", "a.las", "a.las"],
        &["classify", "a.las", "-o", "d.laz"],
        &["segment", "a.las", "-o", "d.laz", "--method", "merge"],
        &["features", "a.las", "-o", "d.npy", "--only", "Planarity"],
        &["train", "a.las", "-o", "d.model", "--set", "forest.trees=2", "--set", "features.pyramid.levels=2"],
        &["evaluate", "a.las", "a.las"],
        &["render", "a.las", "-o", "d.png"],
    ] {
        let (_, err) = ends(f, verb, 0);
        let told = err.matches("1 of ").count();
        assert!(told == 1 && err.contains("outside the box") && err.contains("number 100 "), "{verb:?}: {err}");
    }
}

#[test]
fn a_stray_point_changes_nothing_for_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let clean = town(&[]);
    let n = clean.len();
    save(f, "clean.npz", &clean);
    save(f, "one.npz", &town(&[[0.0; 3]]));
    save(f, "two.npz", &town(&[[0.0; 3], [510_000.0, 5_200_000.0, 400.0]]));
    let begin = Instant::now();
    ends(f, &["classify", "clean.npz", "-o", "clean_out.npz"], 0);
    let usual = begin.elapsed();
    for (name, strays) in [("one", 1), ("two", 2)] {
        let (input, output) = (format!("{name}.npz"), format!("{name}_out.npz"));
        let begin = Instant::now();
        let (_, err) = ends(f, &["classify", &input, "-o", &output], 0);
        assert!(begin.elapsed() < 5 * usual + std::time::Duration::from_secs(1), "{:?} for {usual:?}", begin.elapsed());
        assert!(err.contains("far from all others") && err.contains(&format!("number {n} at 0, 0, 0")), "{err}");
        for column_name in [names::CLASSIFICATION, names::CONFIDENCE, names::ENTROPY] {
            assert_eq!(
                column(f, &output, column_name)[..n],
                column(f, "clean_out.npz", column_name)[..],
                "{column_name}"
            );
        }
        assert_eq!(column(f, &output, names::CLASSIFICATION)[n..], vec![7.0; strays][..]);
        assert_eq!(column(f, &output, names::CONFIDENCE)[n..], vec![0.0; strays][..]);
    }
    for method in [
        "cut-pursuit",
        "felzenszwalb",
        "riemannian",
        "local-graph",
        "slic",
        "vccs",
        "region-growing",
        "octree-region-growing",
    ] {
        ends(f, &["segment", "clean.npz", "-o", "clean_out.npz", "--method", method], 0);
        let (_, err) = ends(f, &["segment", "one.npz", "-o", "one_out.npz", "--method", method], 0);
        assert!(err.contains("far from all others"), "{method}: {err}");
        let found = column(f, "one_out.npz", "ClusterID");
        assert_eq!((&found[..n], found[n]), (&column(f, "clean_out.npz", "ClusterID")[..], 0.0), "{method}");
    }
    ends(f, &["features", "clean.npz", "-o", "clean.npy", "--only", "Planarity"], 0);
    ends(f, &["features", "one.npz", "-o", "one.npy", "--only", "Planarity"], 0);
    let [clean_rows, one_rows] = ["clean.npy", "one.npy"].map(|name| std::fs::read(f.join(name)).unwrap());
    assert_eq!(clean_rows[128..], one_rows[128..clean_rows.len()]);
    for recipe in [
        &["--set", "forest.trees=3", "--set", "features.pyramid.levels=3"][..],
        &["--weak", "--per-class", "30"],
        &["--recipe", "objects", "--set", "forest.trees=3"],
    ] {
        let models = ["clean", "one"].map(|name| {
            let (input, output) = (format!("{name}.npz"), format!("{name}.model"));
            let (_, err) = ends(f, &[&["train", &input, "-o", &output], recipe].concat(), 0);
            assert_eq!(err.contains("far from all others"), name == "one", "{recipe:?}: {err}");
            std::fs::read(f.join(output)).unwrap()
        });
        // The weak recipe may draw other examples: there is one labelled point more.
        assert!(models[0] == models[1] || recipe[0] == "--weak", "{recipe:?}");
    }
}

#[test]
fn two_sites_far_apart_are_both_named() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let one = town(&[]);
    let rows: Vec<[f64; 3]> = (0..one.len()).map(|i| one.xyz(i)).collect();
    let moved = rows.iter().map(|p| [p[0] + 20_000.0, p[1] + 20_000.0, p[2]]);
    save(f, "a.npz", &Cloud::from_rows(&rows.iter().copied().chain(moved).collect::<Vec<_>>()).unwrap());
    let (_, err) = ends(f, &["classify", "a.npz", "-o", "b.npz"], 0);
    assert!(!err.contains("far from all others"), "{err}");
    let codes = column(f, "b.npz", names::CLASSIFICATION);
    assert!(codes.iter().all(|&c| c > 1.0 && c != 7.0));
    ends(f, &["segment", "a.npz", "-o", "b.npz", "--method", "local-graph"], 0);
    let span = rows.iter().map(|p| [p[0] + 3e9, p[1], p[2]]);
    save(f, "c.npz", &Cloud::from_rows(&rows.iter().copied().chain(span).collect::<Vec<_>>()).unwrap());
    let (_, err) = ends(f, &["classify", "c.npz", "-o", "d.npz"], 2);
    assert!(err.contains("from the other end of the cloud") && err.contains("--bounds"), "{err}");
}
