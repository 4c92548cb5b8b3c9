//! Areas: polygons with holes, from GeoJSON or well-known text.

mod classes;
mod geojson;
mod polygon;
mod wkt;

pub use classes::ClassArea;

use crate::cloud::Cloud;
use crate::cloud::crs::codes_of;
use crate::error::{Error, Result};
use crate::io::open;
use crate::parallel::{Monitor, map_ordered};
use parry2d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry2d_f64::math::Vector;
use parry2d_f64::partitioning::{Bvh, BvhBuildStrategy};
use polygon::{Polygon, Ring};
use serde::Deserialize;
use std::path::Path;
use std::str::FromStr;

/// Points tested at a time.
const PIECE: usize = 1 << 16;

/// Polygons with holes. A position is inside if it is in any of them and not in one of that polygon's holes.
///
/// Of two polygons that share a side, a position on it is inside exactly one: the lower and the left border belong to a
/// polygon, the upper and the right one do not.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "String")]
pub struct Area {
    polygons: Vec<Polygon>,
    tree: Bvh,
    /// EPSG code of the coordinates, if the text has one.
    pub code: Option<u16>,
}

/// Rings of polygons as a text has them.
#[derive(Debug, Default)]
struct Parsed {
    polygons: Vec<Vec<Ring>>,
    code: Option<u16>,
}

impl Area {
    /// Reads GeoJSON or well-known text from a file or a pipe.
    ///
    /// # Errors
    /// If the file cannot be read, or as [`Area::from_str`].
    pub fn read(path: &Path) -> Result<Self> {
        let text = open::text(path, open::MOST_TABLE)?;
        text.parse().map_err(|e| Error::input(format!("{}: {e}", path.display())))
    }

    /// Whether a text is the well-known text of polygons, rather than the name of a file.
    pub fn is_wkt(text: &str) -> bool {
        wkt::polygons_in(text).is_some()
    }

    /// Whether each point of a cloud is inside, by its x and y in the unit of the file. O(log sides) a point, if the
    /// polygons are not folded like a comb.
    ///
    /// # Errors
    /// If the reference systems differ, or the work was cancelled.
    pub fn contains(&self, cloud: &Cloud, monitor: &Monitor) -> Result<Vec<bool>> {
        let inside = self.inside(cloud, monitor)?;
        if !inside.contains(&true) {
            self.warn_if_apart(cloud, monitor)?;
        }
        Ok(inside)
    }

    /// The same without a warning if area and cloud are apart, as one of several tiles may be.
    ///
    /// # Errors
    /// As [`Area::contains`].
    pub fn inside(&self, cloud: &Cloud, monitor: &Monitor) -> Result<Vec<bool>> {
        let own = cloud.crs.as_deref().and_then(|crs| codes_of(crs).horizontal);
        if let (Some(code), Some(own)) = (self.code, own)
            && code != own
        {
            let text = format!("the polygon is in EPSG:{code} and the cloud in EPSG:{own}: project one of them first");
            return Err(Error::input(text));
        }
        monitor.stage("polygon", cloud.len() as u64);
        let parts = map_ordered(cloud.len().div_ceil(PIECE), monitor, |piece| {
            let range = piece * PIECE..((piece + 1) * PIECE).min(cloud.len());
            monitor.advance(range.len() as u64);
            let inside = |i: usize| {
                let [x, y, _] = cloud.xyz(i);
                self.holds([x, y])
            };
            Ok(range.map(inside).collect::<Vec<bool>>())
        })?;
        Ok(parts.concat())
    }

    /// Whether a position is inside; false if it is not finite.
    pub fn holds(&self, at: [f64; 2]) -> bool {
        if !at.iter().all(|v| v.is_finite()) {
            return false;
        }
        let place = Vector::new(at[0], at[1]);
        self.tree.intersect_aabb(&Aabb::new(place, place)).any(|i| self.polygons[i as usize].holds(at))
    }

    /// A warning if the boxes of area and cloud do not meet: the coordinates are probably not of one system.
    fn warn_if_apart(&self, cloud: &Cloud, monitor: &Monitor) -> Result<()> {
        let Some([low, high]) = cloud.bounds_watched(monitor)? else { return Ok(()) };
        let Some(all) = self.polygons.iter().map(|polygon| polygon.bounds).reduce(|a, b| a.merged(&b)) else {
            return Ok(());
        };
        let (mins, maxs) = (all.mins, all.maxs);
        if mins.x > high[0] || maxs.x < low[0] || mins.y > high[1] || maxs.y < low[1] {
            let box_of = |low: [f64; 2], high: [f64; 2]| format!("{low:?} to {high:?}");
            monitor.warn(format!(
                "the polygon ({}) is not where the cloud is ({}): both must have the same reference system",
                box_of([mins.x, mins.y], [maxs.x, maxs.y]),
                box_of([low[0], low[1]], [high[0], high[1]])
            ));
        }
        Ok(())
    }
}

impl FromStr for Area {
    type Err = Error;

