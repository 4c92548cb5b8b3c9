use super::geometry::{Form, Patch, between, cross, dot, length, sub, unit};
use super::scanner::Echo;
use super::world::{Block, Frame};
use super::*;

const KINDS: [SceneKind; 4] = [SceneKind::Urban, SceneKind::Mobile, SceneKind::Indoor, SceneKind::Airborne];

fn small(kind: SceneKind, seed: u64) -> SceneParams {
    let extent = if kind == SceneKind::Indoor { 6.0 } else { 30.0 };
    SceneParams { seed, rays: 60_000, extent, ..SceneParams::of(kind) }
}

/// Points of tripods in a world, without mixed pixels.
fn scanned(world: World, at: Vec<Vector>, noise: f64) -> Vec<Echo> {
    let params = SceneParams { noise, noise_per_metre: 0.0, mixed_pixels: 0.0, rays: 200_000, ..Default::default() };
    let pattern = Pattern::tripods(at, params.rays);
    let (tree, classes) = (Tree::new(world.patches), world.classes);
    Scan { tree: &tree, classes: &classes, pattern: &pattern, params: &params }.run(&Monitor::default()).unwrap()
}

fn plate(world: &mut World, distance: f64, half: f64) -> u32 {
    let surface = world.surface(classes::BUILDING);
    let corner = |y: f64, z: f64| [distance, y * half, z * half];
    world.polygon(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], surface);
    surface
}

#[test]
fn rays_end_at_the_analytic_distance_of_a_box() {
    let mut world = World::default();
    let block = Block { low: [-3.0, -2.0, -1.0], high: [3.0, 2.0, 1.5], class: 6, open: [false; 2] };
    block.build(&mut world, &Frame::new([0.0; 3], 0.0));
    assert_eq!((world.edges.len(), world.classes.len()), (12, 6));
    let echoes = scanned(world, vec![[0.0; 3]], 0.0);
    assert!(echoes.len() > 190_000);
    for Echo { measured: [x, y, z], .. } in echoes {
        let sides = [x.abs() - 3.0, y.abs() - 2.0, if z > 0.0 { z - 1.5 } else { -1.0 - z }];
        assert!(sides.into_iter().fold(f64::MIN, f64::max).abs() < 1e-9);
    }
}

#[test]
fn ranges_have_the_noise_that_is_asked_for_and_nothing_lies_behind_a_wall() {
    let mut world = World::default();
    let front = plate(&mut world, 5.0, 2.0);
    plate(&mut world, 8.0, 3.1);
    let echoes = scanned(world, vec![[0.0; 3]], 0.02);
    assert!(echoes.len() > 1000 && echoes.iter().all(|echo| echo.surface == Some(front)));
    let errors: Vec<f64> = echoes.iter().map(|echo| length(echo.measured) - length(echo.met)).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let deviation = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / errors.len() as f64).sqrt();
    assert!(mean.abs() < 0.001 && (deviation - 0.02).abs() < 0.001, "{mean} {deviation}");
}

#[test]
fn points_become_fewer_with_the_square_of_the_distance() {
    let count = |distance: f64| {
        let mut world = World::default();
        plate(&mut world, distance, 0.6);
        scanned(world, vec![[0.0; 3]], 0.0).len() as f64
    };
    let [near, middle, far] = [4.0, 8.0, 16.0].map(count);
    assert!((near / middle - 4.0).abs() < 0.35 && (middle / far - 4.0).abs() < 0.5, "{near} {middle} {far}");
}

#[test]
fn mixed_pixels_lie_between_the_two_surfaces() {
    let mut params =
        SceneParams { mixed_pixels: 0.5, noise: 0.0, noise_per_metre: 0.0, rays: 200_000, ..Default::default() };
    let mut world = World::default();
    plate(&mut world, 3.0, 0.5);
    plate(&mut world, 6.0, 4.0);
    let (tree, classes) = (Tree::new(world.patches), world.classes);
    let pattern = Pattern::tripods(vec![[0.0; 3]], params.rays);
    let run = |params: &SceneParams| {
        Scan { tree: &tree, classes: &classes, pattern: &pattern, params }.run(&Monitor::default()).unwrap()
    };
    let mixed: Vec<Echo> = run(&params).into_iter().filter(|echo| echo.surface.is_none()).collect();
    assert!(mixed.len() > 30, "{}", mixed.len());
    assert!(mixed.iter().all(|echo| (2.99..6.01).contains(&echo.measured[0])));
    assert!(mixed.iter().filter(|echo| (3.2..5.8).contains(&echo.measured[0])).count() > mixed.len() / 2);
    params.mixed_pixels = 0.0;
    assert!(run(&params).iter().all(|echo| echo.surface.is_some()));
}

