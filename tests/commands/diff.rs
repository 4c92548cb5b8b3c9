//! Command line tests of `diff`, `convert`, `merge` and `--salvage`: exit codes, streams and files.

use scansion_tests::{demo_scan, street};

scansion_tests::program!(ends);

#[test]
fn classify_changes_only_what_it_says() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    std::fs::copy(demo_scan(), f.join("in.laz")).unwrap();
    ends(f, &["classify", "in.laz", "-o", "out.laz", "--no-extra", "-q"], 0);
    let (out, err) = ends(f, &["diff", "in.laz", "out.laz"], 1);
    assert!(out.starts_with("only Classification in ") && out.contains("the same class"), "{out}");
    assert_eq!(err, "");
    ends(f, &["classify", "in.laz", "-o", "out.las", "-q"], 0);
    let (out, _) = ends(f, &["diff", "in.laz", "out.las", "--format", "json"], 1);
    let found: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(found["same"], false);
    assert_eq!(found["only_in"][1], serde_json::json!(["Confidence", "Entropy"]));
    assert_eq!(found["fields"].as_array().unwrap().len(), 1, "{found}");
    let mut records: Vec<&str> =
        found["records"].as_array().unwrap().iter().map(|r| r["name"].as_str().unwrap()).collect();
    records.sort_unstable();
    let expected = ["LASF_Spec 0", "LASF_Spec 4", "scansion 1"];
    assert_eq!(records, expected, "class names, the descriptors of the new dimensions, what made the classes");
    let (out, _) = ends(f, &["diff", "in.laz", "out.las", "--format", "csv"], 1);
    assert!(out.starts_with("kind,name,points") && out.contains("field,\"Confidence\",,,,absent,present,"), "{out}");
}

#[test]
fn csv_has_what_json_has_of_a_field() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    std::fs::write(f.join("a.csv"), "x,y,z,slope\n0,0,0,nan\n1,0,0,2\n0,1,0,3\n").unwrap();
    std::fs::write(f.join("b.csv"), "x,y,z,slope\n0,0,0,1\n1,0,0,2.5\n0,1,0,3\n").unwrap();
    let (out, _) = ends(f, &["diff", "a.csv", "b.csv", "--format", "csv"], 1);
    let row = |line: &str| line.split(',').map(str::to_string).collect::<Vec<_>>();
    let lines: Vec<Vec<String>> = out.lines().map(row).collect();
    assert_eq!(lines[0].last().unwrap(), "one_sided", "{out}");
    assert!(lines.iter().all(|line| line.len() == lines[0].len()), "{out}");
    assert!(lines.contains(&row("field,\"slope\",2,0,0.5,,,1")), "{out}");
}

