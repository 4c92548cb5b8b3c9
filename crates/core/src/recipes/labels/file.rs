//! Labels picked by hand, for the points of a cloud.

use crate::cloud::{Cloud, MetricCloud};
use crate::error::{Error, Result};
use crate::io::{LabelRow, LabelTable};
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use crate::recipes::Labels;
use std::path::Path;

/// Labels picked by hand: positions with a class (for the nearest point), or segments with a class (for all points with
/// that `ClusterID`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelFile {
    table: LabelTable,
}

/// How picked positions find their points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picking {
    /// Metres per unit of the coordinates, above 0.
    pub metres: f64,
    /// Largest distance of a position from its point, metres.
    pub within: f64,
}

impl LabelFile {
    /// Reads a table: [`LabelTable::read`].
    ///
    /// # Errors
    /// `path:line: what is wrong`.
    pub fn read(path: &Path) -> Result<Self> {
        Ok(Self { table: LabelTable::read(path)? })
    }

    /// Labels at the points of a cloud whose class is in `labels`.
    pub fn of_cloud(path: &Path, cloud: &Cloud, labels: &Labels) -> Self {
        let row = |(i, code): (usize, &Option<u8>)| code.map(|code| LabelRow { line: i + 1, of: cloud.xyz(i), code });
        let positions = labels.codes.iter().enumerate().filter_map(row).collect();
        Self { table: LabelTable { path: path.to_path_buf(), positions, segments: Vec::new() } }
    }

    /// The labels of a cloud's points. Each position must be near enough to a point.
    ///
    /// # Errors
    /// If a position is too far from every point, the cloud lacks a segment, or a point gets two classes.
    pub fn apply(&self, cloud: &Cloud, picking: &Picking, monitor: &Monitor) -> Result<Labels> {
        let mut codes: Vec<Option<u8>> = vec![None; cloud.len()];
        self.apply_positions(cloud, picking, &mut codes, monitor)?;
        self.apply_segments(cloud, &mut codes)?;
        Ok(Labels::new(codes, cloud.scheme))
    }

    fn apply_positions(
        &self,
        cloud: &Cloud,
        picking: &Picking,
        codes: &mut [Option<u8>],
        monitor: &Monitor,
    ) -> Result<()> {
        if self.table.positions.is_empty() {
            return Ok(());
        }
        self.check_box(cloud, picking, monitor)?;
        let points = MetricCloud::new(cloud, Some(picking.metres), monitor)?.some_points(monitor)?;
        let rows: Vec<[f64; 3]> = self.table.positions.iter().map(|row| row.of).collect();
        let rows = Cloud::from_rows(&rows)?;
        let queries = MetricCloud::new(&rows, Some(picking.metres), monitor)?.points_and_strays(monitor)?;
        let queries = queries.moved_to(points.frame.origin)?;
        let near = nearest_of(&points.positions, &queries.positions, 1, monitor)?;
        for (q, LabelRow { line, of: at, code }) in self.table.positions.iter().enumerate() {
            let distance = f64::from(near.squared_distances(q)[0]).sqrt();
            if distance > picking.within {
                let found = format!("{at:?} is {distance:.3} m from the nearest point");
                return Err(self.too_far(*line, found, picking));
            }
            self.put(*line, &mut codes[points.frame.index[near.of(q)[0] as usize] as usize], *code)?;
        }
        Ok(())
    }

    /// Fails at the first position outside the cloud's bounding box by more than the distance allowed.
    fn check_box(&self, cloud: &Cloud, picking: &Picking, monitor: &Monitor) -> Result<()> {
        let Some([low, high]) = cloud.bounds_watched(monitor)? else { return Ok(()) };
        for LabelRow { line, of: at, .. } in &self.table.positions {
            let beyond = (0..3).map(|a| (low[a] - at[a]).max(at[a] - high[a])).fold(0.0, f64::max) * picking.metres;
            if beyond > picking.within || beyond.is_nan() {
                let found = format!("{at:?} is {beyond:.3e} m outside the cloud from {low:?} to {high:?}");
                return Err(self.too_far(*line, found, picking));
            }
        }
        Ok(())
    }

