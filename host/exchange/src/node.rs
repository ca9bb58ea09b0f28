//! YAML and JSON, looked into with errors that say where.

use serde_json::Value;
use vergence_vision::ImageSize;

use crate::{ExchangeError, Format};

/// A value with the place where it is.
#[derive(Clone)]
pub struct Node {
    value: Value,
    place: String,
    format: Format,
}

/// Parses YAML, of which JSON is a part. Directives such as OpenCV's `%YAML:1.0`, which is none, are left out, and documents after the first.
pub fn parse(format: Format, text: &str) -> Result<Node, ExchangeError> {
    let mut body = String::new();
    for line in text.trim_start_matches('\u{feff}').lines().filter(|line| !line.starts_with('%')) {
        let ends = matches!(line.trim_end(), "---" | "...");
        if ends && body.lines().any(|line| !line.trim().is_empty() && !line.starts_with('#')) {
            break;
        }
        if !ends {
            body += line;
            body.push('\n');
        }
    }
    let value = serde_saphyr::from_str(&body)
        .map_err(|error| ExchangeError::Wrong { format, problem: format!("it is not readable: {error}") })?;
    Ok(Node { value, place: String::new(), format })
}

impl Node {
    /// A node that holds nothing, for errors of formats that are no YAML.
    pub fn nothing(format: Format) -> Self {
        Self { value: Value::Null, place: String::new(), format }
    }

    /// An error about this value: `problem` goes on after its place or after "it".
    pub fn wrong(&self, problem: impl std::fmt::Display) -> ExchangeError {
        let problem = format!("{} {problem}", if self.place.is_empty() { "it" } else { &self.place });
        ExchangeError::Wrong { format: self.format, problem }
    }

    fn child(&self, name: &str, value: &Value) -> Self {
        let place = if self.place.is_empty() { name.to_owned() } else { format!("{}.{name}", self.place) };
        Self { value: value.clone(), place, format: self.format }
    }

    /// The value of the first of `keys` that is there and not null.
    pub fn get(&self, keys: &[&str]) -> Option<Self> {
        let found =
            keys.iter().find_map(|key| self.value.get(key).filter(|value| !value.is_null()).map(|value| (key, value)));
        found.map(|(key, value)| self.child(key, value))
    }

    /// The same where one must be there.
    pub fn need(&self, keys: &[&str]) -> Result<Self, ExchangeError> {
        self.get(keys).ok_or_else(|| self.wrong(format!("has no {}", keys.join(" or "))))
    }

    /// The keys of a mapping.
    pub fn keys(&self) -> Vec<String> {
        self.value.as_object().map(|map| map.keys().cloned().collect()).unwrap_or_default()
    }

    /// The entries of a sequence.
    pub fn entries(&self) -> Result<Vec<Self>, ExchangeError> {
        let list = self.value.as_array().ok_or_else(|| self.wrong("is no list"))?;
        Ok(list.iter().enumerate().map(|(index, value)| self.child(&index.to_string(), value)).collect())
    }

    pub fn text(&self) -> Result<String, ExchangeError> {
        match &self.value {
            Value::String(text) => Ok(text.clone()),
            Value::Number(number) => Ok(number.to_string()),
            _ => Err(self.wrong("is no text")),
        }
    }

    /// A finite number. YAML of Python takes 1e-05 for a text.
    pub fn number(&self) -> Result<f64, ExchangeError> {
        let number = match &self.value {
            Value::String(text) => text.trim().parse().ok(),
            value => value.as_f64(),
        };
        number.filter(|number: &f64| number.is_finite()).ok_or_else(|| self.wrong("is no finite number"))
    }

    /// All numbers of a list, of a list of lists, or of a mapping with the list `data`, as OpenCV and ROS write matrices.
    pub fn numbers(&self) -> Result<Vec<f64>, ExchangeError> {
        if let Some(data) = self.get(&["data"]) {
            return data.numbers();
        }
        let entries = self.entries()?;
        if entries.iter().all(|entry| entry.value.is_array()) {
            let rows = entries.iter().map(Self::numbers).collect::<Result<Vec<_>, _>>()?;
            return Ok(rows.concat());
        }
        entries.iter().map(Self::number).collect()
    }

    /// Exactly `N` numbers.
    pub fn array<const N: usize>(&self) -> Result<[f64; N], ExchangeError> {
        self.numbers()?
            .try_into()
            .map_err(|numbers: Vec<f64>| self.wrong(format!("has {} numbers, not {N}", numbers.len())))
    }

    /// The numbers of `N` keys of a mapping.
    pub fn fields<const N: usize>(&self, keys: [&str; N]) -> Result<[f64; N], ExchangeError> {
        let mut values = [0.0; N];
        for (value, key) in values.iter_mut().zip(keys) {
            *value = self.need(&[key])?.number()?;
        }
        Ok(values)
    }

    /// Width and height in pixels.
    pub fn size(&self) -> Result<ImageSize, ExchangeError> {
        let [width, height] = self.array()?;
        self.image_size(width, height)
    }

    /// The size of images from two numbers.
    pub fn image_size(&self, width: f64, height: f64) -> Result<ImageSize, ExchangeError> {
        let is_size = |n: f64| (1.0..=100_000.0).contains(&n) && n.fract() == 0.0;
        if is_size(width) && is_size(height) {
            return Ok(ImageSize { width: width as u32, height: height as u32 });
        }
        Err(self.wrong(format!("says {width} x {height}, which is no size of an image")))
    }
}
