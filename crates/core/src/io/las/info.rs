//! What header and records of a file say, without reading a point.

use super::extra;
use super::fields::of_format;
use super::records::Records;
use super::vlr::crs;
use crate::error::Result;
use crate::io::FileInfo;
use std::path::Path;

pub(in crate::io) fn inspect(path: &Path) -> Result<FileInfo> {
    let records = Records::open(path)?;
    let header = &records.header;
    let (extras, undescribed) = extra::described(header, &records.vlrs);
    let (crs, metres_per_unit) = crs(header, records.vlrs.iter().chain(&records.evlrs));
    let fields = of_format(header.format).map(|(_, name)| name.to_string());
    let mut warnings = Vec::new();
    if undescribed > 0 {
        warnings.push(format!("{undescribed} extra bytes a point have no descriptor; they are kept, not shown"));
    }
    if (0..3).any(|a| header.low[a] > header.high[a]) && header.points > 0 {
        warnings.push("the bounds in the header are not in order".into());
    }
    if crs.is_none() {
        warnings.push("no coordinate reference system".into());
    }
    Ok(FileInfo {
        path: path.to_path_buf(),
        format: if header.compressed { "LAZ" } else { "LAS" }.into(),
        version: Some(format!("1.{}", header.minor)),
        point_format: Some(header.format),
        points: header.points,
        bounds: (header.points > 0).then_some((header.low, header.high)),
        scale: Some(header.scale),
        offset: Some(header.offset),
        crs,
        metres_per_unit,
        dimensions: fields.chain(extras.into_iter().map(|e| e.name)).collect(),
        vlrs: records
            .vlrs
            .iter()
            .chain(&records.evlrs)
            .map(|v| format!("{} {}", v.user(), super::header::u16_at(&v.head, 18)))
            .collect(),
        warnings,
    })
}
