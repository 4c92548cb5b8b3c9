//! Writing a raster as GeoTIFF (OGC 19-008): TIFF by the crate `tiff`, the geographic tags by this file.

use super::{Georeference, NODATA, row_from_north};
use crate::cloud::Raster;
use crate::cloud::crs::{
    AngularUnit, Codes, LinearUnit, Unit, codes_of, is_geocentric, part_of, unit_of, vertical_unit_of,
};
use crate::error::{Error, Result};
use crate::io::atomic::AtomicFile;
use crate::memory;
use crate::parallel::Monitor;
use std::io::{Seek, Write};
use std::path::Path;
use tiff::encoder::colortype::Gray32Float;
use tiff::encoder::{Compression, DeflateLevel, ImageEncoder, TiffEncoder, TiffKind};
use tiff::tags::Tag;
use tiff::{TiffError, TiffResult};

/// Bytes of a strip before compression, about.
const STRIP: usize = 1 << 18;

/// GDAL's metadata, among them the unit of the heights.
const GDAL_METADATA: Tag = Tag::Unknown(42112);

/// Code of what has none.
const OWN: u16 = 32767;

/// Longest text of a system that GDAL reads.
const LONGEST: usize = 2300;

/// Writes the raster; its coordinates and heights are in the units of the reference system.
pub(super) fn write(path: &Path, raster: &Raster, place: &Georeference, monitor: &Monitor) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    encode(file.writer()?, raster, place, monitor).map_err(|problem| match problem {
        Problem::Core(error) => error,
        Problem::Tiff(TiffError::IoError(error)) => Error::io(path, error),
        Problem::Tiff(error) => Error::input(format!("{}: {error}", path.display())),
    })?;
    file.finish()
}

enum Problem {
    Core(Error),
    Tiff(TiffError),
}

impl From<TiffError> for Problem {
    fn from(error: TiffError) -> Self {
        Self::Tiff(error)
    }
}

fn encode<W: Write + Seek>(
    to: W,
    raster: &Raster,
    place: &Georeference,
    monitor: &Monitor,
) -> std::result::Result<(), Problem> {
    let [columns, rows] = [raster.columns(), raster.rows()].map(|n| n as u32);
    let mut heights: Vec<f32> = Vec::new();
    memory::reserve(&mut heights, raster.values().len(), "the heights of a raster").map_err(Problem::Core)?;
    for row in 0..raster.rows() {
        monitor.check().map_err(Problem::Core)?;
        heights.extend(row_from_north(raster, row));
    }
    let mut tiff = TiffEncoder::new(to)?.with_compression(Compression::Deflate(DeflateLevel::Balanced));
    let mut image = tiff.new_image::<Gray32Float>(columns, rows)?;
    image.rows_per_strip((STRIP / 4 / raster.columns()).clamp(1, raster.rows()) as u32)?;
    tags(&mut image, raster, place)?;
    // Strip by strip, the crate would not compress.
    Ok(image.write_data(&heights)?)
}

fn tags<W: Write + Seek, K: TiffKind>(
    image: &mut ImageEncoder<'_, W, Gray32Float, K>,
    raster: &Raster,
    place: &Georeference,
) -> TiffResult<()> {
    let ([west, south], cell) = (raster.origin(), raster.cell());
    let north = south + cell * raster.rows() as f64;
    let tags = image.encoder();
    tags.write_tag(Tag::ModelPixelScaleTag, &[cell, cell, 0.0][..])?;
    tags.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, west, north, 0.0][..])?;
    let Keys { directory, texts, doubles } = keys(place);
    if !directory.is_empty() {
        tags.write_tag(Tag::GeoKeyDirectoryTag, &directory[..])?;
    }
    if !doubles.is_empty() {
        tags.write_tag(Tag::GeoDoubleParamsTag, &doubles[..])?;
    }
    if !texts.is_empty() {
        tags.write_tag(Tag::GeoAsciiParamsTag, &texts[..])?;
    }
    if let Some(LinearUnit { name, .. }) = place.metres_per_height().and_then(LinearUnit::of) {
        let unit = format!("<Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">{name}</Item>");
        tags.write_tag(GDAL_METADATA, &format!("<GDALMetadata>{unit}</GDALMetadata>")[..])?;
    }
    tags.write_tag(Tag::GdalNodata, &format!("{NODATA}")[..])
}

/// GeoTIFF keys (OGC 19-008), and the texts and numbers that they refer to.
#[derive(Debug, Default, PartialEq)]
struct Keys {
    directory: Vec<u16>,
    texts: String,
    doubles: Vec<f64>,
}

