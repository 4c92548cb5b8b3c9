//! Consistent orientation of normals.

use super::union_find::UnionFind;
use super::{Adjacency, KnnGraphParams, knn_graph, minimum_spanning_tree};
use crate::cloud::{Points, Positions};
use crate::error::{Error, Result};
use crate::features::{Normals, check_neighbours, normals};
use crate::neighbours::{Neighbours, knn};
use crate::parallel::{Monitor, map_watched, watched};
use serde::{Deserialize, Serialize};

/// Number of points between two checks for cancellation.
const LOOK: u64 = 16_384;

/// The side of a surface that its normals point to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Orientation {
    /// Up: enough for terrain and roofs, arbitrary on walls.
    Up,
    /// Towards the sensor, in metres of the cloud's own coordinates.
    Sensor([f64; 3]),
    /// Propagated from the highest point along a minimum spanning tree of the graph of nearest neighbours.
    #[default]
    SpanningTree,
}

/// How the oriented normals of a cloud are found.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalParams {
    /// Neighbours of a point, not counting itself; 2..=32.
    pub neighbours: usize,
    /// The side to which the normals point.
    pub orientation: Orientation,
}

impl Default for NormalParams {
    fn default() -> Self {
        Self { neighbours: 15, orientation: Orientation::Up }
    }
}

impl NormalParams {
    /// Checks the parameters.
    ///
    /// # Errors
    /// If a parameter is outside its range.
    pub fn validate(&self) -> Result<()> {
        check_neighbours(self.neighbours)?;
        self.orientation.validate()
    }

    /// Normal and surface variation of each point: [`normals`] of its nearest neighbours, turned to one side by
    /// [`Orientation::orient`].
    ///
    /// # Errors
    /// As [`normals`] and [`Orientation::orient`].
    pub fn find(&self, points: &Points, monitor: &Monitor) -> Result<Normals> {
        let near = knn(&points.positions, self.neighbours, monitor)?;
        let mut found = normals(&points.positions, &near, monitor)?;
        self.orientation.orient(points, &near, &mut found.directions, monitor)?;
        Ok(found)
    }
}

impl Orientation {
    /// Checks the position of the sensor.
    ///
    /// # Errors
    /// If it is not finite.
    pub fn validate(&self) -> Result<()> {
        match self {
            Orientation::Sensor(at) if at.iter().any(|c| !c.is_finite()) => {
                Err(Error::parameter("orientation", format!("{at:?}"), "up, spanning-tree or a finite position"))
            }
            _ => Ok(()),
        }
    }

    /// Flips normals so that they point to one side; only signs change.
    ///
    /// `SpanningTree`: H. Hoppe et al., *Surface reconstruction from unorganized points*, SIGGRAPH 1992, section 3.3: the
    /// minimum spanning tree of the graph of nearest neighbours with weights 1 − |n_i · n_j|; the normal of the highest
    /// point is turned up, every other one to the side of its parent in the tree. Each connected component has a highest
    /// point of its own. O(n k log n); memory about 30 bytes a neighbour.
    ///
    /// # Errors
    /// If the numbers of points, neighbours and normals differ, the sensor is not finite, or the work was cancelled.
    pub fn orient(
        &self,
        points: &Points,
        neighbours: &Neighbours,
        directions: &mut [[f32; 3]],
        monitor: &Monitor,
    ) -> Result<()> {
        if directions.len() != points.len() {
            let (normals, n) = (directions.len(), points.len());
            return Err(Error::input(format!("{normals} normals for {n} points")));
        }
        self.validate()?;
        match self {
            Orientation::Up => {
                directions.iter_mut().filter(|n| n[2] < 0.0).for_each(flip);
                monitor.check()
            }
            Orientation::Sensor(at) => {
                towards(points, directions, *at);
                monitor.check()
            }
            Orientation::SpanningTree => propagate(&points.positions, neighbours, directions, monitor),
        }
    }
}

fn flip(normal: &mut [f32; 3]) {
    *normal = normal.map(|c| -c);
}

fn towards(points: &Points, directions: &mut [[f32; 3]], sensor: [f64; 3]) {
    let [x, y, z] = [0, 1, 2].map(|a| sensor[a] - points.frame.origin[a]);
    for (i, normal) in directions.iter_mut().enumerate() {
        let at = points.positions.xyz(i).map(f64::from);
        let sight = [x - at[0], y - at[1], z - at[2]];
        if (0..3).map(|a| sight[a] * f64::from(normal[a])).sum::<f64>() < 0.0 {
            flip(normal);
        }
    }
}

