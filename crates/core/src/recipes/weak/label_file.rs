//! Manually picked labels: positions with a class, or segments with a class.

use crate::cloud::{Cloud, Points};
use crate::error::{Error, Result};
use crate::io::open;
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use crate::recipes::Labels;
use std::path::{Path, PathBuf};

/// A table of labels: `x,y,z,class` (for the nearest point) or `cluster_id,class` (for all points of a segment, by the
/// cloud's `ClusterID`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelFile {
    path: PathBuf,
    /// Line, position, class.
    places: Vec<(usize, [f64; 3], u8)>,
    /// Line, segment, class.
    segments: Vec<(usize, u32, u8)>,
}

/// Indices of the columns of a table.
enum Columns {
    Places([usize; 4]),
    Segments([usize; 2]),
}

impl LabelFile {
    /// Reads a text table separated by commas, semicolons or blanks, with or without a header line. Rows with an empty
    /// class are skipped, so that a partly filled-in list can be used; `#` starts a comment.
    ///
    /// # Errors
    /// `path:line: what is wrong`.
    pub fn read(path: &Path) -> Result<Self> {
        let text = open::text(path, open::MOST_TABLE)?;
        let mut file = Self { path: path.to_path_buf(), ..Self::default() };
        let mut columns = None;
        for (line, row) in text.lines().map(str::trim).enumerate() {
            if row.is_empty() || row.starts_with('#') {
                continue;
            }
            let cells = cells(row);
            match &columns {
                Some(columns) => file.take(line + 1, &cells, columns)?,
                None => {
                    let numbers = cells.iter().all(|c| c.parse::<f64>().is_ok());
                    let found = if numbers { by_count(cells.len()) } else { by_name(&cells) };
                    let found = found.ok_or_else(|| {
                        file.wrong(line + 1, format!("columns {}", cells.join(", ")), "x,y,z,class or cluster_id,class")
                    })?;
                    if numbers {
                        file.take(line + 1, &cells, &found)?;
                    }
                    columns = Some(found);
                }
            }
        }
        match file.places.is_empty() && file.segments.is_empty() {
            true => Err(Error::input(format!("{}: no row with a class", path.display()))),
            false => Ok(file),
        }
    }

    /// Labels at the points of a cloud whose class is in `labels`.
    pub fn of_cloud(path: &Path, cloud: &Cloud, labels: &Labels) -> Self {
        let places = labels.codes.iter().enumerate().filter_map(|(i, code)| code.map(|c| (i + 1, cloud.xyz(i), c)));
        Self { path: path.to_path_buf(), places: places.collect(), segments: Vec::new() }
    }

    /// The labels of a cloud's points. Each position must be within `within` metres of a point.
    ///
    /// # Errors
    /// If a position is too far from every point, the cloud lacks a segment, or a point gets two classes.
    pub fn apply(&self, cloud: &Cloud, (metres, within): (f64, f64), monitor: &Monitor) -> Result<Labels> {
        let mut codes: Vec<Option<u8>> = vec![None; cloud.len()];
        self.apply_places(cloud, (metres, within), &mut codes, monitor)?;
        self.apply_segments(cloud, &mut codes)?;
        Ok(Labels::new(codes, cloud.scheme))
    }

    fn apply_places(
        &self,
        cloud: &Cloud,
        (metres, within): (f64, f64),
        codes: &mut [Option<u8>],
        monitor: &Monitor,
    ) -> Result<()> {
        if self.places.is_empty() {
            return Ok(());
        }
        self.check_box(cloud, (metres, within), monitor)?;
        let points = Points::from_cloud_watched(cloud, metres, monitor)?;
        let rows: Vec<[f64; 3]> = self.places.iter().map(|p| p.1).collect();
        let queries = Points::with_strays(&Cloud::from_rows(&rows)?, metres, monitor)?;
        if points.is_empty() {
            return Err(Error::input("the cloud has no point with finite coordinates"));
        }
        let near = nearest_of(&points, &queries, 1, monitor)?;
        for (q, (line, place, code)) in self.places.iter().enumerate() {
            let distance = f64::from(near.squared_distances(q)[0]).sqrt();
            if distance > within {
                let found = format!("{place:?} is {distance:.3} m from the nearest point");
                return Err(self.wrong(*line, found, &format!("at most {within} m; check the coordinate system")));
            }
            self.put(*line, &mut codes[points.index[near.of(q)[0] as usize] as usize], *code)?;
        }
        Ok(())
    }

