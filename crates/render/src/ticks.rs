//! Placement and labelling of ticks, in whole-number arithmetic: no platform logarithm decides
//! where a tick lies.

use twofold_num::elementary;

/// A tick on an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Value on the axis.
    pub value: f64,
    /// Label in rich text; empty for a minor tick.
    pub label: String,
}

/// The ticks of an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ticks {
    /// Labelled ticks.
    pub major: Vec<Tick>,
    /// Values of the ticks between them.
    pub minor: Vec<f64>,
}

/// Ten to a whole power, correctly rounded: the decimal text is what is meant.
fn decimal(mantissa: i64, exponent: i32) -> f64 {
    format!("{mantissa}e{exponent}").parse().unwrap_or(f64::NAN)
}

/// Ticks of a linear axis from `lower` to `upper`, about `wanted` labelled ones, at multiples of 1,
/// 2 or 5 times a power of ten.
pub fn linear(lower: f64, upper: f64, wanted: f64) -> Ticks {
    let (lower, upper) = (lower.min(upper), lower.max(upper));
    let span = upper - lower;
    if !(span > 0.0 && span.is_finite() && wanted > 0.0) {
        return Ticks::default();
    }
    let raw = span / wanted;
    let mut exponent = elementary::log10(raw).floor() as i32;
    if decimal(1, exponent) > raw {
        exponent -= 1;
    }
    let ratio = raw / decimal(1, exponent);
    // Thresholds are geometric means, so that the step is the nearest of the three in ratio.
    let (mantissa, exponent, divisions) = if ratio < 1.5 {
        (1, exponent, 5)
    } else if ratio < 3.2 {
        (2, exponent, 4)
    } else if ratio < 7.1 {
        (5, exponent, 5)
    } else {
        (1, exponent + 1, 5)
    };
    let step = decimal(mantissa, exponent);
    let tolerance = 1e-9 * span;
    let first = ((lower - tolerance) / step).ceil() as i64;
    let last = ((upper + tolerance) / step).floor() as i64;
    if last - first > 1000 {
        return Ticks::default();
    }
    // Very large or small numbers share a power of ten, which goes into every label: no separate
    // exponent is overlooked.
    let largest = lower.abs().max(upper.abs());
    let shift =
        if !(1e-3..1e5).contains(&largest) { elementary::log10(largest).floor() as i32 } else { 0 };
    let major = (first..=last)
        .map(|k| Tick {
            value: decimal(k * mantissa, exponent),
            label: label(k * mantissa, exponent, shift),
        })
        .collect();
    let fine = step / f64::from(divisions);
    let first = ((lower - tolerance) / fine).ceil() as i64;
    let last = ((upper + tolerance) / fine).floor() as i64;
    let minor =
        (first..=last).filter(|k| k % i64::from(divisions) != 0).map(|k| k as f64 * fine).collect();
    Ticks { major, minor }
}

/// `mantissa` times ten to `exponent` as a decimal number, with ten to `shift` taken out if that is
/// not zero.
fn label(mantissa: i64, exponent: i32, shift: i32) -> String {
    let text = fixed(mantissa, exponent - shift);
    match shift {
        0 => text,
        _ if mantissa == 0 => "0".to_owned(),
        _ if text == "1" || text == "-1" => format!("{}10^{{{shift}}}", text.trim_end_matches('1')),
        _ => format!("{text}×10^{{{shift}}}"),
    }
}

fn fixed(mantissa: i64, exponent: i32) -> String {
    let sign = if mantissa < 0 { "-" } else { "" };
    let digits = mantissa.unsigned_abs().to_string();
    if exponent >= 0 {
        let zeros = if mantissa == 0 { 0 } else { exponent as usize };
        return format!("{sign}{digits}{}", "0".repeat(zeros));
    }
    let decimals = (-exponent) as usize;
    let digits = format!("{digits:0>width$}", width = decimals + 1);
    let (whole, fraction) = digits.split_at(digits.len() - decimals);
    format!("{sign}{whole}.{fraction}")
}

/// Ticks of a logarithmic axis from `lower` to `upper` (both positive), at most about `wanted`
/// labelled ones: at powers of ten, and at twice and five times these where the axis covers few of
/// them.
pub fn logarithmic(lower: f64, upper: f64, wanted: f64) -> Ticks {
    let (lower, upper) = (lower.min(upper), lower.max(upper));
    if !(lower > 0.0 && upper.is_finite() && lower < upper && wanted > 0.0) {
        return Ticks::default();
    }
    let first = elementary::log10(lower).floor() as i32;
    let last = elementary::log10(upper).ceil() as i32;
    let inside = |v: f64| v >= lower * (1.0 - 1e-9) && v <= upper * (1.0 + 1e-9);
    let decades = (first..=last).filter(|e| inside(decimal(1, *e))).count();
    let every = ((decades as f64 / wanted).ceil() as i32).max(1);
    let mut ticks = Ticks::default();
    for e in first..=last {
        let power = decimal(1, e);
        if inside(power) {
            if e.rem_euclid(every) == 0 {
                ticks.major.push(Tick { value: power, label: power_label(1, e) });
            } else {
                ticks.minor.push(power);
            }
        }
        for m in 2..=9 {
            let value = decimal(m, e);
            if !inside(value) || every > 1 {
                continue;
            }
            if decades < 3 && (m == 2 || m == 5) {
                ticks.major.push(Tick { value, label: power_label(m, e) });
            } else if decades <= 8 {
                ticks.minor.push(value);
            }
        }
    }
    // One notation along an axis: plain numbers, or powers of ten throughout.
    if ticks.major.iter().any(|t| t.label.contains('^')) {
        for tick in &mut ticks.major {
            if let Some((mantissa, exponent)) = tick.label.parse::<f64>().ok().and_then(one_digit) {
                tick.label = power_notation(mantissa, exponent);
            }
        }
    }
    ticks
}

