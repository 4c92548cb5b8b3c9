//! Tests of the ground filter on scenes with a known ground.

use super::*;
use crate::cloud::Cloud;
use crate::random::stream;

fn points(rows: &[[f64; 3]]) -> Points {
    Points::from_cloud(&Cloud::from_rows(rows).unwrap(), 1.0)
}

fn ground(rows: &[[f64; 3]]) -> Vec<bool> {
    ground_points(&points(rows), &GroundParams::default(), &Monitor::default()).unwrap()
}

#[test]
fn a_house_and_a_tree_on_a_hill_are_not_ground_but_the_hill_is() {
    let hill = |x: f64, y: f64| 0.1 * x + 0.05 * y;
    let mut random = stream(2, 1);
    let mut rows = Vec::new();
    for (x, y) in (0..120).flat_map(|i| (0..120).map(move |j| (f64::from(i) * 0.5, f64::from(j) * 0.5))) {
        let house = (20.0..32.0).contains(&x) && (20.0..30.0).contains(&y);
        let tree = (x - 45.0).hypot(y - 45.0) < 3.0 && random.uniform() < 0.5;
        rows.push([
            x,
            y,
            hill(x, y)
                + if house {
                    6.0
                } else if tree {
                    2.0 + 4.0 * random.uniform()
                } else {
                    0.0
                },
        ]);
    }
    let found = ground(&rows);
    let wrong = found.iter().zip(&rows).filter(|(found, p)| **found != (p[2] - hill(p[0], p[1]) < 0.1));
    assert_eq!(wrong.count(), 0);
}

#[test]
fn a_pit_of_noise_is_not_ground_and_does_not_draw_the_ground_down() {
    let mut rows: Vec<[f64; 3]> = (0..900).map(|i| [f64::from(i % 30), f64::from(i / 30), 0.0]).collect();
    rows.push([15.2, 15.2, -20.0]);
    let found = ground(&rows);
    assert!(!found[900]);
    assert!(found[..900].iter().all(|&ground| ground));
}

#[test]
fn one_point_is_ground_and_none_is_an_error() {
    assert_eq!(ground(&[[1.0, 2.0, 3.0]]), [true]);
    assert!(ground_points(&Points::default(), &GroundParams::default(), &Monitor::default()).is_err());
    let wide = GroundParams { window: f64::INFINITY, ..GroundParams::default() };
    assert!(ground_points(&points(&[[0.0; 3]]), &wide, &Monitor::default()).is_err());
}

/// Points every half metre of a square of this many metres, at this height.
fn scene(edge: i32, height: impl Fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
    let at = |i: i32| [f64::from(i % (2 * edge)) * 0.5, f64::from(i / (2 * edge)) * 0.5];
    (0..4 * edge * edge).map(at).map(|[x, y]| [x, y, height(x, y)]).collect()
}

#[test]
fn a_level_field_and_planes_are_ground_everywhere_and_steep_ones_within_six_metres_of_the_border() {
    for slope in [0.0, 0.1, 0.3, 0.5] {
        let rows = scene(60, |x, y| slope * (0.8 * x + 0.6 * y));
        let found = ground(&rows);
        let inside = |p: &[f64; 3]| slope < 0.5 || (p[0].max(p[1]) < 54.0 && p[0].min(p[1]) >= 6.0);
        assert!(rows.iter().zip(&found).all(|(p, &g)| g || !inside(p)), "slope {slope}");
        assert!(found.iter().filter(|&&g| g).count() as f64 > 0.97 * rows.len() as f64);
    }
}

#[test]
fn a_house_on_a_steep_slope_is_not_ground_but_the_slope_is() {
    let house = |x: f64, y: f64| (20.0..32.0).contains(&x) && (24.0..36.0).contains(&y);
    let rows = scene(60, |x, y| if house(x, y) { 24.0 } else { 0.5 * x });
    // The uppermost metres border on nothing that is higher: openings cut them.
    let found = ground(&rows);
    let inside = rows.iter().zip(&found).filter(|(p, _)| p[0] < 54.0);
    assert_eq!(inside.filter(|(p, g)| **g == house(p[0], p[1])).count(), 0);
}

