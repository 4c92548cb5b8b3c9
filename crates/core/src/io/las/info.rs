//! Information from header and records of a file, without reading points.

use super::copc;
use super::fields::of_format;
use super::header::crs::Projection;
use super::records::Records;
use super::rewrite::provenance;
use crate::error::Result;
use crate::io::FileInfo;
use std::path::Path;

pub(in crate::io) fn inspect(path: &Path) -> Result<FileInfo> {
    let mut records = Records::open(path)?;
    let mut warnings = Vec::new();
    let octree = copc::is(&records).then(|| copc::describe(&mut records));
    if let Some(Err(e)) = &octree {
        warnings.push(format!("the octree is damaged, only the whole file can be read: {e}"));
    }
    let header = &records.header;
    let (extras, undescribed) = records.extras();
    let all = records.vlrs.iter().chain(&records.evlrs);
    let Projection { crs, metres_per_unit, warning } = Projection::of(header.wkt(), all);
    let fields = of_format(header.format).map(|(_, name)| name.to_string());
    if undescribed > 0 {
        warnings.push(format!("{undescribed} extra bytes a point have no descriptor; they are kept, not shown"));
    }
    if (0..3).any(|a| header.low[a] > header.high[a]) && header.points > 0 {
        warnings.push("the bounds in the header are not in order".into());
    }
    warnings.extend(warning);
    if let Some(offset) = header.time().1 {
        warnings
            .push(format!("GPS times count from {offset} million seconds; other formats than LAS do not keep that"));
    }
    if crs.is_none() {
        warnings.push("no coordinate reference system".into());
    }
    Ok(FileInfo {
        path: path.to_path_buf(),
        format: match (header.compressed, octree.is_some()) {
            (true, true) => "COPC",
            (true, false) => "LAZ",
            (false, _) => "LAS",
        }
        .into(),
        version: Some(format!("1.{}", header.minor)),
        point_format: Some(header.format),
        points: header.points,
        bounds: (header.points > 0).then_some([header.low, header.high]),
        scale: Some(header.scale),
        offset: Some(header.offset),
        crs,
        metres_per_unit,
        vertical: None,
        dimensions: fields.chain(extras.into_iter().map(|e| e.name)).collect(),
        vlrs: records
            .vlrs
            .iter()
            .chain(&records.evlrs)
            .map(|v| format!("{} {}", v.user(), super::header::u16_at(&v.head, 18)))
            .collect(),
        provenance: provenance::get(&records.vlrs),
        warnings,
        octree: octree.and_then(Result::ok),
    })
}

#[cfg(test)]
mod tests {
    use super::super::chunks::encode_table;
    use super::*;
    use crate::cloud::Cloud;
    use crate::io;
    use std::io::{Seek, SeekFrom, Write};
    use std::time::{Duration, Instant};

    /// Header, records and chunk table of a LAZ file with a gigabyte and 200 million points; its chunks are a sparse
    /// region of the file.
    #[test]
    fn a_gigabyte_of_laz_is_described_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.laz");
        io::write(&path, &Cloud::from_rows(&[[1.0, 2.0, 3.0]; 9]).unwrap(), &Default::default()).unwrap();
        let records = Records::open(&path).unwrap();
        let (start, vlr) = (records.header.points_at, &records.chunks.as_ref().unwrap().vlr);
        let sizes = vec![(50_000, 262_144); 4000];
        let table = encode_table(&path, vlr, &sizes).unwrap();
        let mut file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        let mut put = |at: u64, bytes: &[u8]| {
            file.seek(SeekFrom::Start(at)).unwrap();
            file.write_all(bytes).unwrap();
        };
        let end = start + 8 + 4000 * 262_144;
        put(247, &200_000_000u64.to_le_bytes());
        put(start, &end.to_le_bytes());
        put(end, &table);
        let times = (0..5).map(|_| {
            let begin = Instant::now();
            assert_eq!(inspect(&path).unwrap().points, 200_000_000);
            begin.elapsed()
        });
        let best = times.min().unwrap();
        // The goal is 50 ms; busy machines and debug builds are allowed more.
        assert!(best < Duration::from_millis(200), "{best:?}");
    }
}
