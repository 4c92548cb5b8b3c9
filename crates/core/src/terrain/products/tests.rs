//! Scenes with known terrain, surface and buildings.

use super::*;
use crate::cloud::{Cloud, CodeScheme, Column, MetricCloud, Raster, Values};
use crate::parallel::Monitor;
use crate::random::stream;

const ORIGIN: [f64; 2] = [600_000.0, 5_000_000.0];

/// Height of the tilted plane.
fn plane(x: f64, y: f64) -> f64 {
    250.0 + 0.2 * (x - ORIGIN[0]) - 0.1 * (y - ORIGIN[1])
}

/// A tilted field of 60 m x 40 m, and a box of 16 m x 10 m whose roof is 8 m above its lowest ground; classes 2 and 6.
/// The box leaves a hole in the ground. Two points of noise (18 and 7).
fn village(unit: f64) -> Cloud {
    let mut s = stream(20, 1);
    let mut rows = Vec::new();
    let mut codes = Vec::new();
    for _ in 0..60 * 40 * 8 {
        let (x, y) = (ORIGIN[0] + 60.0 * s.uniform(), ORIGIN[1] + 40.0 * s.uniform());
        let (u, v) = (x - ORIGIN[0], y - ORIGIN[1]);
        let house = (20.0..36.0).contains(&u) && (15.0..25.0).contains(&v);
        rows.push([x, y, if house { plane(x, y) + 8.0 } else { plane(x, y) }]);
        codes.push(if house { 6 } else { 2 });
    }
    rows.extend([[ORIGIN[0] + 5.0, ORIGIN[1] + 5.0, 290.0], [ORIGIN[0] + 50.0, ORIGIN[1] + 5.0, 230.0]]);
    codes.extend([18, 7]);
    let rows: Vec<[f64; 3]> = rows.iter().map(|row| row.map(|v| v / unit)).collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("Classification", Values::U8(codes))).unwrap();
    cloud.scheme = CodeScheme::Asprs;
    cloud.metres_per_unit = Some(unit);
    cloud
}

struct Found {
    terrain: Raster,
    surface: Raster,
    heights: Vec<f32>,
    note: String,
}

fn found(cloud: &Cloud, params: &ProductParams) -> Found {
    let monitor = Monitor::default();
    let scene = MetricCloud::new(cloud, None, &monitor).unwrap();
    let survey = Survey::new(&scene, params, &monitor).unwrap();
    Found {
        terrain: terrain_model(&survey, params, &monitor).unwrap(),
        surface: surface_model(&survey, params.cell, &monitor).unwrap(),
        heights: heights_above_ground(&scene, &survey, params, &monitor).unwrap(),
        note: survey.note,
    }
}

fn centre(raster: &Raster, i: usize) -> [f64; 2] {
    let at = [i % raster.columns(), i / raster.columns()];
    [0, 1].map(|a| raster.origin()[a] + (at[a] as f64 + 0.5) * raster.cell())
}

#[test]
fn a_tilted_plane_with_a_hole_comes_back() {
    for cell in [0.5, 1.0, 3.0] {
        let found = found(&village(1.0), &ProductParams { cell, ..ProductParams::default() });
        let border = |[x, y]: [f64; 2]| {
            let (u, v) = (x - ORIGIN[0], y - ORIGIN[1]);
            u.min(60.0 - u).min(v).min(40.0 - v)
        };
        for (i, &height) in found.terrain.values().iter().enumerate() {
            let at = centre(&found.terrain, i);
            // Coordinates are rounded to f32; outside the triangulation the nearest height is taken.
            let allowed = if border(at) > cell { 1e-3 } else { 0.4 * cell };
            assert!((height - plane(at[0], at[1])).abs() < allowed, "{cell}: {at:?} {height}");
        }
        assert!(found.note.ends_with("of class 2"), "{}", found.note);
    }
}

#[test]
fn the_normalised_surface_is_the_height_of_the_box_and_noise_has_no_part_in_it() {
    let found = found(&village(1.0), &ProductParams::default());
    let heights = normalised(&found.surface, &found.terrain).unwrap();
    for (i, &height) in heights.values().iter().enumerate() {
        let [x, y] = centre(&heights, i);
        let (u, v) = (x - ORIGIN[0], y - ORIGIN[1]);
        if found.surface.values()[i].is_nan() {
            assert!(height.is_nan());
        } else if (21.0..35.0).contains(&u) && (16.0..24.0).contains(&v) {
            // The highest point of a cell lies up to half a cell uphill.
            assert!((8.0 - 0.16..8.0 + 0.16).contains(&height), "{u} {v} {height}");
        } else if !(19.0..37.0).contains(&u) || !(14.0..26.0).contains(&v) {
            assert!((0.0..0.16 + 0.2).contains(&height), "{u} {v} {height}");
        }
    }
    let other = Raster::new([0.0; 2], 1.0, 1, vec![0.0]).unwrap();
    assert!(normalised(&found.surface, &other).is_err());
}