#[test]
fn the_edges_of_terraces_come_back() {
    // Walls of 1.5 m every 15 m: the upper edges are cut by openings and lie on the ground again.
    let rows = scene(60, |_, y| 1.5 * (y / 15.0).floor());
    let lost = ground(&rows).iter().filter(|&&g| !g).count() as f64 / rows.len() as f64;
    assert!(lost < 0.01, "{lost}");
}

#[test]
fn a_roof_as_wide_as_the_window_is_not_ground() {
    let roof = |x: f64, y: f64| (25.0..75.0).contains(&x) && (25.0..75.0).contains(&y);
    let rows = scene(100, |x, y| if roof(x, y) { 8.0 } else { 0.0 });
    let found = ground(&rows);
    assert!(rows.iter().zip(&found).all(|(p, &g)| g != roof(p[0], p[1])));
    // Half the window: the published parameters take a roof of more than 36 m for ground.
    let published = ground_points(&points(&rows), &GroundParams::published(), &Monitor::default()).unwrap();
    assert!(rows.iter().zip(&published).any(|(p, &g)| g && roof(p[0], p[1])));
}

/// Whether no point of the places is ground, and every other one is.
fn are_the_objects(rows: &[[f64; 3]], object: impl Fn(f64, f64) -> bool) -> bool {
    ground(rows).iter().zip(rows).all(|(&g, p)| g != object(p[0], p[1]))
}

#[test]
fn a_roof_wider_than_the_window_is_not_ground() {
    let inside = |v: f64, [low, high]: [f64; 2]| (low..high).contains(&v);
    let hall = move |x: f64, y: f64| inside(x, [20.0, 120.0]) && inside(y, [30.0, 100.0]);
    let slope = |x: f64| 0.05 * x;
    let on_slope = scene(140, |x, y| slope(x) + if hall(x, y) { 9.0 } else { 0.0 });
    assert!(are_the_objects(&on_slope, hall));
    // Without walls to look for it is ground, as before.
    let plain = GroundParams { wall: 0.0, ..GroundParams::default() };
    let found = ground_points(&points(&on_slope), &plain, &Monitor::default()).unwrap();
    assert!(found.iter().zip(&on_slope).any(|(&g, p)| g && hall(p[0], p[1])));
    // In other cells as well.
    for cell in [0.5, 2.0] {
        let params = GroundParams { cell, ..GroundParams::default() };
        let found = ground_points(&points(&on_slope), &params, &Monitor::default()).unwrap();
        assert!(found.iter().zip(&on_slope).all(|(&g, p)| !(g && hall(p[0], p[1]))), "{cell}");
    }
    // Stairs of 3 m lead up to it; they may be either.
    let stairs = |x: f64, y: f64| inside(x, [10.0, 20.0]) && inside(y, [60.0, 63.0]);
    let height = |x: f64, y: f64| {
        if hall(x, y) {
            3.0
        } else if stairs(x, y) {
            0.3 * (x - 10.0)
        } else {
            0.0
        }
    };
    let with_stairs: Vec<[f64; 3]> = scene(140, height);
    let found = ground(&with_stairs);
    assert!(found.iter().zip(&with_stairs).all(|(&g, p)| stairs(p[0], p[1]) || g != hall(p[0], p[1])));
    // A wide hall on a wider podium.
    let podium = move |x: f64, y: f64| inside(x, [10.0, 132.0]) && inside(y, [10.0, 130.0]);
    let height = |x: f64, y: f64| 5.0 * f64::from(u8::from(podium(x, y)) + u8::from(hall(x, y)));
    assert!(are_the_objects(&scene(190, height), podium));
}

