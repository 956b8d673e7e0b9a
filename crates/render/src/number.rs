//! Numbers as rich text.

/// A number as a printer would set it: 0.13, 10^{-5}, 1.05×10^{-8}, 200 000.
pub fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if (1e4..1e16).contains(&magnitude) && value == value.trunc() {
        let digits = format!("{magnitude:.0}");
        let mut grouped = String::new();
        for (i, digit) in digits.chars().enumerate() {
            if i > 0 && (digits.len() - i).is_multiple_of(3) {
                grouped.push('\u{2009}');
            }
            grouped.push(digit);
        }
        return if value < 0.0 { format!("−{grouped}") } else { grouped };
    }
    if (1e-2..1e4).contains(&magnitude) {
        return format!("{value}").replace('-', "−");
    }
    let text = format!("{value:.2e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
    let power = format!("10^{{{exponent}}}");
    match mantissa {
        "1" => power,
        "-1" => format!("−{power}"),
        _ => format!("{}×{power}", mantissa.replace('-', "−")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers() {
        for (value, text) in [
            (0.13, "0.13"),
            (1e-5, "10^{-5}"),
            (1.0536712e-8, "1.05×10^{-8}"),
            (2e5, "200\u{2009}000"),
            (-1.2, "−1.2"),
            (1e-3, "10^{-3}"),
            (150.0, "150"),
            (0.0, "0"),
            (-2.5e-4, "−2.5×10^{-4}"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
