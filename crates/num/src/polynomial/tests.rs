use super::super::Elementary;
use super::super::series::{Constants, Solution};
use super::super::tape::Recorded;
use super::*;
use crate::Arithmetic;

fn blend(x: &[Recorded]) -> Vec<Recorded> {
    let c = |v: f64| Recorded::from_f64(v);
    let r2 = x[0].squared() + x[1].squared() + x[2].squared();
    let (dy, dz) = ((c(0.1) - x[1].scale(1e-2)) * r2, (c(0.1) - x[2].scale(1e-2)) * r2);
    let plus = [-x[1], c(1.0) + dy, c(-1.2) + dz];
    let minus = [x[2], c(-1.4) + dy, c(1.0) + dz];
    let phi = (c(1.0) + (x[0] / c(1e-3)).tanh()).scale(0.5);
    plus.into_iter().zip(minus).map(|(p, m)| m + (p - m) * phi).collect()
}

#[test]
fn outside_the_layer_the_series_are_those_of_the_tape() {
    let tape = Tape::record(3, blend);
    for (side, x) in [(1.0, [0.3, -0.7, 0.4]), (-1.0, [-0.3, 0.9, 0.2])] {
        let flow = Flow::new(&tape, side).unwrap();
        // The sum of three squares and two factors; the other field has cancelled.
        assert_eq!(flow.sums.len(), 3, "{flow:?}");
        assert!(flow.radial.is_some(), "{flow:?}");
        let by_sums = Flow { radial: None, ..flow.clone() };
        let mut found = Series::default();
        for degree in [7, 12, 13, 15, 16, 17, 31] {
            let mut solution = Solution::new(degree, &tape, Constants::Binary);
            for flow in [&flow, &by_sums] {
                // Results of an earlier expansion have no effect.
                for x in [[1e3, 7.0, -2.0], x] {
                    flow.expand(&x, degree, &mut found);
                    solution.expand(&x);
                }
                for i in 0..3 {
                    for (k, want) in solution.component(i).iter().enumerate() {
                        let got = found.component(i)[k];
                        assert!(
                            (got - want).abs() <= 1e-13 * (1.0 + want.abs()),
                            "{degree} {i} {k}: {got} {want}"
                        );
                    }
                }
            }
        }
        let (gradient, constant) = flow.linear_argument().unwrap();
        assert_eq!((gradient, constant), (&[1.0 / 1e-3, 0.0, 0.0][..], 0.0));
        assert_eq!(flow.argument(1, &found), found.component(0)[1] * (1.0 / 1e-3));
    }
}

#[test]
fn products_of_products_used_again_and_arguments_that_are_products() {
    // a = x y is wanted twice, a^2 once, x a once; the layer is at x y = 1.
    let tape = Tape::record(2, |x| {
        let a = x[0] * x[1];
        let phi = (a - Recorded::one()).tanh();
        vec![a * a - x[0].scale(2.0) * a + phi, a - x[1] * x[1] * x[1] - phi]
    });
    let flow = Flow::new(&tape, -1.0).unwrap();
    assert!(flow.has_layer() && flow.linear_argument().is_none());
    let (mut found, mut solution) =
        (Series::default(), Solution::new(11, &tape, Constants::Binary));
    // So far inside the other half of the layer that tanh is -1.
    let x = [-9.0, 8.0];
    flow.expand(&x, 11, &mut found);
    solution.expand(&x);
    for i in 0..2 {
        for (k, want) in solution.component(i).iter().enumerate() {
            let got = found.component(i)[k];
            assert!((got - want).abs() <= 1e-13 * (1.0 + want.abs()), "{i} {k}: {got} {want}");
        }
    }
    let (_, w) = solution.layer_arguments().next().unwrap();
    for (k, want) in w.iter().enumerate() {
        let got = flow.argument(k, &found);
        assert!((got - want).abs() <= 1e-13 * (1.0 + want.abs()), "{k}: {got} {want}");
    }
}

