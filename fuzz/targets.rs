//! Targets of fuzzing: every reader of foreign bytes. A reader may refuse; it must not panic, hang,
//! or take memory that its input does not pay for. Where something is read that can be written
//! again, it must come back the same. Two drivers make the inputs: tests/it/fuzz.rs, which needs no
//! tool, and libFuzzer (fuzz/Cargo.toml), which sees what an input runs through.

use twofold::job::spec::{FunnelSpec, Observation, RunSpec, SwitchSpec};
use twofold::job::sweep::Rows;
use twofold::job::{encode, simulate, store};
use twofold::record::{Hash, Manifest};
use twofold::render::{decode_png, png_size, read_provenance};
use twofold::system::{Definition, PiecewiseSmooth, System};

/// A reader under test. What it gives back says how far an input came: inputs that come somewhere
/// new are worth changing further.
pub type Target = fn(&[u8]) -> String;

/// Outcome of a read, in words.
fn said<T, E: std::fmt::Display>(found: &Result<T, E>) -> String {
    match found {
        Ok(_) => "read".into(),
        Err(error) => error.to_string(),
    }
}

/// All of them, by name.
pub const TARGETS: [(&str, Target); 9] = [
    ("spec", spec),
    ("system", system),
    ("manifest", manifest),
    ("csv", csv),
    ("png", png),
    ("svg", picture),
    ("pdf", picture),
    ("store", store),
    ("certificate", certificate),
];

fn text(bytes: &[u8]) -> Option<&str> {
    std::str::from_utf8(bytes).ok()
}

/// A spec: read, checked, written and read again; a sound one is also run, briefly.
pub fn spec(bytes: &[u8]) -> String {
    let mut spec = match serde_json::from_slice::<RunSpec>(bytes) {
        Ok(spec) => spec,
        Err(error) => return error.to_string(),
    };
    let again: RunSpec = serde_json::from_str(&serde_json::to_string(&spec).unwrap()).unwrap();
    // Not-a-number is no JSON, so that equality is what it seems.
    assert_eq!(again, spec);
    if let Err(error) = spec.validate() {
        return error.to_string();
    }
    // The work of a valid spec is bounded, so that the fuzzer goes on: few steps and points.
    spec.t_end = spec.t_end.min(1.0);
    spec.method.max_steps = spec.method.max_steps.min(50);
    spec.schedule.restart_every = spec.schedule.restart_every.map(|t| t.max(0.1));
    if let Some(kick) = &mut spec.schedule.kick {
        kick.every = kick.every.max(0.1);
    }
    if let SwitchSpec::Filippov { funnel: Some(FunnelSpec { times, horizon, .. }), .. } =
        &mut spec.switch
    {
        (*times, *horizon) = (1, horizon.min(0.5));
    }
    match &mut spec.observe {
        Observation::Path { chord } => *chord = chord.max(1e-2),
        Observation::Times { every } => *every = every.max(1e-2),
        Observation::Section { .. } => {}
    }
    said(&simulate::answer(&spec, &()))
}

/// A system's file: read, written and read again, and asked for its field.
pub fn system(bytes: &[u8]) -> String {
    let Some(text) = text(bytes) else { return "no text".into() };
    let definition = match Definition::from_toml(text, "a file") {
        Ok(definition) => definition,
        Err(diagnostic) => return diagnostic.message.clone(),
    };
    let again = Definition::from_toml(&definition.to_toml(), "written again")
        .expect("what is written can be read");
    assert_eq!(again.to_toml(), definition.to_toml());
    let system = System::new(definition);
    let _ = system.reversed().canonical();
    if let Ok(bound) = system.bind::<3>() {
        let _ = bound.switching(&twofold::nalgebra::SVector::<f64, 3>::zeros());
    }
    said(&system.check())
}

/// A manifest.
pub fn manifest(bytes: &[u8]) -> String {
    let Some(text) = text(bytes) else { return "no text".into() };
    let found = Manifest::parse(text, "a file");
    if let Ok(manifest) = &found {
        let again =
            Manifest::parse(std::str::from_utf8(&manifest.to_json()).unwrap(), "written again")
                .unwrap();
        assert_eq!(again, *manifest);
    }
    said(&found)
}

/// A table as CSV, the rows of a sweep, and a sweep's journal.
pub fn csv(bytes: &[u8]) -> String {
    let table = encode::from_csv(bytes);
    if let Ok((heading, table)) = &table {
        let (_, again) = encode::from_csv(&encode::csv(table, &heading.about))
            .expect("what is written can be read");
        assert_eq!(encode::bits(&[again]), encode::bits(std::slice::from_ref(table)));
    }
    let lines: Vec<String> = text(bytes).unwrap_or_default().lines().map(str::to_owned).collect();
    format!(
        "{} {} {}",
        said(&table),
        said(&Rows::from_csv(bytes)),
        said(&Rows::from_journal(&lines))
    )
}

/// A picture: what it says of itself.
pub fn picture(bytes: &[u8]) -> String {
    let found = read_provenance(bytes);
    format!("{} {}", said(&found), found.is_ok_and(|provenance| provenance.intact))
}

/// A PNG picture: what it says of itself, and its pixels.
pub fn png(bytes: &[u8]) -> String {
    // Memory is taken for pixels: not for more than a small machine has, while fuzzing.
    let small = png_size(bytes).is_some_and(|(w, h)| u64::from(w) * u64::from(h) < 1 << 22);
    let pixels = if small { said(&decode_png(bytes)) } else { "large".into() };
    format!("{} {pixels}", picture(bytes))
}

/// An entry of a store, and the tables in it. Its digest is made to fit, so that what lies behind
/// it is reached.
pub fn store(bytes: &[u8]) -> String {
    let found = store::answer_in(bytes);
    let content = &bytes[..bytes.len().saturating_sub(64)];
    let sealed = store::answer_in(&[content, Hash::of(content).as_str().as_bytes()].concat());
    if let Ok(answer) = &sealed {
        let again =
            encode::from_bits(&encode::bits(&answer.tables)).expect("what is written can be read");
        assert_eq!(encode::bits(&again), encode::bits(&answer.tables));
    }
    let tables = encode::from_bits(bytes);
    if let Ok(tables) = &tables {
        let again = encode::from_bits(&encode::bits(tables)).expect("what is written can be read");
        assert_eq!(encode::bits(&again), encode::bits(tables));
    }
    format!("{} {} {}", said(&found), said(&sealed), said(&tables))
}

/// A theorem's certificate, without the orbits that the checker computes itself (`make forge` tries
/// those).
pub fn certificate(bytes: &[u8]) -> String {
    match text(bytes) {
        Some(text) => {
            let theorems = twofold::paper::code::theorems();
            said(&twofold::verify::Checker::of_reader(theorems).verify(text))
        }
        None => "no text".into(),
    }
}
