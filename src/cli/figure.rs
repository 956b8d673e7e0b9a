//! The command line that every figure's binary shares.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser};
use rayon::prelude::*;

use super::progress::Progress;
use super::recompute::recompute;
use super::speak::{complain, print_json};
use super::words::Method;
use super::{CliError, Exit, LONG_VERSION, in_pool, interrupt};
use crate::integrate::filippov::ExitRule;
use crate::job::spec::{RunSpec, SwitchSpec};
use crate::job::{Executor, Store};
use crate::paper::pipeline::{
    Computed, PictureRecord, PipelineError, compute_with_tables, questions,
};
use crate::paper::reuse::{ReusablePicture, ReusablePictures};
use crate::paper::{Alterations, Figure, FigurePanel, Picture, View, figures};
use crate::record::files::{read, still_there, try_folder};
use crate::record::{FileError, write};
use crate::report::{Making, Makings, Timed, names};

/// Compute a figure and write it as PNG, SVG and PDF, with its numbers as CSV.
#[derive(Clone, Debug, Parser)]
#[command(version, long_version = LONG_VERSION, after_help = Exit::HELP, max_term_width = 120)]
struct Arguments {
    #[command(flatten)]
    flags: FigureFlags,
}

/// Options of making figures.
#[derive(Clone, Debug, clap::Args)]
pub struct FigureFlags {
    /// Folder to write to; a folder named after the figure is made in it.
    #[arg(long, value_name = "DIR", default_value = "target/figures")]
    out: PathBuf,
    /// Reading of the parameters: the name of one of the figure's, or all [default: all].
    #[arg(long, value_name = "READING")]
    reading: Option<String>,
    /// One panel only, such as "ii"; the picture is marked.
    #[arg(long, value_name = "PANEL")]
    only: Option<String>,
    /// Threads; 0 is one per core. The bytes do not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Another seed for random kicks and exits; the picture is marked.
    #[arg(long, value_name = "SEED", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Another final time; the picture is marked as shortened.
    #[arg(
        long,
        value_parser = crate::cli::flags::time,
        value_name = "T",
        allow_negative_numbers = true
    )]
    t_end: Option<f64>,
    /// Another integration method; the picture is marked.
    #[arg(long, value_enum, value_name = "METHOD")]
    method: Option<Method>,
    /// The later half of sections alone, as the paper shows them; the picture is marked.
    #[arg(long)]
    late: bool,
    /// Compute the rows that are committed beside the figure anew, and stop if one comes out
    /// otherwise (census, audit, basin: hours; what is finished is kept in --out, and the same
    /// command goes on with it).
    #[arg(long)]
    recompute: bool,
    #[command(flatten)]
    store: StoreFlags,
    /// Print what was made, with hashes and statistics, as JSON on standard output.
    #[arg(long)]
    json: bool,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
    /// Print the runs' specs as JSON and compute nothing; a single one can be given to `twofold run
    /// --spec`.
    #[arg(long, conflicts_with_all = ["out", "threads", "json", "store", "fresh", "recompute",
        "late"])]
    print_spec: bool,
}

/// Options of the store.
#[derive(Clone, Debug, clap::Args)]
pub struct StoreFlags {
    /// Folder in which answers are kept for the next time.
    #[arg(long, value_name = "DIR", default_value = "target/store")]
    store: PathBuf,
    /// Compute everything anew and keep nothing.
    #[arg(long, conflicts_with = "store")]
    fresh: bool,
}

impl StoreFlags {
    /// The store that these flags ask for.
    pub fn store(&self) -> Option<Store> {
        (!self.fresh).then(|| Store::new(&self.store))
    }
}

/// Every reading.
const ALL: &str = "all";

/// The definition of a figure's flags, with its own name, description and examples.
fn command(figure: &Figure) -> clap::Command {
    // Clap keeps names for as long as the program runs, and a program has one figure.
    let id: &'static str = Box::leak(figure.id.to_string().into_boxed_str());
    let caption = figure.pictures.first().map_or("", |p| p.caption.as_str());
    let about =
        format!("{id}: {}. Written as PNG, SVG and PDF, with its numbers as CSV.", figure.title);
    let mut examples = format!("Examples:\n  {id} --out pictures\n  {id} --json --quiet");
    let reading = figure.pictures.iter().find_map(Picture::reading_name);
    let reading = reading.map_or(String::new(), |name| format!(" --reading {name}"));
    if !reading.is_empty() {
        examples += &format!("\n  {id}{reading}");
    }
    if let Some(panel) = figure.pictures.iter().flat_map(|p| &p.panels).next() {
        let several = figure.pictures.iter().any(|p| p.panels.len() > 1);
        let only = if several { format!(" --only {}", panel.label) } else { String::new() };
        let reading = if figure.pictures.len() > 1 { &reading } else { "" };
        examples += &format!(
            "\n  {id} --t-end 100\n  {id}{only}{reading} --print-spec > spec.json && twofold run \
                --spec spec.json"
        );
    }
    Arguments::command()
        .name(id)
        .bin_name(id)
        .about(about.clone())
        .long_about(format!("{about}\n\n{}", crate::paper::wording::plain(caption)))
        .after_help(format!("{examples}\n\n{}", Exit::HELP))
}