#[test]
fn instructions_change_no_bit() {
    use pulp::{Simd, WithSimd};
    let flow = Flow::new(&Tape::record(3, blend), 1.0).unwrap();
    let radial = flow.radial.clone().unwrap();
    let flow = Flow { radial: None, ..flow };
    for degree in [9, 14, 16, 17, 18, 25, 31] {
        let (mut plain, mut here) = (Series::default(), Series::default());
        let x = [0.3, -0.7, 0.4];
        Expansion { flow: &flow, x: &x, degree, series: &mut plain }.with_simd(pulp::Scalar);
        flow.expand(&x, degree, &mut here);
        for i in 0..3 {
            let bits = |series: &Series| {
                series.component(i).iter().map(|c| c.to_bits()).collect::<Vec<_>>()
            };
            assert_eq!(bits(&plain), bits(&here), "{degree}");
        }
        let bits = |expand: &dyn Fn(radial::Task<'_>)| {
            let mut series = Series::default();
            expand(radial::Task { of: &radial, x, degree, series: &mut series });
            (0..3).flat_map(|i| series.component(i).to_vec()).map(f64::to_bits).collect::<Vec<_>>()
        };
        let want = bits(&|task| radial::In::<_, 16>(task).with_simd(pulp::Scalar));
        if degree <= 17 {
            assert_eq!(
                bits(&|task| radial::In::<_, 8>(task).with_simd(pulp::Scalar)),
                want,
                "{degree}"
            );
        }
        assert_eq!(bits(&|task| radial.expand(task.x, task.degree, task.series)), want, "{degree}");
        #[cfg(target_arch = "x86_64")]
        {
            match pulp::x86::V3::try_new() {
                Some(set) => {
                    assert_eq!(
                        bits(&|task| Simd::vectorize(set, radial::In::<_, 4>(task))),
                        want,
                        "{degree}"
                    );
                }
                None => println!("not run: AVX2"),
            }
            match pulp::x86::V4::try_new() {
                Some(set) => {
                    assert_eq!(
                        bits(&|task| Simd::vectorize(set, radial::In::<_, 2>(task))),
                        want,
                        "{degree}"
                    );
                }
                None => println!("not run: AVX-512"),
            }
        }
    }
}

#[test]
fn other_forms_are_no_radial_ones() {
    let c = |v: f64| Recorded::from_f64(v);
    let r2 = |x: &[Recorded]| x[0].squared() + x[1].squared() + x[2].squared();
    // x', with y' and z' in this form or y' in another.
    let form = |x: &dyn Fn(&[Recorded]) -> Recorded, y: &dyn Fn(&[Recorded]) -> Recorded| {
        let tape = Tape::record(3, |v| vec![x(v), y(v), c(1.0) + (c(2.0) - v[2]) * r2(v)]);
        Flow::new(&tape, 1.0).unwrap().radial
    };
    let linear = |x: &[Recorded]| x[1] + x[2];
    assert!(form(&linear, &|x| r2(x).scale(0.3)).is_some());
    assert!(form(&linear, &|x| (c(1.0) - x[1]) * r2(x)).is_some());
    assert!(form(&|x| x[1] * x[2], &|x| (c(1.0) - x[1]) * r2(x)).is_none());
    let other = |y: &dyn Fn(&[Recorded]) -> Recorded| assert_eq!(form(&linear, y), None);
    // A square is missing, is doubled, the factor is of another state, there is a term beside
    // the product, or nothing at all.
    other(&|x| x[0].squared() + x[1].squared());
    other(&|x| r2(x) + x[0].squared());
    other(&|x| (c(1.0) - x[2]) * r2(x));
    other(&|x| x[1] + (c(1.0) - x[1]) * r2(x));
    other(&|_| c(1.0));
    // A square counts more than the others, a product is no square, one stands for the third, a
    // number is added to the three.
    other(&|x| x[0].squared() + x[1].squared().scale(2.0) + x[2].squared());
    other(&|x| x[0].squared() + x[1].squared() + x[2].squared().scale(2.0));
    other(&|x| x[0] * x[1] + x[1].squared() + x[2].squared());
    other(&|x| x[0].squared() + x[1].squared() + x[0] * x[1]);
    other(&|x| (r2(x) + c(1.0)) * (c(2.0) - x[1]));
}

/// The series by `flow` and those of its tape.
fn agree(tape: &Tape, flow: &Flow, x: &[f64]) {
    let (mut found, mut solution) = (Series::default(), Solution::new(12, tape, Constants::Binary));
    flow.expand(x, 12, &mut found);
    solution.expand(x);
    for i in 0..x.len() {
        for (k, want) in solution.component(i).iter().enumerate() {
            let got = found.component(i)[k];
            assert!((got - want).abs() <= 1e-13 * (1.0 + want.abs()), "{i} {k}: {got} {want}");
        }
    }
}

