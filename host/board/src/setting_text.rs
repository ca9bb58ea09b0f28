//! The board's settings as people write them, by name and with units: `baseline.speed` is `40mm/s`.

use std::time::Duration;

use vergence_protocol::{AxisKind, SettingItem, SettingKey};
use vergence_rig::Rig;
use vergence_vision::{Angle, Length};

/// One setting of the board of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedSetting {
    /// Name of its axis in the rig; `None` for a setting of the whole board.
    pub axis: Option<String>,
    /// Its name among the settings of its axis.
    pub item: &'static str,
    /// Its key on the wire.
    pub key: SettingKey,
    form: Form,
}

/// The text form of a wire value.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// Millimetres or degrees, divided by seconds to this power.
    Quantity(AxisKind, u8),
    /// A whole number.
    Number,
    /// A whole number with this unit behind it.
    Unit(&'static str),
    /// True or false.
    Flag,
    /// A duration, in microseconds on the wire.
    Period,
    /// One of these words; the wire value is its index.
    Choice(&'static [&'static str]),
}

/// All settings of a board with the axes of `rig`, in the order of a settings file: first those of the whole board.
#[must_use]
pub fn settings(rig: &Rig) -> Vec<NamedSetting> {
    let of_no_axis = SettingItem::ALL.into_iter().filter(|item| !item.is_of_axis()).map(|item| NamedSetting {
        axis: None,
        item: name(item, None),
        key: SettingKey { item, axis: 0 },
        form: form(item, AxisKind::Linear),
    });
    let of_axes = (0u8..).zip(&rig.axes).flat_map(|(index, axis)| {
        SettingItem::ALL.into_iter().filter(|item| item.is_of_axis()).map(move |item| NamedSetting {
            axis: Some(axis.name.clone()),
            item: name(item, Some(axis.kind)),
            key: SettingKey { item, axis: index },
            form: form(item, axis.kind),
        })
    });
    of_no_axis.chain(of_axes).collect()
}

fn name(item: SettingItem, kind: Option<AxisKind>) -> &'static str {
    match (item, kind) {
        (SettingItem::StepsPerUnit, Some(AxisKind::Linear)) => "steps_per_metre",
        (SettingItem::StepsPerUnit, Some(AxisKind::Rotary)) => "steps_per_revolution",
        (SettingItem::CountsPerUnit, Some(AxisKind::Linear)) => "counts_per_metre",
        (SettingItem::CountsPerUnit, Some(AxisKind::Rotary)) => "counts_per_revolution",
        (SettingItem::StreamPeriod, _) => "stream_period",
        (SettingItem::HoldAfter, _) => "hold_after",
        _ => item.name(),
    }
}

fn form(item: SettingItem, kind: AxisKind) -> Form {
    match item {
        SettingItem::Speed | SettingItem::HomeSeekSpeed | SettingItem::HomeApproachSpeed => Form::Quantity(kind, 1),
        SettingItem::Acceleration => Form::Quantity(kind, 2),
        SettingItem::Jerk => Form::Quantity(kind, 3),
        SettingItem::StepsPerUnit
        | SettingItem::CountsPerUnit
        | SettingItem::Baud
        | SettingItem::Microsteps
        | SettingItem::StallThreshold
        | SettingItem::IndexEvery
        | SettingItem::EncoderZero
        | SettingItem::ServoId
        | SettingItem::ServoBaud => Form::Number,
        SettingItem::Encoder => Form::Choice(&["quadrature", "as5048a", "servo"]),
        SettingItem::StepsReversed
        | SettingItem::CountsReversed
        | SettingItem::StealthChop
        | SettingItem::StallWatch => Form::Flag,
        SettingItem::StreamPeriod | SettingItem::HoldDelay | SettingItem::HoldAfter => Form::Period,
        SettingItem::SenseResistor => Form::Unit("mOhm"),
        SettingItem::RunCurrent | SettingItem::HoldCurrent => Form::Unit("mA"),
        SettingItem::Driver => Form::Choice(&["plain", "tmc2209", "servo"]),
        SettingItem::HomeEnd => Form::Choice(&["low", "high"]),
        SettingItem::HomeSwitch => Form::Choice(&["normally_open", "normally_closed", "stallguard"]),
        SettingItem::HardLimit => Form::Choice(&["normally_closed", "normally_open"]),
        SettingItem::Machine => Form::Choice(&["bench", "robot"]),
        _ => Form::Quantity(kind, 0),
    }
}

