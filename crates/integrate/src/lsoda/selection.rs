//! Constants and formulas of step, order and method selection, apart from the loop that uses them.
//!
//! If a step of order q made the error D (tolerance 1), the step that would just meet the tolerance
//! is longer by D^(-1/(q+1)). Gear (1971) and Hindmarsh (1983) divide this by a bias, larger for
//! the changes that are to be discouraged, and take the order that allows the longest step.

use super::coefficients::{ADAMS_ORDERS, BDF_ORDERS};
use twofold_num::elementary::rough_pow;

/// Bias against the present order, Hindmarsh (1983).
pub(super) const BIAS_SAME: f64 = 1.2;
/// Bias against the next lower order.
pub(super) const BIAS_LOWER: f64 = 1.3;
/// Bias against the next higher order.
pub(super) const BIAS_HIGHER: f64 = 1.4;
/// A change that gains less than this is not worth the rescaling.
pub(super) const LEAST_GAIN: f64 = 1.1;
/// Largest growth of the step at the very first change, because the first step is a guess.
pub(super) const GROWTH_FIRST: f64 = 1e4;
/// Largest growth at later changes.
pub(super) const GROWTH: f64 = 10.0;
/// Largest growth after a failure.
pub(super) const GROWTH_AFTER_FAILURE: f64 = 2.0;
/// Factor on the step after a corrector that did not converge.
pub(super) const SHRINK_NOT_CONVERGED: f64 = 0.25;
/// Largest factor on the step after the second error-test failure in one step.
pub(super) const SHRINK_REPEATED: f64 = 0.2;
/// After three, the derivatives in the history are not to be trusted: a tenth of the step, and
/// order 1.
pub(super) const SHRINK_RESET: f64 = 0.1;
/// Failures of one kind in one step before the integration is given up.
pub(super) const MOST_FAILURES: u32 = 10;
/// Corrector iterations before it is declared divergent.
pub(super) const MOST_ITERATIONS: u32 = 3;
/// Steps after which an iteration matrix is renewed in any case.
pub(super) const MATRIX_LIFETIME: u64 = 20;
/// Relative change of h l_0 beyond which it is renewed.
pub(super) const MATRIX_DRIFT: f64 = 0.3;
/// Assumed rate of convergence with a new iteration matrix.
pub(super) const FIRST_RATE: f64 = 0.7;
/// Steps between a change of method and the next thought of one, Petzold (1983).
pub(super) const STEPS_BEFORE_SWITCH: i32 = 20;
/// Ratio of the BDF step to the Adams step above which Adams is left for BDF: a BDF step costs
/// about that much more.
pub(super) const SWITCH_RATIO: f64 = 5.0;

/// The order-1-to-5 restriction of the stiffness test: an Adams order above needs accuracy, not
/// stability.
pub(super) const SWITCH_ORDERS: usize = BDF_ORDERS;

const _: () = assert!(SWITCH_ORDERS <= ADAMS_ORDERS);

/// The factor by which the step may grow at `order` if its error was `error`. The 1e-6 keeps it
/// finite at error 0.
pub(super) fn growth(bias: f64, error: f64, order: usize) -> f64 {
    1.0 / (bias * (rough_pow(error, ROOTS[order]) + 1e-6))
}

/// 1 / (order + 1).
static ROOTS: [f64; ADAMS_ORDERS + 2] = {
    let mut roots = [1.0; ADAMS_ORDERS + 2];
    let mut order = 1;
    while order < roots.len() {
        roots[order] = 1.0 / (order + 1) as f64;
        order += 1;
    }
    roots
};

/// Errors at the orders 0, 1, ... above which [`growth`] stays below [`LEAST_GAIN`]: 1 / (bias
/// LEAST_GAIN), to the power order + 1, and a millionth more for the roundings.
const fn no_gain(bias: f64) -> [f64; ADAMS_ORDERS + 2] {
    let base = 1.0 / (bias * LEAST_GAIN);
    let mut errors = [1.000_001 * base; ADAMS_ORDERS + 2];
    let mut order = 1;
    while order < errors.len() {
        errors[order] = errors[order - 1] * base;
        order += 1;
    }
    errors
}

pub(super) const NO_GAIN_SAME: [f64; ADAMS_ORDERS + 2] = no_gain(BIAS_SAME);
pub(super) const NO_GAIN_LOWER: [f64; ADAMS_ORDERS + 2] = no_gain(BIAS_LOWER);
pub(super) const NO_GAIN_HIGHER: [f64; ADAMS_ORDERS + 2] = no_gain(BIAS_HIGHER);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn above_these_errors_no_order_gains_enough_and_below_them_each_does() {
        for (bias, errors) in
            [(BIAS_SAME, NO_GAIN_SAME), (BIAS_LOWER, NO_GAIN_LOWER), (BIAS_HIGHER, NO_GAIN_HIGHER)]
        {
            for (order, error) in errors.into_iter().enumerate() {
                assert!(growth(bias, error, order) < LEAST_GAIN, "bias {bias}, order {order}");
                // The 1e-6 beside the root counts for up to that much of the gain, as often as the
                // order says in the error.
                assert!(
                    growth(bias, error * (1.0 - 4e-5), order) > LEAST_GAIN,
                    "bias {bias}, order {order}"
                );
            }
        }
    }
}
