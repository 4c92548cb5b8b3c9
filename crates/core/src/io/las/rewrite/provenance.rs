//! How the classes of a file were made: text in a record of the user `scansion`, number 1.

use crate::error::{Error, Result};
use crate::io::las::header::vlr::Vlr;

const USER: &str = "scansion";
const NUMBER: u16 = 1;

/// Stores the text; one that is there is replaced.
///
/// # Errors
/// If the text has more than 65,535 bytes.
pub(super) fn put(vlrs: &mut Vec<Vlr>, text: &str) -> Result<()> {
    if text.len() > usize::from(u16::MAX) {
        return Err(Error::input(format!("provenance of {} bytes; a record holds 65535", text.len())));
    }
    vlrs.retain(|v| !v.is(USER, NUMBER));
    vlrs.push(Vlr::new(USER, NUMBER, "How the classes were made", text.as_bytes().to_vec()));
    Ok(())
}

/// The text, if the file has one; bytes that are no text are left out.
pub(in crate::io::las) fn get(vlrs: &[Vlr]) -> Option<String> {
    let record = vlrs.iter().find(|v| v.is(USER, NUMBER))?;
    Some(String::from_utf8_lossy(&record.data).trim_end_matches('\0').to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_text_replaces_the_one_before() {
        let mut vlrs = vec![Vlr::new("LASF_Spec", 4, "other", vec![1, 2])];
        assert_eq!(get(&vlrs), None);
        put(&mut vlrs, "first").unwrap();
        put(&mut vlrs, "second").unwrap();
        assert_eq!((get(&vlrs).as_deref(), vlrs.len()), (Some("second"), 2));
        assert!(put(&mut vlrs, &"x".repeat(70_000)).is_err());
    }
}
