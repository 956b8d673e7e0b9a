//! The folder of Jeffrey (2013), file by file, so that an installed program has it anywhere.
#![forbid(unsafe_code)]

/// Path in the folder and text of everything in it that a program reads.
pub const JEFFREY_2013: &[(&str, &str)] = &[
    ("paper.toml", include_str!("jeffrey-2013/paper.toml")),
    ("sentences.toml", include_str!("jeffrey-2013/sentences.toml")),
    ("theorems.toml", include_str!("jeffrey-2013/theorems.toml")),
    ("figures/fig2.toml", include_str!("jeffrey-2013/figures/fig2.toml")),
    ("figures/fig5.toml", include_str!("jeffrey-2013/figures/fig5.toml")),
    ("figures/fig6.toml", include_str!("jeffrey-2013/figures/fig6.toml")),
    ("figures/fig7.toml", include_str!("jeffrey-2013/figures/fig7.toml")),
    ("figures/fig8.toml", include_str!("jeffrey-2013/figures/fig8.toml")),
    ("figures/fig9.toml", include_str!("jeffrey-2013/figures/fig9.toml")),
    ("expected/audit.json", include_str!("jeffrey-2013/expected/audit.json")),
    ("expected/basin.json", include_str!("jeffrey-2013/expected/basin.json")),
    ("expected/census.json", include_str!("jeffrey-2013/expected/census.json")),
    ("expected/convergence.json", include_str!("jeffrey-2013/expected/convergence.json")),
    ("expected/delay.json", include_str!("jeffrey-2013/expected/delay.json")),
    ("expected/digits.json", include_str!("jeffrey-2013/expected/digits.json")),
    ("expected/fig1.json", include_str!("jeffrey-2013/expected/fig1.json")),
    ("expected/fig2.json", include_str!("jeffrey-2013/expected/fig2.json")),
    ("expected/fig3.json", include_str!("jeffrey-2013/expected/fig3.json")),
    ("expected/fig4.json", include_str!("jeffrey-2013/expected/fig4.json")),
    ("expected/fig5.json", include_str!("jeffrey-2013/expected/fig5.json")),
    ("expected/fig6.json", include_str!("jeffrey-2013/expected/fig6.json")),
    ("expected/fig7.json", include_str!("jeffrey-2013/expected/fig7.json")),
    ("expected/fig8.json", include_str!("jeffrey-2013/expected/fig8.json")),
    ("expected/fig9.json", include_str!("jeffrey-2013/expected/fig9.json")),
    ("expected/law.json", include_str!("jeffrey-2013/expected/law.json")),
    ("expected/lottery.json", include_str!("jeffrey-2013/expected/lottery.json")),
    ("expected/workprecision.json", include_str!("jeffrey-2013/expected/workprecision.json")),
];

/// The text of a file of Jeffrey (2013), by its path in the folder.
///
/// # Panics
///
/// If there is none: paths are written by programmers.
pub fn jeffrey_2013(path: &str) -> &'static str {
    let found = JEFFREY_2013.iter().find(|file| file.0 == path);
    found.unwrap_or_else(|| panic!("{path} is not embedded")).1
}
