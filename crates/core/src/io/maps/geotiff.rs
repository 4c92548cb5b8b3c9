//! Writing a raster as GeoTIFF (OGC 19-008): TIFF by the crate `tiff`, the geographic tags by this file.

use super::{Georeference, NODATA, row_from_north};
use crate::cloud::Raster;
use crate::cloud::crs::{Codes, LinearUnit, codes_of, vertical_unit_of};
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

/// Writes the raster; its coordinates and heights are in the unit of the reference system.
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
    let (keys, texts) = keys(place);
    if !keys.is_empty() {
        tags.write_tag(Tag::GeoKeyDirectoryTag, &keys[..])?;
    }
    if !texts.is_empty() {
        tags.write_tag(Tag::GeoAsciiParamsTag, &texts[..])?;
    }
    if let Some(LinearUnit { name, .. }) = place.metres_per_unit.and_then(LinearUnit::of) {
        let unit = format!("<Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">{name}</Item>");
        tags.write_tag(GDAL_METADATA, &format!("<GDALMetadata>{unit}</GDALMetadata>")[..])?;
    }
    tags.write_tag(Tag::GdalNodata, &format!("{NODATA}")[..])
}

/// The key directory, and the texts that it refers to; nothing if the system is not known.
fn keys(place: &Georeference) -> (Vec<u16>, String) {
    let crs = place.crs.as_deref().unwrap_or_default();
    let Codes { horizontal, vertical } = codes_of(crs);
    let linear = place.metres_per_unit.and_then(LinearUnit::of).map(|unit| unit.code);
    let heights = vertical_unit_of(crs).and_then(LinearUnit::of).map(|unit| unit.code);
    let text = citation(crs).filter(|_| horizontal.is_none()).unwrap_or_default();
    let own = (!text.is_empty()).then_some(OWN);
    let short = |key: u16, value: Option<u16>| value.map(|value| [key, 0, 1, value]);
    let entries = [
        short(1024, own.or(horizontal.map(|_| 1))),
        short(1025, Some(1)),
        short(3072, own.or(horizontal)),
        own.map(|_| [3073, 34737, text.len() as u16, 0]),
        short(3076, linear),
        short(4096, vertical),
        short(4099, heights),
    ];
    if own.or(horizontal).is_none() {
        return (Vec::new(), String::new());
    }
    let entries: Vec<[u16; 4]> = entries.into_iter().flatten().collect();
    let mut directory = vec![1, 1, 1, entries.len() as u16];
    directory.extend(entries.iter().flatten());
    (directory, text)
}

/// Whether the file would tell nothing of the system.
pub(super) fn loses(place: &Georeference) -> bool {
    place.crs.is_some() && keys(place).0.is_empty()
}

/// A system without a code is user-defined; GDAL reads its text (WKT 1) from the citation. Of a compound system it is that
/// of the horizontal part.
fn citation(crs: &str) -> Option<String> {
    let plane = if crs.starts_with("COMPD_CS[") { projected(crs)? } else { crs };
    let known = plane.is_ascii() && plane.starts_with("PROJCS[") && plane.len() < LONGEST;
    known.then(|| format!("ESRI PE String = {plane}|"))
}

/// The projected part of a compound system in WKT 1, up to its closing bracket.
fn projected(crs: &str) -> Option<&str> {
    let text = crs.get(crs.find("PROJCS[")?..)?;
    let (mut open, mut quoted) = (0usize, false);
    let end = text.char_indices().find(|&(_, c)| {
        match c {
            '"' => quoted = !quoted,
            '[' if !quoted => open += 1,
            ']' if !quoted => open = open.saturating_sub(1),
            _ => return false,
        }
        c == ']' && open == 0
    })?;
    text.get(..=end.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiff::decoder::{Decoder, DecodingResult};

    fn place(crs: &str, metres: f64) -> Georeference {
        Georeference { crs: Some(crs.into()), metres_per_unit: Some(metres) }
    }

    #[test]
    fn keys_tell_system_and_units() {
        let of =
            |crs: &str, metres| keys(&place(crs, metres)).0[4..].chunks(4).map(|k| [k[0], k[3]]).collect::<Vec<_>>();
        assert_eq!(of("EPSG:2154", 1.0), [[1024, 1], [1025, 1], [3072, 2154], [3076, 9001]]);
        let dutch = [[1024, 1], [1025, 1], [3072, 28992], [3076, 9001], [4096, 5709], [4099, 9001]];
        assert_eq!(of("EPSG:7415", 1.0), dutch);
        assert_eq!(of("EPSG:2229", 1200.0 / 3937.0)[3], [3076, 9003]);
        assert_eq!(keys(&Georeference::default()), (vec![], String::new()));
        assert!(keys(&place("somewhere", 1.0)).0.is_empty());
        let (own, text) = keys(&place("PROJCS[\"own\"]", 1.0));
        assert_eq!(text, "ESRI PE String = PROJCS[\"own\"]|");
        let compound = r#"COMPD_CS["both",PROJCS["own [1",UNIT["m",1]],VERT_CS["h",UNIT["m",1]]]"#;
        assert_eq!(keys(&place(compound, 1.0)).1, r#"ESRI PE String = PROJCS["own [1",UNIT["m",1]]|"#);
        assert!(loses(&place("PROJCRS[\"own\"]", 1.0)) && !loses(&place(compound, 1.0)));
        assert!(!loses(&Georeference::default()));
        assert!(own.chunks(4).any(|k| k == [3073, 34737, text.len() as u16, 0]));
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
