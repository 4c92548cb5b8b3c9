//! Writes a cloud as LAS 1.4 or LAZ.

pub(super) mod step;
pub(super) mod writer;

use super::fields::extra;
use super::fields::fit::Fit;
use super::header::vlr::Vlr;
use super::header::{RECORD_SIZES, lookup, put};
use crate::cloud::crs::{codes_of, other_unit};
use crate::cloud::{Cloud, Column, Coordinates, names};
use crate::error::{Error, Result};
use crate::io::WriteOptions;
use crate::parallel::{Monitor, watched};
use std::borrow::Cow;
use std::path::Path;
use step::{LasFrame, frame};
use writer::{CHUNK, Front, Writer};

/// Number of points encoded at once.
const SLAB: usize = 100_000;

/// Writes LAS or LAZ by the extension, columns as [`Fit`] says; the point format is the smallest of 6, 7 and 8 that has the cloud's colours.
pub(in crate::io) fn write(path: &Path, cloud: &Cloud, options: &WriteOptions) -> Result<()> {
    options.validate()?;
    let frame = frame(cloud, options)?;
    let wkt = las_wkt(cloud, &options.monitor);
    let has = |name| cloud.column(name).is_some();
    let format = if has("Infrared") {
        8
    } else if names::COLOUR.iter().any(|n| has(n)) {
        7
    } else {
        6
    };
    let Fit { fields, extras } = Fit::new(cloud.columns(), format, &options.monitor)?;
    let base = usize::from(RECORD_SIZES[usize::from(format)]);
    let length = base + extras.iter().map(|c| extra::size_of(extra::kind_of(&c.values))).sum::<usize>();
    let length16 = u16::try_from(length)
        .map_err(|_| Error::input(format!("records of {length} bytes; at most 65535 are possible")))?;
    let laz = path.extension().and_then(|e| e.to_str()).is_some_and(|e| e.eq_ignore_ascii_case("laz"));
    let mut vlrs = vlrs(wkt.as_deref(), &extras)?;
    if !cloud.class_names.is_empty() {
        let names = cloud.class_names.iter().map(|(&code, own)| (code, own.name.clone()));
        lookup::add(&mut vlrs, &names.collect::<Vec<_>>());
    }
    let front = Front {
        header: header(cloud, &RecordLayout { format, length: length16, frame, wkt: wkt.is_some() }, &options.monitor)?,
        vlrs,
        gap: Vec::new(),
        chunk: laz.then_some(CHUNK),
    };
    let mut writer = Writer::create(path, front)?;
    options.monitor.stage("write", cloud.len() as u64);
    for first in (0..cloud.len()).step_by(SLAB) {
        let points = first..(first + SLAB).min(cloud.len());
        let mut records = vec![0; points.len() * length];
        for (record, i) in records.chunks_exact_mut(length).zip(points.clone()) {
            let ticks = ticks(cloud, i, &frame, options.scale.is_some())?;
            (0..3).for_each(|a| put(record, 4 * a, &ticks[a].to_le_bytes()));
            fields
                .iter()
                .for_each(|(field, column, factor)| field.store(format, record, column.values.get(i) * factor));
            let mut at = base;
            for column in &extras {
                extra::store(&column.values, i, &mut record[at..]);
                at += extra::size_of(extra::kind_of(&column.values));
            }
        }
        writer.push(&records, &options.monitor)?;
        options.monitor.advance(points.len() as u64);
    }
    writer.finish(&options.monitor, |_| Ok(0), |_, _| {})
}

/// The scale and offset with which a cloud is written.
///
/// # Errors
/// If a scale is not above 0, or no step fits the extent and the point spacing.
pub fn las_frame(cloud: &Cloud, options: &WriteOptions) -> Result<LasFrame> {
    options.validate()?;
    frame(cloud, options)
}

/// The reference system as WKT, the only form in point formats from 6 on. Warns of what that does not tell.
pub fn las_wkt(cloud: &Cloud, monitor: &Monitor) -> Option<String> {
    let kept = cloud.wkt().filter(|wkt| wkt.len() < 65_535);
    if let (None, Some(text)) = (&kept, &cloud.crs) {
        let short: String = text.chars().take(60).collect();
        monitor.warn(format!("the reference system {short} is not kept: no WKT of it is known that fits LAS"));
    }
    let heights = |crs: &Option<String>| crs.as_deref().and_then(|crs| codes_of(crs).vertical);
    if let (Some(_), Some(code), None) = (&kept, heights(&cloud.crs), heights(&kept)) {
        monitor.warn(format!("the vertical system EPSG:{code} is not kept: it is not in our table"));
    }
    if let Some(text) = other_unit(cloud.metres_per_unit, kept.as_deref()) {
        monitor.warn(text);
    }
    kept
}