#[test]
fn every_point_has_its_height_above_ground() {
    let cloud = village(1.0);
    let found = found(&cloud, &ProductParams::default());
    for (i, &height) in found.heights.iter().enumerate() {
        let [x, y, z] = cloud.xyz(i);
        let expected = z - plane(x, y);
        // Half a cell of slope at the border of the raster.
        assert!((f64::from(height) - expected).abs() < 0.15, "{i}: {height} {expected}");
    }
    let mut rows: Vec<[f64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i)).collect();
    rows[7][2] = f64::NAN;
    let holed = Cloud::from_rows(&rows).unwrap();
    let params = ProductParams { ground: GroundChoice::Filter, ..ProductParams::default() };
    let monitor = Monitor::default();
    let scene = MetricCloud::new(&holed, None, &monitor).unwrap();
    let survey = Survey::new(&scene, &params, &monitor).unwrap();
    let heights = heights_above_ground(&scene, &survey, &params, &monitor).unwrap();
    assert!(heights[7].is_nan() && heights.len() == rows.len() && !heights[8].is_nan());
    assert!(survey.note.contains("ground filter"), "{}", survey.note);
}

#[test]
fn feet_and_metres_give_the_same_terrain() {
    let params = ProductParams { cell: 0.9144, ..ProductParams::default() };
    let (metres, feet) = (found(&village(1.0), &params), found(&village(0.3048), &params));
    assert_eq!(metres.terrain.columns(), feet.terrain.columns());
    let pairs = metres.terrain.values().iter().zip(feet.terrain.values());
    assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 2e-3));
    let in_feet = feet.terrain.clone().in_unit(0.3048).unwrap();
    assert_eq!(in_feet.cell(), 3.0);
    assert!(pairs.zip(in_feet.values()).all(|((a, _), b)| (a / 0.3048 - b).abs() < 1e-2));
}

#[test]
fn a_tile_of_20_metres_has_20_cells() {
    let rows: Vec<[f64; 3]> = (0..441).map(|i| [f64::from(i % 21), f64::from(i / 21), f64::from(i)]).collect();
    let found = found(&Cloud::from_rows(&rows).unwrap(), &ProductParams::default());
    assert_eq!((found.surface.columns(), found.surface.rows()), (20, 20));
    assert_eq!((found.surface.origin(), found.surface.values()[399]), ([0.0; 2], 440.0));
    let one = Cloud::from_rows(&[[5.0, 7.0, 3.0]]).unwrap();
    let params = ProductParams { ground: GroundChoice::Filter, ..ProductParams::default() };
    assert_eq!(self::found(&one, &params).terrain.values(), [3.0]);
}

#[test]
fn cells_far_from_all_ground_stay_empty() {
    let mut rows: Vec<[f64; 3]> = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20), 1.0]).collect();
    rows.extend((0..400).map(|i| [100.0 + f64::from(i % 20), f64::from(i / 20), 2.0]));
    let cloud = Cloud::from_rows(&rows).unwrap();
    let near = found(&cloud, &ProductParams { reach: 10.0, ground: GroundChoice::Filter, ..ProductParams::default() });
    let empty = |x: f64| near.terrain.values()[near.terrain.cell_of([x, 5.0])].is_nan();
    assert!(!empty(10.5) && !empty(28.5) && empty(31.5) && empty(60.5) && !empty(92.5));
    // Between the sites the ground rises by 1 m in 81 m; cells at their border reach into that.
    assert!(near.heights.iter().all(|h| h.abs() < 0.01));
}

