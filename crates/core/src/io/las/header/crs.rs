//! Reference system and units of a file: WKT, or GeoTIFF keys (OGC 19-008).

use super::vlr::Vlr;
use super::{array, u16_at};
use crate::cloud::crs::{
    AngularUnit, LinearUnit, Plane, Unit, Vertical, same_length, unit_of, vertical_unit_of, with_heights,
};
use crate::io::Georeference;
use crate::parallel::Monitor;
use std::f64::consts::PI;

/// The code of what has none.
const OWN: u16 = 32767;

/// Units of heights and of x and y that differ by less, as a share, distort nothing that counts, as the two feet.
const DISTORTING: f64 = 1e-4;

/// User of the records that tell the reference system.
const USER: &str = "LASF_Projection";

/// A variable length record of the user `LASF_Projection`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProjectionRecord {
    /// Its number: 2112 is WKT, 34735 to 34737 are GeoTIFF keys.
    pub id: u16,
    /// Its content.
    pub data: Vec<u8>,
}

/// Where points lie that have these records, as in a file of LAS. `wkt`: the file says that WKT counts (global encoding,
/// bit 4). Warns, as reading does, if heights have a unit of their own.
pub fn las_georeference(records: &[ProjectionRecord], wkt: bool, monitor: &Monitor) -> Georeference {
    let vlrs: Vec<Vlr> = records.iter().map(|record| Vlr::new(USER, record.id, "", record.data.clone())).collect();
    let found = Projection::of(wkt, vlrs.iter());
    found.warning.into_iter().for_each(|text| monitor.warn(text));
    Georeference { crs: found.crs, metres_per_unit: found.metres_per_unit }
}

/// What records tell of the coordinates.
#[derive(Debug, Default, PartialEq)]
pub(in crate::io) struct Projection {
    /// The CRS as WKT, `EPSG:n` or `EPSG:n+m` (m: of heights).
    pub(in crate::io) crs: Option<String>,
    /// Metres per unit of x and y.
    pub(in crate::io) metres_per_unit: Option<f64>,
    /// That heights have a unit of their own.
    pub(in crate::io) warning: Option<String>,
}

impl Projection {
    /// From WKT if it counts, else from GeoTIFF keys; from WKT too if the keys tell no system, and no other unit.
    pub(in crate::io) fn of<'a>(wkt_counts: bool, vlrs: impl Iterator<Item = &'a Vlr> + Clone) -> Self {
        let find = |id| vlrs.clone().find(|v| v.is(USER, id)).map(|v| &v.data[..]);
        let wkt =
            find(2112).map(|d| String::from_utf8_lossy(d).trim_end_matches('\0').to_string()).filter(|w| !w.is_empty());
        let keys = find(34735).map(|keys| Keys { keys, doubles: find(34736).unwrap_or_default() });
        let of_keys = keys.filter(|_| !wkt_counts || wkt.is_none()).map(Self::of_keys);
        match (of_keys, wkt) {
            (Some(found), None) => found,
            (Some(found), Some(wkt)) if found.outweighs(&wkt) => found,
            (_, Some(wkt)) => Self::of_wkt(wkt),
            (None, None) => Self::default(),
        }
    }

    /// Whether WKT that does not count cannot complete this: a system is told, or another unit.
    fn outweighs(&self, wkt: &str) -> bool {
        let other = |own| length(unit_of(wkt)).is_none_or(|metres| !same_length(metres, own));
        self.crs.is_some() || self.metres_per_unit.is_some_and(other)
    }

    fn of_wkt(wkt: String) -> Self {
        let unit = unit_of(&wkt);
        let warning = vertical_unit_of(&wkt).and_then(|heights| vertical_warning(unit, heights));
        Self { metres_per_unit: length(unit), crs: Some(wkt), warning }
    }

    fn of_keys(keys: Keys<'_>) -> Self {
        let (plane, heights) = (keys.plane(), keys.heights());
        let metres_per_unit = plane.metres();
        let crs = with_heights(plane, heights);
        let unit = metres_per_unit.map(Unit::Length).or_else(|| unit_of(crs.as_deref()?));
        let vertical = heights.metres_per_unit.or_else(|| vertical_unit_of(crs.as_deref()?));
        Self { warning: vertical.and_then(|heights| vertical_warning(unit, heights)), crs, metres_per_unit }
    }
}

