//! Classes: code, name and colour.

use crate::cloud::{ClassNames, CodeScheme, OwnClass};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// One class: the code in files, its name and its colour in pictures.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Class {
    /// Code in files, 0..=255.
    pub code: u8,
    /// Name for people.
    pub name: String,
    /// sRGB colour.
    pub colour: [u8; 3],
}

/// Classes in ascending order of their codes; each code once.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Class>", into = "Vec<Class>")]
pub struct ClassTable {
    classes: Vec<Class>,
}

impl ClassTable {
    /// A table of classes, sorted by code. Fails if a code occurs twice.
    pub fn new(mut classes: Vec<Class>) -> Result<Self> {
        classes.sort_by_key(|c| c.code);
        match classes.windows(2).find(|w| w[0].code == w[1].code) {
            Some(w) => {
                Err(Error::input(format!("class code {} stands twice ({}, {})", w[0].code, w[0].name, w[1].name)))
            }
            None => Ok(Self { classes }),
        }
    }

    /// A table of these codes, with names and colours of the ASPRS list where it has the code.
    pub fn from_codes(codes: &[u8]) -> Self {
        Self::of_scheme(codes, CodeScheme::Asprs)
    }

    /// A table of these codes, with names from the list they belong to.
    pub fn of_scheme(codes: &[u8], scheme: CodeScheme) -> Self {
        Self::named(codes, scheme, &ClassNames::new())
    }

    /// A table of these codes, with their own names where they have any, else those of the list they belong to.
    pub fn named(codes: &[u8], scheme: CodeScheme, own: &ClassNames) -> Self {
        let mut codes = codes.to_vec();
        codes.sort_unstable();
        codes.dedup();
        Self { classes: codes.into_iter().map(|code| preset::named(code, scheme, own)).collect() }
    }

    /// The same classes with these names, and colours, where their codes have any.
    #[must_use]
    pub fn renamed(mut self, own: &ClassNames) -> Self {
        for class in &mut self.classes {
            if let Some(own) = own.get(&class.code) {
                class.name.clone_from(&own.name);
                class.colour = own.colour.unwrap_or(class.colour);
            }
        }
        self
    }

    /// Names and colours by code.
    pub fn names(&self) -> ClassNames {
        let own = |class: &Class| (class.code, OwnClass { name: class.name.clone(), colour: Some(class.colour) });
        self.classes.iter().map(own).collect()
    }

    /// The classes in ascending order of code.
    pub fn classes(&self) -> &[Class] {
        &self.classes
    }

    /// Their codes, ascending.
    pub fn codes(&self) -> Vec<u8> {
        self.classes.iter().map(|class| class.code).collect()
    }

    /// Number of classes.
    pub fn len(&self) -> usize {
        self.classes.len()
    }

    /// True if there is no class.
    pub fn is_empty(&self) -> bool {
        self.classes.is_empty()
    }

    /// A code that is not in the table, for points without a class: 1 (unclassified), else 0, else the highest.
    pub fn free_code(&self) -> u8 {
        let all = [1, 0].into_iter().chain((2..=255).rev());
        all.into_iter().find(|&code| self.position(code).is_none()).unwrap_or(1)
    }

    /// Position of a code in the table.
    pub fn position(&self, code: u8) -> Option<usize> {
        self.classes.binary_search_by_key(&code, |c| c.code).ok()
    }
}

impl TryFrom<Vec<Class>> for ClassTable {
    type Error = Error;
    fn try_from(classes: Vec<Class>) -> Result<Self> {
        Self::new(classes)
    }
}

impl From<ClassTable> for Vec<Class> {
    fn from(table: ClassTable) -> Self {
        table.classes
    }
}

mod listed;
pub mod preset;
mod remap;
pub use remap::LabelMap;