/// The digit and the exponent of a plain label between 0.01 and 9000.
fn one_digit(value: f64) -> Option<(i64, i32)> {
    (-2..=3).flat_map(|e| (1..=9).map(move |m| (m, e))).find(|(m, e)| decimal(*m, *e) == value)
}

fn power_label(mantissa: i64, exponent: i32) -> String {
    match (mantissa, exponent) {
        (m, -2..=3) => fixed(m, exponent),
        (m, e) => power_notation(m, e),
    }
}

fn power_notation(mantissa: i64, exponent: i32) -> String {
    if mantissa == 1 {
        format!("10^{{{exponent}}}")
    } else {
        format!("{mantissa}×10^{{{exponent}}}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn labels(ticks: &Ticks) -> Vec<&str> {
        ticks.major.iter().map(|t| t.label.as_str()).collect()
    }

    #[test]
    fn linear_ticks_are_round_numbers() {
        assert_eq!(
            labels(&linear(-1.6, 1.6, 7.0)),
            ["-1.5", "-1.0", "-0.5", "0.0", "0.5", "1.0", "1.5"]
        );
        assert_eq!(labels(&linear(0.0, 100.0, 5.0)), ["0", "20", "40", "60", "80", "100"]);
        assert_eq!(labels(&linear(-24.0, 34.0, 6.0)), ["-20", "-10", "0", "10", "20", "30"]);
        assert_eq!(labels(&linear(0.22, 0.79, 6.0)), ["0.3", "0.4", "0.5", "0.6", "0.7"]);
    }

    #[test]
    fn ends_on_a_tick_keep_it_despite_rounding() {
        let ticks = linear(0.1, 0.3, 2.0);
        assert_eq!(labels(&ticks), ["0.1", "0.2", "0.3"]);
        assert_eq!(ticks.major[2].value, 0.3);
    }

    #[test]
    fn large_and_small_numbers_carry_their_power_of_ten() {
        assert_eq!(
            labels(&linear(0.0, 2e5, 4.0)),
            ["0", "0.5×10^{5}", "1.0×10^{5}", "1.5×10^{5}", "2.0×10^{5}"]
        );
        assert_eq!(labels(&linear(0.0, 3e-4, 3.0)), ["0", "10^{-4}", "2×10^{-4}", "3×10^{-4}"]);
    }

    #[test]
    fn log_ticks_are_powers_of_ten() {
        assert_eq!(
            labels(&logarithmic(1e-8, 1e-4, 8.0)),
            ["10^{-8}", "10^{-7}", "10^{-6}", "10^{-5}", "10^{-4}"]
        );
        assert_eq!(labels(&logarithmic(3.0, 60.0, 8.0)), ["5", "10", "20", "50"]);
        assert_eq!(labels(&logarithmic(50.0, 2e5, 8.0)), ["10^{2}", "10^{3}", "10^{4}", "10^{5}"]);
        assert!(logarithmic(1e-300, 1e300, 6.0).major.len() <= 8);
    }

    #[test]
    fn no_range_gives_no_ticks() {
        for (a, b) in [(1.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            assert_eq!(linear(a, b, 5.0), Ticks::default());
            assert_eq!(logarithmic(a, b, 5.0), Ticks::default());
        }
        assert_eq!(logarithmic(-1.0, 1.0, 5.0), Ticks::default());
    }

    proptest! {
        #[test]
        fn ticks_lie_in_range_ascend_and_say_what_they_are(centre in -1e6f64..1e6,
            span in 1e-3f64..1e6, wanted in 2.0f64..12.0) {
            let (lower, upper) = (centre - span, centre + span);
            let ticks = linear(lower, upper, wanted);
            prop_assert!(!ticks.major.is_empty());
            prop_assert!(ticks.major.len() as f64 <= 2.2 * wanted + 2.0);
            prop_assert!(ticks.major.windows(2).all(|w| w[0].value < w[1].value));
            for t in &ticks.major {
                prop_assert!(t.value >= lower - 1e-6 * span && t.value <= upper + 1e-6 * span);
                let (number, power) = match t.label.split_once("×10^{") {
                    Some((n, p)) => (n.to_owned(), p.trim_end_matches('}').to_owned()),
                    None => match t.label.split_once("10^{") {
                        Some((sign, p)) => (format!("{sign}1"), p.trim_end_matches('}').to_owned()),
                        None => (t.label.clone(), "0".to_owned()),
                    },
                };
                let parsed: f64 = format!("{number}e{power}").parse().unwrap();
                prop_assert_eq!(parsed, t.value);
            }
        }
    }
}
