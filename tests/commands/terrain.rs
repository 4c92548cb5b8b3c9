//! The commands `terrain` and `height`: files, units, and what they refuse.

use scansion_core::Cloud;
use scansion_core::cloud::{Column, Values};
use scansion_core::io::{self, read_ascii_grid};
use scansion_tests::street;

scansion_tests::program!(scansion, done, fails);

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Four houses of 8 m x 10 m in classes 2, 5 and 6, in UTM.
fn houses() -> Cloud {
    let cloud = street(40.0, 3);
    let rows: Vec<[f64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i)).collect();
    let moved: Vec<[f64; 3]> = rows.iter().map(|p| [p[0] + 500_000.0, p[1] + 5_000_000.0, p[2] + 100.0]).collect();
    let mut moved = Cloud::from_rows(&moved).unwrap();
    moved.set_column(cloud.column("Classification").unwrap().clone()).unwrap();
    moved.crs = Some("EPSG:25832".into());
    moved
}

#[test]
fn one_run_makes_all_products_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &houses(), &Default::default()).unwrap();
    let names = ["dtm.tif", "dsm.asc", "chm.tiff", "b.geojson"];
    let arguments = |threads: &'static str| {
        let files = ["-o", names[0], "--dsm", names[1], "--chm", names[2], "--footprints", names[3]];
        [&["terrain", "a.laz", "--format", "json", "-j", threads], &files[..]].concat()
    };
    let report: serde_json::Value = serde_json::from_str(&done(f, &arguments("1"))).unwrap();
    let bytes = || names.map(|name| std::fs::read(f.join(name)).unwrap());
    let one = bytes();
    done(f, &arguments("3"));
    assert!(one == bytes(), "the number of threads changes bytes");
    assert_eq!((&report[0]["columns"], &report[0]["rows"]), (&40.into(), &40.into()));
    assert!(one[0].starts_with(b"II*\0") && one[2].starts_with(b"II*\0"));
    let surface = read_ascii_grid(&f.join("dsm.asc")).unwrap();
    assert_eq!((surface.origin(), surface.columns()), ([500_000.0, 5_000_000.0], 40));
    assert!((surface.bilinear([500_007.0, 5_000_008.0]) - 108.0).abs() < 0.2);
    let found: serde_json::Value = serde_json::from_slice(&one[3]).unwrap();
    assert_eq!(found["crs"]["properties"]["name"], "urn:ogc:def:crs:EPSG::25832");
    let features = found["features"].as_array().unwrap();
    assert_eq!(features.len(), 4, "{features:?}");
    for feature in features {
        let of = |name: &str| feature["properties"][name].as_f64().unwrap();
        assert!((70.0..=80.0).contains(&of("area")) && (of("height_max") - 8.0).abs() < 0.5, "{feature}");
        assert!((of("height_median") - 7.0).abs() < 0.5 && of("points") > 800.0, "{feature}");
    }
    assert!(done(f, &["terrain", "a.laz", "--dsm", "only.tif"]).contains("surface"));
    let filtered = scansion(f, &["terrain", "a.laz", "-o", "f.tif", "--ground-filter"]);
    assert!(text(&filtered.stderr).contains("by the ground filter"), "{}", text(&filtered.stderr));
}

#[test]
fn withheld_points_and_the_system_of_heights_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let mut cloud = houses();
    let marks: Vec<u8> = (0..cloud.len()).map(|i| u8::from(cloud.xyz(i)[2] > 104.0)).collect();
    let count = marks.iter().filter(|&&mark| mark > 0).count();
    cloud.set_column(Column::new("Withheld", Values::U8(marks))).unwrap();
    // NAVD88 in US survey feet; 5103 is a datum, which some files have there.
    for (name, crs) in [("a.las", "EPSG:26910+6360"), ("b.npz", "EPSG:26910+5103")] {
        cloud.crs = Some(crs.into());
        io::write(&f.join(name), &cloud, &Default::default()).unwrap();
    }
    for products in [["-o", "a.tif"], ["--dsm", "a.asc"]] {
        let found = scansion(f, &[&["terrain", "a.las", "--overwrite"], &products[..]].concat());
        let told = text(&found.stderr);
        assert!(told.contains(&format!("{count} withheld points are left out")), "{told}");
    }
    // What is higher than 4 m above the field was left out.
    let surface = read_ascii_grid(&f.join("a.asc")).unwrap();
    assert!(surface.values().iter().any(|z| z.is_finite()));
    assert!(surface.values().iter().all(|z| z.is_nan() || *z <= 104.0));
    assert!(done(f, &["info", "a.las"]).contains("EPSG:6360, unit 0.3048"));
    let report: serde_json::Value = serde_json::from_str(&done(f, &["info", "b.npz", "--json"])).unwrap();
    assert_eq!(report[0]["vertical"], serde_json::json!({"code": 5103, "metres_per_unit": null}));
    let told = text(&scansion(f, &["terrain", "b.npz", "-o", "b.tif"]).stderr);
    assert!(told.contains("EPSG:5103 is not in our table"), "{told}");
}

