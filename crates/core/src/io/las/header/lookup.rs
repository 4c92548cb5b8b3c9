//! The Classification Lookup record (LAS 1.4 R15, `LASF_Spec` 0): names of class codes, 15 bytes each.

use super::vlr::Vlr;
use crate::cloud::{ClassNames, OwnClass};

const ENTRY: usize = 16;

/// Adds names of codes. Existing names are kept; a record whose length is not the standard's is not changed.
pub(in crate::io::las) fn add(vlrs: &mut Vec<Vlr>, names: &[(u8, String)]) {
    let is_lookup = |v: &Vlr| v.is("LASF_Spec", 0);
    if !vlrs.iter().any(is_lookup) {
        let data = (0..=255u8).flat_map(|code| std::iter::once(code).chain([0; ENTRY - 1])).collect();
        vlrs.push(Vlr::new("LASF_Spec", 0, "Classification lookup", data));
    }
    let Some(vlr) = vlrs.iter_mut().find(|v| is_lookup(v)) else { return };
    if vlr.data.len() != 256 * ENTRY {
        return;
    }
    for (code, name) in names {
        let at = usize::from(*code) * ENTRY;
        let Some(entry) = vlr.data.get_mut(at..at + ENTRY) else { continue };
        if entry[0] == *code && entry[1..].iter().all(|&b| b == 0) {
            let plain = name.bytes().filter(|b| b.is_ascii_graphic() || *b == b' ');
            entry[1..].iter_mut().zip(plain).for_each(|(slot, b)| *slot = b);
        }
    }
}

/// Removes the names of these codes.
pub(in crate::io::las) fn remove(vlrs: &mut [Vlr], names: &[(u8, String)]) {
    for vlr in vlrs.iter_mut().filter(|v| v.is("LASF_Spec", 0) && v.data.len() == 256 * ENTRY) {
        for (code, _) in names {
            let at = usize::from(*code) * ENTRY;
            vlr.data[at..at + ENTRY].fill(0);
            vlr.data[at] = *code;
        }
    }
}

/// The names in a file; none if the record's length is not the standard's.
pub(in crate::io::las) fn get(vlrs: &[Vlr]) -> ClassNames {
    let of_standard = |v: &&Vlr| v.is("LASF_Spec", 0) && v.data.len() == 256 * ENTRY;
    let Some(vlr) = vlrs.iter().find(of_standard) else { return ClassNames::new() };
    let name = |entry: &[u8]| {
        let text = entry[1..].split(|&b| b == 0).next().unwrap_or_default();
        String::from_utf8_lossy(text.trim_ascii()).into_owned()
    };
    let all = vlr.data.chunks_exact(ENTRY).map(|entry| (entry[0], OwnClass { name: name(entry), colour: None }));
    all.filter(|(_, own)| !own.name.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(vlrs: &[Vlr], code: usize) -> String {
        let entry = &vlrs[0].data[code * ENTRY..(code + 1) * ENTRY];
        assert_eq!(usize::from(entry[0]), code);
        String::from_utf8_lossy(&entry[1..]).trim_end_matches('\0').to_string()
    }

    #[test]
    fn names_are_added_and_old_ones_stay() {
        let mut vlrs = Vec::new();
        add(&mut vlrs, &[(2, "ground".into()), (5, "a name of more than fifteen bytes".into())]);
        add(&mut vlrs, &[(2, "other".into()), (255, "last".into())]);
        assert_eq!((name(&vlrs, 2), name(&vlrs, 5)), ("ground".to_string(), "a name of more ".to_string()));
        assert_eq!((name(&vlrs, 255), name(&vlrs, 7)), ("last".to_string(), String::new()));
        assert_eq!((vlrs.len(), vlrs[0].data.len()), (1, 4096));
        let names: Vec<(u8, String)> = get(&vlrs).into_iter().map(|(code, own)| (code, own.name)).collect();
        assert_eq!(names, [(2, "ground"), (5, "a name of more"), (255, "last")].map(|(c, n)| (c, n.to_string())));
        let other = [(2, "road".to_string())];
        remove(&mut vlrs, &other);
        add(&mut vlrs, &other);
        assert_eq!((name(&vlrs, 2), name(&vlrs, 255)), ("road".to_string(), "last".to_string()));
        vlrs[0].data.pop();
        assert!(get(&vlrs).is_empty() && get(&[]).is_empty());
    }
}