#[test]
fn a_wide_roof_in_a_thin_cloud_is_not_ground() {
    let hall = |x: f64, y: f64| (30.0..110.0).contains(&x) && (30.0..110.0).contains(&y);
    let mut random = stream(11, 3);
    let dense = scene(140, |x, y| 0.02 * y + 0.1 * (0.1 * x).sin() + if hall(x, y) { 8.0 } else { 0.0 });
    // 0.3 points per square metre.
    let rows: Vec<[f64; 3]> = dense.into_iter().filter(|_| random.uniform() < 0.075).collect();
    assert!(are_the_objects(&rows, hall));
}

#[test]
fn plateaus_and_terraces_stay_ground() {
    // A wall from border to border, with 60 m of ground above it.
    let terrace = scene(130, |_, y| if y < 60.0 { 4.0 } else { 0.0 });
    assert!(ground(&terrace).iter().all(|&g| g));
    // A plateau of 90 m between slopes of 0.4.
    let away = |v: f64| ((v - 80.0).abs() - 45.0).max(0.0);
    let plateau = scene(160, |x, y| 20.0 - (0.4 * away(x).max(away(y))).min(12.0));
    let lost = ground(&plateau).iter().filter(|&&g| !g).count();
    assert!(lost * 200 < plateau.len(), "{lost}");
    // A quarry: walls rise around its floor.
    let pit = |v: f64| (35.0..125.0).contains(&v);
    let quarry = scene(160, |x, y| if pit(x) && pit(y) { -10.0 } else { 0.0 });
    let lost = ground(&quarry).iter().filter(|&&g| !g).count();
    assert!(lost * 200 < quarry.len(), "{lost}");
    // Land between two canals, and a block inside a sunken ring road.
    let canal = |y: f64| (90.0..100.0).contains(&y) || (160.0..170.0).contains(&y);
    let canals = scene(260, |_, y| if canal(y) { -3.0 } else { 0.0 });
    assert!(ground(&canals).iter().all(|&g| g));
    let from_middle = |x: f64, y: f64| (x - 130.0).abs().max((y - 130.0).abs());
    let ring = scene(260, |x, y| if (38.0..50.0).contains(&from_middle(x, y)) { -4.0 } else { 0.0 });
    let lost = ground(&ring).iter().filter(|&&g| !g).count();
    assert!(lost * 30 < ring.len(), "{lost}");
    // Ground on three sides of a wide hall that the border of the scan cuts.
    let cut = |x: f64, y: f64| x < 80.0 && (30.0..110.0).contains(&y);
    assert!(are_the_objects(&scene(140, |x, y| if cut(x, y) { 8.0 } else { 0.0 }), cut));
}

#[test]
fn the_ground_does_not_depend_on_threads() {
    let mut random = stream(9, 4);
    let rows = scene(80, |x, y| 0.2 * x + if (x * 0.3).sin() * (y * 0.2).cos() > 0.7 { 4.0 } else { 0.0 });
    let sparse: Vec<[f64; 3]> = rows.into_iter().filter(|_| random.uniform() < 0.2).collect();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ground(&sparse))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn parameters_of_older_recipes_load_and_ranges_are_checked() {
    let old = r#"{"cell":1.0,"slope":0.15,"window":18.0,"threshold":0.5,"scaling":1.25}"#;
    let read: GroundParams = serde_json::from_str(old).unwrap();
    assert_eq!((read.method, read.window), (GroundMethod::Refined, 18.0));
    assert!(serde_json::to_string(&GroundParams::published()).unwrap().contains(r#""method":"morphological""#));
    assert!(GroundParams::published().validate().is_ok());
    assert!(GroundParams { relief: -0.1, ..GroundParams::default() }.validate().is_err());
    assert!(GroundParams { wall: f64::NAN, ..GroundParams::default() }.validate().is_err());
    assert_eq!((read.wall, GroundParams::published().wall), (2.0, 0.0));
}