#[test]
fn heights_are_added_and_nothing_else_changes() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let cloud = houses();
    io::write(&f.join("a.laz"), &cloud, &Default::default()).unwrap();
    done(f, &["height", "a.laz", "-o", "h.laz"]);
    let diff = text(&scansion(f, &["diff", "a.laz", "h.laz"]).stdout);
    let lines: Vec<&str> = diff.lines().skip(1).collect();
    assert_eq!(lines.len(), 3, "{diff}");
    assert!(diff.contains("only in the second: HeightAboveGround") && diff.contains("record length"), "{diff}");
    let read = io::read(&f.join("h.laz")).unwrap();
    let heights = &read.column("HeightAboveGround").unwrap().values;
    let codes = &cloud.column("Classification").unwrap().values;
    for i in 0..cloud.len() {
        let ground = codes.get(i) < 3.0;
        assert!(if ground { heights.get(i).abs() < 0.1 } else { heights.get(i) > -0.2 }, "{i}: {}", heights.get(i));
    }
    assert_eq!(heights.type_name(), "f4");
    assert!(fails(f, &["height", "a.laz", "-o", "a.laz"], 2).contains("--overwrite"));
    done(f, &["height", "a.laz", "-o", "a.laz", "--overwrite"]);
    assert!(std::fs::read(f.join("a.laz")).unwrap() == std::fs::read(f.join("h.laz")).unwrap());
}

#[test]
fn rasters_of_clouds_in_feet_are_in_feet() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let metres = street(40.0, 3);
    let feet: Vec<[f64; 3]> = (0..metres.len()).map(|i| metres.xyz(i).map(|v| v / 0.3048)).collect();
    let mut feet = Cloud::from_rows(&feet).unwrap();
    feet.set_column(metres.column("Classification").unwrap().clone()).unwrap();
    io::write(&f.join("feet.laz"), &feet, &Default::default()).unwrap();
    let arguments = ["--unit", "0.3048", "--cell", "0.9144", "--footprints", "b.geojson"];
    done(f, &[&["terrain", "feet.laz", "-o", "dtm.asc", "--dsm", "dsm.asc"], &arguments[..]].concat());
    let header = std::fs::read_to_string(f.join("dsm.asc")).unwrap();
    assert!(header.contains("xllcorner 0\nyllcorner 0\ncellsize 3\n"), "{}", &header[..100]);
    let surface = read_ascii_grid(&f.join("dsm.asc")).unwrap();
    assert!((surface.bilinear([7.0 / 0.3048, 8.0 / 0.3048]) - 8.0 / 0.3048).abs() < 0.7);
    let found: serde_json::Value = serde_json::from_slice(&std::fs::read(f.join("b.geojson")).unwrap()).unwrap();
    let features = found["features"].as_array().unwrap();
    assert!(features.iter().all(|b| (70.0..=80.0).contains(&b["properties"]["area"].as_f64().unwrap())));
    let corner = |b: &serde_json::Value| b["geometry"]["coordinates"][0][0][0].as_f64().unwrap();
    assert!(features.iter().any(|b| corner(b) > 60.0), "corners are in feet");
    done(f, &["height", "feet.laz", "-o", "h.laz", "--unit", "0.3048"]);
    let read = io::read(&f.join("h.laz")).unwrap();
    let heights = read.column("HeightAboveGround").unwrap().values.to_f64();
    let highest = heights.iter().copied().fold(0.0, f64::max);
    assert!((highest - 8.0 / 0.3048).abs() < 1.5, "{highest}");
}

