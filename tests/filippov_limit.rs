//! eps -> 0: the smoothed system against the Filippov motion.

use nalgebra::vector;
use twofold::integrate::filippov::limit::{after_visit, convergence, observed_rate};
use twofold::integrate::filippov::{FilippovError, FunnelGrid, Mode, Settings};
use twofold::system::Caricature;

#[test]
fn smoothed_orbits_converge_at_first_order_before_the_first_visit() {
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    // After one crossing, after three, and twice in sliding; the visit is at t = 13.196.
    let times = [2.0, 7.0, 9.0, 11.0];
    let eps = [1.6e-2, 8e-3, 4e-3, 2e-3, 1e-3, 5e-4];
    let rows = convergence(&c, vector![0.2, 0.0, -1.0], &times, &eps, &Settings::default()).unwrap();
    assert_eq!(rows.len(), times.len() * eps.len());
    assert!(rows.iter().filter(|r| r.t > 8.0).all(|r| r.mode == Mode::SlidingAttracting));
    for t in times {
        let rate = observed_rate(&rows, t);
        println!("t = {t}: rate {rate:.4}");
        for r in rows.iter().filter(|r| r.t == t) {
            println!("   eps {:e} distance {:.4e}", r.eps, r.distance);
        }
        assert!((rate - 1.0).abs() < 0.05, "t = {t}: rate {rate}");
    }
}

#[test]
fn no_comparison_where_the_future_is_a_set() {
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    let error = convergence(&c, vector![0.2, 0.0, -1.0], &[14.0], &[1e-2], &Settings::default()).unwrap_err();
    assert!(matches!(error, FilippovError::NoSuchExit { .. }), "{error}");
}

#[test]
fn smoothed_orbits_leave_inside_the_funnel() {
    let grid = FunnelGrid { shortest: 1e-3, longest: 2.5, times: 80, horizon: 12.0, until_two_fold: true, per_step: 1 };
    for alpha in [1e-1, 1e-3] {
        let c = Caricature::with_reinjection(alpha, 1e-5);
        let eps = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4];
        let start = vector![0.2, 0.0, -1.0];
        let rows = after_visit(&c, start, 80.0, &eps, 0.6, &grid, &Settings::default()).unwrap();
        for r in &rows {
            println!("alpha {alpha} {r:?}");
            // Smoothing blurs a two-fold over a distance sqrt(eps): the orbit goes out within that of some member, in a
            // funnel that is much wider.
            assert!(r.width > 1.5, "{r:?}");
            assert!(r.distance < r.eps.sqrt(), "{r:?}");
        }
        // The distance falls, but slowly and not steadily (figures/convergence): only the bound above and the end are certain.
        assert!(rows[..4].iter().all(|r| rows[4].distance < r.distance), "nearest at the smallest eps");
        // No limit: which member it follows depends on eps.
        let times: Vec<_> = rows.iter().map(|r| r.exit_time).collect();
        assert!(times.windows(2).all(|t| (t[0] / t[1] - 1.0).abs() > 0.1), "{times:?}");
    }
}