fn propagate(
    points: &Positions,
    neighbours: &Neighbours,
    directions: &mut [[f32; 3]],
    monitor: &Monitor,
) -> Result<()> {
    monitor.stage("orientation", points.len() as u64);
    let graph = knn_graph(points.len(), neighbours, &KnnGraphParams::default(), monitor)?;
    let mut weights = Vec::with_capacity(graph.edges().len());
    for piece in watched(graph.edges().len(), monitor) {
        let turn = |&[a, b]: &[u32; 2]| (1.0 - dot(directions[a as usize], directions[b as usize]).abs()).max(0.0);
        weights.extend(graph.edges()[piece?].iter().map(turn));
    }
    let graph = graph.with_weights(weights)?;
    let tree = minimum_spanning_tree(&graph, monitor)?;
    let pairs: Vec<[u32; 2]> = map_watched(tree.len(), monitor, |i| graph.edges()[tree[i] as usize])?;
    drop((tree, graph));
    let roots = highest(&pairs, points, monitor)?;
    let adjacency = Adjacency::new(points.len(), &pairs, monitor)?;
    spread(&adjacency, &roots, directions, monitor)
}

/// The highest point of each component of a forest, the first of equal ones.
fn highest(forest: &[[u32; 2]], points: &Positions, monitor: &Monitor) -> Result<Vec<u32>> {
    const NONE: u32 = u32::MAX;
    let mut components = UnionFind::new(points.len());
    for some in watched(forest.len(), monitor) {
        forest[some?].iter().for_each(|&[a, b]| _ = components.unite(a, b));
    }
    let mut top = vec![NONE; points.len()];
    for some in watched(points.len(), monitor) {
        for i in some? {
            let best = &mut top[components.root(i as u32) as usize];
            if *best == NONE || points.z[i].total_cmp(&points.z[*best as usize]).is_gt() {
                *best = i as u32;
            }
        }
    }
    top.retain(|&i| i != NONE);
    Ok(top)
}

/// Propagates the signs from the roots, depth first.
fn spread(tree: &Adjacency, roots: &[u32], directions: &mut [[f32; 3]], monitor: &Monitor) -> Result<()> {
    let mut seen = vec![false; directions.len()];
    let (mut stack, mut done) = (Vec::new(), 0);
    for &root in roots {
        if directions[root as usize][2] < 0.0 {
            flip(&mut directions[root as usize]);
        }
        seen[root as usize] = true;
        stack.push(root);
        while let Some(node) = stack.pop() {
            let normal = directions[node as usize];
            for (next, _) in tree.of(node as usize) {
                if !std::mem::replace(&mut seen[next as usize], true) {
                    if dot(directions[next as usize], normal) < 0.0 {
                        flip(&mut directions[next as usize]);
                    }
                    stack.push(next);
                }
            }
            done += 1;
            if done % LOOK == 0 {
                monitor.check()?;
                monitor.advance(LOOK);
            }
        }
    }
    Ok(())
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

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
        let params = NormalParams { neighbours: 10, orientation: orientation.clone() };
        let directions = params.find(&points, &Monitor::default()).unwrap().directions;
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
    fn pieces_that_do_not_touch_each_have_a_highest_point() {
        // Two squares side by side, the second upside down; 1 and 5 are the highest.
        let rows =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 2.0], [1.0, 1.0, 1.0], [9.0, 0.0, 3.0], [9.0, 1.0, 3.0], [9.5, 0.0, 5.0]];
        let points = Points::from_cloud(&Cloud::from_rows(&rows).unwrap(), 1.0);
        let forest = [[0, 1], [1, 2], [3, 4], [4, 5]];
        assert_eq!(highest(&forest, &points.positions, &Monitor::default()).unwrap(), [1, 5]);
        let near = knn(&points.positions, 2, &Monitor::default()).unwrap();
        let mut directions = vec![[0.0, 0.6, -0.8]; 6];
        directions[2] = [0.0, -0.6, 0.8];
        Orientation::SpanningTree.orient(&points, &near, &mut directions, &Monitor::default()).unwrap();
        assert_eq!(directions, [[0.0, -0.6, 0.8]; 6]);
    }

    #[test]
    fn a_cancelled_orientation_stops() {
        let (points, _) = ball();
        let near = knn(&points.positions, 10, &Monitor::default()).unwrap();
        let monitor = Monitor::default();
        monitor.cancel();
        for orientation in [Orientation::SpanningTree, Orientation::Up, Orientation::Sensor([0.0; 3])] {
            let found = orientation.orient(&points, &near, &mut vec![[0.0, 0.0, 1.0]; points.len()], &monitor);
            assert!(matches!(found, Err(Error::Interrupted)));
        }
    }

    #[test]
    fn a_sensor_nowhere_and_missing_normals_are_refused() {
        let (points, _) = ball();
        let monitor = Monitor::default();
        let near = knn(&points.positions, 10, &monitor).unwrap();
        let mut directions = vec![[0.0, 0.0, 1.0]; points.len()];
        let nowhere = Orientation::Sensor([f64::NAN, 0.0, 0.0]);
        assert!(nowhere.orient(&points, &near, &mut directions, &monitor).is_err());
        assert!(Orientation::Up.orient(&points, &near, &mut directions[1..], &monitor).is_err());
    }
}
