//! Number of visits to the singularity by runs of fig. 6(i) until t = 150, at each candidate for
//! alpha and beta: 30 starts within 1e-9 of the paper's. A visit comes within 0.1 of the origin
//! after more than 0.4 away. CSV on standard output, a row a run.
//!
//! `make capture`, or
//! `cargo run --release --example visits > papers/jeffrey-2013/code/capture/visits.csv`

use twofold::integrate::Schedule;
use twofold::jeffrey_2013::study::claims::claims;
use twofold::job::JobError;
use twofold::job::recording::Data;
use twofold::job::simulate::simulate;
use twofold::job::spec::*;
use twofold::num::random::RandomStream;
use twofold::system::Caricature;

/// Printed, with one exponent changed, and the maximum of the map of the parameters.
pub const CANDIDATES: [[f64; 2]; 8] = [
    [1e-3, 1e-6],
    [1e-3, 1e-5],
    [1e-3, 1e-4],
    [1e-3, 1e-3],
    [1e-2, 1e-5],
    [1e-1, 1e-5],
    [1e-1, 3.162_277_660_168_38e-4],
    [1.0, 1e-5],
];

/// The visits of a run whose start is shifted by numbers of the stream `stream`.
///
/// # Errors
///
/// If the run fails.
pub fn visits([alpha, beta]: [f64; 2], stream: u64) -> Result<u32, JobError> {
    let mut random = RandomStream::new(2013, stream);
    let shift = claims().rules.shift;
    let start = [0.2, 0.0, -1.0].map(|x| x + random.uniform_in(-shift, shift));
    let run = RunSpec {
        system: Caricature::with_reinjection(alpha, beta).into(),
        switch: SwitchSpec::tanh(1e-3),
        start: start.to_vec(),
        t_end: 150.0,
        method: MethodSpec::ndsolve_defaults(Method::Lsoda),
        schedule: Schedule { restart_every: None, kick: None },
        observe: Observation::Path { chord: 1e-3 },
    };
    let Data::Path(samples) = simulate(&run, &())?.data else {
        unreachable!("a path was asked for")
    };
    let (mut away, mut count) = (true, 0);
    for sample in &samples {
        let square: f64 = sample.x.iter().map(|v| v * v).sum();
        if square > 0.4 * 0.4 {
            away = true;
        } else if square < 0.1 * 0.1 && away {
            away = false;
            count += 1;
        }
    }
    Ok(count)
}

fn main() -> Result<(), JobError> {
    println!("params.alpha,params.beta,start,visits");
    for at in CANDIDATES {
        for start in 0..30 {
            println!("{:?},{:?},{start},{}", at[0], at[1], visits(at, start)?);
        }
    }
    Ok(())
}
