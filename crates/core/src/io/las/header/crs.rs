//! Reference system and units of a file: WKT, or GeoTIFF keys (OGC 19-008).

use super::vlr::Vlr;
use super::{Header, array, u16_at};
use crate::cloud::crs::{Unit, Vertical, unit_of, vertical_unit_of, with_heights};

/// The CRS as WKT, `EPSG:n` or `EPSG:n+m` (m: of heights), and metres per unit, from WKT or GeoTIFF keys.
pub(in crate::io) fn crs<'a>(
    header: &Header,
    vlrs: impl Iterator<Item = &'a Vlr> + Clone,
) -> (Option<String>, Option<f64>) {
    let find = |id| vlrs.clone().find(|v| v.is("LASF_Projection", id)).map(|v| &v.data[..]);
    let wkt =
        find(2112).map(|d| String::from_utf8_lossy(d).trim_end_matches('\0').to_string()).filter(|w| !w.is_empty());
    let keys = find(34735).map(|keys| Keys { keys, doubles: find(34736).unwrap_or_default() });
    match (wkt, keys) {
        (Some(wkt), keys) if header.wkt() || keys.is_none() => {
            let metres = length(&wkt);
            (Some(wkt), metres)
        }
        (_, Some(keys)) => {
            let plane = keys.system();
            let metres = keys.unit(3076, 3077).or_else(|| plane.as_deref().and_then(length));
            (with_heights(plane, metres, keys.heights()), metres)
        }
        _ => (None, None),
    }
}

/// Metres per unit of height, if the file states it and it differs from that of x and y.
pub(in crate::io) fn other_vertical_unit<'a>(
    header: &Header,
    vlrs: impl Iterator<Item = &'a Vlr> + Clone,
) -> Option<f64> {
    let (crs, horizontal) = crs(header, vlrs.clone());
    let find = |id| vlrs.clone().find(|v| v.is("LASF_Projection", id)).map(|v| &v.data[..]);
    let keys = find(34735).filter(|_| !header.wkt());
    let keys = keys.map(|keys| Keys { keys, doubles: find(34736).unwrap_or_default() });
    let vertical = keys.and_then(|keys| keys.unit(4099, 0)).or_else(|| vertical_unit_of(&crs?))?;
    Some(vertical).filter(|v| horizontal.is_some_and(|h| (h / v - 1.0).abs() > 1e-4))
}

fn length(crs: &str) -> Option<f64> {
    match unit_of(crs) {
        Some(Unit::Length(metres)) => Some(metres),
        _ => None,
    }
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
        self.short(key).filter(|&code| code > 0 && code != 32767)
    }

    /// The projected system, or the geographic one of a file without projection.
    fn system(&self) -> Option<String> {
        let geographic = || self.code(2048).filter(|_| self.short(1024) == Some(2) && self.short(3072).is_none());
        self.code(3072).or_else(geographic).map(|code| format!("EPSG:{code}"))
    }

    /// The system and the unit of heights.
    fn heights(&self) -> Vertical {
        Vertical { code: self.code(4096), metres_per_unit: self.unit(4099, 0) }
    }

    /// Metres in the linear unit of key `code`, or, if that is user-defined, in the number of key `size`.
    fn unit(&self, code: u16, size: u16) -> Option<f64> {
        let metres = match self.short(code)? {
            9001 => 1.0,
            9002 => 0.3048,
            9003 => 1200.0 / 3937.0,
            9005 => 0.304_797_265_4,
            9030 => 1852.0,
            9031 => 1.000_013_596_5,
            9036 => 1000.0,
            9040 => 0.914_398_414_616_029,
            9041 => 0.304_799_471_538_676,
            9080 => 0.304_799_510_248_147,
            9094 => 0.304_799_710_181_509,
            9095 => 0.304_800_749_1,
            9096 => 0.9144,
            32767 => self.double(size)?,
            _ => return None,
        };
        (metres.is_finite() && metres > 0.0).then_some(metres)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::crs::codes_of;

    /// The keys as bytes, headed.
    fn keys(entries: &[[u16; 4]]) -> Vec<u8> {
        let head = [1, 1, 0, entries.len() as u16];
        [&[head], entries].concat().concat().into_iter().flat_map(u16::to_le_bytes).collect()
    }

    #[test]
    fn geotiff_keys_tell_system_and_unit() {
        let doubles: Vec<u8> = [7.0, 0.25].into_iter().flat_map(f64::to_le_bytes).collect();
        let of = |entries: &[[u16; 4]]| {
            let keys = keys(entries);
            let keys = Keys { keys: &keys, doubles: &doubles };
            (keys.system(), keys.unit(3076, 3077))
        };
        let epsg = |code| Some(format!("EPSG:{code}"));
        assert_eq!(of(&[[3072, 0, 1, 26910], [3076, 0, 1, 9002]]), (epsg(26910), Some(0.3048)));
        assert_eq!(of(&[[1024, 0, 1, 1], [2048, 0, 1, 4269], [3072, 0, 1, 2229]]), (epsg(2229), None));
        assert_eq!(of(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]]), (epsg(4326), None));
        assert_eq!(of(&[[3072, 0, 1, 32767], [3076, 0, 1, 32767], [3077, 34736, 1, 1]]), (None, Some(0.25)));
        assert_eq!(of(&[]), (None, None));
    }

    #[test]
    fn a_code_alone_tells_the_unit_and_keys_tell_that_of_heights() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.las");
        crate::io::write(&path, &crate::Cloud::from_rows(&[[1.0; 3]]).unwrap(), &Default::default()).unwrap();
        let header = crate::io::las::Records::open(&path).unwrap().header;
        let record = |entries: &[[u16; 4]]| [Vlr::new("LASF_Projection", 34735, "", keys(entries))];
        let feet = record(&[[1024, 0, 1, 1], [3072, 0, 1, 2229], [4099, 0, 1, 9001]]);
        let found = crs(&header, feet.iter());
        // Heights in metres over feet.
        let system = found.0.unwrap();
        assert_eq!((codes_of(&system).horizontal, vertical_unit_of(&system)), (Some(2229), Some(1.0)));
        assert!((found.1.unwrap() - 0.304_800_609_6).abs() < 1e-10);
        assert_eq!(other_vertical_unit(&header, feet.iter()), Some(1.0));
        let utm = record(&[[1024, 0, 1, 1], [3072, 0, 1, 32632], [4099, 0, 1, 9001]]);
        assert_eq!(crs(&header, utm.iter()), (Some("EPSG:32632".into()), Some(1.0)));
        assert_eq!(other_vertical_unit(&header, utm.iter()), None);
        let degrees = record(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]]);
        assert_eq!(crs(&header, degrees.iter()), (Some("EPSG:4326".into()), None));
        // NAVD88 in US survey feet, over metres; then only the unit of heights.
        let navd = record(&[[1024, 0, 1, 1], [3072, 0, 1, 26910], [4096, 0, 1, 6360], [4099, 0, 1, 9003]]);
        assert_eq!(crs(&header, navd.iter()), (Some("EPSG:26910+6360".into()), Some(1.0)));
        assert!((other_vertical_unit(&header, navd.iter()).unwrap() - 1200.0 / 3937.0).abs() < 1e-12);
        let unit = record(&[[1024, 0, 1, 1], [3072, 0, 1, 26910], [4099, 0, 1, 9002]]);
        let (text, metres) = crs(&header, unit.iter());
        assert_eq!((metres, vertical_unit_of(&text.unwrap())), (Some(1.0), Some(0.3048)));
    }
}