/// What the horizontal part of a system is: the value of the key of the model type.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Model {
    Projected = 1,
    Geographic = 2,
    Geocentric = 3,
}

impl Model {
    /// Codes that are not in our table are taken for projected systems.
    fn of(crs: &str) -> Self {
        match unit_of(crs) {
            Some(Unit::Angle(_)) => Self::Geographic,
            _ if is_geocentric(crs) => Self::Geocentric,
            _ => Self::Projected,
        }
    }
}

/// The keys of a place; none if neither the system nor the unit is known.
fn keys(place: &Georeference) -> Keys {
    let crs = place.crs.as_deref().unwrap_or_default();
    let Codes { horizontal, vertical } = codes_of(crs);
    let model = Model::of(crs);
    let text = citation(crs).filter(|_| horizontal.is_none());
    if horizontal.is_none() && text.is_none() {
        return unit_alone(place);
    }
    let (own, projected) = (text.is_some().then_some(OWN), model == Model::Projected);
    let text = text.unwrap_or_default();
    let metres = place.metres_per_unit.filter(|_| model != Model::Geographic);
    let linear = metres.map(|metres| LinearUnit::of(metres).map_or(OWN, |unit| unit.code));
    let angular = match unit_of(crs) {
        Some(Unit::Angle(radians)) => Some(radians),
        _ => None,
    };
    let angle = angular.map(|radians| AngularUnit::of(radians).map_or(OWN, |unit| unit.code));
    let (linear, earth_centred) = if projected { (linear, None) } else { (None, linear) };
    let entries = [
        short(1024, own.or(Some(model as u16))),
        short(1025, Some(1)),
        short(2048, horizontal.filter(|_| !projected)),
        short(2052, earth_centred),
        own_unit(2053, earth_centred),
        short(2054, angle),
        own_unit(2055, angle),
        short(3072, own.or(horizontal).filter(|_| projected)),
        own.map(|_| [3073, 34737, text.len() as u16, 0]),
        short(3076, linear),
        own_unit(3077, linear),
        short(4096, vertical),
        short(4099, height_unit(place)),
    ];
    let own_angle = angular.filter(|_| angle == Some(OWN));
    Keys {
        directory: directory(&entries),
        texts: text,
        doubles: own_angle.into_iter().chain(own_size(metres)).collect(),
    }
}

/// The unit of heights, if the system tells it; one without a code has no place in the keys.
fn height_unit(place: &Georeference) -> Option<u16> {
    vertical_unit_of(place.crs.as_deref()?)?;
    place.metres_per_height().and_then(LinearUnit::of).map(|unit| unit.code)
}

/// The keys of a plane of which only the unit is known.
fn unit_alone(place: &Georeference) -> Keys {
    let Some(metres) = place.metres_per_unit else { return Keys::default() };
    let linear = Some(LinearUnit::of(metres).map_or(OWN, |unit| unit.code));
    let texts = "unknown|".to_string();
    let entries = [
        short(1024, Some(OWN)),
        short(1025, Some(1)),
        Some([1026, 34737, texts.len() as u16, 0]),
        short(3076, linear),
        own_unit(3077, linear),
        short(4096, place.crs.as_deref().and_then(|crs| codes_of(crs).vertical)),
        short(4099, height_unit(place)),
    ];
    Keys { directory: directory(&entries), texts, doubles: own_size(Some(metres)) }
}

/// A key with a number.
fn short(key: u16, value: Option<u16>) -> Option<[u16; 4]> {
    value.map(|value| [key, 0, 1, value])
}

/// The key that refers to the size of a unit that has no code: the first number, as a system has one unit of x and y.
fn own_unit(key: u16, code: Option<u16>) -> Option<[u16; 4]> {
    code.filter(|&code| code == OWN).map(|_| [key, 34736, 1, 0])
}

/// The size of a unit that has no code.
fn own_size(metres: Option<f64>) -> Vec<f64> {
    metres.filter(|&metres| LinearUnit::of(metres).is_none()).into_iter().collect()
}

/// The entries, headed by the version of the format and their number.
fn directory(entries: &[Option<[u16; 4]>]) -> Vec<u16> {
    let entries: Vec<[u16; 4]> = entries.iter().copied().flatten().collect();
    let head = [1, 1, 1, entries.len() as u16];
    head.into_iter().chain(entries.concat()).collect()
}