impl NamedSetting {
    /// The full name: `baseline.speed`, or `baud`.
    #[must_use]
    pub fn name(&self) -> String {
        match &self.axis {
            Some(axis) => format!("{axis}.{}", self.item),
            None => self.item.to_owned(),
        }
    }

    /// A wire value as text with its unit.
    #[must_use]
    pub fn write(&self, value: i64) -> String {
        match self.form {
            Form::Quantity(kind, power) => {
                let (micro, unit) = match kind {
                    AxisKind::Linear => (1e-3, "mm"),
                    AxisKind::Rotary => (1e-6_f64.to_degrees(), "deg"),
                };
                let number = shortest(value, micro);
                let per = ["", "/s", "/s2", "/s3"].get(usize::from(power)).copied().unwrap_or_default();
                format!("{number}{unit}{per}")
            }
            Form::Number => value.to_string(),
            Form::Unit(unit) => format!("{value}{unit}"),
            Form::Flag => (value != 0).to_string(),
            Form::Period => match u64::try_from(value) {
                Ok(us) => humantime::format_duration(Duration::from_micros(us)).to_string(),
                Err(_) => format!("{value}us"),
            },
            Form::Choice(words) => {
                let word = usize::try_from(value).ok().and_then(|index| words.get(index));
                word.map_or_else(|| value.to_string(), |word| (*word).to_owned())
            }
        }
    }

    /// Parses text with a unit into a wire value.
    ///
    /// # Errors
    /// A sentence that names the setting and what it expects.
    pub fn read(&self, text: &str) -> Result<i64, String> {
        let text = text.trim();
        let fail = |problem: String| format!("{}: {problem}", self.name());
        let expected =
            |example: &str| format!("{}: '{text}' is not such a value: write it like {example}", self.name());
        match self.form {
            Form::Quantity(kind, power) => {
                let (number, per) = text.split_once('/').unwrap_or((text, ""));
                let per = per.trim().replace('²', "2").replace('³', "3").replace('^', "");
                if per != ["", "s", "s2", "s3"].get(usize::from(power)).copied().unwrap_or_default() {
                    return Err(expected(&self.write(40_000)));
                }
                let micro = match kind {
                    AxisKind::Linear => number.parse::<Length>().map(|length| length.mm() * 1e3),
                    AxisKind::Rotary => number.parse::<Angle>().map(|angle| angle.rad() * 1e6),
                };
                // The cast saturates: the board refuses a value that is too large.
                micro.map(|micro| micro.round() as i64).map_err(|error| fail(error.to_string()))
            }
            Form::Number => text.parse().map_err(|_| expected("921600")),
            Form::Unit(unit) => text
                .strip_suffix(unit)
                .and_then(|number| number.trim().parse().ok())
                .ok_or_else(|| expected(&self.write(800))),
            Form::Flag => text.parse::<bool>().map(i64::from).map_err(|_| expected("true or false")),
            Form::Period => humantime::parse_duration(text)
                .ok()
                .and_then(|period| i64::try_from(period.as_micros()).ok())
                .ok_or_else(|| expected("2ms, or 0s for none")),
            Form::Choice(words) => (0..)
                .zip(words)
                .find_map(|(value, word)| (*word == text).then_some(value))
                .ok_or_else(|| expected(&words.join(" or "))),
        }
    }

    /// A wire value as TOML: text with its unit, a number or a boolean.
    #[must_use]
    pub fn toml(&self, value: i64) -> toml::Value {
        match self.form {
            Form::Number => value.into(),
            Form::Flag => (value != 0).into(),
            Form::Quantity(..) | Form::Unit(_) | Form::Period | Form::Choice(_) => self.write(value).into(),
        }
    }

