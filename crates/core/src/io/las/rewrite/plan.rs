//! The destination of each edit in the output record.

use super::promote;
use crate::cloud::{Column, Values};
use crate::error::{Error, Result};
use crate::io::Edit;
use crate::io::las::fields::Field;
use crate::io::las::fields::extra::{self, Extra};
use crate::io::las::header::vlr::Vlr;
use crate::io::las::header::{RECORD_SIZES, put};
use crate::io::las::records::Records;
use crate::io::las::write::writer::Front;
use crate::io::table::edits::check_distinct;
use rayon::prelude::*;

/// The destination of a dimension's values in the output record.
struct Slot<'a> {
    at: usize,
    values: &'a Values,
}

/// All changes.
pub(super) struct RecordChanges<'a> {
    codes: Option<&'a [u8]>,
    colours: Option<&'a [[u8; 3]]>,
    slots: Vec<Slot<'a>>,
    /// Point format of the input, and of the output if it differs.
    format: u8,
    to: Option<u8>,
    pub(super) old_length: usize,
    pub(super) new_length: usize,
}

/// Finds the destination of each edit and extends record length and descriptors.
pub(super) fn plan<'a>(
    records: &Records,
    front: &mut Front,
    edits: &'a [Edit],
    to: Option<u8>,
) -> Result<RecordChanges<'a>> {
    check_distinct(edits)?;
    let header = &records.header;
    let format = to.unwrap_or(header.format);
    let base = usize::from(RECORD_SIZES[usize::from(format)]);
    let moved = base as isize - isize::try_from(usize::from(RECORD_SIZES[usize::from(header.format)])).unwrap_or(0);
    let (known, undescribed) = records.extras();
    let mut length = base + header.extra();
    let (mut slots, mut added, mut codes, mut colours) = (Vec::new(), Vec::new(), None, None);
    for edit in edits {
        let column = match edit {
            Edit::Dimension(column) => column,
            Edit::Classification(new) => {
                codes = Some(&new[..]);
                continue;
            }
            Edit::Colour(new) => {
                colours = Some(&new[..]);
                continue;
            }
            Edit::ClassNames(_) | Edit::OtherClassNames(_) | Edit::Provenance(_) => continue,
        };
        if Field::named(&column.name, format).is_some() {
            let allowed = "a name that the point format does not use itself";
            return Err(Error::parameter("dimension", &column.name, allowed));
        }
        match known.iter().find(|e| e.name == column.name) {
            Some(old) => {
                slots.push(Slot { at: same_type(old, column)?.saturating_add_signed(moved), values: &column.values });
            }
            None => {
                slots.push(Slot { at: length, values: &column.values });
                added.extend(extra::descriptor(column)?);
                length += extra::size_of(extra::kind_of(&column.values));
            }
        }
    }
    if !added.is_empty() {
        // The descriptors of an extended record must come first, because descriptors are in the order of the bytes.
        for extended in records.evlrs.iter().filter(|v| extra::is_record(v)) {
            let whole = extended.data.len() / 192 * 192;
            describe(&mut front.vlrs, 0, &extended.data[..whole])?;
        }
        describe(&mut front.vlrs, undescribed, &added)?;
    }
    let new_length = u16::try_from(length)
        .map_err(|_| Error::input(format!("records of {length} bytes; at most 65535 are possible")))?;
    put(&mut front.header, 105, &new_length.to_le_bytes());
    let old_length = usize::from(header.record_length);
    Ok(RecordChanges { codes, colours, slots, format: header.format, to, old_length, new_length: length })
}

fn same_type(old: &Extra, column: &Column) -> Result<usize> {
    match old.kind == extra::kind_of(&column.values) && old.scaled.is_none() {
        true => Ok(old.at),
        false => Err(Error::parameter(
            "dimension",
            &column.name,
            "another name: the file has a dimension of this name and another type",
        )),
    }
}

/// Adds descriptors to the Extra Bytes record, or creates it. Several records become one, the first, because other software
/// reads only that one.
pub(in crate::io::las) fn describe(vlrs: &mut Vec<Vlr>, undescribed: usize, added: &[u8]) -> Result<()> {
    let described = vlrs.iter().filter(|v| extra::is_record(v));
    let mut data: Vec<u8> = described.flat_map(|v| &v.data[..v.data.len() / 192 * 192]).copied().collect();
    data.extend(extra::undescribed(undescribed));
    data.extend_from_slice(added);
    match vlrs.iter().position(extra::is_record) {
        Some(first) => {
            let mut place = 0..;
            vlrs.retain(|v| !extra::is_record(v) | (place.next() == Some(first)));
            vlrs[first].set_data(data);
        }
        None => vlrs.push(Vlr::new("LASF_Spec", 4, "Extra Bytes Record", data)),
    }
    match vlrs.iter().any(|v| extra::is_record(v) && v.data.len() > 65_535) {
        true => Err(Error::input("more than 341 extra dimensions do not fit into one Extra Bytes record")),
        false => Ok(()),
    }
}

impl RecordChanges<'_> {
    /// Whether records can be changed in place.
    pub(super) fn keeps_length(&self) -> bool {
        self.to.is_none() && self.old_length == self.new_length
    }

    /// Changes a record in place.
    pub(super) fn apply(&self, record: &mut [u8], i: usize) {
        let format = self.to.unwrap_or(self.format);
        if let Some(codes) = self.codes {
            Field::Classification.store(format, record, f64::from(codes[i]));
        }
        if let Some(colours) = self.colours {
            for (field, value) in [Field::Red, Field::Green, Field::Blue].into_iter().zip(colours[i]) {
                field.store(format, record, 257.0 * f64::from(value));
            }
        }
        for slot in &self.slots {
            extra::store(slot.values, i, &mut record[slot.at..]);
        }
    }

    /// Copies records into longer ones or another format, and changes them.
    pub(super) fn widen(&self, old: &[u8], first: usize) -> Vec<u8> {
        let mut new = vec![0; old.len() / self.old_length * self.new_length];
        let pairs = new.par_chunks_exact_mut(self.new_length).zip(old.par_chunks_exact(self.old_length));
        pairs.with_min_len(8192).enumerate().for_each(|(i, (to, from))| {
            match self.to {
                Some(format) => promote::record(self.format, format, from, to),
                None => to[..from.len()].copy_from_slice(from),
            }
            self.apply(to, first + i);
        });
        new
    }
}
