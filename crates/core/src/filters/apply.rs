//! All filters of a run, one after the other.

use super::classes::of_classes;
use super::heights::Heights;
use super::{FilterParams, OutlierParams, outliers};
use crate::cloud::{Cloud, MetricCloud};
use crate::error::Result;
use crate::parallel::Monitor;
use serde::Serialize;

/// What a filter did.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Step {
    /// Name of the filter.
    pub filter: &'static str,
    /// Points that it removed, of those that the filters before it left.
    pub removed: u64,
    /// Points that it marked as noise.
    pub marked: u64,
}

/// The points that filters keep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Filtered {
    /// Whether each point is kept.
    pub kept: Vec<bool>,
    /// Whether each point was found to be noise; such points are kept only if they are to be marked.
    pub noise: Vec<bool>,
    /// The filters in the order in which they were applied.
    pub steps: Vec<Step>,
    /// How the ground was found, for the user.
    pub notes: Vec<String>,
}

/// Finds the points of a cloud that all filters keep.
///
/// Each filter works on the points that those before it left, in the order of the fields of [`FilterParams`]; the ground
/// is that of all points but noise. O(n log n) for outliers and heights, else O(n) and O(log sides) a point for polygons.
///
/// # Errors
/// If a parameter is out of range; if points are filtered by class and have none; if outliers or heights are asked for
/// and the coordinates are degrees, or there is no ground; if the polygon has another reference system; or if the work
/// was cancelled.
///
/// ```
/// use scansion_core::{Cloud, filters::{FilterParams, filter}, parallel::Monitor};
/// # fn main() -> scansion_core::Result<()> {
/// let cloud = Cloud::from_rows(&[[1.0, 1.0, 0.0], [5.0, 1.0, 0.0], [1.0, 5.0, 0.0]])?;
/// let polygon = Some("POLYGON ((0 0, 6 0, 6 2, 0 2, 0 0))".parse()?);
/// let found = filter(&cloud, &FilterParams { polygon, ..Default::default() }, &Monitor::default())?;
/// assert_eq!(found.kept, [true, true, false]);
/// # Ok(())
/// # }
/// ```
pub fn filter(cloud: &Cloud, params: &FilterParams, monitor: &Monitor) -> Result<Filtered> {
    params.validate()?;
    let all = vec![true; cloud.len()];
    let mut found = Filtered { kept: all, noise: vec![false; cloud.len()], ..Filtered::default() };
    if params.has_classes() {
        found.keep("classes", &of_classes(cloud, params, monitor)?);
    }
    if !cloud.is_empty() {
        found.remove_noise(cloud, params, monitor)?;
        found.keep_heights(cloud, params, monitor)?;
    }
    if let Some([low, high]) = params.bounds {
        let within = |i: usize| (0..3).all(|a| (low[a]..=high[a]).contains(&cloud.xyz(i)[a]));
        found.keep("bounds", &(0..cloud.len()).map(within).collect::<Vec<bool>>());
    }
    if let Some(area) = &params.polygon {
        let mut inside = area.contains(cloud, monitor)?;
        inside.iter_mut().for_each(|inside| *inside ^= params.outside);
        found.keep("polygon", &inside);
    }
    Ok(found)
}

impl Filtered {
    /// Number of points that are kept.
    pub fn count(&self) -> u64 {
        self.kept.iter().filter(|kept| **kept).count() as u64
    }

    fn remove_noise(&mut self, cloud: &Cloud, params: &FilterParams, monitor: &Monitor) -> Result<()> {
        let methods = [
            ("statistical outliers", params.statistical.map(OutlierParams::Statistical)),
            ("radius outliers", params.radius.map(OutlierParams::Radius)),
        ];
        if methods.iter().all(|(_, method)| method.is_none()) {
            return Ok(());
        }
        let scene = MetricCloud::new(cloud, params.metres_per_unit, monitor)?;
        scene.oddities().into_iter().for_each(|text| monitor.warn(text.replace("set aside", "taken for noise")));
        for (name, method) in methods {
            let Some(method) = method else { continue };
            let active: Vec<bool> = self.kept.iter().zip(&self.noise).map(|(kept, noise)| *kept && !noise).collect();
            let found = outliers(&scene, &active, &method, monitor)?;
            self.noise.iter_mut().zip(&found).for_each(|(noise, found)| *noise |= found);
            match params.mark {
                true => self.steps.push(Step { filter: name, removed: 0, marked: count(&found) }),
                false => self.keep(name, &found.iter().map(|noise| !noise).collect::<Vec<bool>>()),
            }
        }
        Ok(())
    }

