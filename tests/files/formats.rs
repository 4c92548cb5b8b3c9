//! Files that other programs wrote, compared with what other readers read from them.

use scansion_core::cloud::Cloud;
use scansion_core::io::{self, ReadOptions};
use scansion_core::parallel::Monitor;
use scansion_tests::data;
use std::path::PathBuf;

/// Sums of columns.
type Expected = &'static [(&'static str, f64)];

/// A folder of the real data.
fn folder(name: &str) -> Option<PathBuf> {
    data().map(|d| d.join(name))
}

/// Sums of the finite values of an axis or column.
fn sum(cloud: &Cloud, name: &str) -> f64 {
    let value = |i: usize| match ["x", "y", "z"].iter().position(|a| *a == name) {
        Some(a) => cloud.xyz(i)[a],
        None => cloud.column(name).unwrap_or_else(|| panic!("no {name}")).values.get(i),
    };
    (0..cloud.len()).map(value).filter(|v| v.is_finite()).sum()
}

fn check(cloud: &Cloud, expected: &[(&str, f64)]) {
    for (name, value) in expected {
        let found = sum(cloud, name);
        assert!((found - value).abs() <= 1e-6 * value.abs().max(1.0), "{name}: {found}, expected {value}");
    }
}

/// Counts and sums as pypcd4 1.5.1 reads them (where it can; the two of version .5 and the tab- and comma-separated ones
/// are summed from their text).
#[test]
fn pcd_files_of_the_point_cloud_library_give_the_values_of_a_peer() {
    let Some(hostile) = folder("hostile") else { return };
    let files: [(&str, usize, Expected); 12] = [
        ("pcl__2d__dilation_binary", 65_536, &[("x", 8_421_376.0), ("y", 8_421_376.0), ("Intensity", 13_048_095.0)]),
        ("pcl__2d__erosion", 65_536, &[("x", 8_421_376.0), ("z", 0.0), ("Intensity", 7_313_541.0)]),
        ("pcl__bun0", 397, &[("x", -11.545135), ("y", 40.753103), ("z", 10.838877), ("curvature", 8.285421)]),
        ("pcl__curve_close", 110, &[("x", 51.5003207), ("y", 55.0), ("z", 0.0)]),
        ("pcl__lamppost", 1771, &[("x", -17_894.468_75), ("y", 131.0625), ("z", -3798.350834)]),
        ("pcl__milk", 13_704, &[("x", -770.3041106), ("y", -1874.0773195), ("z", 10_610.029352)]),
        ("pcl__noisy_slice_displaced", 3782, &[("x", 3780.9182046), ("y", 2821.7020643), ("z", 4847.9989394)]),
        ("pcl__office2_keypoints", 1123, &[("x", -3185.857518), ("z", 1122.5107237), ("Intensity", 534.6424676)]),
        (
            "pcl__pcl_logo",
            12_909,
            &[("y", 1943.2658042), ("Red", 1_761_558.0), ("Green", 2_004_238.0), ("Blue", 1_482_476.0)],
        ),
        ("pcl__sac_plane_test", 3283, &[("x", 3697.339023), ("y", -217.9378376), ("curvature", 36.2602041)]),
        ("pcl__bunny", 397, &[]),
        ("pcl__bun4", 361, &[]),
    ];
    for (name, points, expected) in files {
        let path = hostile.join(name).with_extension("pcd");
        let cloud = io::read(&path).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((cloud.len(), io::inspect(&path).unwrap().points), (points, points as u64), "{name}");
        check(&cloud, expected);
    }
    for name in ["PDAL__pcd__utm17_comma.pcd", "PDAL__pcd__utm17_tab.pcd"] {
        let cloud = io::read(&hostile.join(name)).unwrap();
        assert_eq!((cloud.len(), cloud.xyz(0)), (10, [289_814.15, 4_320_978.61, 170.76]));
    }
    let cloud = io::read(&hostile.join("lasR__extdata__Example.pcd")).unwrap();
    let classes = &cloud.column("Classification").unwrap().values;
    assert_eq!((cloud.len(), cloud.xyz(0), classes.len()), (30, [339_002.88, 5_248_000.5, 975.59], 30));
    assert_eq!(cloud.column("GpsTime").unwrap().values.get(0), 269_347.28);
    for (name, expected) in
        [("PDAL__pcd__missingheader.pcd", "no line `DATA`"), ("pcl__stereo_left.pcd", "there is no x")]
    {
        let message = io::read(&hostile.join(name)).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn organised_frames_keep_their_points_that_are_not_a_number() {
    let Some(folder) = folder("rgbd") else { return };
    let cloud = io::read(&folder.join("pcl_data__learn0.pcd")).unwrap();
    let absent = (0..cloud.len()).filter(|&i| cloud.xyz(i)[2].is_nan()).count();
    assert_eq!((cloud.len(), absent), (307_200, 124_908));
    check(&cloud, &[("x", -9432.5426789), ("z", 155_107.450759), ("Red", 66_005_905.0), ("Blue", 60_963_298.0)]);
    check(&cloud, &[("Classification", 814_473.0)]);
}

/// Sums as pye57 0.4.19 reads them, over all scans.
#[test]
fn e57_files_give_the_values_of_a_peer() {
    let Some(hostile) = folder("hostile") else { return };
    let files: [(&str, usize, Expected); 4] = [
        ("A4", 4, &[("x", -178.207901), ("y", -4.2534), ("z", 0.4261), ("Green", 1020.0), ("Red", 0.0)]),
        ("B2", 2, &[("x", -85.2817993), ("y", 3.9304), ("z", 1.1768), ("Red", 510.0), ("Green", 510.0)]),
        ("A_merged_B", 6, &[("x", -263.4897003), ("y", -0.323), ("z", 1.6029), ("Intensity", 4.0), ("Green", 1530.0)]),
        (
            "A_B_different_dims",
            2,
            &[("x", 167.3718719), ("y", 1075.7387695), ("Intensity", 0.7596483), ("Red", 74.0), ("ScanIndex", 1.0)],
        ),
    ];
    for (name, points, expected) in files {
        let path = hostile.join(format!("PDAL__e57__{name}.e57"));
        let cloud = io::read(&path).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((cloud.len(), io::inspect(&path).unwrap().points), (points, points as u64), "{name}");
        check(&cloud, expected);
    }
}

/// Sums of x, y, z and the classes as numpy reads them.
const SAMP11: [f64; 4] = [19490274071.9375, 205394925512.0, 13538076.1898, 59796.0];

#[test]
fn npz_files_that_numpy_wrote_are_read() {
    let Some(folder) = folder("ground") else { return };
    let cloud = io::read(&folder.join("pcl_data__isprs_samp11.npz")).unwrap();
    check(&cloud, &[("x", SAMP11[0]), ("y", SAMP11[1]), ("z", SAMP11[2]), ("Classification", SAMP11[3])]);
    let chairs = data().unwrap().join("objects/modelnet10_voxels32_chair_monitor.npz");
    assert!(io::read(&chairs).unwrap_err().to_string().contains("chair"));
}

/// A real COPC file: its nodes are its chunks, boxes are filters, a resolution half as coarse is one level more.
#[test]
fn copc_boxes_and_levels_are_parts_of_the_whole() {
    let Some(folder) = folder("scale") else { return };
    let path = folder.join("lone-star.copc.laz");
    let octree = io::inspect(&path).unwrap().octree.unwrap();
    let all = io::read(&path).unwrap();
    assert_eq!((all.len(), octree.points_per_level.iter().sum::<u64>()), (518_862, 518_862));
    let read =
        |bounds, resolution| io::read_with(&path, &ReadOptions { bounds, resolution, ..Default::default() }).unwrap();
    let [low, high] = all.bounds().unwrap();
    assert_eq!(read(Some([low, high]), None), all);
    let middle = [0, 1, 2].map(|a| (low[a] + high[a]) / 2.0);
    for bounds in [[low, middle], [middle, high], [middle, middle]] {
        let inside = |i: &u32| (0..3).all(|a| (bounds[0][a]..=bounds[1][a]).contains(&all.xyz(*i as usize)[a]));
        let indices: Vec<u32> = (0..all.len() as u32).filter(inside).collect();
        assert_eq!(read(Some(bounds), None), all.select(&indices));
    }
    let mut points = 0;
    for (level, n) in octree.points_per_level.iter().enumerate() {
        points += n;
        assert_eq!(read(None, Some(octree.spacing / f64::from(1u32 << level))).len() as u64, points, "level {level}");
    }
    let coarse = read(Some([low, middle]), Some(octree.spacing));
    assert!(!coarse.is_empty() && (coarse.len() as u64) < octree.points_per_level[0]);
}

#[test]
fn text_of_scanners_is_read_and_meshes_are_refused() {
    let Some(hostile) = folder("hostile") else { return };
    let cloud = io::read(&hostile.join("PDAL__pts__test.pts")).unwrap();
    assert_eq!((cloud.len(), cloud.xyz(0)), (19, [3.980972, -2.006119, -0.010086]));
    assert_eq!(cloud.column("Intensity").unwrap().values.get(0), -1035.0);
    assert_eq!(cloud.column("Blue").unwrap().values.get(0), 38.0);
    let message = io::read(&hostile.join("PDAL__pts__bunny_8.pts")).unwrap_err().to_string();
    assert!(message.contains("found 8, allowed 9"), "{message}");
    let cloud = io::read(&hostile.join("PDAL__ptx__1.2-with-color.ptx")).unwrap();
    assert_eq!((cloud.len(), cloud.xyz(0)), (1065, [637_012.24, 849_028.31, 431.66]));
    assert_eq!(cloud.column("Green").unwrap().values.get(0), 77.0);
    let cloud = io::read(&hostile.join("PDAL__ptx__no-color.ptx")).unwrap();
    assert_eq!((cloud.len(), cloud.columns().len()), (15, 1));
    for name in ["assimp__OFF__Cube.off", "assimp__invalid__OutOfMemory.off", "trimesh__ballA.off"] {
        let message = io::read(&hostile.join(name)).unwrap_err().to_string();
        assert!(message.contains("OFF is a mesh"), "{message}");
    }
}

/// Every unusual file gives a cloud or an error within the time limit; reading in blocks gives the same.
#[test]
fn every_odd_file_is_read_or_refused_soon() {
    let Some(hostile) = folder("hostile") else { return };
    let (mut read, mut refused) = (0, 0);
    for entry in std::fs::read_dir(hostile).unwrap() {
        let path = entry.unwrap().path();
        let start = std::time::Instant::now();
        let whole = io::read(&path);
        let blocks = io::blocks(&path, 1000, &ReadOptions::default())
            .and_then(|blocks| blocks.map(|b| b.map(|b| b.len())).sum::<Result<usize, _>>());
        match (&whole, &blocks) {
            (Ok(cloud), Ok(points)) => assert_eq!(cloud.len(), *points, "{}", path.display()),
            (Err(_), Err(_)) => {}
            _ => panic!("{}: {:?} {blocks:?}", path.display(), whole.map(|c| c.len())),
        }
        if whole.is_ok() {
            io::inspect(&path).unwrap();
            read += 1;
        } else {
            refused += 1;
        }
        assert!(start.elapsed().as_secs() < 5, "{}", path.display());
    }
    eprintln!("{read} read, {refused} refused");
    assert!(read > 110);
}

/// Text whose columns are named by a header row, by the caller or only by their number.
#[test]
fn columns_of_text_are_named_and_never_guessed_in_silence() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, text: &str, columns: &[&str]| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let monitor = Monitor::default();
        let text_columns = columns.iter().map(ToString::to_string).collect();
        let options = ReadOptions { text_columns, monitor: monitor.clone(), ..ReadOptions::default() };
        io::read_with(&path, &options).map(|cloud| (cloud, monitor.take_warnings()))
    };
    // Names of surveyors, semicolons and decimal commas.
    let survey = "Easting;Northing;Height;Code\n3450123,50;5712000,25;101,75;6\n3450124,00;5712001,00;-2,5;2\n";
    let (cloud, warnings) = read("survey.csv", survey, &[]).unwrap();
    assert_eq!((cloud.xyz(0), cloud.xyz(1)), ([3_450_123.5, 5_712_000.25, 101.75], [3_450_124.0, 5_712_001.0, -2.5]));
    assert!(cloud.column("Code").is_some() && warnings.is_empty(), "{warnings:?}");
    let (cloud, _) = read("tabs.txt", "1,5\t2,5\t3,5\n4,5\t5,5\t6\n", &[]).unwrap();
    assert_eq!([cloud.xyz(0), cloud.xyz(1)], [[1.5, 2.5, 3.5], [4.5, 5.5, 6.0]]);
    // Without names: a warning with the first line and what it is taken as.
    let (cloud, warnings) = read("bare.xyz", "1 2 3 10 20 30\n", &[]).unwrap();
    assert_eq!(cloud.column("Green").unwrap().values.get(0), 20.0);
    assert!(
        warnings[0].contains("\"1 2 3 10 20 30\"") && warnings[0].contains("x, y, z, Red, Green, Blue"),
        "{warnings:?}"
    );
    assert!(read("plain.xyz", "1 2 3\n", &[]).unwrap().1.is_empty());
    // Names given by the caller, with and without a header row.
    for text in ["7 3 2 1 5\n", "a b c d e\n7 3 2 1 5\n"] {
        let (cloud, warnings) = read("given.xyz", text, &["class", "z", "y", "x", "r"]).unwrap();
        assert_eq!((cloud.len(), cloud.xyz(0), warnings.len()), (1, [1.0, 2.0, 3.0], 0));
        let values = |name: &str| cloud.column(name).unwrap().values.get(0);
        assert_eq!((values("Classification"), values("Red")), (7.0, 5.0));
    }
    let message = |text: &str, columns: &[&str]| read("bad.xyz", text, columns).unwrap_err().to_string();
    let few = message("1 2 3 4\n", &["x", "y", "z"]);
    assert!(few.contains("4 in 1 2 3 4") && few.contains("x, y, z"), "{few}");
    assert!(message("1 2 3\n", &["x", "y", "class"]).contains("easting"));
    assert!(message("1,5 2,5 3,5\n", &[]).contains("semicolons"));
    assert!(message("1 2\n", &[]).contains("2 in 1 2"));
}