/// The stored integers of a point: the cloud's own, unless it is `rescaled`.
fn ticks(cloud: &Cloud, i: usize, frame: &LasFrame, rescaled: bool) -> Result<[i32; 3]> {
    let LasFrame { scale, offset } = frame;
    if let (Coordinates::Scaled { ticks, .. }, false) = (cloud.coordinates(), rescaled) {
        return Ok([0, 1, 2].map(|a| ticks[a][i]));
    }
    let p = cloud.xyz(i);
    match p.iter().all(|v| v.is_finite()) {
        true => Ok([0, 1, 2].map(|a| ((p[a] - offset[a]) / scale[a]).round() as i32)),
        false => Err(not_finite(i, p)),
    }
}

/// Fails if a coordinate is not finite.
pub(in crate::io) fn check_finite(cloud: &Cloud, monitor: &Monitor) -> Result<()> {
    for piece in watched(cloud.len(), monitor) {
        let wrong = piece?.map(|i| (i, cloud.xyz(i))).find(|(_, p)| !p.iter().all(|v| v.is_finite()));
        wrong.map_or(Ok(()), |(i, p)| Err(not_finite(i, p)))?;
    }
    Ok(())
}

fn not_finite(i: usize, p: [f64; 3]) -> Error {
    Error::input(format!("point {i} has coordinates {p:?}; LAS holds finite ones only: filter outliers first"))
}

fn vlrs(wkt: Option<&str>, extras: &[Cow<'_, Column>]) -> Result<Vec<Vlr>> {
    let mut vlrs = Vec::new();
    if let Some(wkt) = wkt {
        let data = [wkt.as_bytes(), &[0]].concat();
        vlrs.push(Vlr::new("LASF_Projection", 2112, "OGC coordinate system WKT", data));
    }
    let mut data = Vec::new();
    for column in extras {
        data.extend(extra::descriptor(column)?);
    }
    if data.len() > 65_535 {
        return Err(Error::input(format!("{} extra dimensions; at most 341 are possible", extras.len())));
    }
    if !data.is_empty() {
        vlrs.push(Vlr::new("LASF_Spec", 4, "Extra Bytes Record", data));
    }
    Ok(vlrs)
}

/// How the points are stored.
struct RecordLayout {
    /// Point format.
    format: u8,
    /// Bytes of a record.
    length: u16,
    frame: LasFrame,
    /// Whether the reference system is stored as WKT.
    wkt: bool,
}

fn header(cloud: &Cloud, layout: &RecordLayout, monitor: &Monitor) -> Result<Vec<u8>> {
    let RecordLayout { format, length, frame: LasFrame { scale, offset }, wkt } = *layout;
    let mut raw = vec![0; 375];
    put(&mut raw, 0, b"LASF");
    // Adjusted standard GPS time, and WKT if there is one (the only CRS in formats from 6 on).
    put(&mut raw, 6, &(1u16 | if wkt { 16 } else { 0 }).to_le_bytes());
    raw[24] = 1;
    raw[25] = 4;
    put(&mut raw, 26, b"scansion");
    put(&mut raw, 58, concat!("scansion ", env!("CARGO_PKG_VERSION")).as_bytes());
    put(&mut raw, 94, &375u16.to_le_bytes());
    raw[104] = format;
    put(&mut raw, 105, &length.to_le_bytes());
    put(&mut raw, 247, &(cloud.len() as u64).to_le_bytes());
    let [low, high] = cloud.bounds_watched(monitor)?.unwrap_or([[0.0; 3]; 2]);
    for a in 0..3 {
        put(&mut raw, 131 + 8 * a, &scale[a].to_le_bytes());
        put(&mut raw, 155 + 8 * a, &offset[a].to_le_bytes());
        put(&mut raw, 179 + 16 * a, &high[a].to_le_bytes());
        put(&mut raw, 187 + 16 * a, &low[a].to_le_bytes());
    }
    if let Some(returns) = cloud.column(names::RETURN_NUMBER) {
        let mut counts = [0u64; 16];
        for piece in watched(cloud.len(), monitor) {
            piece?.for_each(|i| counts[(returns.values.get(i) as usize).min(15)] += 1);
        }
        (1..=15).for_each(|r| put(&mut raw, 247 + 8 * r, &counts[r].to_le_bytes()));
    }
    Ok(raw)
}