#[test]
fn height_contours_of_a_slope_in_feet_lie_whole_feet_apart() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let rows: Vec<[f64; 3]> = (0..90 * 60)
        .map(|i| [f64::from(i % 90) * 2.0 + 0.3, f64::from(i / 90) * 2.0 + 0.4, 10.0 + 0.05 * f64::from(i % 90)])
        .collect();
    let mut slope = Cloud::from_rows(&rows).unwrap();
    slope.set_column(Column::new("Classification", Values::U8(vec![2; rows.len()]))).unwrap();
    slope.crs = Some("EPSG:2229".into());
    io::write(&f.join("feet.laz"), &slope, &Default::default()).unwrap();
    let said = done(f, &["terrain", "feet.laz", "--contours", "h.geojson", "--interval", "0.5", "--cell", "0.6096"]);
    assert!(said.contains("8 height contours from 10.50 to 14.00, "), "{said}");
    let drawing = io::read_lines(&f.join("h.geojson")).unwrap();
    assert_eq!(drawing.len(), 8);
    for line in &drawing {
        let height = line[0][2];
        assert!((height * 2.0 - (height * 2.0).round()).abs() < 1e-9);
        assert!(
            line.iter().all(|at| at[2] == height && (10.0 + 0.025 * (at[0] - 0.3) - height).abs() < 0.02),
            "{line:?}"
        );
    }
    let report = done(f, &["terrain", "feet.laz", "--contours", "h.dxf", "--format", "json"]);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!((report[0]["product"].as_str(), report[0]["lines"].as_u64()), (Some("contours"), Some(4)));
    assert!(
        done(f, &["terrain", "feet.laz", "--contours", "h.obj", "--interval", "50"]).contains("no height contours")
    );
    assert!(fails(f, &["terrain", "feet.laz", "--contours", "x.shp"], 2).contains("GeoPackage"));
    assert!(fails(f, &["terrain", "feet.laz", "--contours", "x.dxf", "--interval", "0"], 2).contains("interval"));
    assert!(fails(f, &["terrain", "feet.laz", "--contours", "x.dxf", "--min-length=-1"], 2).contains("min_length"));
}

#[test]
fn tiles_give_the_products_of_their_merged_file() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let whole = houses();
    let (west, east): (Vec<u32>, Vec<u32>) =
        (0..whole.len() as u32).partition(|&i| whole.xyz(i as usize)[0] < 500_017.0);
    for (name, part) in [("tile_1.laz", west), ("tile_2.laz", east)] {
        io::write(&f.join(name), &whole.select(&part), &Default::default()).unwrap();
    }
    done(f, &["merge", "tile_1.laz", "tile_2.laz", "-o", "whole.laz"]);
    let products = |inputs: &str| {
        done(f, &["terrain", inputs, "-o", "t.tif", "--dsm", "s.asc", "--footprints", "b.geojson"]);
        ["t.tif", "s.asc", "b.geojson"].map(|name| std::fs::read(f.join(name)).unwrap())
    };
    assert!(products("whole.laz") == products("tile_*.laz"));
    let mut other = io::read(&f.join("tile_2.laz")).unwrap();
    other.crs = Some("EPSG:25833".into());
    io::write(&f.join("tile_3.laz"), &other, &Default::default()).unwrap();
    assert!(fails(f, &["terrain", "tile_1.laz", "tile_3.laz", "-o", "x.tif"], 4).contains("another reference system"));
}

#[test]
fn what_has_no_terrain_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    io::write(&f.join("a.laz"), &street(6.0, 1), &Default::default()).unwrap();
    io::write(&f.join("empty.las"), &Cloud::from_rows(&[]).unwrap(), &Default::default()).unwrap();
    let mut degrees = Cloud::from_rows(&[[2.35, 48.85, 30.0], [2.36, 48.86, 31.0]]).unwrap();
    degrees.set_column(Column::new("Classification", Values::U8(vec![2, 2]))).unwrap();
    degrees.crs = Some("EPSG:4326".into());
    io::write(&f.join("degrees.las"), &degrees, &Default::default()).unwrap();
    assert!(fails(f, &["terrain", "empty.las", "-o", "x.tif"], 4).contains("no point"));
    assert!(fails(f, &["terrain", "degrees.las", "-o", "x.tif"], 4).contains("degrees"));
    assert!(fails(f, &["height", "degrees.las", "-o", "x.las"], 4).contains("degrees"));
    assert!(fails(f, &["terrain", "a.laz", "-o", "x.png"], 2).contains(".tif"));
    assert!(fails(f, &["terrain", "a.laz", "--footprints", "x.shp"], 2).contains("GeoJSON"));
    assert!(fails(f, &["terrain", "a.laz", "-o", "x.tif", "--ground-classes", "9"], 4).contains("class 9"));
    assert!(
        fails(f, &["terrain", "a.laz", "--footprints", "x.geojson", "--building-classes", "17"], 4)
            .contains("class 17")
    );
    assert!(fails(f, &["terrain", "a.laz", "-o", "x.tif", "--cell", "0"], 2).contains("cell"));
    assert!(fails(f, &["terrain", "a.laz", "-o", "x.tif", "--cell", "1e-6"], 2).contains("larger cell"));
    assert!(fails(f, &["terrain", "a.laz", "-o", "x.tif", "--dsm", "x.tif"], 2).contains("twice"));
    std::fs::copy(f.join("a.laz"), f.join("b.tif")).unwrap();
    assert!(fails(f, &["terrain", "b.tif", "-o", "b.tif"], 2).contains("input"));
    fails(f, &["terrain", "a.laz"], 2);
    fails(f, &["terrain", "a.laz", "-o", "x.tif", "--noise-classes", "many"], 2);
    assert!(!f.join("x.tif").exists() && !f.join("x.geojson").exists());
}