#[test]
fn a_radial_equation_with_every_number_in_it() {
    let c = |v: f64| Recorded::from_f64(v);
    let tape = Tape::record(3, |x| {
        let r2 = x[0].squared() + x[1].squared() + x[2].squared();
        let first = c(0.7) + x[0].scale(0.3) - x[1].scale(1.1) + x[2].scale(0.2);
        vec![
            first,
            c(-0.4) + (c(0.5) - x[1].scale(0.6)) * r2,
            c(0.9) + (x[2].scale(0.8) - c(0.2)) * r2,
        ]
    });
    let flow = Flow::new(&tape, 1.0).unwrap();
    assert!(flow.radial.is_some() && !flow.has_layer());
    agree(&tape, &flow, &[0.3, -0.7, 0.4]);
    let tape = Tape::record(3, |x| {
        let r2 = x[0].squared() + x[1].squared() + x[2].squared();
        vec![x[1], r2.scale(0.3), (c(2.0) - x[2]) * r2]
    });
    agree(&tape, &Flow::new(&tape, 1.0).unwrap(), &[0.3, -0.7, 0.4]);
}

#[test]
fn like_terms_and_factors_of_products_are_put_together() {
    let tape = Tape::record(2, |x| {
        let three = x[0] + x[0].scale(2.0);
        vec![three - x[1].scale(3.0) * x[0].scale(2.0), x[0] * x[1] + x[1].scale(0.5)]
    });
    let reduced = Reduced::new(&tape, 1.0).unwrap();
    assert_eq!(reduced.derivatives[0].terms, [(0, 3.0), (2, -6.0)]);
    // y x and x y are one.
    assert_eq!(reduced.products.len(), 1);
    agree(&tape, &Flow::new(&tape, 1.0).unwrap(), &[0.3, -0.7]);
}

#[test]
fn what_is_wanted_twice_is_a_series_of_its_own_and_nothing_else() {
    let sums = |f: &dyn Fn(&[Recorded]) -> Vec<Recorded>| {
        Flow::new(&Tape::record(2, f), 1.0).unwrap().sums.len()
    };
    let one = Recorded::one;
    assert_eq!(sums(&|x| vec![x[0] * x[1], x[0]]), 0);
    assert_eq!(sums(&|x| vec![x[0] * x[1], x[0] * x[1] + x[0]]), 1);
    // In a sum, and in a factor, which is one too.
    assert_eq!(sums(&|x| vec![x[0] * x[1], (one() + x[0] * x[1]) * x[0]]), 2);
    assert_eq!(sums(&|x| vec![(one() + x[0]) * x[1], (one() + x[0]) * x[0]]), 1);
}

#[test]
fn there_are_series_for_as_many_as_there_is_room() {
    let factors = |many: u32| {
        Tape::record(2, |x| {
            let product = |k| (x[0] + Recorded::from_f64(f64::from(k))) * x[1];
            vec![(1..=many).map(product).fold(x[0], |sum, product| sum + product), x[0]]
        })
    };
    assert_eq!(Flow::new(&factors(62), 1.0).map(|flow| flow.sums.len()).ok(), Some(62));
    assert_eq!(Flow::new(&factors(63), 1.0).err(), Some(NotPolynomial::Size));
    agree(&factors(40), &Flow::new(&factors(40), 1.0).unwrap(), &[0.01, -0.02]);
}

#[test]
fn what_is_no_polynomial_is_refused() {
    let refused =
        |f: fn(&[Recorded]) -> Recorded| Flow::new(&Tape::record(1, |x| vec![f(x)]), 1.0).err();
    assert_eq!(refused(|x| x[0] * x[0] / Recorded::from_f64(3.0)), None);
    assert_eq!(refused(|x| x[0] * x[0] / x[0]), Some(NotPolynomial::Operation("/")));
    assert_eq!(refused(|x| x[0].exp()), Some(NotPolynomial::Operation("exp")));
    assert_eq!(refused(|x| x[0].tanh() + (x[0] + x[0]).tanh()), Some(NotPolynomial::Layers));
    // An operation that no value needs may be of any kind.
    let tape = Tape::record(1, |x| vec![x[0], x[0].exp()]);
    assert!(Flow::new(&tape.select([0]), 1.0).is_ok() && Flow::new(&tape, 1.0).is_err());
    // tanh of a number is a number.
    assert_eq!(refused(|x| x[0] * Recorded::from_f64(0.3).tanh()), None);
}