    /// From the text of a GeoJSON object (Polygon, MultiPolygon, or features and collections of these), or from
    /// well-known text (POLYGON, MULTIPOLYGON; with z, m and SRID too).
    fn from_str(text: &str) -> Result<Self> {
        let Parsed { polygons, code } = match text.trim_start().starts_with('{') {
            true => geojson::parsed(text)?,
            false => wkt::parsed(text)?,
        };
        let polygons = polygons.into_iter().map(Polygon::new).collect::<Result<Vec<_>>>()?;
        let boxes: Vec<Aabb> = polygons.iter().map(|polygon| polygon.bounds).collect();
        Ok(Self { polygons, tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes), code })
    }
}

impl TryFrom<String> for Area {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn area(text: &str) -> Area {
        text.parse().unwrap()
    }

    /// The winding number of a ring around a position: another method than crossings of a ray.
    fn winds(ring: &[[f64; 2]], at: [f64; 2]) -> bool {
        let angle = |a: [f64; 2], b: [f64; 2]| {
            let (u, v) = ([a[0] - at[0], a[1] - at[1]], [b[0] - at[0], b[1] - at[1]]);
            (u[0] * v[1] - u[1] * v[0]).atan2(u[0] * v[0] + u[1] * v[1])
        };
        let turns: f64 = (0..ring.len()).map(|i| angle(ring[i], ring[(i + 1) % ring.len()])).sum();
        turns.abs() > 3.0
    }

    #[test]
    fn positions_inside_are_those_that_the_border_winds_around() {
        let mut s = stream(2, 9);
        let mut star = |corners: usize, size: f64| -> Vec<[f64; 2]> {
            let radii: Vec<f64> = (0..corners).map(|_| size * (0.4 + 0.6 * s.uniform())).collect();
            let turn = |i: usize| std::f64::consts::TAU * i as f64 / corners as f64;
            (0..corners).map(|i| [5e5 + radii[i] * turn(i).cos(), 5e6 + radii[i] * turn(i).sin()]).collect()
        };
        let (outer, hole) = (star(900, 100.0), star(40, 35.0));
        let list = |ring: &[[f64; 2]]| {
            let corners: Vec<String> = ring.iter().map(|[x, y]| format!("{x} {y}")).collect();
            format!("({})", corners.join(", "))
        };
        let area = area(&format!("POLYGON ({}, {})", list(&outer), list(&hole)));
        let mut inside = 0;
        for _ in 0..20_000 {
            let at = [5e5 + 220.0 * (s.uniform() - 0.5), 5e6 + 220.0 * (s.uniform() - 0.5)];
            let expected = winds(&outer, at) && !winds(&hole, at);
            assert_eq!(area.holds(at), expected, "{at:?}");
            inside += usize::from(expected);
        }
        assert!((5_000..15_000).contains(&inside), "{inside}");
    }

    #[test]
    fn squares_side_by_side_share_no_position_and_leave_none_out() {
        let mut squares = Vec::new();
        for (i, j) in (0..9).map(|n| (n % 3, n / 3)) {
            squares.push(area(&format!("POLYGON(({i} {j},{i} {e},{d} {e},{d} {j},{i} {j}))", d = i + 1, e = j + 1)));
        }
        for n in 0..3600 {
            let at = [f64::from(n % 60) / 20.0, f64::from(n / 60) / 20.0];
            assert_eq!(squares.iter().filter(|square| square.holds(at)).count(), 1, "{at:?}");
        }
        assert!(!squares[8].holds([3.0, 2.5]) && !squares[8].holds([f64::NAN, 2.5]));
    }

    #[test]
    fn polygons_that_overlap_are_one_area() {
        let area = area("MULTIPOLYGON (((0 0, 4 0, 4 4, 0 4)), ((2 2, 6 2, 6 6, 2 6), (3 3, 5 3, 5 5, 3 5)))");
        assert!(area.holds([3.5, 3.5]) && area.holds([1.0, 1.0]) && area.holds([5.5, 5.5]));
        assert!(!area.holds([4.5, 4.5]) && !area.holds([1.0, 5.0]));
    }

    #[test]
    fn an_area_elsewhere_or_of_another_system_is_told_of() {
        let monitor = Monitor::default();
        let mut cloud = Cloud::from_rows(&[[500_000.0, 5e6, 1.0]]).unwrap();
        cloud.crs = Some("EPSG:25832".into());
        let degrees = area("POLYGON((9 45, 10 45, 10 46, 9 46))");
        assert_eq!(degrees.contains(&cloud, &monitor).unwrap(), [false]);
        assert!(monitor.take_warnings()[0].contains("reference system"));
        let near = area("SRID=25832;POLYGON((499999 4999999, 500001 4999999, 500001 5000001, 499999 5000001))");
        assert_eq!(near.contains(&cloud, &monitor).unwrap(), [true]);
        cloud.crs = Some("EPSG:25833".into());
        let message = near.contains(&cloud, &monitor).unwrap_err().to_string();
        assert!(message.contains("EPSG:25832") && message.contains("EPSG:25833"), "{message}");
    }
}
