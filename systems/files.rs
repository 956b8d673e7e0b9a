//! The built-in systems: every file of this folder, by name.
#![forbid(unsafe_code)]

/// Name and text of every system.
pub const FILES: [(&str, &str); 15] = [
    ("caricature", include_str!("caricature.toml")),
    ("caricature-as-printed", include_str!("caricature-as-printed.toml")),
    ("two-fold", include_str!("two-fold.toml")),
    ("wheel", include_str!("wheel.toml")),
    ("relay-linear", include_str!("relay-linear.toml")),
    ("relay-parabolic", include_str!("relay-parabolic.toml")),
    ("stick-slip", include_str!("stick-slip.toml")),
    ("dry-friction", include_str!("dry-friction.toml")),
    ("friction-pair", include_str!("friction-pair.toml")),
    ("relay-third-order", include_str!("relay-third-order.toml")),
    ("chua", include_str!("chua.toml")),
    ("gene-switch", include_str!("gene-switch.toml")),
    ("fused-focus", include_str!("fused-focus.toml")),
    ("relay-square", include_str!("relay-square.toml")),
    ("two-blocks", include_str!("two-blocks.toml")),
];

/// Name and text of every general system (folder `general`).
pub const GENERAL: [(&str, &str); 9] = [
    ("bouncing-ball", include_str!("general/bouncing-ball.toml")),
    ("impact-oscillator", include_str!("general/impact-oscillator.toml")),
    ("relay-hysteresis", include_str!("general/relay-hysteresis.toml")),
    ("three-blocks", include_str!("general/three-blocks.toml")),
    ("sliding-mode-control", include_str!("general/sliding-mode-control.toml")),
    ("buck", include_str!("general/buck.toml")),
    ("cuk-converter", include_str!("general/cuk-converter.toml")),
    ("rimless-wheel", include_str!("general/rimless-wheel.toml")),
    ("driven-by-data", include_str!("general/driven-by-data.toml")),
];

/// Tables that general systems read.
pub const TABLES: [(&str, &str); 1] = [("inflow.csv", include_str!("general/inflow.csv"))];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_folder_is_built_in() {
        let mut found: Vec<String> = std::fs::read_dir(env!("CARGO_MANIFEST_DIR"))
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .filter(|name| name != "Cargo.toml")
            .filter_map(|n| n.strip_suffix(".toml").map(Into::into))
            .collect();
        found.sort();
        let mut known: Vec<&str> = FILES.iter().map(|(name, _)| *name).collect();
        known.sort();
        assert_eq!(found, known);
    }
}