/// Whether a patch of the surface contains a place, up to a millimetre of distance and a centimetre beyond its sides.
fn contains(patch: &Patch, at: Vector) -> bool {
    let [u, v] = patch.sides;
    let (normal, from) = (cross(u, v), sub(at, patch.corner));
    let square = dot(normal, normal);
    let place = [dot(cross(from, v), normal) / square, dot(cross(u, from), normal) / square];
    let margin = 0.01 / length(u).min(length(v));
    (dot(from, normal) / square.sqrt()).abs() < 0.003 && patch.form != Form::Disc && patch.covers(place, margin)
}

#[test]
fn every_edge_lies_on_two_surfaces_at_an_angle() {
    for (kind, seed) in KINDS.into_iter().flat_map(|kind| (0..4).map(move |seed| (kind, seed))) {
        let (world, _) = world_of(&small(kind, seed), &Monitor::default()).unwrap();
        let mut of_surface: Vec<Vec<&Patch>> = vec![Vec::new(); world.classes.len()];
        world.patches.iter().for_each(|patch| of_surface[patch.surface as usize].push(patch));
        assert!(world.edges.len() > 300, "{kind:?} {}", world.edges.len());
        for edge in &world.edges {
            let middle = between(edge.ends, 0.5);
            let [a, b] = edge.surfaces.map(|surface| {
                let patch = of_surface[surface as usize].iter().find(|patch| contains(patch, middle));
                let code = world.classes[surface as usize];
                patch
                    .unwrap_or_else(|| panic!("{kind:?} {seed}: {edge:?} is not on its surface of class {code}"))
                    .normal()
            });
            let angle = length(cross(a, b)).atan2(dot(a, b).abs()).to_degrees();
            assert!(angle > 29.9, "{kind:?} {seed}: {edge:?} has {angle} degrees");
        }
    }
}

#[test]
fn equal_seeds_give_equal_scenes_on_any_number_of_threads() {
    for kind in KINDS {
        let on = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| scene(&small(kind, seed), &Monitor::default()).unwrap())
        };
        let one = on(1, 7);
        assert!(one == on(3, 7) && one.positions != on(1, 8).positions);
        assert_eq!(one.codes.len(), one.positions.len());
        assert_eq!(one.edges.len(), one.edge_surfaces.len());
        assert!(
            one.edges.len() > 100 && one.positions.len() > 20_000,
            "{kind:?} {} {}",
            one.edges.len(),
            one.positions.len()
        );
        assert!(one.codes.contains(&classes::BUILDING) && one.codes.contains(&classes::GROUND));
    }
}

#[test]
fn edges_that_count_have_points_beside_them() {
    let params = SceneParams { noise: 0.0, noise_per_metre: 0.0, mixed_pixels: 0.0, ..small(SceneKind::Indoor, 3) };
    let made = scene(&params, &Monitor::default()).unwrap();
    for edge in made.edges.iter().step_by(17) {
        let [a, b] = edge.map(|end| end.map(f64::from));
        let nearest = made.positions.iter().map(|at| {
            let from = sub(at.map(f64::from), a);
            let way = unit(sub(b, a));
            let along = dot(from, way).clamp(0.0, length(sub(b, a)));
            length(sub(from, way.map(|v| v * along)))
        });
        assert!(nearest.fold(f64::MAX, f64::min) < 0.4);
    }
}

#[test]
fn values_outside_their_ranges_and_cancelled_work_are_errors() {
    let fails = |params: SceneParams| scene(&params, &Monitor::default()).is_err();
    assert!(fails(SceneParams { rays: 10, ..Default::default() }));
    assert!(fails(SceneParams { positions: 0, ..Default::default() }));
    assert!(fails(SceneParams { noise: f64::NAN, ..Default::default() }));
    assert!(fails(SceneParams { extent: 1.0, ..Default::default() }));
    for kind in KINDS {
        let least = SceneParams { extent: 4.0, rays: 1000, positions: 4, ..SceneParams::of(kind) };
        assert!(!scene(&least, &Monitor::default()).unwrap().codes.is_empty());
    }
    let monitor = Monitor::default();
    monitor.cancel();
    assert!(matches!(scene(&small(SceneKind::Urban, 0), &monitor), Err(Error::Interrupted)));
}
