//! Text of pages: escaping for XML, and numbers as people read them.

/// Escapes `text` for XML: markup characters become entities, and characters that XML forbids are replaced.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            c if c.is_control() && !matches!(c, '\n' | '\t') => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// Prints `value` with `digits` significant digits; a dash where it is not finite.
#[must_use]
pub fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    fixed(value, digits - 1 - value.abs().log10().floor() as i32)
}

/// Prints `value` with `decimals` decimals; none where `decimals` is negative.
#[must_use]
pub fn fixed(value: f64, decimals: i32) -> String {
    const MOST_DECIMALS: i32 = 9;
    if !value.is_finite() {
        return "–".to_owned();
    }
    let text = format!("{value:.*}", decimals.clamp(0, MOST_DECIMALS) as usize);
    // The typographic minus is as wide as a digit.
    match text.strip_prefix('-') {
        Some(zero) if zero.chars().all(|c| matches!(c, '0' | '.')) => zero.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// Prints a value and its standard deviation, both to the second significant digit of the deviation.
#[must_use]
pub fn with_sigma(value: f64, sigma: f64) -> [String; 2] {
    if !sigma.is_finite() || sigma <= 0.0 {
        return [significant(value, 6), "–".to_owned()];
    }
    let decimals = 1 - sigma.log10().floor() as i32;
    [fixed(value, decimals), fixed(sigma, decimals)]
}

/// Prints a count with its noun in singular or plural: "1 view", "2 views".
#[must_use]
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
