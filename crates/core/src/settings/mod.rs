//! How values that TOML or JSON cannot hold are written in recipes and settings: none, and infinity.

pub(crate) mod changes;

use serde::de::value::{BoolDeserializer, F64Deserializer, I64Deserializer, StrDeserializer, U64Deserializer};
use serde::de::{DeserializeOwned, Deserializer, Error, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::marker::PhantomData;

/// The word for a value that is absent.
const NONE: &str = "none";

/// An optional value that is always written out, an absent one as the word `none`, so that a recipe shows every key, and
/// a value that is there by default can be taken away.
pub(crate) mod optional {
    use super::{DeserializeOwned, Deserializer, NONE, Optional, PhantomData, Serialize, Serializer};

    pub(crate) fn serialize<T: Serialize, S: Serializer>(value: &Option<T>, to: S) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => value.serialize(to),
            None => to.serialize_str(NONE),
        }
    }

    pub(crate) fn deserialize<'de, T: DeserializeOwned, D: Deserializer<'de>>(from: D) -> Result<Option<T>, D::Error> {
        from.deserialize_any(Optional { zero: false, of: PhantomData })
    }
}

/// The same for numbers of which 0 means none too, as recipes of earlier versions say it.
pub(crate) mod optional_or_zero {
    pub(crate) use super::optional::serialize;
    use super::{DeserializeOwned, Deserializer, Optional, PhantomData};

    pub(crate) fn deserialize<'de, T: DeserializeOwned, D: Deserializer<'de>>(from: D) -> Result<Option<T>, D::Error> {
        from.deserialize_any(Optional { zero: true, of: PhantomData })
    }
}

struct Optional<T> {
    /// Whether 0 means none.
    zero: bool,
    of: PhantomData<T>,
}

impl<T: DeserializeOwned> Visitor<'_> for Optional<T> {
    type Value = Option<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a value or \"{NONE}\"")
    }

    fn visit_unit<E: Error>(self) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Self::Value, E> {
        T::deserialize(BoolDeserializer::new(value)).map(Some)
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Self::Value, E> {
        if self.zero && value == 0 { Ok(None) } else { T::deserialize(I64Deserializer::new(value)).map(Some) }
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Self::Value, E> {
        if self.zero && value == 0 { Ok(None) } else { T::deserialize(U64Deserializer::new(value)).map(Some) }
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Self::Value, E> {
        let none = self.zero && value.to_bits() << 1 == 0;
        if none { Ok(None) } else { T::deserialize(F64Deserializer::new(value)).map(Some) }
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Self::Value, E> {
        if value == NONE { Ok(None) } else { T::deserialize(StrDeserializer::new(value)).map(Some) }
    }
}

/// A number that may be infinite. JSON has no infinity: it is read from the word `inf` too.
pub(crate) fn number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "a number or \"inf\"")]
    enum Written {
        Number(f64),
        Word(Infinity),
    }
    #[derive(Deserialize)]
    enum Infinity {
        #[serde(rename = "inf")]
        Infinity,
    }
    Ok(match Written::deserialize(from)? {
        Written::Number(number) => number,
        Written::Word(Infinity::Infinity) => f64::INFINITY,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize, PartialEq, Serialize)]
    #[serde(default)]
    struct Settings {
        #[serde(with = "optional")]
        edge: Option<f64>,
        #[serde(with = "optional_or_zero")]
        depth: Option<usize>,
        #[serde(with = "optional")]
        colour: Option<bool>,
        #[serde(deserialize_with = "number")]
        strength: f64,
    }

    impl Default for Settings {
        fn default() -> Self {
            Self { edge: Some(2.0), depth: Some(30), colour: Some(true), strength: 1.0 }
        }
    }

    #[test]
    fn values_that_are_absent_are_written_and_read() {
        let none = Settings { edge: None, depth: None, colour: None, strength: f64::INFINITY };
        let text = toml::to_string(&none).unwrap();
        assert_eq!(text, "edge = \"none\"\ndepth = \"none\"\ncolour = \"none\"\nstrength = inf\n");
        for settings in [none, Settings::default()] {
            assert_eq!(toml::from_str::<Settings>(&toml::to_string(&settings).unwrap()).unwrap(), settings);
        }
        let json = r#"{"edge": null, "depth": 0, "colour": "none", "strength": "inf"}"#;
        let read: Settings = serde_json::from_str(json).unwrap();
        assert_eq!(read, Settings { edge: None, depth: None, colour: None, strength: f64::INFINITY });
        // An integer is a number, and 0 a value where it does not mean none.
        let read: Settings = toml::from_str("edge = 0\ndepth = 12\nstrength = 3").unwrap();
        assert_eq!(read, Settings { edge: Some(0.0), depth: Some(12), strength: 3.0, ..Settings::default() });
    }

    #[test]
    fn other_words_are_refused() {
        for text in ["edge = \"no\"", "depth = -1", "colour = 1", "strength = \"infinite\"", "depth = [1]"] {
            assert!(toml::from_str::<Settings>(text).is_err(), "{text}");
        }
    }
}