    /// Keeps points in the range of heights, and marked noise.
    fn keep_heights(&mut self, cloud: &Cloud, params: &FilterParams, monitor: &Monitor) -> Result<()> {
        let Some(range) = params.height else { return Ok(()) };
        let heights = Heights::of(cloud, &self.noise, params, monitor)?;
        let wanted = |(height, noise): (&f32, &bool)| *noise || range.holds(f64::from(*height));
        let wanted: Vec<bool> = heights.metres.iter().zip(&self.noise).map(wanted).collect();
        self.keep("height", &wanted);
        self.notes.push(heights.note);
        Ok(())
    }

    /// Removes the points that are not wanted.
    fn keep(&mut self, filter: &'static str, wanted: &[bool]) {
        let before = self.count();
        self.kept.iter_mut().zip(wanted).for_each(|(kept, wanted)| *kept &= wanted);
        self.steps.push(Step { filter, removed: before - self.count(), marked: 0 });
    }
}

fn count(marks: &[bool]) -> u64 {
    marks.iter().filter(|mark| **mark).count() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values, names};
    use crate::filters::{HeightRange, RadiusParams, StatisticalParams};
    use crate::random::stream;

    /// Ground of 40 m x 40 m in class 2 with a box in class 6 on it, 6 m high, and two points high above.
    fn village() -> Cloud {
        let mut s = stream(3, 1);
        let mut rows: Vec<[f64; 3]> = (0..8000).map(|_| [40.0 * s.uniform(), 40.0 * s.uniform(), 0.0]).collect();
        let house = |p: &[f64; 3]| (p[0] - 20.0).abs() < 6.0 && (p[1] - 20.0).abs() < 5.0;
        let mut codes: Vec<u8> = rows.iter().map(|p| if house(p) { 6 } else { 2 }).collect();
        rows.iter_mut().zip(&codes).for_each(|(p, &code)| p[2] = 50.0 + 0.05 * p[0] + f64::from(code - 2) * 1.5);
        rows.extend([[10.0, 10.0, 90.0], [11.0, 30.0, 95.0]]);
        codes.extend([1, 1]);
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        cloud.set_column(Column::new(names::CLASSIFICATION, Values::U8(codes))).unwrap();
        cloud
    }

    fn run(params: &FilterParams) -> Filtered {
        filter(&village(), params, &Monitor::default()).unwrap()
    }

    fn steps(found: &Filtered) -> Vec<(&'static str, u64, u64)> {
        found.steps.iter().map(|step| (step.filter, step.removed, step.marked)).collect()
    }

    #[test]
    fn each_filter_works_on_what_is_left_and_counts_what_it_takes() {
        let house =
            village().column(names::CLASSIFICATION).unwrap().values.to_f32().iter().filter(|c| **c > 5.0).count();
        let found = run(&FilterParams {
            drop_classes: vec![2],
            radius: Some(RadiusParams::default()),
            height: Some(HeightRange { low: 2.0, high: f64::INFINITY }),
            bounds: Some([[f64::NEG_INFINITY, f64::NEG_INFINITY, 0.0], [20.0, 99.0, 99.0]]),
            ..FilterParams::default()
        });
        let west = found.count();
        assert!(west > house as u64 / 3 && west < 2 * house as u64 / 3);
        let ground = (8000 - house) as u64;
        let rest = house as u64 - west;
        assert_eq!(
            steps(&found),
            [("classes", ground, 0), ("radius outliers", 2, 0), ("height", 0, 0), ("bounds", rest, 0)]
        );
        assert!(found.notes[0].contains("class 2"), "{:?}", found.notes);
    }

    #[test]
    fn marked_points_stay_where_they_are_whatever_their_height() {
        let statistical = Some(StatisticalParams { multiplier: 8.0, ..StatisticalParams::default() });
        let height = Some(HeightRange { low: f64::NEG_INFINITY, high: 1.0 });
        let marked = run(&FilterParams { statistical, mark: true, height, ..FilterParams::default() });
        assert_eq!((marked.steps[0].removed, marked.steps[0].marked), (0, 2));
        assert!(marked.kept[8000..] == [true, true] && marked.noise[8000..] == [true, true]);
        let removed = run(&FilterParams { statistical, height, ..FilterParams::default() });
        assert!(removed.kept[8000..] == [false, false] && removed.count() + 2 == marked.count());
        let polygon = Some("POLYGON ((0 0, 40 0, 40 20, 0 20))".parse().unwrap());
        let cut = run(&FilterParams { statistical, mark: true, polygon, ..FilterParams::default() });
        assert!(cut.kept[8000..] == [true, false]);
    }

    #[test]
    fn noise_does_not_move_the_ground() {
        let mut cloud = village();
        let mut rows: Vec<[f64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i)).collect();
        rows.extend((0..6).map(|i| [5.0 + f64::from(i) * 5.0, 35.0, -20.0]));
        cloud = Cloud::from_rows(&rows).unwrap();
        let mut params = FilterParams { height: "-0.5..0.5".parse().ok(), ..FilterParams::default() };
        params.radius = Some(RadiusParams { radius: 2.0, ..RadiusParams::default() });
        let found = filter(&cloud, &params, &Monitor::default()).unwrap();
        assert_eq!((found.steps[0].removed, found.kept[8000..].contains(&true)), (8, false));
        let ground = (0..8000).filter(|&i| rows[i][2] < 53.0);
        assert!(ground.filter(|&i| found.kept[i]).count() > 6000 && found.notes[0].contains("filter"));
    }

    #[test]
    fn heights_of_the_cloud_are_taken_in_its_unit() {
        let mut cloud = Cloud::from_rows(&[[0.0; 3]; 4]).unwrap();
        cloud
            .set_column(Column::new(names::HEIGHT_ABOVE_GROUND, Values::F32(vec![1.0, 10.0, 20.0, f32::NAN])))
            .unwrap();
        let of = |cloud: &Cloud| {
            let params = FilterParams { height: "2..5".parse().ok(), ..FilterParams::default() };
            filter(cloud, &params, &Monitor::default()).unwrap().kept
        };
        assert_eq!(of(&cloud), [false; 4]);
        cloud.metres_per_unit = Some(0.3048);
        assert_eq!(of(&cloud), [false, true, false, false]);
    }

    #[test]
    fn classes_are_kept_or_dropped_and_absent_ones_are_told_of() {
        let monitor = Monitor::default();
        let params = FilterParams { classes: vec![6, 9], ..FilterParams::default() };
        let found = filter(&village(), &params, &monitor).unwrap();
        assert!(found.count() > 100 && monitor.take_warnings() == ["no point has class 9"]);
        let dropped = run(&FilterParams { drop_classes: vec![1, 2], ..FilterParams::default() });
        assert_eq!(dropped.kept, found.kept);
        let params = FilterParams { drop_classes: vec![64, 1], ..FilterParams::default() };
        filter(&village(), &params, &monitor).unwrap();
        assert_eq!(monitor.take_warnings(), ["no point has class 64"]);
        let bare = Cloud::from_rows(&[[0.0; 3]]).unwrap();
        assert!(filter(&bare, &params, &monitor).unwrap_err().to_string().contains("no classes"));
    }

    #[test]
    fn a_cloud_without_points_has_none_left() {
        let mut cloud = Cloud::from_rows(&[]).unwrap();
        cloud.set_column(Column::new(names::CLASSIFICATION, Values::U8(Vec::new()))).unwrap();
        let found = filter(
            &cloud,
            &FilterParams {
                classes: vec![2],
                statistical: Some(StatisticalParams::default()),
                height: "2..".parse().ok(),
                polygon: "POLYGON ((0 0, 1 0, 1 1))".parse().ok(),
                ..FilterParams::default()
            },
            &Monitor::default(),
        );
        assert!(found.unwrap().kept.is_empty());
    }
}
