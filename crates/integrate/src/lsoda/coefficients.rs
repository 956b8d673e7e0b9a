//! The two families in Nordsieck form, from their defining polynomials.
//!
//! With y_j = h^j x^(j)/j! for j = 0..q, a step is y <- P y + l e, where P is the Pascal triangle
//! (the Taylor prediction) and e = h f(x) - (P y)_1 the correction. A method is its vector l. Gear
//! (1971) and Hindmarsh (1983) give l through a generating polynomial L(s) = sum_j l_j s^j,
//! normalised to l_1 = 1:
//!
//! ```text
//! Adams-Moulton of order q:  L'(s) = (s + 1)(s + 2)...(s + q - 1) / (q - 1)!,   L(-1) = 0
//! BDF of order q:            L(s) = (s + 1)(s + 2)...(s + q) / K,            K such that l_1 = 1
//! ```
//!
//! The leading term of the local error is C_q h^(q+1) x^(q+1): C_q = |gamma*_q| with the Moulton
//! coefficient gamma*_q = (1/q!) int_{-1}^0 s (s + 1)...(s + q - 1) ds (Hairer, Norsett & Wanner
//! 1993, sec. III.1) for Adams, and 1/(q + 1) for BDF, in the convention of Radhakrishnan &
//! Hindmarsh (1993), sec. 2. What a program has are e (which is h^(q+1) x^(q+1) for Adams and that
//! over l_0 for BDF), the difference of two e's, and y_q. [`Formula`] keeps the divisors that turn
//! norms of these into errors at the orders q, q + 1 and q - 1.

/// The highest order of the Adams-Moulton family.
pub(super) const ADAMS_ORDERS: usize = 12;
/// The highest order of the BDF family: order 6 is the last that is stable at all, and barely.
pub(super) const BDF_ORDERS: usize = 5;
/// Columns of a Nordsieck array.
pub(super) const COLUMNS: usize = ADAMS_ORDERS + 1;

/// One order of one family.
#[derive(Clone, Copy, Debug)]
pub(super) struct Formula {
    /// l_0, ..., l_q.
    pub l: [f64; COLUMNS],
    /// |y_q| / `lower` is the error at order q - 1. Zero at order 1, which has no lower one.
    pub lower: f64,
    /// |e| / `same` is the error at order q.
    pub same: f64,
    /// |e - e_before| / `higher` is the error at order q + 1.
    pub higher: f64,
    /// The corrector's iteration has converged where what is left of it is below this: an error of
    /// 1/(2 (q + 2)).
    pub converged: f64,
}

const NOTHING: Formula =
    Formula { l: [0.0; COLUMNS], lower: 0.0, same: 0.0, higher: 0.0, converged: 0.0 };

/// The product p(s) (s + root), for a polynomial of degree `degree`.
const fn times(p: [f64; COLUMNS], degree: usize, root: f64) -> [f64; COLUMNS] {
    let mut product = [0.0; COLUMNS];
    let mut i = 0;
    while i <= degree {
        product[i] += p[i] * root;
        product[i + 1] += p[i];
        i += 1;
    }
    product
}

/// int_{-1}^0 s^shift p(s) ds.
const fn integral(p: [f64; COLUMNS], degree: usize, shift: usize) -> f64 {
    let mut sum = 0.0;
    let mut i = 0;
    while i <= degree {
        let power = i + shift + 1;
        // -(-1)^power / power
        sum += if power % 2 == 1 { p[i] } else { -p[i] } / power as f64;
        i += 1;
    }
    sum
}

const ONE: [f64; COLUMNS] = {
    let mut p = [0.0; COLUMNS];
    p[0] = 1.0;
    p
};

/// Adams-Moulton, orders 1 to 12 at indices 0 to 11.
pub(super) static ADAMS: [Formula; ADAMS_ORDERS] = {
    // |gamma*_q| for q = 0..=12, and q!. The product for the Moulton coefficient of order q is s times that for l.
    let mut gamma = [0.0; ADAMS_ORDERS + 2];
    let mut factorial = [1.0; ADAMS_ORDERS + 2];
    let mut table = [NOTHING; ADAMS_ORDERS];
    let mut p = ONE;
    let mut q = 1;
    while q <= ADAMS_ORDERS {
        factorial[q] = factorial[q - 1] * q as f64;
        // p = (s + 1)...(s + q - 1), of degree q - 1.
        gamma[q] = -integral(p, q - 1, 1) / factorial[q];
        let l = &mut table[q - 1].l;
        l[0] = integral(p, q - 1, 0) / factorial[q - 1];
        let mut j = 1;
        while j <= q {
            l[j] = p[j - 1] / (j as f64 * factorial[q - 1]);
            j += 1;
        }
        p = times(p, q - 1, q as f64);
        q += 1;
    }
    let mut q = 1;
    while q <= ADAMS_ORDERS {
        let formula = &mut table[q - 1];
        formula.same = 1.0 / gamma[q];
        formula.converged = 0.5 / (q + 2) as f64 * formula.same;
        if q > 1 {
            formula.lower = 1.0 / (gamma[q - 1] * factorial[q]);
        }
        if q < ADAMS_ORDERS {
            formula.higher = 1.0 / gamma[q + 1];
        }
        q += 1;
    }
    table
};