    /// Fails at the first position outside the cloud's bounding box by more than `within` metres.
    fn check_box(&self, cloud: &Cloud, (metres, within): (f64, f64), monitor: &Monitor) -> Result<()> {
        let Some((low, high)) = cloud.bounds_watched(monitor)? else { return Ok(()) };
        for (line, place, _) in &self.places {
            let beyond = (0..3).map(|a| (low[a] - place[a]).max(place[a] - high[a])).fold(0.0, f64::max) * metres;
            if beyond > within || beyond.is_nan() {
                let found = format!("{place:?} is {beyond:.3e} m outside the cloud from {low:?} to {high:?}");
                return Err(self.wrong(*line, found, &format!("at most {within} m; check the coordinate system")));
            }
        }
        Ok(())
    }

    fn apply_segments(&self, cloud: &Cloud, codes: &mut [Option<u8>]) -> Result<()> {
        if self.segments.is_empty() {
            return Ok(());
        }
        let column = cloud.column("ClusterID").ok_or_else(|| {
            Error::input(format!("{} names segments, but the cloud has no ClusterID", self.path.display()))
        })?;
        let mut of = std::collections::HashMap::new();
        for &(line, segment, code) in &self.segments {
            self.put(line, of.entry(segment).or_insert(None), code)?;
        }
        let mut seen = std::collections::HashSet::new();
        for (i, place) in codes.iter_mut().enumerate() {
            let segment = column.values.get(i) as u32;
            if let Some(Some(code)) = of.get(&segment) {
                seen.insert(segment);
                *place = Some(*code);
            }
        }
        match self.segments.iter().find(|(_, segment, _)| !seen.contains(segment)) {
            Some((line, segment, _)) => {
                Err(self.wrong(*line, format!("cluster_id {segment}"), "a ClusterID that the cloud has"))
            }
            None => Ok(()),
        }
    }

    fn put(&self, line: usize, place: &mut Option<u8>, code: u8) -> Result<()> {
        match place.replace(code) {
            Some(other) if other != code => Err(self.wrong(
                line,
                format!("class {code} where an earlier line has {other}"),
                "one class for one place",
            )),
            _ => Ok(()),
        }
    }

    fn take(&mut self, line: usize, cells: &[&str], columns: &Columns) -> Result<()> {
        let class = match columns {
            Columns::Places([.., class]) | Columns::Segments([_, class]) => *class,
        };
        if cells.get(class).is_none_or(|c| c.is_empty()) {
            return Ok(());
        }
        let number = |column: usize, allowed: &str| {
            let cell = cells.get(column).copied().unwrap_or_default();
            let value = cell.parse::<f64>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| self.wrong(line, format!("{cell:?} in column {}", column + 1), allowed))
        };
        let whole = |column: usize, most: f64, allowed: &str| {
            let value = number(column, allowed)?;
            match (0.0..=most).contains(&value) && value.fract().abs() <= 0.0 {
                true => Ok(value),
                false => Err(self.wrong(line, value, allowed)),
            }
        };
        let code = whole(class, 255.0, "a class code, 0 to 255")? as u8;
        match columns {
            Columns::Places([x, y, z, _]) => {
                let place = [number(*x, "a number")?, number(*y, "a number")?, number(*z, "a number")?];
                self.places.push((line, place, code));
            }
            Columns::Segments([segment, _]) => {
                let segment = whole(*segment, f64::from(u32::MAX), "a ClusterID")? as u32;
                self.segments.push((line, segment, code));
            }
        }
        Ok(())
    }

    fn wrong(&self, line: usize, found: impl std::fmt::Display, allowed: &str) -> Error {
        Error::input(format!("{}:{line}: {found} (allowed: {allowed})", self.path.display()))
    }
}

fn cells(row: &str) -> Vec<&str> {
    match row.contains([',', ';']) {
        true => row.split([',', ';']).map(|c| c.trim().trim_matches('"')).collect(),
        false => row.split_whitespace().collect(),
    }
}

fn by_count(cells: usize) -> Option<Columns> {
    match cells {
        4 => Some(Columns::Places([0, 1, 2, 3])),
        2 => Some(Columns::Segments([0, 1])),
        _ => None,
    }
}

fn by_name(cells: &[&str]) -> Option<Columns> {
    let at = |names: &[&str]| cells.iter().position(|c| names.contains(&c.to_lowercase().as_str()));
    let class = at(&["class", "label", "code", "classification"])?;
    if let Some(segment) = at(&["cluster_id", "clusterid", "segment"]) {
        return Some(Columns::Segments([segment, class]));
    }
    Some(Columns::Places([at(&["x"])?, at(&["y"])?, at(&["z"])?, class]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Column, Values};

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
        read(text).unwrap().apply(&cloud(), (1.0, 0.5), &Monitor::default()).unwrap().codes
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
            Ok(file) => file.apply(&cloud(), (1.0, 0.5), &Monitor::default()).unwrap_err().to_string(),
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