/// A wide heap with a flat top and steep sides on a gentle slope: a window of 18 m would find another ground.
#[test]
fn the_ground_filter_of_the_commands_has_its_own_defaults() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    let inside = |x: f64, y: f64| (x - 30.0).min(74.0 - x).min(y - 30.0).min(74.0 - y);
    let rows: Vec<[f64; 3]> = (0..10_816)
        .map(|i| (f64::from(i % 104), f64::from(i / 104)))
        .map(|(x, y)| [x, y, 0.02 * x + (0.9 * inside(x, y)).clamp(0.0, 9.0)])
        .collect();
    io::write(&f.join("a.laz"), &Cloud::from_rows(&rows).unwrap(), &Default::default()).unwrap();
    let own = scansion_core::terrain::GroundParams::default();
    let numbers = [own.window, own.slope, own.wall].map(|value| value.to_string());
    let given = ["--window", &numbers[0], "--slope", &numbers[1], "--wall", &numbers[2]];
    let grid = |name: &str, more: &[&str]| {
        done(f, &[&["terrain", "a.laz", "-o", name, "--ground-filter"], more].concat());
        std::fs::read(f.join(name)).unwrap()
    };
    let default = grid("a.asc", &[]);
    assert!(default == grid("b.asc", &given));
    assert!(default != grid("c.asc", &["--window", "18"]), "the heap is wider than twice 18 m");
    // A hall wider than the window is found by its walls.
    let hall = |x: f64, y: f64| if (x - 52.0).abs().max((y - 52.0).abs()) < 36.0 { 6.0 } else { 0.0 };
    let rows: Vec<[f64; 3]> =
        (0..10_816).map(|i| (f64::from(i % 104), f64::from(i / 104))).map(|(x, y)| [x, y, hall(x, y)]).collect();
    io::write(&f.join("a.laz"), &Cloud::from_rows(&rows).unwrap(), &Default::default()).unwrap();
    let heights = |name: &str, more: &[&str]| String::from_utf8(grid(name, more)).unwrap();
    assert!(!heights("d.asc", &[]).contains(" 6 ") && heights("e.asc", &["--wall", "0"]).contains(" 6 "));
}

/// The paper reports an F-score above 99.5 % on its data, from many more labels.
#[test]
fn the_ground_of_an_oakland_street_is_found_from_a_hundred_examples() {
    use scansion_core::classification::ForestParams;
    use scansion_core::cloud::Points;
    use scansion_core::features::optimal_features;
    use scansion_core::neighbours::OptimalParams;
    use scansion_core::parallel::Monitor;
    use scansion_core::random::stream;
    use scansion_core::terrain::{RoadExample, road_points};
    let Some(data) = scansion_tests::data() else { return };
    let cloud = io::read(&data.join("oakland/part_14.laz")).unwrap();
    let points = Points::from_cloud(&cloud, 1.0);
    let codes = cloud.column("Classification").unwrap();
    let road: Vec<bool> = points.frame.index.iter().map(|&i| codes.values.get(i as usize) == 2.0).collect();
    let params = OptimalParams { k_step: 10, ..Default::default() };
    let features = optimal_features(&points.positions, &params, &Monitor::default()).unwrap().table;
    let mut random = stream(1, 0);
    let example = |i: usize| RoadExample { descriptors: *features.row(i).first_chunk().unwrap(), road: road[i] };
    let examples: Vec<RoadExample> = (0..100).map(|_| example(random.below(points.len()))).collect();
    let found = road_points(&features, &examples, &ForestParams::breiman(), &Monitor::default()).unwrap();
    let count = |a: bool, b: bool| found.iter().zip(&road).filter(|r| *r == (&a, &b)).count() as f64;
    let score = 2.0 * count(true, true) / (2.0 * count(true, true) + count(true, false) + count(false, true));
    println!("F {score}");
    assert!(score > 0.95, "F {score}");
}