#[test]
fn convert_and_merge_keep_what_the_target_holds() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    std::fs::copy(demo_scan(), f.join("in.laz")).unwrap();
    ends(f, &["convert", "in.laz", "out.las"], 0);
    let (out, _) = ends(f, &["diff", "in.laz", "out.las"], 0);
    assert!(out.starts_with("same: "), "{out}");
    ends(f, &["convert", "in.laz", "out.ply"], 0);
    let (out, _) = ends(f, &["diff", "in.laz", "out.ply"], 1);
    assert!(!out.contains("first point"), "no value differs, only their types: {out}");
    let (_, err) = ends(f, &["convert", "in.laz", "part.laz", "--bounds", "1,2,3"], 2);
    assert!(err.contains("4 or 6"), "{err}");
    let mut cloud = scansion_core::io::read(&f.join("in.laz")).unwrap();
    cloud.crs = Some("PROJCS[\"a\"]".into());
    scansion_core::io::write(&f.join("crs.laz"), &cloud, &Default::default()).unwrap();
    let (_, err) = ends(f, &["convert", "crs.laz", "out.ply"], 0);
    assert!(err.contains("reference system"), "{err}");
    ends(f, &["convert", "in.laz", "in.laz"], 2);
    cloud.metres_per_unit = Some(1.0);
    scansion_core::io::write(&f.join("metres.npz"), &cloud, &Default::default()).unwrap();
    cloud.metres_per_unit = Some(0.3048);
    scansion_core::io::write(&f.join("feet.npz"), &cloud, &Default::default()).unwrap();
    let (out, _) = ends(f, &["diff", "metres.npz", "feet.npz"], 1);
    assert!(out.contains("metres per unit") && out.contains("0.3048"), "{out}");
    std::fs::remove_file(f.join("feet.npz")).unwrap();
    (cloud.crs, cloud.metres_per_unit) = (None, Some(0.3048));
    scansion_core::io::write(&f.join("feet.npz"), &cloud, &Default::default()).unwrap();
    ends(f, &["convert", "feet.npz", "-o", "feet.laz"], 0);
    assert_eq!(scansion_core::io::inspect(&f.join("feet.laz")).unwrap().metres_per_unit, Some(0.3048));
    ends(f, &["convert", "feet.npz", "two.laz", "-o", "names.laz"], 2);
    ends(f, &["convert", "in.laz", "out.nonsense"], 2);
    for (name, seed) in [("tile_1.laz", 1), ("tile_2.laz", 2), ("other.laz", 3)] {
        scansion_core::io::write(&f.join(name), &street(12.0, seed), &Default::default()).unwrap();
    }
    ends(f, &["merge", "tile_[12].laz", "all.laz"], 0);
    let count = |name: &str| scansion_core::io::inspect(&f.join(name)).unwrap().points;
    assert_eq!(count("all.laz"), count("tile_1.laz") + count("tile_2.laz"));
    ends(f, &["merge", "none_*.laz", "all2.laz"], 4);
    ends(f, &["merge", "tile_1.laz", "all.laz", "all.laz"], 2);
}

#[test]
fn a_damaged_file_is_refused_or_salvaged_with_a_count() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    scansion_core::io::write(&f.join("a.las"), &street(20.0, 1), &Default::default()).unwrap();
    let bytes = std::fs::read(f.join("a.las")).unwrap();
    std::fs::write(f.join("cut.las"), &bytes[..bytes.len() - 1000]).unwrap();
    let (_, err) = ends(f, &["convert", "cut.las", "out.las"], 4);
    assert!(err.contains("number of points") && !f.join("out.las").exists(), "{err}");
    let (out, _) = ends(f, &["info", "--salvage", "--json", "cut.las"], 0);
    let found: serde_json::Value = serde_json::from_str(&out).unwrap();
    let lost = found[0]["lost"].as_u64().unwrap();
    assert!(lost > 0 && lost < 60, "{found}");
    let (_, err) = ends(f, &["convert", "--salvage", "cut.las", "out.las"], 0);
    assert!(err.contains(&format!("{lost} of ")), "{err}");
    ends(f, &["info", "out.las", "--stats"], 0);
    let (_, err) = ends(f, &["classify", "--salvage", "cut.las", "-o", "named.laz"], 0);
    assert!(err.contains("points are lost"), "{err}");
    // Of this one nothing is left but the header.
    let points = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
    std::fs::write(f.join("header.las"), &bytes[..points]).unwrap();
    let convert = ["convert", "--salvage", "header.las", "none.laz"];
    for arguments in [&convert[..], &["classify", "--salvage", "header.las", "-o", "none.laz"]] {
        let (_, err) = ends(f, arguments, 4);
        assert!(err.contains("none of its") && !f.join("none.laz").exists(), "{err}");
    }
    let read = found[0]["read"].as_u64().unwrap();
    assert_eq!(scansion_core::io::inspect(&f.join("named.laz")).unwrap().points, read);
}

#[test]
fn an_unfinished_output_is_no_input() {
    let folder = tempfile::tempdir().unwrap();
    let f = folder.path();
    std::fs::copy(demo_scan(), f.join(".a.laz.77.partial")).unwrap();
    let (_, err) = ends(f, &["info", ".a.laz.77.partial"], 4);
    assert!(err.contains("never finished"), "{err}");
}