/// Runs a figure binary: parses the command line, computes, writes.
pub fn main(figure: Figure) -> ExitCode {
    interrupt::listen();
    let arguments =
        match command(&figure).try_get_matches().and_then(|m| Arguments::from_arg_matches(&m)) {
            Ok(arguments) => arguments,
            Err(error) => return super::commands::usage(&error).into(),
        };
    match run(vec![figure], &arguments.flags) {
        Ok(()) => Exit::Fine.into(),
        Err(error) => {
            complain(&format!("error: {error}"));
            error.exit().into()
        }
    }
}

/// Computes these figures and writes them, as the flags say.
///
/// # Errors
///
/// See [`CliError`].
pub fn run(figures: Vec<Figure>, arguments: &FigureFlags) -> Result<(), CliError> {
    refuse_idle(&figures, arguments)?;
    let figures =
        figures.into_iter().map(|f| select(f, arguments)).collect::<Result<Vec<_>, _>>()?;
    if arguments.print_spec {
        return print_specs(&figures);
    }
    for figure in &figures {
        try_folder(&arguments.out.join(&*figure.id))?;
    }
    let progress = Progress::new(arguments.quiet);
    if arguments.recompute {
        for figure in &figures {
            recompute(
                figures::data(&figure.id),
                &arguments.out.join(&*figure.id),
                arguments.threads,
                &progress,
            )?;
        }
    }
    let executor = Executor::new(arguments.store.store(), &progress);
    let made =
        in_pool(arguments.threads, || make_what_is_missing(&figures, &arguments.out, &executor))??;
    say_how(&figures, &made, arguments, &progress)?;
    if arguments.json {
        print_json(&made.into_iter().map(|m| m.record).collect::<Vec<_>>())?;
    }
    Ok(())
}

/// Makes these figures, each in a folder of its own under `out`: all their questions first, side by
/// side, the longest first; then the pictures. Answers that the executor's store keeps are not lost
/// if this is killed. Pictures that this program made in `out` before and that are unchanged are
/// reused, if the store records them.
///
/// # Errors
///
/// If a computation or a drawing failed, a file could not be written, or what was written has been
/// removed by the time that all is done; what could be made is there all the same.
pub fn make(
    figures: &[Figure],
    out: &Path,
    executor: &Executor<'_>,
) -> Result<Vec<PictureRecord>, CliError> {
    Ok(make_what_is_missing(figures, out, executor)?.into_iter().map(|made| made.record).collect())
}

/// A picture that is there.
struct Made {
    /// Its record.
    record: PictureRecord,
    /// Whether it was drawn by this call, and did not stand there already.
    anew: bool,
}

fn make_what_is_missing(
    figures: &[Figure],
    out: &Path,
    executor: &Executor<'_>,
) -> Result<Vec<Made>, CliError> {
    let pictures: Vec<(PathBuf, &Picture)> =
        figures.iter().flat_map(|f| f.pictures.iter().map(|p| (out.join(&*f.id), p))).collect();
    let reusable = executor.store().and_then(ReusablePictures::of);
    let found = |(folder, picture): &(PathBuf, &Picture)| {
        reusable.as_ref().and_then(|s| s.find(picture, folder))
    };
    let found_there: Vec<Option<ReusablePicture>> =
        pictures.par_iter().with_max_len(1).map(found).collect();
    let missing = pictures.iter().zip(&found_there).filter(|(_, found)| found.is_none());
    executor.gather(&questions(missing.map(|((_, picture), _)| *picture)));
    // One by one: in larger portions a thread would be left with several while others have none.
    let results: Vec<Result<(Made, Vec<Written>), CliError>> = pictures
        .par_iter()
        .zip(found_there)
        .with_max_len(1)
        .map(|((folder, picture), found)| {
            let png = folder.join(format!("{}.png", picture.name));
            if let Some(ReusablePicture { record, files }) = found {
                executor.progress().line(&format!("unchanged: {}", png.display()));
                return Ok((Made { record, anew: false }, files));
            }
            let mut written = Vec::new();
            let mut keep = |file: &str, bytes: &[u8]| {
                written.push(put(folder, file, bytes)?);
                Ok(())
            };
            let computed =
                compute_with_tables(picture, executor, &mut keep).map_err(|error| match error {
                    PipelineError::Table(file) => CliError::from(file),
                    other => other.into(),
                })?;
            write_picture(folder, &computed, &mut written)?;
            executor.forget();
            executor.progress().line(&format!("wrote {}", png.display()));
            if let Some(Err(error)) =
                reusable.as_ref().map(|s| s.remember(picture, &computed.record))
            {
                // The picture is there; only the next run will have to draw it again.
                executor.progress().line(&format!("not kept for the next run: {error}"));
            }
            Ok((Made { record: computed.record, anew: true }, written))
        })
        .collect();
    let (made, written): (Vec<_>, Vec<_>) =
        results.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    still_there(&written.concat())?;
    Ok(made)
}

