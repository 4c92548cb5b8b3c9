//! Labels picked by hand, for the points of a cloud.

use crate::classes::LabelMap;
use crate::cloud::{Cloud, MetricCloud};
use crate::error::{Error, Result};
use crate::filters::ClassArea;
use crate::io::{LabelRow, LabelTable, LabelledSegment};
use crate::neighbours::nearest_of;
use crate::parallel::Monitor;
use crate::recipes::{LabelParams, Labels};
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Labels picked by hand: positions with a class (for the nearest point), segments with a class (for all points with
/// that `ClusterID`), or polygons with a class (for all points in them). A segment may come with the position of one of
/// its points, as in a list of suggestions: it then finds its cloud, and a cloud divided anew is noticed.
#[derive(Clone, Debug, Default)]
pub struct LabelFile {
    table: LabelTable,
    areas: Vec<ClassArea>,
}

/// How picked positions find their points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picking {
    /// Metres per unit of the coordinates, above 0.
    pub metres: f64,
    /// Largest distance of a position from its point, metres.
    pub within: f64,
}

/// A cloud that picked labels belong to.
#[derive(Clone, Copy, Debug)]
pub struct PickedCloud<'a> {
    /// The cloud.
    pub cloud: &'a Cloud,
    /// How positions find their points in it.
    pub picking: Picking,
}

/// A position that has a class.
type Position = LabelRow<[f64; 3]>;

/// The point that a position belongs to.
#[derive(Clone, Copy)]
struct Nearest {
    /// Metres.
    distance: f64,
    cloud: usize,
    point: usize,
}

/// The segments that a cloud has.
fn clusters(cloud: &Cloud) -> HashSet<u32> {
    let column = cloud.column("ClusterID");
    column.map(|column| (0..cloud.len()).map(|i| column.values.get(i) as u32).collect()).unwrap_or_default()
}

/// The nearest point of a cloud to each position.
fn nearest_in(at: &[[f64; 3]], picked: &PickedCloud<'_>, monitor: &Monitor) -> Result<Vec<Nearest>> {
    if at.is_empty() {
        return Ok(Vec::new());
    }
    let metres = Some(picked.picking.metres);
    let points = MetricCloud::new(picked.cloud, metres, monitor)?.some_points(monitor)?;
    let queries = MetricCloud::new(&Cloud::from_rows(at)?, metres, monitor)?.points_and_strays(monitor)?;
    let queries = queries.moved_to(points.frame.origin)?;
    let near = nearest_of(&points.positions, &queries.positions, 1, monitor)?;
    let nearest = |q: usize| Nearest {
        distance: f64::from(near.squared_distances(q)[0]).sqrt(),
        cloud: 0,
        point: points.frame.index[near.of(q)[0] as usize] as usize,
    };
    Ok((0..at.len()).map(nearest).collect())
}