/// Whether the file would tell nothing of the system.
pub(super) fn loses(place: &Georeference) -> bool {
    place.crs.as_deref().is_some_and(|crs| codes_of(crs).horizontal.is_none() && citation(crs).is_none())
}

/// A system without a code is user-defined; GDAL reads its text (WKT 1) from the citation. Of a compound system it is that
/// of the horizontal part.
fn citation(crs: &str) -> Option<String> {
    let plane = if crs.starts_with("COMPD_CS[") { part_of(crs, "PROJCS[")? } else { crs };
    let known = plane.is_ascii() && plane.starts_with("PROJCS[") && plane.len() < LONGEST;
    known.then(|| format!("ESRI PE String = {plane}|"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiff::decoder::{Decoder, DecodingResult};

    fn place(crs: &str, metres: f64) -> Georeference {
        Georeference { crs: Some(crs.into()), metres_per_unit: Some(metres) }
    }

    fn of(place: &Georeference) -> Vec<[u16; 2]> {
        let keys = keys(place).directory;
        keys.get(4..).unwrap_or_default().chunks(4).map(|key| [key[0], key[3]]).collect()
    }

    #[test]
    fn keys_tell_system_and_units() {
        let of = |crs: &str, metres| of(&place(crs, metres));
        assert_eq!(of("EPSG:2154", 1.0), [[1024, 1], [1025, 1], [3072, 2154], [3076, 9001]]);
        let dutch = [[1024, 1], [1025, 1], [3072, 28992], [3076, 9001], [4096, 5709], [4099, 9001]];
        assert_eq!(of("EPSG:7415", 1.0), dutch);
        assert_eq!(of("EPSG:2229", 1200.0 / 3937.0)[3], [3076, 9003]);
        assert_eq!(keys(&Georeference::default()), Keys::default());
        let Keys { directory: own, texts: text, .. } = keys(&place("PROJCS[\"own\"]", 1.0));
        assert_eq!(text, "ESRI PE String = PROJCS[\"own\"]|");
        let compound = r#"COMPD_CS["both",PROJCS["own [1",UNIT["m",1]],VERT_CS["h",UNIT["m",1]]]"#;
        assert_eq!(keys(&place(compound, 1.0)).texts, r#"ESRI PE String = PROJCS["own [1",UNIT["m",1]]|"#);
        assert!(loses(&place("PROJCRS[\"own\"]", 1.0)) && !loses(&place(compound, 1.0)));
        assert!(!loses(&Georeference::default()) && loses(&place("somewhere", 1.0)));
        assert!(own.chunks(4).any(|k| k == [3073, 34737, text.len() as u16, 0]));
    }

    #[test]
    fn heights_have_their_own_system_and_unit() {
        // NAVD88 in US survey feet over metres.
        let navd = place("EPSG:26910+6360", 1.0);
        let keys = [[1024, 1], [1025, 1], [3072, 26910], [3076, 9001], [4096, 6360], [4099, 9003]];
        assert_eq!(of(&navd), keys);
        assert!((navd.metres_per_height().unwrap() - 1200.0 / 3937.0).abs() < 1e-12);
        // A code that is not in the table is kept; its unit is not known.
        let unknown = place("EPSG:26910+5103", 1.0);
        assert_eq!((of(&unknown)[4..].to_vec(), unknown.metres_per_height()), (vec![[4096, 5103]], Some(1.0)));
        // A unit given by the user is that of x, y and heights.
        assert_eq!(place("EPSG:26910+5703", 0.3048).metres_per_height(), Some(0.3048));
    }

    #[test]
    fn geographic_and_geocentric_systems_are_no_projected_ones() {
        let degrees = Georeference { crs: Some("EPSG:4326".into()), metres_per_unit: None };
        assert_eq!(of(&degrees), [[1024, 2], [1025, 1], [2048, 4326], [2054, 9102]]);
        let grads = |code| Georeference { crs: Some(format!("EPSG:{code}")), metres_per_unit: None };
        for code in [4807, 4810, 4811, 4816, 4819, 4821, 4901, 4902] {
            assert_eq!(of(&grads(code)), [[1024, 2], [1025, 1], [2048, code], [2054, 9105]]);
        }
        let own = r#"GEOGCS["a",UNIT["unit",0.1],AUTHORITY["EPSG","4807"]]"#;
        let own = keys(&Georeference { crs: Some(own.into()), metres_per_unit: None });
        assert_eq!((&own.directory[16..], own.doubles), (&[2054, 0, 1, 32767, 2055, 34736, 1, 0][..], vec![0.1]));
        // A geocentric system in WKT 2, with a code of the table and with another.
        for code in [4978, 64000] {
            let two = format!(
                r#"GEODCRS["c",CS[Cartesian,3],AXIS["(X)",geocentricX],LENGTHUNIT["metre",1],ID["EPSG",{code}]]"#
            );
            for crs in [two, "EPSG:4978".into()].into_iter().take(if code == 4978 { 2 } else { 1 }) {
                assert_eq!(of(&place(&crs, 1.0)), [[1024, 3], [1025, 1], [2048, code], [2052, 9001]]);
            }
        }
        // Without a code, nothing but the unit is kept, and the loss is told.
        let two = r#"GEODCRS["c",CS[Cartesian,3],AXIS["(X)",geocentricX],LENGTHUNIT["foot",0.3048]]"#;
        assert_eq!(of(&place(two, 0.3048)), [[1024, 32767], [1025, 1], [1026, 0], [3076, 9002]]);
        assert!(loses(&place(two, 0.3048)));
    }

    #[test]
    fn a_unit_without_a_system_is_kept() {
        let unit = |metres| Georeference { crs: None, metres_per_unit: Some(metres) };
        assert_eq!(of(&unit(0.3048)), [[1024, 32767], [1025, 1], [1026, 0], [3076, 9002]]);
        assert_eq!(of(&unit(1000.0))[3], [3076, 9036]);
        let own = keys(&unit(100.0));
        assert_eq!(
            (&own.directory[16..], &own.doubles[..]),
            (&[3076, 0, 1, 32767, 3077, 34736, 1, 0][..], &[100.0][..])
        );
        // Heights over it.
        let heights = r#"COMPD_CS["unknown",LOCAL_CS["unknown",UNIT["metre",1]],VERT_CS["v",UNIT["foot",0.3048],AUTHORITY["EPSG","8228"]]]"#;
        let keys = [[1024, 32767], [1025, 1], [1026, 0], [3076, 9001], [4096, 8228], [4099, 9002]];
        assert_eq!(of(&place(heights, 1.0)), keys);
    }

    #[test]
    fn heights_that_the_file_cannot_hold_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.tif", "a.asc"] {
            let path = folder.path().join(name);
            for height in [-9999.0, -9999.0001, 1e39, -1e39] {
                let raster = Raster::new([0.0; 2], 1.0, 2, vec![1.0, f64::NAN, 2.0, height]).unwrap();
                let written = crate::io::write_raster(&path, &raster, &Georeference::default(), &Monitor::default());
                let text = written.unwrap_err().to_string();
                assert!(text.contains("row 0 from the north, column 1") && !path.exists(), "{text}");
            }
            let raster = Raster::new([0.0; 2], 1.0, 1, vec![-9998.0, 3e38]).unwrap();
            crate::io::write_raster(&path, &raster, &Georeference::default(), &Monitor::default()).unwrap();
            for metres in [0.0, -1.0, f64::NAN] {
                let place = Georeference { crs: None, metres_per_unit: Some(metres) };
                assert!(crate::io::write_raster(&path, &raster, &place, &Monitor::default()).is_err());
            }
        }
    }

    #[test]
    fn a_raster_comes_back_from_tiff_with_north_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        for [columns, rows] in [[3, 2], [1, 1], [700, 400], [70_000, 3]] {
            let values: Vec<f64> =
                (0..columns * rows).map(|i| if i == 1 { f64::NAN } else { i as f64 * 0.25 }).collect();
            let raster = Raster::new([1000.0, 2000.0], 0.5, columns, values.clone()).unwrap();
            write(&path, &raster, &place("EPSG:2154", 1.0), &Monitor::default()).unwrap();
            let mut tiff = Decoder::new(std::fs::File::open(&path).unwrap()).unwrap();
            assert_eq!(tiff.dimensions().unwrap(), (columns as u32, rows as u32));
            let DecodingResult::F32(read) = tiff.read_image().unwrap() else { panic!("not floats") };
            for (i, &value) in values.iter().enumerate() {
                let found = read[(rows - 1 - i / columns) * columns + i % columns];
                assert_eq!(found, if value.is_nan() { NODATA } else { value as f32 });
            }
            let tie = tiff.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap();
            assert_eq!(tie, [0.0, 0.0, 0.0, 1000.0, 2000.0 + 0.5 * rows as f64, 0.0]);
            assert_eq!(tiff.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap(), [0.5, 0.5, 0.0]);
            assert_eq!(tiff.get_tag_ascii_string(Tag::GdalNodata).unwrap(), "-9999");
        }
    }
}
