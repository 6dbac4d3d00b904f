//! Numbers of any size in a few characters.

/// Digits of a number that are shown.
const DIGITS: i32 = 4;

/// A number to four digits, without zeros that say nothing: `"1235"`, `"0.25"`, `"3.1e-9"`.
pub fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{}", value + 0.0);
    }
    let size = value.abs().log10().floor() as i32;
    let plain = |text: String| {
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    };
    if (-3..6).contains(&size) {
        let decimals = (DIGITS - 1 - size).max(0) as usize;
        return plain(format!("{value:.decimals$}"));
    }
    let text = format!("{value:.3e}");
    match text.split_once('e') {
        Some((digits, power)) => format!("{}e{power}", plain(digits.to_owned())),
        None => text,
    }
}

/// The same with what it is measured in, where that is known: `"12.5 MPa"`.
pub fn with_unit(value: f64, unit: &str) -> String {
    if unit.is_empty() { short(value) } else { format!("{} {unit}", short(value)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_four_digits_at_most_and_none_for_nothing() {
        for (value, words) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1234.56, "1235"),
            (0.25, "0.25"),
            (-3.24686, "-3.247"),
            (100.0, "100"),
            (123456.0, "123456"),
            (0.00123456, "0.001235"),
            (3.1e-9, "3.1e-9"),
            (-2.0e6, "-2e6"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(short(value), words, "{value}");
        }
        assert_eq!(
            (with_unit(2.5, "MPa"), with_unit(2.5, "")),
            ("2.5 MPa".to_owned(), "2.5".to_owned()),
            "unit"
        );
    }
}