impl LabelFile {
    /// Reads a file as [`LabelFile::read_mapped`], whose codes are 0 to 255.
    ///
    /// # Errors
    /// `path:line: what is wrong`.
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_mapped(path, &LabelMap::default())
    }

    /// Reads a table ([`LabelTable::read_mapped`]) or, if the name ends in `.geojson` or `.json`, polygons
    /// ([`ClassArea::read_mapped`]), with the classes that the map gives them.
    ///
    /// # Errors
    /// `path:line: what is wrong`.
    pub fn read_mapped(path: &Path, map: &LabelMap) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        match ["geojson", "json"].contains(&extension.as_str()) {
            true => {
                let table = LabelTable { path: path.to_path_buf(), ..LabelTable::default() };
                Ok(Self { table, areas: ClassArea::read_mapped(path, map)? })
            }
            false => {
                Ok(Self { table: LabelTable::read_mapped(path, &|value| map.of_value(value))?, areas: Vec::new() })
            }
        }
    }

    /// The labels without those that mean "unlabelled" or are not among the classes of `params`.
    #[must_use]
    pub fn limited(mut self, params: &LabelParams) -> Self {
        let wanted = |code: u8| {
            let known = params.classes.is_empty() || params.classes.contains(&code);
            known && !params.unlabelled.iter().flatten().any(|&none| none == code)
        };
        self.table.positions.retain(|row| wanted(row.code));
        self.table.segments.retain(|row| wanted(row.code));
        self.areas.retain(|area| wanted(area.code));
        self
    }

    /// Labels at the points of a cloud whose class is in `labels`.
    pub fn of_cloud(path: &Path, cloud: &Cloud, labels: &Labels) -> Self {
        let row = |(i, code): (usize, &Option<u8>)| code.map(|code| LabelRow { line: i + 1, of: cloud.xyz(i), code });
        let positions = labels.codes.iter().enumerate().filter_map(row).collect();
        Self { table: LabelTable { path: path.to_path_buf(), positions, segments: Vec::new() }, areas: Vec::new() }
    }

    /// The labels of a cloud's points. Each position must be near enough to a point.
    ///
    /// # Errors
    /// If a position is too far from every point, the cloud lacks a segment or has another one at its position, or a
    /// point gets two classes.
    pub fn apply(&self, cloud: &Cloud, picking: &Picking, monitor: &Monitor) -> Result<Labels> {
        let labels = Self::apply_all(std::slice::from_ref(self), &[PickedCloud { cloud, picking: *picking }], monitor)?;
        Ok(labels.into_iter().next().unwrap_or_default())
    }

    /// The labels of the points of several clouds, from several files. A position belongs to the cloud with the nearest
    /// point, the first of equally near ones; a segment to the only cloud that has it.
    ///
    /// # Errors
    /// If a position is too far from the points of every cloud, no cloud or several have a segment, another segment is at
    /// a segment's position, or a point gets two classes.
    pub fn apply_all(files: &[Self], clouds: &[PickedCloud<'_>], monitor: &Monitor) -> Result<Vec<Labels>> {
        let mut codes: Vec<Vec<Option<u8>>> = clouds.iter().map(|picked| vec![None; picked.cloud.len()]).collect();
        for file in files {
            file.apply_areas(clouds, &mut codes, monitor)?;
            file.apply_positions(clouds, &mut codes, monitor)?;
            file.apply_segments(clouds, &mut codes, monitor)?;
        }
        let of = |cloud: &Cloud, codes| Labels { names: cloud.class_names.clone(), ..Labels::new(codes, cloud.scheme) };
        Ok(codes.into_iter().zip(clouds).map(|(codes, picked)| of(picked.cloud, codes)).collect())
    }

    /// Gives the points in each polygon its class.
    fn apply_areas(&self, clouds: &[PickedCloud<'_>], codes: &mut [Vec<Option<u8>>], monitor: &Monitor) -> Result<()> {
        for (number, ClassArea { area, code }) in (1..).zip(&self.areas) {
            let path = self.table.path.display();
            let mut found = false;
            for (picked, slots) in clouds.iter().zip(codes.iter_mut()) {
                let inside = area.inside(picked.cloud, monitor)?;
                for (slot, _) in slots.iter_mut().zip(&inside).filter(|(_, inside)| **inside) {
                    found = true;
                    if let Some(other) = slot.replace(*code).filter(|other| other != code) {
                        return Err(Error::input(format!(
                            "{path}: polygon {number} with a class: class {code} where another label has {other}"
                        )));
                    }
                }
            }
            if !found {
                return Err(Error::input(format!(
                    "{path}: polygon {number} with a class holds no point; check the coordinate system"
                )));
            }
        }
        Ok(())
    }

    fn apply_positions(
        &self,
        clouds: &[PickedCloud<'_>],
        codes: &mut [Vec<Option<u8>>],
        monitor: &Monitor,
    ) -> Result<()> {
        let rows = &self.table.positions;
        for (row, found) in rows.iter().zip(self.located(rows, clouds, monitor)?) {
            self.put(row.line, &mut codes[found.cloud][found.point], row.code)?;
        }
        Ok(())
    }

    /// The nearest point of each position.
    fn located(&self, rows: &[Position], clouds: &[PickedCloud<'_>], monitor: &Monitor) -> Result<Vec<Nearest>> {
        match clouds {
            _ if rows.is_empty() => Ok(Vec::new()),
            [one] => self.located_in(rows, one, monitor),
            _ => self.located_among(rows, clouds, monitor),
        }
    }

    fn located_in(&self, rows: &[Position], picked: &PickedCloud<'_>, monitor: &Monitor) -> Result<Vec<Nearest>> {
        let picking = &picked.picking;
        self.check_box(rows, picked, monitor)?;
        let at: Vec<[f64; 3]> = rows.iter().map(|row| row.of).collect();
        let found = nearest_in(&at, picked, monitor)?.into_iter().zip(rows);
        let near = |(found, row): (Nearest, &Position)| match found.distance > picking.within {
            true => {
                let found = format!("{:?} is {:.3} m from the nearest point", row.of, found.distance);
                Err(self.too_far(row.line, found, picking))
            }
            false => Ok(found),
        };
        found.map(near).collect()
    }

    /// The nearest point of each position in the cloud that has it, the first of equally near ones.
    fn located_among(&self, rows: &[Position], clouds: &[PickedCloud<'_>], monitor: &Monitor) -> Result<Vec<Nearest>> {
        let mut best: Vec<Option<Nearest>> = vec![None; rows.len()];
        for (number, picked) in clouds.iter().enumerate() {
            let PickedCloud { cloud, picking } = picked;
            let Some([low, high]) = cloud.bounds_watched(monitor)? else { continue };
            let reach = picking.within / picking.metres;
            let inside = |at: &[f64; 3]| (0..3).all(|a| at[a] >= low[a] - reach && at[a] <= high[a] + reach);
            let near: Vec<usize> = (0..rows.len()).filter(|&row| inside(&rows[row].of)).collect();
            let at: Vec<[f64; 3]> = near.iter().map(|&row| rows[row].of).collect();
            for (row, found) in near.into_iter().zip(nearest_in(&at, picked, monitor)?) {
                let nearer = best[row].is_none_or(|known| found.distance < known.distance);
                if found.distance <= picking.within && nearer {
                    best[row] = Some(Nearest { cloud: number, ..found });
                }
            }
        }
        let found = rows.iter().zip(best).map(|(row, found)| {
            found.ok_or_else(|| {
                let within = clouds.iter().map(|picked| picked.picking.within).fold(0.0, f64::max);
                let found = format!("{:?} is near no point of the {} clouds", row.of, clouds.len());
                let allowed = format!("at most {within} m from a point of one of them; check the coordinate system");
                self.table.wrong(row.line, found, &allowed)
            })
        });
        found.collect()
    }

    /// Gives the points of each segment its class. Where the table tells a position, the segment there must be the same;
    /// in a cloud without `ClusterID` the point there gets the class.
    fn apply_segments(
        &self,
        clouds: &[PickedCloud<'_>],
        codes: &mut [Vec<Option<u8>>],
        monitor: &Monitor,
    ) -> Result<()> {
        let rows = &self.table.segments;
        if rows.is_empty() {
            return Ok(());
        }
        let placed =
            |row: &LabelRow<LabelledSegment>| row.of.at.map(|of| LabelRow { line: row.line, of, code: row.code });
        let placed: Vec<Position> = rows.iter().filter_map(placed).collect();
        let mut places = self.located(&placed, clouds, monitor)?.into_iter();
        let mut classes: Vec<HashMap<u32, LabelRow<u32>>> = vec![HashMap::new(); clouds.len()];
        let there: Vec<HashSet<u32>> = clouds.iter().map(|picked| clusters(picked.cloud)).collect();
        for &LabelRow { line, of: LabelledSegment { id, at }, code } in rows {
            let place = at.and_then(|_| places.next());
            if let Some(place) = place.filter(|place| there[place.cloud].is_empty()) {
                self.put(line, &mut codes[place.cloud][place.point], code)?;
                continue;
            }
            let owner = match place {
                Some(place) => self.checked(LabelRow { line, of: id, code }, place, clouds)?,
                None => self.owner(line, id, &there)?,
            };
            let known = classes[owner].entry(id).or_insert(LabelRow { line, of: id, code });
            self.put(line, &mut Some(known.code), code)?;
        }
        for ((picked, slots), classes) in
            clouds.iter().zip(codes).zip(classes).filter(|(_, classes)| !classes.is_empty())
        {
            let Some(column) = picked.cloud.column("ClusterID") else { continue };
            for (i, slot) in slots.iter_mut().enumerate() {
                if let Some(row) = classes.get(&(column.values.get(i) as u32)) {
                    self.put(row.line, slot, row.code)?;
                }
            }
        }
        Ok(())
    }

    /// The cloud at a segment's position, if the point there is of that segment.
    fn checked(&self, row: LabelRow<u32>, place: Nearest, clouds: &[PickedCloud<'_>]) -> Result<usize> {
        let column = clouds[place.cloud].cloud.column("ClusterID");
        match column.map(|column| column.values.get(place.point) as u32) {
            Some(there) if there != row.of => {
                let found = format!("cluster_id {} at a point of segment {there}", row.of);
                Err(self.table.wrong(row.line, found, "the segment there; the cloud was divided anew after the table"))
            }
            _ => Ok(place.cloud),
        }
    }

    /// The only cloud that has a segment.
    fn owner(&self, line: usize, id: u32, there: &[HashSet<u32>]) -> Result<usize> {
        let owners: Vec<usize> = (0..there.len()).filter(|&cloud| there[cloud].contains(&id)).collect();
        match (&owners[..], there) {
            ([one], _) => Ok(*one),
            (_, [only]) if only.is_empty() => Err(Error::input(format!(
                "{} names segments, but the cloud has no ClusterID",
                self.table.path.display()
            ))),
            (_, [_]) => Err(self.table.wrong(line, format!("cluster_id {id}"), "a ClusterID that the cloud has")),
            _ => {
                let found = format!("cluster_id {id} in {} of {} clouds", owners.len(), there.len());
                let allowed = "a ClusterID that one of them has; with several clouds give positions x,y,z,class";
                Err(self.table.wrong(line, found, allowed))
            }
        }
    }

    /// Fails at the first position outside the cloud's bounding box by more than the distance allowed.
    fn check_box(&self, rows: &[Position], picked: &PickedCloud<'_>, monitor: &Monitor) -> Result<()> {
        let PickedCloud { cloud, picking } = picked;
        let Some([low, high]) = cloud.bounds_watched(monitor)? else { return Ok(()) };
        for LabelRow { line, of: at, .. } in rows {
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
    fn positions_belong_to_the_tile_of_the_nearest_point_and_files_add_up() {
        let tile = |x: f64| Cloud::from_rows(&[[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x + 2.0, 0.0, 0.0]]).unwrap();
        let (west, mut east) = (tile(0.0), tile(3.0));
        east.set_column(Column::new("ClusterID", Values::U32(vec![7, 7, 8]))).unwrap();
        let tiles = [&west, &east].map(|cloud| PickedCloud { cloud, picking: NEAR });
        let apply = |texts: &[&str]| {
            let files: Vec<LabelFile> = texts.iter().map(|text| read(text).unwrap()).collect();
            LabelFile::apply_all(&files, &tiles, &Monitor::default())
        };
        // 2.6 lies between the tiles, nearer to the point at 3.
        let both = apply(&["x,y,z,class\n0.1,0,0,2\n2.6,0,0,6\n", "cluster_id,class\n8,5\n"]).unwrap();
        assert_eq!(both[0].codes, [Some(2), None, None]);
        assert_eq!(both[1].codes, [Some(6), None, Some(5)]);
        // Segments with positions: those of the tile there, or the point there if the tile has none.
        let both = apply(&["cluster_id,x,y,z,class\n7,3,0,0,5\n1,1,0,0,2\n2,0,0,0,\n"]).unwrap();
        assert_eq!(both[0].codes, [None, Some(2), None]);
        assert_eq!(both[1].codes, [Some(5), Some(5), None]);
        let message = |texts: &[&str]| apply(texts).unwrap_err().to_string();
        assert!(message(&["cluster_id,x,y,z,class\n8,3,0,0,5\n"]).contains("cluster_id 8 at a point of segment 7"));
        assert!(message(&["x,y,z,class\n9,0,0,2\n"]).contains("near no point of the 2 clouds"));
        assert!(message(&["cluster_id,class\n9,2\n"]).contains("0 of 2 clouds"));
        assert!(message(&["x,y,z,class\n0,0,0,2\n", "x,y,z,class\n0,0,0,3\n"]).contains("class 3"));
    }

    #[test]
    fn polygons_label_all_points_in_them() {
        let square = |x: f64, class: u8| {
            format!(
                r#"{{"type":"Feature","properties":{{"class":{class}}},"geometry":{{"type":"Polygon","coordinates":[[[{x},-1],[{},-1],[{},1],[{x},1],[{x},-1]]]}}}}"#,
                x + 1.6,
                x + 1.6
            )
        };
        let apply = |features: &[String]| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("labels.geojson");
            let text = format!(r#"{{"type":"FeatureCollection","features":[{}]}}"#, features.join(","));
            std::fs::write(&path, text).unwrap();
            LabelFile::read(&path).unwrap().apply(&cloud(), &NEAR, &Monitor::default())
        };
        let found = apply(&[square(-0.1, 6), square(2.9, 2)]).unwrap();
        assert_eq!(found.codes, [Some(6), Some(6), None, Some(2)]);
        let message = |features: &[String]| apply(features).unwrap_err().to_string();
        assert!(message(&[square(-0.1, 6), square(0.9, 2)]).contains("polygon 2 with a class: class 2"));
        assert!(message(&[square(90.0, 6)]).contains("holds no point"));
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
            ("cluster_id,class\n1,2\n1,3\n", ":3: class 3 where an earlier line has 2"),
            ("cluster_id,x,y,z,class\n1,2,0,0,5\n", "cluster_id 1 at a point of segment 2"),
            ("cluster_id,x,y,z,class\n1,500,0,0,5\n", "outside the cloud"),
            ("a,b\n1,2\n", "x,y,z,class or cluster_id,class"),
            ("x,y,z,class\n", "no row"),
        ] {
            assert!(message(text).contains(expected), "{}", message(text));
        }
    }
}
