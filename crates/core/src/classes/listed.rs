//! A class table as a person writes it, as in `2,5,64=vehicle`.

use super::{Class, ClassTable, preset};
use crate::error::{Error, Result};
use std::str::FromStr;

impl FromStr for ClassTable {
    type Err = Error;

    /// Reads codes separated by commas, each with `=name` or with the name of the ASPRS list.
    fn from_str(text: &str) -> Result<Self> {
        let class = |part: &str| {
            let (code, name) = part.split_once('=').map_or((part, None), |(code, name)| (code, Some(name.trim())));
            let bad = || Error::parameter("classes", part, "CODE or CODE=NAME, codes 0..255, e.g. 2,5,64=vehicle");
            let known = preset::asprs(code.trim().parse().map_err(|_| bad())?);
            match name {
                None => Ok(known),
                Some("") => Err(bad()),
                Some(name) => Ok(Class { name: name.into(), ..known }),
            }
        };
        Self::new(text.split(',').map(str::trim).filter(|part| !part.is_empty()).map(class).collect::<Result<_>>()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_have_their_own_names_or_those_of_asprs() {
        let table: ClassTable = "64=tram, 2,".parse().unwrap();
        let names: Vec<(u8, &str)> = table.classes().iter().map(|c| (c.code, c.name.as_str())).collect();
        assert_eq!(names, [(2, "ground"), (64, "tram")]);
        for bad in ["car", "256", "2=", "2,2", "=car"] {
            assert!(bad.parse::<ClassTable>().is_err(), "{bad}");
        }
    }
}
