//! The findings that the project stands on, at full length: SCIENCE's reference orbits in the figures as they are.

use twofold::analyse::{Crossing, Direction};
use twofold::job::recording::Data;
use twofold::job::simulate::simulate;
use twofold::paper::Reading;
use twofold::paper::figures;

/// The late half of every panel of fig. 7 in a reading.
fn late_halves(reading: Reading) -> Vec<Vec<Crossing>> {
    let figure = figures::all().into_iter().find(|f| f.id == "fig7").unwrap();
    let picture = figure.pictures.into_iter().find(|p| p.reading == Some(reading)).unwrap();
    picture
        .panels
        .iter()
        .map(|panel| match simulate(&panel.run, &()).unwrap().data {
            Data::Section(crossings) => crossings.into_iter().filter(|c| c.t > 0.5 * panel.run.t_end).collect(),
            _ => panic!("fig. 7 is made of sections"),
        })
        .collect()
}

#[test]
fn printed_reading_ends_on_one_periodic_orbit() {
    // y = 0 at (x, z) = (17.0573, -0.0154) up and (-13.3857, -0.0199) down, period 20.25, to three digits of the orbit's size.
    for late in late_halves(Reading::Printed) {
        for c in &late {
            let (x, z) = if c.direction == Direction::Up { (17.0573, -0.0154) } else { (-13.3857, -0.0199) };
            assert!((c.x[0] - x).abs() < 1e-2, "{c:?}");
            assert!((c.x[2] - z).abs() < 5e-3, "{c:?}");
        }
        let ups: Vec<f64> = late.iter().filter(|c| c.direction == Direction::Up).map(|c| c.t).collect();
        let period = (ups[ups.len() - 1] - ups[0]) / (ups.len() - 1) as f64;
        assert!((period - 20.25).abs() < 5e-3, "{period}");
    }
}

#[test]
fn reconstructed_reading_is_bounded() {
    for late in late_halves(Reading::Reconstructed) {
        assert!(late.len() > 30_000);
        for c in &late {
            assert!(c.x[0].abs() < 1.6 && c.x[2].abs() < 0.9, "{c:?}");
        }
    }
}
