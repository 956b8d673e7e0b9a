//! eps -> 0: the smoothed system against the Filippov motion.

use twofold::analyse::limit::{
    AfterVisitQuestion, ConvergenceQuestion, after_visit, convergence, observed_rate,
};
use twofold::analyse::passage::{PassageQuestion, passage};
use twofold::integrate::filippov::{FilippovError, FilippovOptions, FunnelGrid, Mode};
use twofold::system::{Caricature, Smoothed, Transition};

fn before(times: &[f64], eps: &[f64]) -> ConvergenceQuestion {
    ConvergenceQuestion {
        start: vec![0.2, 0.0, -1.0],
        times: times.into(),
        eps: eps.into(),
        settings: FilippovOptions::default(),
    }
}

#[test]
fn smoothed_orbits_converge_at_first_order_before_the_first_visit() {
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    // After one crossing, after three, and twice in sliding; the visit is at t = 13.196.
    let times = [2.0, 7.0, 9.0, 11.0];
    let eps = [1.6e-2, 8e-3, 4e-3, 2e-3, 1e-3, 5e-4];
    let found = convergence(&c, &before(&times, &eps)).unwrap();
    assert_eq!(found.rows.len(), times.len() * eps.len());
    assert!(found.statistics.steps > 0);
    assert!(found.rows.iter().filter(|r| r.t > 8.0).all(|r| r.mode == Mode::SlidingAttracting));
    for t in times {
        let here = || found.rows.iter().filter(|r| r.t == t);
        let rate = observed_rate(here().map(|r| [r.eps, r.distance]));
        println!("t = {t}: rate {rate:.4}");
        for r in here() {
            println!("   eps {:e} distance {:.4e}", r.eps, r.distance);
        }
        assert!((rate - 1.0).abs() < 0.05, "t = {t}: rate {rate}");
    }
}

#[test]
fn questions_that_cannot_be_answered_are_refused() {
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    let error = convergence(&c, &before(&[14.0], &[1e-2])).unwrap_err();
    assert!(
        matches!(error, FilippovError::NoSuchExit { .. }),
        "the future is a set there: {error}"
    );
    let mut short = before(&[2.0], &[1e-2]);
    short.start.pop();
    let error = convergence(&c, &short).unwrap_err();
    assert!(matches!(error, FilippovError::Invalid(_)), "{error}");
}

#[test]
fn smoothed_orbits_leave_inside_the_funnel() {
    // The question of papers/jeffrey-2013/code/convergence.
    let question = AfterVisitQuestion {
        start: vec![0.2, 0.0, -1.0],
        t_end: 80.0,
        eps: vec![1e-2, 3e-3, 1e-3, 3e-4, 1e-4],
        beyond: 0.6,
        grid: FunnelGrid {
            shortest: 1e-3,
            longest: 2.5,
            times: 80,
            horizon: 12.0,
            until_two_fold: true,
            per_step: 1,
        },
        refinements: 3,
        finer: 21,
        settings: FilippovOptions::default(),
    };
    for alpha in [1e-1, 1e-3] {
        let c = Caricature::with_reinjection(alpha, 1e-5);
        let far = PassageQuestion::far([0.2, 0.0, -1.0], question.beyond, question.t_end);
        let crossing = |eps: f64| {
            let field = Smoothed { system: c, transition: Transition::Tanh, eps };
            Ok(passage(&field, eps, &far)?.far.map(Vec::from))
        };
        let found = after_visit(&c, &question, crossing).unwrap();
        assert_eq!(found.rows.len(), question.eps.len());
        // Smoothing blurs a two-fold over a distance sqrt(eps): the orbit goes out within that of
        // some member, in a funnel that is much wider.
        assert!(found.width > 1.5, "{}", found.width);
        for r in &found.rows {
            println!("alpha {alpha} {r:?}");
            assert!(r.distance < r.eps.sqrt(), "{r:?}");
            let coarse = found.members.iter().map(|m| {
                let squares = m.crossing.iter().zip(&r.crossing).map(|(a, b)| (a - b) * (a - b));
                squares.sum::<f64>().sqrt()
            });
            let coarse = coarse.fold(f64::INFINITY, f64::min);
            assert!(r.distance <= coarse, "the search made it worse: {r:?} {coarse}");
        }
        // The distance falls, but slowly and not steadily (the figure `convergence`): only the
        // bound above and the end are certain.
        let distance = |i: usize| found.rows[i].distance;
        assert!((0..4).all(|i| distance(4) < distance(i)), "nearest at the smallest eps");
        // The member that it follows depends on eps.
        let times: Vec<_> = found.rows.iter().map(|r| r.nearest.exit_time).collect();
        assert!(times.windows(2).all(|t| (t[0] / t[1] - 1.0).abs() > 0.1), "{times:?}");
    }
}