/// BDF, orders 1 to 5 at indices 0 to 4.
pub(super) static BDF: [Formula; BDF_ORDERS] = {
    let mut table = [NOTHING; BDF_ORDERS];
    let mut p = ONE;
    let mut factorial = 1.0;
    let mut q = 1;
    while q <= BDF_ORDERS {
        p = times(p, q - 1, q as f64);
        let formula = &mut table[q - 1];
        let mut j = 0;
        while j <= q {
            formula.l[j] = p[j] / p[1];
            j += 1;
        }
        // factorial = (q - 1)!: y_q q! / q is h^q x^(q) / q.
        formula.lower = 1.0 / factorial;
        formula.same = (q + 1) as f64 / formula.l[0];
        formula.converged = 0.5 / (q + 2) as f64 * formula.same;
        formula.higher = (q + 2) as f64 / formula.l[0];
        factorial *= q as f64;
        q += 1;
    }
    table
};

/// Error of the BDF formula over error of the Adams formula of the same order, for the same
/// y_(q+1), orders 1 to 5 at indices 0 to 4: an e stands for l_q e, whatever the family. From 1
/// (order 1, the same formula) upwards.
pub(super) static ERROR_RATIO: [f64; BDF_ORDERS] = {
    let mut ratios = [0.0; BDF_ORDERS];
    let mut q = 1;
    while q <= BDF_ORDERS {
        let (adams, bdf) = (&ADAMS[q - 1], &BDF[q - 1]);
        ratios[q - 1] = adams.same * adams.l[q] / (bdf.same * bdf.l[q]);
        q += 1;
    }
    ratios
};

/// Stability limits of the predictor-corrector Adams methods of orders 1 to 12 on the negative real
/// axis, as |h lambda|: the values of Petzold (1983), who chose them a little inside the region.
/// |h lambda|: the values of Petzold (1983), who chose them a little inside the region.
pub(super) static ADAMS_STABILITY: [f64; ADAMS_ORDERS] =
    [0.5, 0.575, 0.55, 0.45, 0.35, 0.25, 0.20, 0.15, 0.10, 0.075, 0.050, 0.025];

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 4e-15 * b.abs(), "{a} {b}");
    }

    /// Hairer, Norsett & Wanner (1993), table III.1.3 (gamma*_j), and Gear (1971), table 9.1 (l).
    #[test]
    fn adams_moulton_by_the_book() {
        let gamma = [
            1.0 / 2.0,
            1.0 / 12.0,
            1.0 / 24.0,
            19.0 / 720.0,
            3.0 / 160.0,
            863.0 / 60480.0,
            275.0 / 24192.0,
        ];
        for (q, g) in (1..).zip(gamma) {
            close(ADAMS[q - 1].same, 1.0 / g);
        }
        let l4 = [3.0 / 8.0, 1.0, 11.0 / 12.0, 1.0 / 3.0, 1.0 / 24.0];
        for (a, b) in ADAMS[3].l.iter().zip(l4) {
            close(*a, b);
        }
        close(ADAMS[1].lower, 1.0);
        close(ADAMS[2].lower, 2.0);
        // l_0 of order q is the coefficient of f(x1): 95/288 at order 5 is 251/720 of the formula
        // of order 5.
        close(ADAMS[4].l[0], 251.0 / 720.0);
    }

    #[test]
    fn bdf_by_the_book() {
        for (q, l0) in (1..).zip([1.0, 2.0 / 3.0, 6.0 / 11.0, 12.0 / 25.0, 60.0 / 137.0]) {
            close(BDF[q - 1].l[0], l0);
            close(BDF[q - 1].l[1], 1.0);
        }
        close(BDF[2].l[2], 6.0 / 11.0);
        close(BDF[2].l[3], 1.0 / 11.0);
        close(BDF[4].lower, 1.0 / 24.0);
    }

    /// y <- P y + l e is exact for polynomials of degree q when e = 0; for x' = 0 started off the
    /// solution, L(-1) = 0 (Adams) keeps x unchanged by stale derivatives.
    #[test]
    fn adams_polynomials_vanish_at_minus_one() {
        for (q, formula) in (1..).zip(&ADAMS) {
            let at: f64 =
                (0..=q).map(|j| if j % 2 == 0 { formula.l[j] } else { -formula.l[j] }).sum();
            assert!(at.abs() < 1e-12, "order {q}: {at}");
        }
    }
}