    /// Parses a TOML value into a wire value.
    ///
    /// # Errors
    /// A sentence that names the setting and what it expects.
    pub fn from_toml(&self, value: &toml::Value) -> Result<i64, String> {
        match value {
            toml::Value::String(text) => self.read(text),
            other => self.read(&other.to_string()),
        }
    }
}

/// `value` times `unit` with the fewest digits that parse back to `value`; five suffice for whole microradians in degrees.
fn shortest(value: i64, unit: f64) -> String {
    let number = value as f64 * unit;
    let reads_back = |text: &String| text.parse::<f64>().is_ok_and(|read| (read / unit).round() as i64 == value);
    let text = (0..5).map(|digits| format!("{number:.digits$}")).find(reads_back);
    let text = text.unwrap_or_else(|| format!("{number:.5}"));
    if text == "-0" { "0".into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bench() -> Vec<NamedSetting> {
        settings(&Rig::from_toml(vergence_rig::BENCH_TOML).unwrap())
    }

    fn setting(name: &str) -> NamedSetting {
        bench().into_iter().find(|setting| setting.name() == name).unwrap()
    }

    #[test]
    fn every_number_is_read_back_as_it_was_written() {
        for setting in bench() {
            for value in [0, 1, 7, 999, 1_001, 40_000, 2_268_928, 8_000_000, 69_813_170, 2_147_483_647] {
                let value = if matches!(setting.form, Form::Flag | Form::Choice(_)) { value % 2 } else { value };
                let text = setting.write(value);
                assert_eq!(setting.read(&text), Ok(value), "{} = {text}", setting.name());
                assert_eq!(setting.from_toml(&setting.toml(value)), Ok(value), "{} = {text}", setting.name());
            }
        }
    }

    #[test]
    fn values_are_written_with_their_units() {
        for (name, value, text) in [
            ("baseline.speed", 40_000, "40mm/s"),
            ("baseline.jerk", 8_000_000, "8000mm/s3"),
            ("separation.max", 2_268_928, "130deg"),
            ("separation.acceleration", 4_188_790, "240deg/s2"),
            ("baseline.counts_per_metre", 2_000_000, "2000000"),
            ("separation.steps_reversed", 1, "true"),
            ("stream_period", 2_000, "2ms"),
            ("baud", 921_600, "921600"),
            ("machine", 1, "robot"),
            ("baseline.driver", 1, "tmc2209"),
            ("baseline.run_current", 800, "800mA"),
            ("separation.sense_resistor", 110, "110mOhm"),
            ("separation.hold_delay", 500_000, "500ms"),
            ("hold_after", 5_000_000, "5s"),
            ("baseline.home_end", 1, "high"),
            ("separation.home_switch", 2, "stallguard"),
            ("baseline.hard_limit", 0, "normally_closed"),
            ("baseline.stall_threshold", 50, "50"),
        ] {
            assert_eq!(setting(name).write(value), text, "{name}");
        }
        assert_eq!(setting("baseline.acceleration").read("0.4 m/s²"), Ok(400_000));
        assert_eq!(setting("separation.speed").read("1rad/s^1").ok(), None);
    }

    #[test]
    fn a_value_with_the_wrong_unit_is_refused_with_an_example() {
        for (name, text, word) in [
            ("baseline.speed", "40mm", "40mm/s"),
            ("baseline.speed", "40", "40mm/s"),
            ("baseline.speed", "40deg/s", "length"),
            ("baseline.min", "40mm/s", "40mm"),
            ("separation.steps_reversed", "yes", "true or false"),
            ("stream_period", "soon", "2ms"),
            ("baud", "fast", "921600"),
            ("machine", "lathe", "bench or robot"),
            ("baseline.run_current", "0.8A", "800mA"),
            ("baseline.hold_current", "400", "800mA"),
            ("baseline.home_end", "left", "low or high"),
        ] {
            let error = setting(name).read(text).unwrap_err();
            assert!(error.contains(word) && error.contains(name), "{error}");
        }
    }
}
