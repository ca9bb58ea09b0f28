//! Servos in words and as JSON.

use serde_json::{Value, json};
use vergence_dynamixel::Id;

use super::examine::{Examination, Swing};
use super::set_up::{FoundServo, model_name};

fn kind(model: u16) -> String {
    model_name(model).map_or_else(|| format!("model {model}"), str::to_owned)
}

impl FoundServo {
    /// What stands above [`FoundServo::row`].
    pub const HEAD: &str = "  id        bit/s  kind          firmware";

    /// The servo as a row of a table.
    #[must_use]
    pub fn row(&self) -> String {
        let alert = if self.alert { "  has found an error of its hardware" } else { "" };
        let Self { id, baud, info, .. } = self;
        format!(
            "{:>4}  {:>11}  {:<12}  {:>8}{alert}",
            id.get(),
            baud.bits_per_second(),
            kind(info.model),
            info.firmware
        )
    }

    /// The servo for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "id": self.id.get(),
            "baud": self.baud.bits_per_second(),
            "model": self.info.model,
            "kind": model_name(self.info.model),
            "firmware": self.info.firmware,
            "hardware_error": self.alert,
        })
    }
}

impl Examination {
    /// The errors of its hardware, for people.
    #[must_use]
    pub fn errors_in_words(&self) -> String {
        if self.errors.is_empty() { "none".to_owned() } else { format!("{:#04x}", self.errors.0) }
    }

    /// Lines for people.
    #[must_use]
    pub fn lines(&self) -> [String; 4] {
        let [median, longest] = self.round_trip_ms();
        let Self { info, volts, celsius, degrees, .. } = self;
        [
            format!("{}, firmware {}", kind(info.model), info.firmware),
            format!("supply {volts:.1} V, {celsius} degrees Celsius, hardware errors {}", self.errors_in_words()),
            format!("at {degrees:.1} degrees, torque {}", if self.has_torque { "on" } else { "off" }),
            format!("a ping takes {median:.1} ms, at most {longest:.1} ms, with adapter and system"),
        ]
    }

    fn round_trip_ms(&self) -> [f64; 2] {
        self.round_trip.map(|time| time.as_secs_f64() * 1e3)
    }

    /// The examination of servo `id` for programs, with the swing where there was one.
    #[must_use]
    pub fn json(&self, id: Id, swing: Option<&Swing>) -> Value {
        let [median, longest] = self.round_trip_ms();
        json!({
            "id": id.get(),
            "model": self.info.model,
            "firmware": self.info.firmware,
            "volts": self.volts,
            "celsius": self.celsius,
            "hardware_errors": self.errors.0,
            "position_deg": self.degrees,
            "torque": self.has_torque,
            "round_trip_ms": { "median": median, "longest": longest },
            "swing_error_deg": swing.map(|swing| swing.errors),
        })
    }
}

impl Swing {
    /// A line for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let [there, back] = self.errors;
        let verdict = if self.is_good { "good" } else { "more than a degree" };
        format!("five degrees and back: off by {there:.2} and {back:.2} degrees, {verdict}")
    }
}