fn length(unit: Option<Unit>) -> Option<f64> {
    match unit {
        Some(Unit::Length(metres)) => Some(metres),
        _ => None,
    }
}

/// The warning if heights have another unit than x and y, which are taken as metres without one.
fn vertical_warning(unit: Option<Unit>, heights: f64) -> Option<String> {
    let plane = match unit {
        Some(Unit::Angle(_)) => return None,
        Some(Unit::Length(metres)) => metres,
        None => 1.0,
    };
    let told = match unit {
        None => "have no unit and are taken as metres".to_string(),
        _ => format!("are in units of {plane} m"),
    };
    ((heights / plane - 1.0).abs() > DISTORTING).then(|| {
        format!(
            "x and y {told}, heights in units of {heights} m: shapes will be distorted; bring them to one unit first, e.g. \
             with PDAL's filters.reprojection"
        )
    })
}

/// GeoTIFF keys (OGC 19-008) and the numbers that some of them refer to.
#[derive(Clone, Copy)]
struct Keys<'a> {
    keys: &'a [u8],
    doubles: &'a [u8],
}

impl Keys<'_> {
    /// Value of a short key.
    fn short(&self, wanted: u16) -> Option<u16> {
        let entries = self.keys.chunks_exact(8).skip(1);
        entries.filter(|e| u16_at(e, 0) == wanted && u16_at(e, 2) == 0).map(|e| u16_at(e, 6)).next()
    }

    /// Value of a key that refers to a double.
    fn double(&self, wanted: u16) -> Option<f64> {
        let mut entries = self.keys.chunks_exact(8).skip(1);
        let entry = entries.find(|e| u16_at(e, 0) == wanted && u16_at(e, 2) == 34736)?;
        self.doubles.chunks_exact(8).nth(usize::from(u16_at(entry, 6))).map(|d| f64::from_le_bytes(array(d, 0)))
    }

    /// The code of a key; 32767 stands for a system without one.
    fn code(&self, key: u16) -> Option<u16> {
        self.short(key).filter(|&code| code > 0 && code != OWN)
    }

    /// The system and the unit of x and y: projected, or geographic or geocentric in a file without projection.
    fn plane(&self) -> Plane {
        let code = self.code(3072);
        match self.short(1024).filter(|_| self.short(3072).is_none()) {
            Some(2) => Plane { code: self.code(2048), unit: Some(Unit::Angle(self.angle())) },
            Some(3) => Plane { code: self.code(2048), unit: self.length(2052, 2053).map(Unit::Length) },
            _ => Plane { code, unit: self.length(3076, 3077).map(Unit::Length) },
        }
    }

    /// The system and the unit of heights.
    fn heights(&self) -> Vertical {
        Vertical { code: self.code(4096), metres_per_unit: self.length(4099, 0) }
    }

    /// Metres in the linear unit of key `code`, or, if that is user-defined, in the number of key `size`.
    fn length(&self, code: u16, size: u16) -> Option<f64> {
        let metres = match self.short(code)? {
            OWN => self.double(size)?,
            known => LinearUnit::coded(known)?.metres,
        };
        (metres.is_finite() && metres > 0.0).then_some(metres)
    }

    /// Radians in the unit of angles; degrees if the keys do not tell.
    fn angle(&self) -> f64 {
        let radians = match self.short(2054) {
            Some(OWN) => self.double(2055),
            code => code.and_then(AngularUnit::coded).map(|unit| unit.radians),
        };
        radians.filter(|radians| radians.is_finite() && *radians > 0.0).unwrap_or(PI / 180.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::crs::{codes_of, vertical_of};

    const FOOT: f64 = 1200.0 / 3937.0;

    /// The keys as bytes, headed.
    fn keys(entries: &[[u16; 4]]) -> Vec<u8> {
        let head = [1, 1, 0, entries.len() as u16];
        [&[head], entries].concat().concat().into_iter().flat_map(u16::to_le_bytes).collect()
    }

    fn doubles() -> Vec<u8> {
        [7.0, 0.25].into_iter().flat_map(f64::to_le_bytes).collect()
    }

    /// What a file with these keys tells.
    fn told(entries: &[[u16; 4]]) -> Projection {
        let record = |id, data| Vlr::new(USER, id, "", data);
        Projection::of(false, [record(34735, keys(entries)), record(34736, doubles())].iter())
    }

    fn length(metres: f64) -> Option<Unit> {
        Some(Unit::Length(metres))
    }

    #[test]
    fn geotiff_keys_tell_system_and_unit() {
        let of = |entries: &[[u16; 4]]| Keys { keys: &keys(entries), doubles: &doubles() }.plane();
        let plane = |code, unit| Plane { code, unit };
        assert_eq!(of(&[[3072, 0, 1, 26910], [3076, 0, 1, 9002]]), plane(Some(26910), length(0.3048)));
        assert_eq!(of(&[[1024, 0, 1, 1], [2048, 0, 1, 4269], [3072, 0, 1, 2229]]), plane(Some(2229), None));
        let own = of(&[[3072, 0, 1, 32767], [3076, 0, 1, 32767], [3077, 34736, 1, 1]]);
        assert_eq!((own, of(&[])), (plane(None, length(0.25)), Plane::default()));
        let angle = |radians| Some(Unit::Angle(radians));
        assert_eq!(of(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]]), plane(Some(4326), angle(PI / 180.0)));
        assert_eq!(of(&[[1024, 0, 1, 2], [2054, 0, 1, 9105]]), plane(None, angle(PI / 200.0)));
        let own = of(&[[1024, 0, 1, 2], [2054, 0, 1, 32767], [2055, 34736, 1, 1]]);
        assert_eq!(own, plane(None, angle(0.25)));
        assert_eq!(of(&[[1024, 0, 1, 3], [2048, 0, 1, 4978]]), plane(Some(4978), None));
    }

    #[test]
    fn a_code_alone_tells_the_unit_and_keys_tell_that_of_heights() {
        let feet = told(&[[1024, 0, 1, 1], [3072, 0, 1, 2229], [4099, 0, 1, 9001]]);
        // Heights in metres over feet.
        let system = feet.crs.unwrap();
        assert_eq!((codes_of(&system).horizontal, vertical_unit_of(&system)), (Some(2229), Some(1.0)));
        assert!((feet.metres_per_unit.unwrap() - 0.304_800_609_6).abs() < 1e-10);
        assert!(feet.warning.unwrap().contains("heights in units of 1 m"));
        let code = |text: &str, metres_per_unit| Projection { crs: Some(text.into()), metres_per_unit, warning: None };
        let utm = told(&[[1024, 0, 1, 1], [3072, 0, 1, 32632], [4099, 0, 1, 9001]]);
        assert_eq!(utm, code("EPSG:32632", Some(1.0)));
        // A length beside degrees is not that of x and y.
        let degrees = told(&[[1024, 0, 1, 2], [2048, 0, 1, 4326], [3076, 0, 1, 9001]]);
        assert_eq!(degrees, code("EPSG:4326", None));
        assert_eq!(told(&[[1024, 0, 1, 3], [2048, 0, 1, 4978]]), code("EPSG:4978", Some(1.0)));
        // NAVD88 in US survey feet, over metres; then only the unit of heights.
        let navd = told(&[[1024, 0, 1, 1], [3072, 0, 1, 26910], [4096, 0, 1, 6360], [4099, 0, 1, 9003]]);
        assert_eq!((navd.crs.as_deref(), navd.metres_per_unit), (Some("EPSG:26910+6360"), Some(1.0)));
        assert!(navd.warning.unwrap().contains("units of 0.3048006"));
        let unit = told(&[[1024, 0, 1, 1], [3072, 0, 1, 26910], [4099, 0, 1, 9002]]);
        assert_eq!((unit.metres_per_unit, vertical_unit_of(&unit.crs.unwrap())), (Some(1.0), Some(0.3048)));
        // Without a unit, x and y are metres for the program.
        let silent = told(&[[1024, 0, 1, 1], [4099, 0, 1, 9002]]);
        assert_eq!((silent.crs, silent.metres_per_unit), (None, None));
        assert!(silent.warning.unwrap().contains("taken as metres, heights in units of 0.3048 m"));
    }

    #[test]
    fn heights_keep_their_unit_over_a_code_that_is_not_in_the_table() {
        let found = told(&[[1024, 0, 1, 1], [3072, 0, 1, 64000], [3076, 0, 1, 9001], [4099, 0, 1, 9003]]);
        let crs = found.crs.unwrap();
        assert_eq!((codes_of(&crs).horizontal, unit_of(&crs)), (Some(64000), length(1.0)));
        assert_eq!(vertical_of(&crs), Some(Vertical { code: None, metres_per_unit: Some(FOOT) }));
        assert!(found.warning.is_some());
    }

    #[test]
    fn the_key_of_heights_counts_more_than_a_compound_code() {
        let with = |code| told(&[[1024, 0, 1, 1], [3072, 0, 1, 7405], [4096, 0, 1, code]]).crs.unwrap();
        assert_eq!([5703, 5701].map(with), ["EPSG:27700+5703", "EPSG:7405"]);
    }

    #[test]
    fn degrees_without_a_known_code_are_no_metres() {
        for code in [0, 32767, 64000] {
            let Projection { crs, metres_per_unit, .. } = told(&[[1024, 0, 1, 2], [2048, 0, 1, code]]);
            assert_eq!((unit_of(&crs.unwrap()), metres_per_unit), (Some(Unit::Angle(PI / 180.0)), None));
        }
    }

    #[test]
    fn wkt_counts_where_the_file_says_so_or_the_keys_are_silent() {
        let wkt = Vlr::new(USER, 2112, "", b"LOCAL_CS[\"a\",UNIT[\"foot\",0.3048]]\0".to_vec());
        let of = |counts, entries: &[[u16; 4]]| {
            Projection::of(counts, [wkt.clone(), Vlr::new(USER, 34735, "", keys(entries))].iter()).metres_per_unit
        };
        let metres = [[3072, 0, 1, 25832]];
        assert_eq!([of(true, &metres), of(false, &metres)], [Some(0.3048), Some(1.0)]);
        assert_eq!([of(true, &[]), of(false, &[[3072, 0, 1, 32767]])], [Some(0.3048); 2]);
        let own = |unit| {
            let keys = keys(&[[3072, 0, 1, 32767], [3076, 0, 1, unit]]);
            Projection::of(false, [wkt.clone(), Vlr::new(USER, 34735, "", keys)].iter())
        };
        assert_eq!(
            [own(9002), own(9001)].map(|found| (found.crs.is_some(), found.metres_per_unit)),
            [(true, Some(0.3048)), (false, Some(1.0))]
        );
        assert_eq!(Projection::of(true, [Vlr::new(USER, 34735, "", keys(&metres))].iter()).metres_per_unit, Some(1.0));
    }

    #[test]
    fn records_in_memory_tell_what_a_file_tells() {
        let record = |id, data| ProjectionRecord { id, data };
        let monitor = Monitor::default();
        let navd = keys(&[[1024, 0, 1, 1], [3072, 0, 1, 26910], [4099, 0, 1, 9003]]);
        let found = las_georeference(&[record(34735, navd)], false, &monitor);
        assert_eq!((found.metres_per_unit, found.metres_per_height()), (Some(1.0), Some(FOOT)));
        assert_eq!(monitor.take_warnings().len(), 1);
        assert_eq!(las_georeference(&[], true, &monitor), Georeference::default());
    }
}
