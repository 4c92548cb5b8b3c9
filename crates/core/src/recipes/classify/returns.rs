//! Whether the returns of a pulse come one below the other, as in scans from above.

use crate::cloud::{MetricCloud, Points, names};
use crate::error::Result;
use crate::parallel::{Monitor, map_watched, sort_watched_by};
use crate::voxels::cells::cell_of;

/// Edge of the squares in plan in which returns are compared, metres.
const EDGE: f64 = 2.0;
/// Fewer squares with both kinds of returns do not show it.
const LEAST: usize = 100;
/// Points that are looked at, about at most.
const SAMPLE: usize = 1 << 21;

/// The first or the last of several returns of a pulse.
#[derive(Clone, Copy, Debug)]
struct Return {
    square: [i32; 2],
    height: f32,
    first: bool,
}

/// Share of the squares of 2 m in plan in which the first of several returns lie higher than the last ones, by their means.
/// `None` without the dimensions for the numbers of returns, or if fewer than 100 squares hold both kinds. O(n log n), of at
/// most two million points, evenly chosen.
///
/// # Errors
/// If the work was cancelled.
pub(in crate::recipes) fn falling(scene: &MetricCloud<'_>, points: &Points, monitor: &Monitor) -> Result<Option<f64>> {
    let column = |name| scene.cloud.column(name).map(|column| &column.values);
    let (Some(number), Some(all)) = (column(names::RETURN_NUMBER), column(names::NUMBER_OF_RETURNS)) else {
        return Ok(None);
    };
    let stride = points.len().div_ceil(SAMPLE).max(1);
    let returned = |i: usize| {
        let row = i * stride;
        let [x, y, height] = points.positions.xyz(row);
        let point = points.frame.index[row] as usize;
        let (number, all) = (number.get(point) as u8, all.get(point) as u8);
        let square = cell_of([x, y].map(|v| f64::from(v) / EDGE));
        (all > 1 && (number == 1 || number == all)).then_some(Return { square, height, first: number < all })
    };
    let mut returns: Vec<Return> =
        map_watched(points.len().div_ceil(stride), monitor, returned)?.into_iter().flatten().collect();
    sort_watched_by(&mut returns, |a, b| a.square.cmp(&b.square), monitor)?;
    let drops: Vec<f64> = returns.chunk_by(|a, b| a.square == b.square).filter_map(drop_of).collect();
    let down = drops.iter().filter(|&&drop| drop > 0.0).count();
    Ok((drops.len() >= LEAST).then(|| down as f64 / drops.len() as f64))
}

/// How much higher the first returns of a square are than the last ones.
fn drop_of(square: &[Return]) -> Option<f64> {
    let mean = |first: bool| {
        let heights = square.iter().filter(|r| r.first == first).map(|r| f64::from(r.height));
        let [sum, count] = heights.fold([0.0, 0.0], |[sum, count], height| [sum + height, count + 1.0]);
        (count > 0.0).then(|| sum / count)
    };
    Some(mean(true)? - mean(false)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, Column, Values};

    /// A wood of 40 x 40 m, two returns a pulse, the first `above` the last, and one pulse of a single return a square.
    fn wood(above: f64, edge: i32) -> Cloud {
        let squares = (0..edge * edge).map(|i| [f64::from(i % edge) * 2.0 + 0.5, f64::from(i / edge) * 2.0 + 0.5]);
        let rows: Vec<[f64; 3]> =
            squares.flat_map(|[x, y]| [[x, y, 100.0 + above], [x, y, 100.0], [x + 1.0, y, 103.0]]).collect();
        let mut cloud = Cloud::from_rows(&rows).unwrap();
        for (name, values) in [(names::RETURN_NUMBER, [1, 2, 1]), (names::NUMBER_OF_RETURNS, [2, 2, 1])] {
            cloud.set_column(Column::new(name, Values::U8(values.repeat(rows.len() / 3)))).unwrap();
        }
        cloud
    }

    #[test]
    fn returns_fall_rise_or_are_too_few_to_say() {
        let found = |cloud: &Cloud| {
            let monitor = Monitor::default();
            let scene = MetricCloud::new(cloud, None, &monitor).unwrap();
            falling(&scene, &scene.points(&monitor).unwrap(), &monitor).unwrap()
        };
        assert_eq!(found(&wood(8.0, 20)), Some(1.0));
        assert_eq!(found(&wood(-8.0, 20)), Some(0.0));
        assert_eq!(found(&wood(8.0, 9)), None);
        assert_eq!(found(&Cloud::from_rows(&[[0.0; 3]; 400]).unwrap()), None);
    }
}
