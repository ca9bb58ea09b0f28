//! Serde functions for quantities with units in TOML values.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serializer};
use vergence_vision::{Angle, Time};

pub fn quantity<'de, D: Deserializer<'de>, Q: FromStr<Err: std::fmt::Display>>(source: D) -> Result<Q, D::Error> {
    String::deserialize(source)?.parse().map_err(serde::de::Error::custom)
}

pub fn optional_quantity<'de, D: Deserializer<'de>, Q: FromStr<Err: std::fmt::Display>>(
    source: D,
) -> Result<Option<Q>, D::Error> {
    quantity(source).map(Some)
}

pub fn quantities<'de, D, Q>(source: D) -> Result<[Q; 3], D::Error>
where
    D: Deserializer<'de>,
    Q: FromStr<Err: std::fmt::Display>,
{
    let [x, y, z] = <[String; 3]>::deserialize(source)?;
    let parse = |text: String| text.parse().map_err(serde::de::Error::custom);
    Ok([parse(x)?, parse(y)?, parse(z)?])
}

pub fn angle_text<S: Serializer>(angle: &Option<Angle>, target: S) -> Result<S::Ok, S::Error> {
    match angle {
        Some(angle) => target.serialize_str(&format!("{}deg", angle.deg())),
        None => target.serialize_none(),
    }
}

pub fn time_text<S: Serializer>(time: &Option<Time>, target: S) -> Result<S::Ok, S::Error> {
    match time {
        Some(time) => target.serialize_str(&format!("{}us", time.us())),
        None => target.serialize_none(),
    }
}