    fn too_far(&self, line: usize, found: String, picking: &Picking) -> Error {
        self.table.wrong(line, found, &format!("at most {} m; check the coordinate system", picking.within))
    }

    fn apply_segments(&self, cloud: &Cloud, codes: &mut [Option<u8>]) -> Result<()> {
        if self.table.segments.is_empty() {
            return Ok(());
        }
        let column = cloud.column("ClusterID").ok_or_else(|| {
            Error::input(format!("{} names segments, but the cloud has no ClusterID", self.table.path.display()))
        })?;
        let mut classes = std::collections::HashMap::new();
        for &LabelRow { line, of: segment, code } in &self.table.segments {
            self.put(line, classes.entry(segment).or_insert(None), code)?;
        }
        let mut seen = std::collections::HashSet::new();
        for (i, place) in codes.iter_mut().enumerate() {
            let segment = column.values.get(i) as u32;
            if let Some(Some(code)) = classes.get(&segment) {
                seen.insert(segment);
                *place = Some(*code);
            }
        }
        match self.table.segments.iter().find(|row| !seen.contains(&row.of)) {
            Some(LabelRow { line, of: segment, .. }) => {
                Err(self.table.wrong(*line, format!("cluster_id {segment}"), "a ClusterID that the cloud has"))
            }
            None => Ok(()),
        }
    }

    fn put(&self, line: usize, place: &mut Option<u8>, code: u8) -> Result<()> {
        match place.replace(code) {
            Some(other) if other != code => Err(self.table.wrong(
                line,
                format!("class {code} where an earlier line has {other}"),
                "one class for one place",
            )),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};

    const NEAR: Picking = Picking { metres: 1.0, within: 0.5 };

    fn read(text: &str) -> Result<LabelFile> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labels.csv");
        std::fs::write(&path, text).unwrap();
        LabelFile::read(&path)
    }

    fn cloud() -> Cloud {
        let mut cloud =
            Cloud::from_rows(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]).unwrap();
        cloud.set_column(Column::new("ClusterID", Values::U32(vec![1, 1, 2, 0]))).unwrap();
        cloud
    }

    fn codes(text: &str) -> Vec<Option<u8>> {
        read(text).unwrap().apply(&cloud(), &NEAR, &Monitor::default()).unwrap().codes
    }

    #[test]
    fn places_label_the_nearest_point_and_segments_all_their_points() {
        let expected = [None, Some(6), None, Some(2)];
        assert_eq!(codes("class,x,y,z\n6,1.1,0,0\n2, 2.9, 0.1, 0\n"), expected);
        assert_eq!(codes("# picked by hand\n1.1 0 0 6\n2.9 0.1 0 2\n"), expected);
        assert_eq!(codes("cluster_id;x;y;z;class\n1;0;0;0;5\n2;2;0;0;\n"), [Some(5), Some(5), None, None]);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let message = |text: &str| match read(text) {
            Ok(file) => file.apply(&cloud(), &NEAR, &Monitor::default()).unwrap_err().to_string(),
            Err(e) => e.to_string(),
        };
        for (text, expected) in [
            ("x,y,z,class\n0,0,0,2\n0,0,far,2\n", ":3: \"far\""),
            ("x,y,z,class\n0,0,0,300\n", ":2: 300"),
            ("x,y,z,class\n500,0,0,2\n", "outside the cloud"),
            ("x,y,z,class\n1e300,0,0,2\n", "outside the cloud"),
            ("x,y,z,class\n1.6,0.4,0,2\n", "from the nearest point"),
            ("x,y,z,class\n0,0,0,2\n0.1,0,0,3\n", ":3: class 3 where an earlier line has 2"),
            ("cluster_id,class\n9,2\n", "cluster_id 9"),
            ("a,b\n1,2\n", "x,y,z,class or cluster_id,class"),
            ("x,y,z,class\n", "no row"),
        ] {
            assert!(message(text).contains(expected), "{}", message(text));
        }
    }
}
