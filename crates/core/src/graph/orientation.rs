//! Normals that point to the same side of a surface.

use super::{Graph, KnnGraphParams, knn_graph, minimum_spanning_tree};
use crate::cloud::Points;
use crate::error::{Error, Result};
use crate::neighbours::Neighbours;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// Which of the two sides of a surface its normals point to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Orientation {
    /// Up: enough for terrain and roofs, arbitrary on walls.
    Up,
    /// Towards the sensor, in metres of the cloud's own coordinates.
    Sensor([f64; 3]),
    /// Propagated from the highest point over a spanning tree that crosses as few edges as possible.
    #[default]
    SpanningTree,
}

/// Turns normals so that they point to one side; no direction changes but in sign.
///
/// `SpanningTree`: Hoppe et al. 1992, *Surface reconstruction from unorganized points*, section 3.3: minimum spanning
/// tree of the graph of nearest neighbours with weights 1 − |n_i · n_j|, the normal of the highest point up, every
/// other one by that of its parent. Pieces that the neighbours do not join each have a highest point of their own.
/// O(n k log n).
///
/// # Errors
/// If the numbers of points, neighbours and normals differ, the sensor is not finite, or the work was cancelled.
pub fn orient(
    points: &Points,
    neighbours: &Neighbours,
    directions: &mut [[f32; 3]],
    orientation: &Orientation,
    monitor: &Monitor,
) -> Result<()> {
    if directions.len() != points.len() {
        let (normals, n) = (directions.len(), points.len());
        return Err(Error::input(format!("{normals} normals for {n} points")));
    }
    match orientation {
        Orientation::Up => directions.iter_mut().filter(|n| n[2] < 0.0).for_each(flip),
        Orientation::Sensor(at) => return towards(points, directions, *at),
        Orientation::SpanningTree => return propagate(points, neighbours, directions, monitor),
    }
    Ok(())
}

fn flip(normal: &mut [f32; 3]) {
    *normal = normal.map(|c| -c);
}

fn towards(points: &Points, directions: &mut [[f32; 3]], sensor: [f64; 3]) -> Result<()> {
    if sensor.iter().any(|c| !c.is_finite()) {
        return Err(Error::input(format!("position {sensor:?} of the sensor is not finite")));
    }
    let [x, y, z] = [0, 1, 2].map(|a| sensor[a] - points.origin[a]);
    for (i, normal) in directions.iter_mut().enumerate() {
        let sight = [x - f64::from(points.x[i]), y - f64::from(points.y[i]), z - f64::from(points.z[i])];
        if (0..3).map(|a| sight[a] * f64::from(normal[a])).sum::<f64>() < 0.0 {
            flip(normal);
        }
    }
    Ok(())
}

fn propagate(points: &Points, neighbours: &Neighbours, directions: &mut [[f32; 3]], monitor: &Monitor) -> Result<()> {
    let graph = knn_graph(points.len(), neighbours, &KnnGraphParams::default(), monitor)?;
    let turn = |&[a, b]: &[u32; 2]| (1.0 - dot(directions[a as usize], directions[b as usize]).abs()).max(0.0);
    let weights = graph.edges().iter().map(turn).collect();
    let graph = graph.with_weights(weights)?;
    let pairs: Vec<[u32; 2]> = minimum_spanning_tree(&graph).iter().map(|&e| graph.edges()[e as usize]).collect();
    monitor.check()?;
    spread(&Graph::new(points.len(), &pairs, &vec![1.0; pairs.len()])?, points, directions);
    Ok(())
}

/// Depth first from the highest point of each piece.
fn spread(tree: &Graph, points: &Points, directions: &mut [[f32; 3]]) {
    let adjacency = tree.adjacency();
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_by(|&a, &b| points.z[b as usize].total_cmp(&points.z[a as usize]).then(a.cmp(&b)));
    let mut seen = vec![false; points.len()];
    let mut stack = Vec::new();
    for root in order {
        if std::mem::replace(&mut seen[root as usize], true) {
            continue;
        }
        if directions[root as usize][2] < 0.0 {
            flip(&mut directions[root as usize]);
        }
        stack.push(root);
        while let Some(node) = stack.pop() {
            let normal = directions[node as usize];
            for (next, _) in adjacency.of(node as usize) {
                if !std::mem::replace(&mut seen[next as usize], true) {
                    if dot(directions[next as usize], normal) < 0.0 {
                        flip(&mut directions[next as usize]);
                    }
                    stack.push(next);
                }
            }
        }
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::features::normals;
    use crate::neighbours::knn;

    /// A ball of radius 2 around (3, 3, 10), evenly sampled on a spiral.
    fn ball() -> (Points, Vec<[f64; 3]>) {
        let outward: Vec<[f64; 3]> = (0..2000)
            .map(|i| {
                let z = 1.0 - (f64::from(i) + 0.5) / 1000.0;
                let (angle, r) = (f64::from(i) * 2.399_963, (1.0 - z * z).sqrt());
                [r * angle.cos(), r * angle.sin(), z]
            })
            .collect();
        let rows: Vec<[f64; 3]> =
            outward.iter().map(|n| [3.0 + 2.0 * n[0], 3.0 + 2.0 * n[1], 10.0 + 2.0 * n[2]]).collect();
        (Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0), outward)
    }

    fn outward_share(orientation: &Orientation) -> f64 {
        let (points, outward) = ball();
        let monitor = Monitor::default();
        let near = knn(&points, 10, &monitor).unwrap();
        let mut directions = normals(&points, &near, &monitor).unwrap().directions;
        orient(&points, &near, &mut directions, orientation, &monitor).unwrap();
        let along = |(n, o): &(&[f32; 3], &[f64; 3])| (0..3).map(|a| f64::from(n[a]) * o[a]).sum::<f64>() > 0.0;
        directions.iter().zip(&outward).filter(along).count() as f64 / outward.len() as f64
    }

    #[test]
    fn the_spanning_tree_turns_all_normals_of_a_ball_outward() {
        assert_eq!(outward_share(&Orientation::SpanningTree), 1.0);
    }

    #[test]
    fn a_sensor_inside_a_ball_turns_all_normals_inward() {
        assert_eq!(outward_share(&Orientation::Sensor([3.0, 3.0, 10.0])), 0.0);
    }

    #[test]
    fn up_leaves_half_of_a_ball_inward() {
        assert!((outward_share(&Orientation::Up) - 0.5).abs() < 0.02);
    }

    #[test]
    fn a_sensor_nowhere_and_missing_normals_are_refused() {
        let (points, _) = ball();
        let monitor = Monitor::default();
        let near = knn(&points, 10, &monitor).unwrap();
        let mut directions = vec![[0.0, 0.0, 1.0]; points.len()];
        let nowhere = Orientation::Sensor([f64::NAN, 0.0, 0.0]);
        assert!(orient(&points, &near, &mut directions, &nowhere, &monitor).is_err());
        assert!(orient(&points, &near, &mut directions[1..], &Orientation::Up, &monitor).is_err());
    }
}