#[test]
fn a_box_has_its_area_and_height() {
    for unit in [1.0, 0.3048] {
        let cloud = village(unit);
        let heights = found(&cloud, &ProductParams::default()).heights;
        let monitor = Monitor::default();
        let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
        let params = FootprintParams::default();
        let found = footprints(&scene, &heights, &params, &monitor).unwrap();
        let [house] = &found[..] else { panic!("{} outlines", found.len()) };
        // Points are 0.35 m apart: the outline lies about half of it inside the walls.
        assert!((160.0 - 52.0 * 0.35..=160.0).contains(&house.area), "{}", house.area);
        assert!((house.height_median - 8.0).abs() < 0.02 && (house.height_max - 8.0).abs() < 0.1, "{house:?}");
        let codes = &cloud.column("Classification").unwrap().values;
        let all = (0..cloud.len()).filter(|&i| codes.get(i) == 6.0).count() as u64;
        assert!(house.points <= all && house.points + 3 >= all, "{} of {all}", house.points);
        assert!(house.rings.len() == 1 && house.rings[0].len() < 12, "{:?}", house.rings);
        assert!(
            house.rings[0]
                .iter()
                .all(|[x, y]| (19.9..36.1).contains(&(x - ORIGIN[0])) && (14.9..25.1).contains(&(y - ORIGIN[1])))
        );
        let large = FootprintParams { min_area: 200.0, ..params.clone() };
        assert!(footprints(&scene, &heights, &large, &monitor).unwrap().is_empty());
        let none = FootprintParams { classes: vec![17], ..params };
        assert!(footprints(&scene, &heights, &none, &monitor).unwrap_err().to_string().contains("class 17"));
        assert!(footprints(&scene, &heights[1..], &FootprintParams::default(), &monitor).is_err());
    }
}

/// The village with 400 points high above the field, which are withheld: half ground, half building.
fn with_withheld() -> Cloud {
    let clean = village(1.0);
    let mut rows: Vec<[f64; 3]> = (0..clean.len()).map(|i| clean.xyz(i)).collect();
    let values = &clean.column("Classification").unwrap().values;
    let mut codes: Vec<u8> = (0..clean.len()).map(|i| values.get(i) as u8).collect();
    let place = |i: u32| [45.0 + 0.25 * f64::from(i % 20), 28.0 + 0.25 * f64::from(i / 20)];
    rows.extend((0..400).map(place).map(|[u, v]| [ORIGIN[0] + u, ORIGIN[1] + v, 285.0]));
    codes.extend([[6; 200], [2; 200]].concat());
    let marks = (0..rows.len()).map(|i| u8::from(i >= clean.len())).collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("Classification", Values::U8(codes))).unwrap();
    cloud.set_column(Column::new("Withheld", Values::U8(marks))).unwrap();
    cloud.scheme = CodeScheme::Asprs;
    cloud
}

#[test]
fn withheld_points_have_no_part_in_models_and_outlines() {
    let (cloud, params, monitor) = (with_withheld(), ProductParams::default(), Monitor::default());
    let (clean, found) = (found(&village(1.0), &params), found(&cloud, &params));
    let text = |raster: &Raster| format!("{:?}", raster.values());
    assert_eq!([&found.terrain, &found.surface].map(text), [&clean.terrain, &clean.surface].map(text));
    assert!(found.note.ends_with("of class 2; 400 withheld points are left out"), "{}", found.note);
    // They have a height, as noise has.
    let last = cloud.len() - 1;
    let [x, y, z] = cloud.xyz(last);
    assert!((f64::from(found.heights[last]) - (z - plane(x, y))).abs() < 0.15);
    let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
    assert_eq!(Survey::of_points(&scene, &params, &monitor).unwrap().note, "400 withheld points are left out");
    assert_eq!(footprints(&scene, &found.heights, &FootprintParams::default(), &monitor).unwrap().len(), 1);
}

#[test]
fn areas_of_outlines_count_after_the_simplification() {
    // 20 m x 10 m with a flat gable of 15 m², which the simplification takes away; and 20 m x 10.25 m.
    let gable = |x: f64| 10.0 + 1.5 * (1.0 - (x - 10.0).abs() / 10.0);
    let mut rows: Vec<[f64; 3]> = Vec::new();
    for (x, y) in (0..81).flat_map(|i| (0..48).map(move |j| (0.25 * f64::from(i), 0.25 * f64::from(j)))) {
        rows.extend((y <= gable(x)).then_some([x, y, 5.0]));
        rows.extend((y <= 10.25).then_some([x + 40.0, y, 5.0]));
    }
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("Classification", Values::U8(vec![6; rows.len()]))).unwrap();
    let monitor = Monitor::default();
    let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
    let areas = |tolerance, min_area| -> Vec<f64> {
        let params = FootprintParams { tolerance, min_area, ..FootprintParams::default() };
        let found = footprints(&scene, &vec![5.0; rows.len()], &params, &monitor).unwrap();
        found.iter().map(|building| building.area).collect()
    };
    let exact = areas(0.0, 10.0);
    assert!((209.0..216.0).contains(&exact[0]) && (exact[1] - 205.0).abs() < 1e-6, "{exact:?}");
    let simple = areas(2.0, 10.0);
    assert!(simple.len() == 2 && (simple[0] - 205.0).abs() < 1e-6 && (simple[1] - 200.0).abs() < 1e-6, "{simple:?}");
    assert_eq!(areas(2.0, 202.0).len(), 1);
}

