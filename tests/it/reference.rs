//! The reference pages of the book, generated from the program: `TWOFOLD_UPDATE=1 cargo test --test
//! it reference::` rewrites them, and without that variable the test compares.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use clap::Arg;
use twofold::cli::commands::definition;
use twofold::jeffrey_2013::study::claims::{Quantity, claims};

const BEGIN: &str =
    "<!-- made by `TWOFOLD_UPDATE=1 cargo test --test it reference::`; do not edit -->";
const END: &str = "<!-- end of what is made -->";

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

pub fn source(file: &str) -> String {
    fs::read_to_string(root().join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
}

/// Compares the generated blocks of a page with `blocks`, in order; or writes them.
pub fn hold(page: &str, blocks: &[String]) {
    let committed = source(page);
    let mut made = String::new();
    let mut rest = committed.as_str();
    for block in blocks {
        let (before, after) =
            rest.split_once(BEGIN).unwrap_or_else(|| panic!("{page}: too few places: {BEGIN}"));
        let (_, behind) =
            after.split_once(END).unwrap_or_else(|| panic!("{page}: a place does not end: {END}"));
        let _ = write!(made, "{before}{BEGIN}\n\n{}\n\n{END}", block.trim());
        rest = behind;
    }
    made.push_str(rest);
    if std::env::var_os("TWOFOLD_UPDATE").is_some() {
        fs::write(root().join(page), made).unwrap();
    } else {
        assert!(
            made == committed,
            "{page} is not what the program says: make reference, and look at the difference"
        );
    }
}

/// Text in a cell of a table.
fn cell(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

/// "`--eps EPS`".
fn flag(arg: &Arg) -> String {
    let value = arg.get_action().takes_values().then(|| {
        let names = arg
            .get_value_names()
            .map(|n| n.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "));
        names.unwrap_or_else(|| arg.get_id().as_str().to_uppercase())
    });
    let value = value.filter(|v| !v.is_empty());
    match (arg.get_long(), value) {
        (Some(long), Some(value)) => cell(&format!("`--{long} {value}`")),
        (Some(long), None) => format!("`--{long}`"),
        (None, value) => cell(&format!("`{}`", value.unwrap_or_default())),
    }
}

/// Help text of a flag, with its choices and its default.
pub fn meaning(arg: &Arg) -> String {
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let mut text = help.trim_end_matches('.').to_owned();
    let choices: Vec<String> =
        arg.get_possible_values().iter().map(|v| format!("`{}`", v.get_name())).collect();
    if !choices.is_empty() && arg.get_action().takes_values() {
        let _ = write!(text, ": {}", choices.join(", "));
    }
    let defaults: Vec<String> =
        arg.get_default_values().iter().map(|v| v.to_string_lossy().into_owned()).collect();
    if !defaults.is_empty() && arg.get_action().takes_values() {
        let _ = write!(text, " [default: {}]", defaults.join(" "));
    }
    cell(&text)
}

fn flags_table<'a>(arguments: impl Iterator<Item = &'a Arg>) -> String {
    let mut text = String::from("| flag | meaning |\n|---|---|\n");
    for arg in arguments {
        let _ = writeln!(text, "| {} | {} |", flag(arg), meaning(arg));
    }
    text
}

fn shown(arg: &&Arg) -> bool {
    !arg.is_hide_set() && !["help", "version"].contains(&arg.get_id().as_str())
}

/// The flags that every command with a run takes.
pub fn run_flags() -> Vec<Arg> {
    use clap::Args as _;
    let command = twofold::cli::flags::RunFlags::augment_args(clap::Command::new("x"));
    command.get_arguments().cloned().collect()
}

#[test]
fn flags_of_a_run_are_as_the_page_says() {
    let flags = run_flags();
    let mut headings: Vec<&str> = Vec::new();
    for heading in flags.iter().map(|a| a.get_help_heading().unwrap_or("A run from a file")) {
        if !headings.contains(&heading) {
            headings.push(heading);
        }
    }
    let mut text = String::new();
    for heading in headings {
        let of =
            flags.iter().filter(|a| a.get_help_heading().unwrap_or("A run from a file") == heading);
        let _ = write!(text, "## {heading}\n\n{}\n", flags_table(of));
    }
    hold("docs/run-flags.md", &[text]);
}

/// Commands that know figures and files, not runs of a system.
fn of_figures(name: &str) -> bool {
    ![
        "run",
        "plot",
        "orbit",
        "lyapunov",
        "rests",
        "scan",
        "sensitivities",
        "sweep",
        "sweep merge",
        "new",
    ]
    .contains(&name)
}

/// A section for each of these commands.
fn sections(wanted: impl Fn(&str) -> bool) -> String {
    let mut program = definition();
    program.build();
    let of_runs: Vec<String> = run_flags().iter().map(|a| a.get_id().to_string()).collect();
    let mut text = String::new();
    let mut all: Vec<(String, clap::Command)> = Vec::new();
    for command in program.get_subcommands().filter(|c| c.get_name() != "help") {
        all.push((command.get_name().to_owned(), command.clone()));
        for inner in command.get_subcommands().filter(|c| c.get_name() != "help") {
            all.push((format!("{} {}", command.get_name(), inner.get_name()), inner.clone()));
        }
    }
    for (name, command) in all.into_iter().filter(|(name, _)| wanted(name)) {
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        let run = command.get_arguments().any(|a| a.get_id() == "switch");
        let own = |a: &&Arg| shown(a) && !(run && of_runs.contains(&a.get_id().to_string()));
        let own: Vec<&Arg> = command.get_arguments().filter(own).collect();
        let _ = write!(text, "## twofold {name}\n\n{}.", cell(about.trim_end_matches('.')));
        if run {
            text.push_str(" Takes the [flags of a run](run-flags.md), too.");
        }
        text.push_str("\n\n");
        if !own.is_empty() {
            let _ = writeln!(text, "{}", flags_table(own.into_iter()));
        }
    }
    text
}

#[test]
fn commands_are_as_the_pages_say() {
    hold("docs/commands.md", &[sections(|name| !of_figures(name))]);
    hold("docs/commands-figures.md", &[sections(of_figures)]);
}

/// A field of a struct in a source file: its name in files, whether it must be given, and its
/// documentation.
pub struct Key {
    pub name: String,
    pub needed: bool,
    pub about: String,
    /// Its type in the source.
    pub of: String,
}

pub fn keys(text: &str, of: &str) -> Vec<Key> {
    let (_, body) =
        text.split_once(&format!("struct {of} {{")).unwrap_or_else(|| panic!("no struct {of}"));
    let (body, _) = body.split_once("\n}").unwrap();
    let (mut about, mut needed, mut renamed) = (String::new(), true, None);
    let mut keys = Vec::new();
    for line in body.lines().map(str::trim) {
        if let Some(doc) = line.strip_prefix("/// ") {
            about.push_str(doc);
            about.push(' ');
        } else if let Some(attribute) = line.strip_prefix("#[serde(") {
            needed &= !attribute.contains("default");
            renamed = attribute
                .split_once("rename = \"")
                .and_then(|(_, r)| r.split('"').next())
                .map(str::to_owned);
        } else if let Some((name, rest)) = line.split_once(':') {
            let of_type = rest.trim().trim_end_matches(',').to_owned();
            needed &= !of_type.starts_with("Option<");
            assert!(!about.is_empty(), "{of}: {name} has no documentation");
            let name = renamed.take().unwrap_or_else(|| {
                name.trim_start_matches("pub ").trim_start_matches("r#").to_owned()
            });
            keys.push(Key { name, needed, about: cell(&about), of: of_type });
            (about, needed) = (String::new(), true);
        }
    }
    keys
}

#[test]
fn keys_of_the_system_file_are_as_the_page_says() {
    let text = source("crates/system/src/document.rs");
    let tables = [
        ("The file", "Document"),
        ("A state as a table", "StateTable"),
        ("A parameter as a table", "ParameterTable"),
        ("The table `second`", "SecondEntry"),
    ];
    let block = keys_tables(&text, &tables);
    let general = source("crates/hybrid/src/definition.rs");
    let of_general = [
        ("The file of a general system", "Document"),
        ("A mode, `[modes.NAME]`", "ModeEntry"),
        ("An event, `[[event]]`", "EventEntry"),
        ("A table of data, `[tables.NAME]`", "TableEntry"),
    ];
    let general_block = keys_tables(&general, &of_general);
    hold("docs/system-file.md", &[block, general_block, functions()]);
    // The reader knows these keys and no others.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.toml");
    fs::write(&file, "nonsense = 1\n").unwrap();
    let run = twofold(folder.path(), &["run", "--system", "a.toml"]);
    let said = String::from_utf8(run.stderr).unwrap();
    for key in keys(&text, "Document") {
        assert!(said.contains(&format!("`{}`", key.name)), "{}: {said}", key.name);
    }
    for (_, of) in of_general {
        let text = match of {
            "Document" => "f = ['1']\nnonsense = 1\n",
            "ModeEntry" => "[modes.a]\nnonsense = 1\n",
            "EventEntry" => "[[event]]\nnonsense = 1\n",
            _ => "[tables.a]\nnonsense = 1\n",
        };
        fs::write(&file, format!("states = ['x']\n{text}")).unwrap();
        let run = twofold(folder.path(), &["run", "--system", "a.toml"]);
        let said = String::from_utf8(run.stderr).unwrap();
        for key in keys(&general, of) {
            assert!(said.contains(&format!("`{}`", key.name)), "{}: {said}", key.name);
        }
    }
}

/// A table of keys for each of these structs.
pub fn keys_tables(text: &str, structs: &[(&str, &str)]) -> String {
    let mut block = String::new();
    for (title, of) in structs {
        let _ = write!(block, "### {title}\n\n| key | needed | meaning |\n|---|---|---|\n");
        for Key { name, needed, about, .. } in keys(text, of) {
            let _ = writeln!(block, "| `{name}` | {} | {about} |", if needed { "yes" } else { "" });
        }
        block.push('\n');
    }
    block
}

/// A table of the functions that expressions know.
fn functions() -> String {
    use twofold::system::expression::{Function, General};
    let text = source("crates/system/src/expression.rs");
    let about = |of: &str, variant: String| {
        let (_, body) = text.split_once(&format!("pub enum {of} {{")).unwrap();
        let at =
            body.find(&format!("    {variant},\n")).unwrap_or_else(|| panic!("no {of}::{variant}"));
        let doc: Vec<&str> = body[..at]
            .lines()
            .rev()
            .map_while(|l| l.trim().strip_prefix("/// "))
            .collect::<Vec<_>>();
        cell(
            &doc.into_iter()
                .rev()
                .collect::<Vec<_>>()
                .join(" ")
                .replace("[`Function::Ln`]", "`ln`"),
        )
    };
    let mut block = String::from("| function | of | meaning |\n|---|---|---|\n");
    for (name, function) in Function::ALL {
        let _ = writeln!(
            block,
            "| `{name}` | any system | {} |",
            about("Function", format!("{function:?}"))
        );
    }
    for (name, function, _) in General::ALL {
        let _ = writeln!(
            block,
            "| `{name}` | general systems | {} |",
            about("General", format!("{function:?}"))
        );
    }
    block
}

/// The paper's sentences with their outcomes; tests/it/claims.rs measures these.
#[test]
fn sentences_are_as_the_page_says() {
    let mut block = String::from("| | the paper's words | outcome |\n|---|---|---|\n");
    for sentence in &claims().sentence {
        let word = |reads: &[&Quantity]| match reads.iter().filter(|r| r.holds).count() {
            0 => "false",
            n if n == reads.len() => "true",
            _ => "true in part",
        };
        let reads: Vec<&Quantity> = sentence.reads.iter().collect();
        let [printed, reconstructed] = ["printed", "reconstructed"].map(|reading| {
            let end = format!(", {reading}");
            let own: Vec<&Quantity> =
                reads.iter().copied().filter(|r| r.quantity.ends_with(&end)).collect();
            (!own.is_empty()).then(|| word(&own))
        });
        let outcome = match (&sentence.untested, printed, reconstructed) {
            (Some(why), ..) => format!("not measured: {why}"),
            (None, Some(a), Some(b)) if a != b => format!("{a} as printed, {b} as reconstructed"),
            (None, None, Some(b)) => format!("{b} as reconstructed"),
            _ => sentence.otherwise.as_deref().unwrap_or_else(|| word(&reads)).to_owned(),
        };
        let _ = writeln!(block, "| {} | {} | {} |", sentence.id, cell(&sentence.quote), outcome);
    }
    hold("docs/sentences.md", &[block]);
}

#[test]
fn exit_codes_are_as_the_page_says() {
    let text = source("src/cli/exit.rs");
    let (_, body) = text.split_once("pub enum Exit {").unwrap();
    let (body, _) = body.split_once("\n}").unwrap();
    let mut block = String::from("| code | meaning |\n|---|---|\n");
    let mut about = String::new();
    for line in body.lines().map(str::trim) {
        match (line.strip_prefix("/// "), line.split_once(" = ")) {
            (Some(doc), _) => about = format!("{about} {doc}"),
            (None, Some((_, code))) => {
                let _ = writeln!(
                    block,
                    "| {} | {} |",
                    code.trim_end_matches(','),
                    cell(about.trim_end_matches('.'))
                );
                about.clear();
            }
            _ => {}
        }
    }
    hold("docs/exit-codes.md", &[block]);
}

fn twofold(folder: &Path, arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_twofold"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Content of each column. A column without a line here fails the test.
const COLUMNS: [(&str, &str); 45] = [
    ("t", "time"),
    ("x", "the first state; likewise each other state under its name"),
    ("y", ""),
    ("v", ""),
    ("z", ""),
    ("direction", "`up` or `down`: the way in which the section is crossed"),
    (
        "mode",
        "`plus` or `minus` in that field, `sliding-attracting` or `sliding-repelling` on the \
            surface; of a general system the mode's name",
    ),
    (
        "signs",
        "a character for each switching function: `+`, `-`, `0` where motion slides on its zero or \
            it rests there, `#` for `floor` and `mod`, `.` where it decides nothing; the fact \
            `signs` names the functions",
    ),
    ("piece", "number of the piece of the motion between two events"),
    (
        "event",
        "what happens, such as `crossing`, `landing`, `two-fold-reached`, `exit`; of a general \
            system the event's name, before and after its reset",
    ),
    ("from", "the mode before the event"),
    ("to", "the mode behind it"),
    ("side", "the side from which the motion comes (landing, grazing) or to which it goes"),
    (
        "leg",
        "duration of the last stretch into a two-fold or an accumulation, which a formula gives",
    ),
    ("error", "estimated error of the arrival at a two-fold"),
    ("time", "at an exit: for how long the motion slid where the surface repels"),
    ("arc", "at an exit: the length of that path"),
    ("rule", "at an exit: the rule that chose it, as JSON"),
    ("future", "number of a future of the funnel; 0 is the approach"),
    ("exit_time", "time of repelling sliding after which this future leaves"),
    ("exit_side", "the side to which it leaves"),
    ("key", "the leading 60 bits of the digest of the row's question"),
    ("outcome", "what the run ends on ([the words](sweeps.md#a-row))"),
    (
        "period",
        "of a sweep: returns to the section in one period, 0 if there is none; of a closed orbit: \
            its period, as time",
    ),
    (
        "captured_at",
        "from this time on the run only turns around one periodic orbit; of quasi-periodic runs, \
            as far back as the ring was followed",
    ),
    ("settled_at", "from this time on it is within tolerance of the orbit"),
    ("radius", "mean distance of the last returns, once settled, from the orbit"),
    ("rate", "rate of approach, per unit time"),
    ("turn", "time of one turn around the orbit"),
    ("exponent", "largest Lyapunov exponent, per unit time"),
    ("exponent_error", "its standard error"),
    ("crossings", "crossings of the section"),
    ("end", "time at which the run ended"),
    ("steps", "steps that the method took"),
    ("reason", "why the run failed; blank if it did not"),
    ("row", "number of the row in the sweep, from 0"),
    ("eps", "the value that is varied: one column for each axis, under its name (`params.mu`)"),
    ("mu", "the parameter that is followed, under its name"),
    ("stability", "`stable`, `unstable` or `not isolated`"),
    ("multiplier1_re", "real part of the first Floquet multiplier; likewise for each other one"),
    ("multiplier1_im", "its imaginary part"),
    ("ending", "what the run ends on ([the words](sweeps.md#a-row))"),
    ("number", "runs that end on the same attractor have the same number"),
    ("start.x", "the value that is varied: one column for each axis, under its name"),
    ("start.y", ""),
];

#[test]
fn columns_are_as_the_page_says() {
    let folder = tempfile::tempdir().unwrap();
    let general = "states = ['x']\nstart = [0]\n[modes.a]\nf = ['1 + sign(x - 2)']\n[modes.b]\nf = \
        ['1']\n[[event]]\nwhen = 'x'\n";
    fs::write(folder.path().join("general.toml"), general).unwrap();
    let filippov = ["--switch", "filippov", "--exit", "after-time:0.3:plus"];
    let cases: Vec<(&str, Vec<&str>)> = vec![
        ("`twofold run`", vec!["run", "--t-end", "1"]),
        ("`twofold run --section`", vec!["run", "--t-end", "3", "--section", "y=0"]),
        (
            "`twofold run --switch hysteretic`",
            vec!["run", "--t-end", "0.1", "--switch", "hysteretic"],
        ),
        ("`twofold run --switch filippov`", [&["run", "--t-end", "3"][..], &filippov].concat()),
        (
            "`twofold run`, a general system",
            vec!["run", "--t-end", "1", "--system", "general.toml"],
        ),
        (
            "`twofold run --section`, a general system",
            vec!["run", "--t-end", "1", "--system", "general.toml", "--section", "x=0.5"],
        ),
        (
            "`twofold orbit`",
            vec![
                "orbit",
                "--system",
                "stick-slip",
                "--switch",
                "filippov",
                "--section",
                "v=0",
                "--format",
                "csv",
            ],
        ),
        (
            "`twofold orbit --along`",
            vec![
                "orbit",
                "--system",
                "fused-focus",
                "--switch",
                "filippov",
                "--section",
                "x=0",
                "--settle",
                "300",
                "--along",
                "mu=-0.01..-0.02:2",
                "--format",
                "csv",
            ],
        ),
        ("`twofold sweep`", vec!["sweep", "--t-end", "1", "--over", "eps=1e-2,2e-2"]),
        (
            "`twofold scan`, one setting",
            vec!["scan", "--t-end", "1", "--section", "y=0", "--over", "eps=1e-2,2e-2"],
        ),
        (
            "`twofold scan`, two settings",
            vec![
                "scan",
                "--t-end",
                "1",
                "--section",
                "y=0",
                "--over",
                "start.x=1,2",
                "--over",
                "start.y=1,2",
            ],
        ),
    ];
    let mut block = String::new();
    let (mut missing, mut used) = (Vec::new(), Vec::new());
    for (title, mut arguments) in cases {
        arguments.extend(["--quiet", "--out", "-"]);
        let run = arguments[0] == "run";
        if run {
            arguments.extend(["--format", "json"]);
        }
        let output = twofold(folder.path(), &arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{title}: {said}");
        let mut tables: Vec<(String, Vec<String>)> = Vec::new();
        if run {
            let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
            for table in answer["tables"].as_array().unwrap() {
                let names = table["columns"].as_array().unwrap().iter();
                let names = names.map(|c| c["name"].as_str().unwrap().to_owned()).collect();
                tables.push((table["name"].as_str().unwrap().to_owned(), names));
            }
        } else {
            let text = String::from_utf8(output.stdout).unwrap();
            let head = text.lines().next().unwrap();
            tables.push((String::new(), head.split(',').map(str::to_owned).collect()));
        }
        for (name, columns) in tables {
            let of = if name.is_empty() { String::new() } else { format!(", table `{name}`") };
            let _ = write!(block, "## {title}{of}\n\n| column | meaning |\n|---|---|\n");
            for column in columns {
                match COLUMNS.iter().find(|(c, _)| *c == column) {
                    None => missing.push(format!("{title}{of}: {column}")),
                    Some((_, "")) => used.push(column),
                    Some((_, meaning)) => {
                        let _ = writeln!(block, "| `{column}` | {meaning} |");
                        used.push(column);
                    }
                }
            }
            block.push('\n');
        }
    }
    assert!(missing.is_empty(), "columns without a meaning in COLUMNS: {missing:#?}");
    let unused: Vec<&str> =
        COLUMNS.iter().map(|c| c.0).filter(|c| !used.iter().any(|u| u == c)).collect();
    assert!(unused.is_empty(), "no table has {unused:?}");
    hold("docs/columns.md", &[block]);
}

/// A string literal of a source file.
struct Literal {
    text: String,
    /// The attribute that it stands in, such as "error".
    attribute: Option<String>,
}

/// The string literals of a source file before its tests, without those of comments.
fn literals(source: &str) -> Vec<Literal> {
    let source = source.split("#[cfg(test)]").next().unwrap();
    let c: Vec<char> = source.chars().collect();
    let (mut i, mut depth) = (0, 0);
    let mut attribute: Option<String> = None;
    let mut found = Vec::new();
    let begins =
        |i: usize, with: &str| with.chars().enumerate().all(|(k, w)| c.get(i + k) == Some(&w));
    while i < c.len() {
        if begins(i, "//") {
            while i < c.len() && c[i] != '\n' {
                i += 1;
            }
        } else if begins(i, "#[") || begins(i, "#![") {
            let start = i + if c[i + 1] == '!' { 3 } else { 2 };
            attribute =
                Some(c[start..].iter().take_while(|c| c.is_alphanumeric() || **c == '_').collect());
            (i, depth) = (start, 1);
        } else if begins(i, "r#\"") {
            let start = i + 3;
            i = (start..c.len()).find(|k| begins(*k, "\"#")).unwrap();
            found
                .push(Literal { text: c[start..i].iter().collect(), attribute: attribute.clone() });
            i += 2;
        } else if c[i] == '\'' {
            // A character, or the name of a lifetime.
            i += match (c.get(i + 1), c.get(i + 2)) {
                (Some('\\'), _) => 2 + (i + 3..c.len()).find(|k| c[*k] == '\'').unwrap() - i - 1,
                (_, Some('\'')) => 3,
                _ => 1,
            };
        } else if c[i] == '"' {
            let mut text = String::new();
            i += 1;
            while c[i] != '"' {
                match (c[i], c[i + 1]) {
                    ('\\', '\n') => {
                        i += 2;
                        while c[i].is_whitespace() {
                            i += 1;
                        }
                        continue;
                    }
                    ('\\', 'n') => text.push(' '),
                    ('\\', other) => text.push(other),
                    (plain, _) => {
                        text.push(plain);
                        i += 1;
                        continue;
                    }
                }
                i += 2;
            }
            i += 1;
            found.push(Literal { text, attribute: attribute.clone() });
        } else {
            if attribute.is_some() {
                depth += i32::from(c[i] == '[') - i32::from(c[i] == ']');
                if depth == 0 {
                    attribute = None;
                }
            }
            i += 1;
        }
    }
    found
}

#[test]
fn literals_are_found() {
    let source = "#[error(\"no \\\"{0}\\\" \\\n    here\")]\n// \"not\"\nfn f<'a>() { g('\"', \
        '\\'', r#\"raw \"x\"\"#, \"b\"); }\n#[cfg(test)] \"no\"";
    let found: Vec<(String, Option<String>)> =
        literals(source).into_iter().map(|l| (l.text, l.attribute)).collect();
    let expected = [("no \"{0}\" here", Some("error")), ("raw \"x\"", None), ("b", None)];
    assert_eq!(
        found,
        expected.map(|(text, attribute)| (text.to_owned(), attribute.map(str::to_owned)))
    );
}

/// Rust files in a folder, with its folders, in order.
fn sources(folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    for path in fs::read_dir(root().join(folder)).unwrap().map(|e| e.unwrap().path()) {
        let name = path.strip_prefix(root()).unwrap().display().to_string();
        if path.is_dir() {
            found.extend(sources(&name));
        } else if name.ends_with(".rs") && !name.ends_with("tests.rs") {
            found.push(name);
        }
    }
    found.sort();
    found
}

/// A message with "..." in the place of what is filled in.
fn filled(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('{') {
        out.push_str(&rest[..at]);
        rest = &rest[at + 1..];
        if let Some(literal) = rest.strip_prefix('{') {
            out.push('{');
            rest = literal;
        } else {
            out.push_str("...");
            rest = rest.split_once('}').map_or("", |(_, after)| after);
        }
    }
    out.push_str(rest);
    cell(&out.replace("}}", "}").replace('`', "'"))
}

/// Whether something is said besides what is filled in.
fn says_something(text: &str) -> bool {
    text.split_whitespace().filter(|w| w.chars().filter(|c| c.is_alphabetic()).count() > 1).count()
        >= 3
}

#[test]
fn errors_are_as_the_page_says() {
    let of_runs = [
        ("The command line", "src/cli"),
        ("Systems and their files", "crates/system/src"),
        ("General systems", "crates/hybrid/src"),
        ("Integration", "crates/integrate/src"),
    ];
    let of_questions = [
        ("Orbits, sections and exponents", "crates/analyse/src"),
        ("Questions, sweeps and files", "crates/job/src"),
        ("Figures and pictures", "crates/paper/src"),
        ("Drawing", "crates/render/src"),
        ("Certificates", "crates/verify/src"),
    ];
    hold("docs/errors.md", &[errors_of(&of_runs)]);
    hold("docs/errors-of-questions.md", &[errors_of(&of_questions)]);
}

/// The messages of errors in these folders, each under its title.
fn errors_of(places: &[(&str, &str)]) -> String {
    let mut block = String::new();
    for (title, folder) in places {
        let _ = write!(block, "## {title}\n\n");
        for file in sources(folder) {
            for literal in literals(&source(&file)) {
                let text = filled(&literal.text);
                if literal.attribute.as_deref() == Some("error") && says_something(&text) {
                    let _ = writeln!(block, "- `{text}`");
                }
            }
        }
        block.push('\n');
    }
    block
}

#[test]
fn messages_are_as_the_note_says() {
    let mut block = String::new();
    for file in ["src/cli", "papers/jeffrey-2013/code/report"].iter().flat_map(|f| sources(f)) {
        let said: Vec<String> = literals(&source(&file))
            .into_iter()
            .filter(|l| l.attribute.is_none())
            .map(|l| filled(&l.text))
            .filter(|text| says_something(text) && !text.starts_with('<'))
            .collect();
        if !said.is_empty() {
            let _ = write!(block, "## {file}\n\n");
            for text in said {
                let _ = writeln!(block, "- `{text}`");
            }
            block.push('\n');
        }
    }
    hold("notes/messages.md", &[block]);
}