/// Writes down by which build, with how many threads and in what time the figures were made: for
/// the report. No picture depends on it. Of figures that stood there already, what was written down
/// when they were made still holds.
fn say_how(
    figures: &[Figure],
    made: &[Made],
    arguments: &FigureFlags,
    progress: &Progress,
) -> Result<(), CliError> {
    let anew = |name: &str| made.iter().any(|m| m.anew && m.record.hashes.name == name);
    let figures: Vec<String> = figures
        .iter()
        .filter(|f| f.pictures.iter().any(|p| anew(&p.name)))
        .map(|f| f.id.to_string())
        .collect();
    if figures.is_empty() {
        return Ok(());
    }
    let path = arguments.out.join(names::MAKING);
    // A file that cannot be read is not worth keeping.
    let before: Makings =
        read(&path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
    let threads = in_pool(arguments.threads, rayon::current_num_threads)?;
    let rounded = |seconds: f64| (1e3 * seconds).round() / 1e3;
    let computed = progress
        .computed()
        .into_iter()
        .map(|(what, s)| Timed { what, seconds: rounded(s) })
        .collect();
    let making = Making {
        figures,
        program: concat!("twofold ", env!("CARGO_PKG_VERSION")).into(),
        commit: env!("TWOFOLD_COMMIT").into(),
        compiler: env!("TWOFOLD_RUSTC").into(),
        target: env!("TWOFOLD_TARGET").into(),
        profile: env!("TWOFOLD_PROFILE").into(),
        threads,
        store: arguments.store.store().is_some(),
        seconds: rounded(progress.seconds()),
        computed,
    };
    let mut json = serde_json::to_vec_pretty(&before.with(making)).expect("times are plain data");
    json.push(b'\n');
    Ok(write(&path, &json)?)
}

/// A file and its length.
type Written = (PathBuf, u64);

/// Writes a file.
fn put(folder: &Path, file: &str, bytes: &[u8]) -> Result<Written, FileError> {
    let path = folder.join(file);
    write(&path, bytes)?;
    Ok((path, bytes.len() as u64))
}

/// Writes a picture's files, its tables being there: the record last, so that a record vouches for
/// everything beside it.
fn write_picture(
    folder: &Path,
    computed: &Computed,
    written: &mut Vec<Written>,
) -> Result<(), FileError> {
    let name = &computed.record.hashes.name;
    let json = computed.record.to_json();
    let files = [
        (format!("{name}.png"), &computed.rendered.png),
        (format!("{name}.svg"), &computed.rendered.svg),
        (format!("{name}.pdf"), &computed.rendered.pdf),
        (format!("{name}.json"), &json),
    ];
    for (file, bytes) in files {
        written.push(put(folder, &file, bytes)?);
    }
    Ok(())
}

/// Refuses a flag that changes none of these figures.
fn refuse_idle(figures: &[Figure], arguments: &FigureFlags) -> Result<(), CliError> {
    let names: Vec<&str> = figures.iter().map(|f| &*f.id).collect();
    let names = names.join(", ");
    let pictures = || figures.iter().flat_map(|f| &f.pictures);
    let of_runs = [
        ("--only", arguments.only.is_some()),
        ("--method", arguments.method.is_some()),
        ("--t-end", arguments.t_end.is_some()),
        ("--print-spec", arguments.print_spec),
    ];
    if let Some((flag, _)) = of_runs.into_iter().find(|(_, given)| *given)
        && pictures().all(|p| p.panels.is_empty())
    {
        return Err(CliError::no_effect(
            flag,
            format!("{names}: not made of single runs; leave it out"),
        ));
    }
    if let Some(only) = &arguments.only
        && pictures()
            .all(|p| p.panels.len() < 2 && p.panels.iter().all(|panel| panel.label == label(only)))
    {
        return Err(CliError::no_effect(
            "--only",
            format!("{names}: there is no other panel; leave it out"),
        ));
    }
    if arguments.recompute && figures.iter().all(|f| figures::data(&f.id).is_empty()) {
        let why = format!(
            "{names}: no rows are committed beside it, everything is computed anyway (--fresh \
                takes nothing from the store)"
        );
        return Err(CliError::no_effect("--recompute", why));
    }
    if arguments.late && !pictures().any(|p| matches!(p.view, View::Section { .. })) {
        return Err(CliError::no_effect(
            "--late",
            format!("{names}: there is no section to halve; leave it out"),
        ));
    }
    if arguments.reading.is_some() && pictures().all(|p| p.reading.is_none()) {
        return Err(CliError::no_effect(
            "--reading",
            format!("{names}: the same in every reading; leave it out"),
        ));
    }
    if let Some(name) = &arguments.reading {
        let mut known: Vec<&str> = Vec::new();
        for reading in pictures().filter_map(Picture::reading_name).chain([ALL]) {
            if !known.contains(&reading) {
                known.push(reading);
            }
        }
        if !known.contains(&name.as_str()) {
            return Err(CliError::Usage(format!(
                "--reading {name}: {names} has no such reading; known are {}",
                known.join(", ")
            )));
        }
    }
    let wanted = |panel: &&FigurePanel| {
        arguments.only.as_deref().is_none_or(|only| panel.label == label(only))
    };
    if arguments.seed.is_some()
        && !pictures().flat_map(|p| &p.panels).filter(wanted).any(|panel| is_random(&panel.run))
    {
        return Err(CliError::no_effect(
            "--seed",
            format!("{names}: nothing in what is to be made is random; leave it out"),
        ));
    }
    Ok(())
}

/// "(ii)" and "ii" are the same panel.
fn label(only: &str) -> &str {
    only.trim_start_matches('(').trim_end_matches(')')
}

/// The pictures and panels that were asked for, altered as asked for, and checked.
fn select(mut figure: Figure, arguments: &FigureFlags) -> Result<Figure, CliError> {
    if let Some(only) = &arguments.only {
        let label = label(only);
        let mut known: Vec<String> =
            figure.pictures.iter().flat_map(|p| &p.panels).map(|p| p.label.clone()).collect();
        if !known.iter().any(|k| k == label) {
            known.sort_by_key(|k| (k.len(), k.clone()));
            known.dedup();
            let known = if known.is_empty() {
                "none: it is not made of panels".into()
            } else {
                known.join(", ")
            };
            return Err(CliError::NoSuchPanel {
                panel: only.clone(),
                figure: figure.id.to_string(),
                known,
            });
        }
        figure.pictures.retain(|p| p.panels.iter().any(|q| q.label == label));
        figure.pictures.iter_mut().for_each(|p| p.keep_only(label));
    }
    let wanted = arguments.reading.as_deref().filter(|name| *name != ALL);
    figure
        .pictures
        .retain(|p| wanted.is_none_or(|name| p.reading_name().is_none_or(|r| r == name)));
    let alterations = Alterations {
        seed: arguments.seed,
        t_end: arguments.t_end,
        method: arguments.method.map(Into::into),
        late: arguments.late,
    };
    for picture in &mut figure.pictures {
        picture.alter(&alterations);
        for panel in &picture.panels {
            panel.run.validate()?;
        }
    }
    Ok(figure)
}

fn is_random(run: &RunSpec) -> bool {
    run.schedule.kick.is_some()
        || matches!(run.switch, SwitchSpec::Filippov { exit: ExitRule::Random { .. }, .. })
}

/// One spec alone, or several under their names.
fn print_specs(figures: &[Figure]) -> Result<(), CliError> {
    let specs: Vec<_> = figures
        .iter()
        .flat_map(|figure| &figure.pictures)
        .flat_map(|picture| {
            picture
                .panels
                .iter()
                .map(move |panel| (format!("{}-{}", picture.name, panel.label), &panel.run))
        })
        .collect();
    match specs.as_slice() {
        [(_, only)] => print_json(only),
        several => print_json(
            &several
                .iter()
                .map(|(name, run)| {
                    (name.clone(), serde_json::to_value(run).expect("specs are plain data"))
                })
                .collect::<serde_json::Map<_, _>>(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::figures;

    #[test]
    fn each_figure_helps_in_its_own_words() {
        for figure in figures::all() {
            let mut command = command(&figure);
            command.clone().debug_assert();
            let (short, long) =
                (command.render_help().to_string(), command.render_long_help().to_string());
            let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
            for text in [&short, &long] {
                assert!(
                    words(text).contains(&format!("{}: {}", figure.id, figure.title)),
                    "{text}"
                );
                assert!(
                    text.contains(&format!("{} --out pictures", figure.id))
                        && words(text).contains(Exit::HELP),
                    "{text}"
                );
            }
        }
    }
}