#[test]
fn a_building_in_a_courtyard_that_is_closed_belongs_to_the_one_around_it() {
    // A roof of 20 m x 20 m, points every 0.5 m. In its courtyard of 6 m x 6 m stands a hut of 2 m x 2 m, 2 m from the walls.
    let far = |i: i32, j: i32| (i - 20).abs().max((j - 20).abs());
    let at = (0..41 * 41).map(|k| [k / 41, k % 41]);
    let kept: Vec<[i32; 2]> = at.filter(|&[i, j]| far(i, j) <= 2 || far(i, j) >= 6).collect();
    let rows: Vec<[f64; 3]> = kept.iter().map(|[i, j]| [f64::from(*i) * 0.5, f64::from(*j) * 0.5, 8.0]).collect();
    let heights: Vec<f32> = kept.iter().map(|&[i, j]| if far(i, j) <= 2 { 3.0 } else { 8.0 }).collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("Classification", Values::U8(vec![6; rows.len()]))).unwrap();
    let monitor = Monitor::default();
    let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
    let found = |min_area: f64| {
        let params = FootprintParams { alpha: Some(0.8), min_area, ..FootprintParams::default() };
        footprints(&scene, &heights, &params, &monitor).unwrap()
    };
    // The courtyard is open: the hut has an outline and its own points.
    let [roof, hut] = &found(1.0)[..] else { panic!("expected a roof and a hut") };
    assert_eq!((roof.rings.len(), hut.rings.len()), (2, 1));
    assert_eq!((hut.points, hut.height_max, roof.points), (25, 3.0, rows.len() as u64 - 25));
    // It is closed: all that stands in it is the roof's, the corners of the hut too.
    let [whole] = &found(50.0)[..] else { panic!("expected a roof") };
    assert_eq!((whole.rings.len(), whole.points), (1, rows.len() as u64));
    assert!((whole.area - 400.0).abs() < 1.0, "{}", whole.area);
}

#[test]
fn sparse_points_get_a_wider_shape() {
    let mut s = stream(20, 2);
    let rows: Vec<[f64; 3]> = (0..900).map(|_| [60.0 * s.uniform(), 60.0 * s.uniform(), 5.0]).collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("Classification", Values::U8(vec![6; 900]))).unwrap();
    let monitor = Monitor::default();
    let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
    let of =
        |alpha| footprints(&scene, &[5.0; 900], &FootprintParams { alpha, ..Default::default() }, &monitor).unwrap();
    // A quarter of a point per m²: 1 m is less than the spacing.
    assert_ne!(of(Some(1.0)).len(), 1);
    let [hall] = &of(None)[..] else { panic!("not one outline") };
    assert!((3200.0..3600.0).contains(&hall.area) && hall.points > 880, "{} {}", hall.area, hall.points);
}

#[test]
fn what_cannot_be_a_terrain_is_refused() {
    let (cloud, monitor) = (village(1.0), Monitor::default());
    let scene = MetricCloud::new(&cloud, None, &monitor).unwrap();
    let said = |params: ProductParams| Survey::new(&scene, &params, &monitor).unwrap_err().to_string();
    let with = |ground| ProductParams { ground, ..ProductParams::default() };
    assert!(said(with(GroundChoice::Classes(vec![9]))).contains("no ground point of class 9"));
    assert!(said(with(GroundChoice::Classes(vec![]))).contains("ground"));
    assert!(said(ProductParams { cell: 0.0, ..ProductParams::default() }).contains("cell"));
    assert!(said(ProductParams { reach: f64::NAN, ..ProductParams::default() }).contains("reach"));
    assert!(said(ProductParams { noise: Some(vec![2, 6, 7, 18]), ..ProductParams::default() }).contains("noise"));
    let empty = Cloud::from_rows(&[]).unwrap();
    let nothing = MetricCloud::new(&empty, None, &monitor).unwrap();
    assert!(Survey::new(&nothing, &ProductParams::default(), &monitor).is_err());
    let odd = FootprintParams { alpha: Some(-1.0), ..FootprintParams::default() };
    assert!(footprints(&scene, &[], &odd, &monitor).is_err());
    let settings: ProductParams = toml::from_str("cell = 2.0\nground = { classes = [2, 9] }\n").unwrap();
    assert_eq!(settings.ground, GroundChoice::Classes(vec![2, 9]));
    assert!(toml::from_str::<ProductParams>("ground = \"filter\"").is_ok());
}
