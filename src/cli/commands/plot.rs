//! `twofold plot`: a picture of any run.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;

use super::run::said_how_it_ended;
use crate::cli::flags::{RunFlags, Use};
use crate::cli::general;
use crate::cli::progress::Progress;
use crate::cli::speak::{deliver, is_standard_output, try_delivery};
use crate::cli::{CliError, Exit};
use crate::draw::plot::{self, Look};
use crate::hybrid::motion::Record;
use crate::job::general::GeneralRun;
use crate::job::question::question_hash;
use crate::job::spec::RunSpec;
use crate::job::{Answer, Executor, JobError, Stop, encode};
use crate::paper::plots::Recorded;
use crate::paper::wording;
use crate::record;
use crate::render::number::number;
use crate::render::{RenderError, markup, render};

/// Draw a run: its states against time, a phase plane, its path in space, or with --section its
/// crossings of a plane. The file's name says the format: .png (600 dpi), .svg or .pdf.
///
/// Axes and labels come from the system; the switching surface h = 0 is drawn where it depends on
/// nothing but the states shown, coloured by what happens there where they are all the states. The
/// same command makes the same bytes on any machine.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold plot --system stick-slip --switch filippov --t-end 30 --out stick-slip.png\n  \
    twofold plot --system my.toml --set gain=2 --kind series --axes x,v --out my.svg\n  \
    twofold plot --reading reconstructed --t-end 2000 --section y=0 --out section.pdf\n  \
    twofold run --system wheel --t-end 60 --out wheel.csv && twofold plot --from wheel.csv \
    --camera -115,18 --out wheel.png")]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// Draw what `twofold run` has written to this file (CSV or JSON) and compute nothing; flags of
    /// the run are then refused.
    #[arg(long, value_name = "FILE", help_heading = "Picture")]
    from: Option<PathBuf>,
    /// Kind of picture [default: section with --section, else by the number of axes that the system
    /// suggests].
    #[arg(long, value_enum, help_heading = "Picture")]
    kind: Option<KindFlag>,
    /// The states on the axes, by name: horizontal, (depth,) vertical; of a series, its panels
    /// [default: the system's].
    #[arg(long, value_name = "X,Y,...", value_delimiter = ',', help_heading = "Picture")]
    axes: Vec<String>,
    /// Azimuth and elevation of the camera in degrees, of a picture in space [default: -60,25].
    #[arg(
        long,
        value_name = "AZIMUTH,ELEVATION",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true,
        help_heading = "Picture"
    )]
    camera: Option<Vec<f64>>,
    /// Heading [default: the system's title].
    #[arg(long, value_name = "TEXT", help_heading = "Picture")]
    title: Option<String>,
    /// File to write, or - for standard output (with --format).
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Format, for standard output.
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Say the words of an SVG picture a second time as invisible text, so that they can be
    /// searched and copied (a PDF picture always does).
    #[arg(long)]
    searchable: bool,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
}

/// A kind of picture.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum KindFlag {
    /// States against time, a panel for each.
    Series,
    /// One state against another.
    Plane,
    /// Three states.
    Space,
    /// Crossings of a plane (with --section).
    Section,
}

impl From<KindFlag> for plot::PictureKind {
    fn from(kind: KindFlag) -> Self {
        match kind {
            KindFlag::Series => plot::PictureKind::Series,
            KindFlag::Plane => plot::PictureKind::Plane,
            KindFlag::Space => plot::PictureKind::Space,
            KindFlag::Section => plot::PictureKind::Section,
        }
    }
}

/// A format of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Pixels, 600 dpi.
    Png,
    /// Vectors, for pages.
    Svg,
    /// Vectors, for print.
    Pdf,
}

impl Format {
    /// The format of a picture that is to be written to `out`.
    pub(super) fn of(out: &Path, given: Option<Self>) -> Result<Self, CliError> {
        if is_standard_output(out) {
            return given.ok_or_else(|| {
                CliError::Usage(
                    "--out - names no format: give --format png, --format svg or --format pdf"
                        .into(),
                )
            });
        }
        if given.is_some() {
            return Err(CliError::no_effect(
                "--format",
                "the file's name says the format; leave it out, or write to standard output (--out \
                    -)",
            ));
        }
        let extension =
            out.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        Self::value_variants().iter().copied().find(|f| f.word() == extension).ok_or_else(|| {
            CliError::Usage(format!(
                "--out {}: a picture's name ends in .png, .svg or .pdf, which says what is written",
                out.display()
            ))
        })
    }

    fn word(self) -> &'static str {
        match self {
            Format::Png => "png",
            Format::Svg => "svg",
            Format::Pdf => "pdf",
        }
    }
}

/// Draws a sheet and writes it.
pub(super) fn write(
    sheet: &crate::render::Sheet,
    out: &Path,
    format: Format,
) -> Result<(), CliError> {
    let rendered = render(sheet).map_err(|error| match error {
        RenderError::Text(e) => CliError::Usage(format!("{e}; give another --title")),
        other => CliError::Job(JobError::Other(other.to_string())),
    })?;
    let bytes = match format {
        Format::Png => rendered.png,
        Format::Svg => rendered.svg,
        Format::Pdf => rendered.pdf,
    };
    deliver(Some(out), &bytes)
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let format = Format::of(&arguments.out, arguments.format)?;
    if arguments.searchable && format != Format::Svg {
        return Err(CliError::no_effect(
            "--searchable",
            "only an SVG picture has a choice: PDF always carries its words, PNG cannot; leave it \
                out",
        ));
    }
    let (run, answer) = if let Some(file) = &arguments.from {
        if let Some(flag) = arguments.flags.first_given() {
            return Err(CliError::no_effect(
                flag,
                "--from gives a whole run that is computed already; leave one of the two out",
            ));
        }
        let (spec, answer) = recorded(file)?;
        (Recorded::Surfaces(spec), Some(Arc::new(answer)))
    } else if let Some(mut run) = general::run_of(&arguments.flags)? {
        if let (None, Record::Path { chord }) = (arguments.flags.chord, &mut run.options.record) {
            *chord = 1e-4;
        }
        (Recorded::General(run, arguments.flags.section.clone()), None)
    } else {
        (Recorded::Surfaces(arguments.flags.spec(Use::Picture)?), None)
    };
    let (frame, question) = (run.frame(), run.question());
    let look = look(arguments, &frame)?;
    let unsuitable =
        |e: plot::PlotError| CliError::Usage(format!("--kind {}: {e}", look.kind.word()));
    // Said before anything is computed.
    plot::axes(&frame, look.kind, &look.axes).map_err(unsuitable)?;
    try_delivery(Some(&arguments.out))?;
    let progress = Progress::new(arguments.quiet);
    let answer = match answer {
        Some(answer) => answer,
        None => {
            progress.say_default_switch(&arguments.flags, &[]);
            Executor::new(None, &progress).ask(&*question)?
        }
    };
    let (method, mut small_print) = match &run {
        Recorded::Surfaces(spec) => (spec.method.name.name(), small_print(spec)),
        Recorded::General(run, _) => {
            let end: f64 = answer.fact("t").map_err(JobError::from)?;
            (run.options.method.name(), vec![general_small_print(run, end)])
        }
    };
    if answer.stop == Stop::Interrupted {
        small_print.push("an interrupted run: this is what was computed until then".into());
    }
    let mut sheet = plot::sheet(&frame, &answer, &look, small_print)
        .map_err(unsuitable)?
        .provenance("Software", concat!("twofold ", env!("CARGO_PKG_VERSION")))
        .provenance("Picture", format!("plot-{}", look.kind.word()))
        .provenance("Reading", "none")
        .provenance("Method", method)
        .provenance("Spec-SHA256", question_hash(&*question).as_str())
        .provenance("Data-SHA256", record::Hash::of(&encode::bits(&answer.tables)).as_str());
    sheet.searchable_svg = arguments.searchable;
    write(&sheet, &arguments.out, format)?;
    Ok(match &run {
        Recorded::General(run, _) => said_how_it_ended(run, &answer),
        Recorded::Surfaces(_) => Exit::Fine,
    })
}

/// The run of a general system up to the time `end` in words.
pub(super) fn general_small_print(run: &GeneralRun, end: f64) -> String {
    let o = &run.options;
    let (from, rtol) = (number(o.t_start), number(o.rtol));
    // A time that the run found has all digits.
    let to = if end == o.t_end { number(end) } else { format!("{end:.6}") };
    let values = run.model.values().unwrap_or_default();
    let names = run.model.definition().parameters().iter().map(|p| p.name.as_str());
    let parameters = wording::numbers(names.filter_map(|name| Some((name, *values.get(name)?))));
    let comma = if parameters.is_empty() { "" } else { ", " };
    format!(
        "{parameters}{comma}*t* = {from} … {to}, event-driven, {}, rtol {rtol}",
        o.method.name()
    )
}

/// The run in words. The system's title, which stands above the picture, is not said again.
pub(super) fn small_print(spec: &RunSpec) -> Vec<String> {
    let mut lines = wording::small_print(None, &[spec]);
    let title = format!("{}, ", markup::literal(spec.system.definition().title()));
    if let Some(rest) = lines.first().and_then(|line| line.strip_prefix(&title)).map(str::to_owned)
    {
        lines[0] = rest;
    }
    lines
}

/// The look that the flags ask for.
fn look(arguments: &Arguments, frame: &plot::Frame) -> Result<Look, CliError> {
    let kind = arguments.kind.map_or_else(|| plot::PictureKind::suiting(frame), Into::into);
    let names: Vec<&str> = frame.states.iter().map(|s| s.name.as_str()).collect();
    let mut axes = Vec::new();
    for name in &arguments.axes {
        let Some(i) = names.iter().position(|n| *n == name.trim()) else {
            return Err(CliError::Usage(format!(
                "--axes: there is no state \"{name}\"; choose among {}",
                names.join(", ")
            )));
        };
        if axes.contains(&i) {
            return Err(CliError::Usage(format!("--axes: \"{name}\" is given twice")));
        }
        axes.push(i);
    }
    let camera = match arguments.camera.as_deref() {
        None => None,
        Some(_) if kind != plot::PictureKind::Space => {
            return Err(CliError::no_effect(
                "--camera",
                "only a picture in space has one; leave it out, or give --kind space",
            ));
        }
        Some(&[azimuth, elevation]) if azimuth.is_finite() && elevation.abs() <= 90.0 => {
            Some((azimuth, elevation))
        }
        Some(_) => {
            return Err(CliError::Usage(
                "--camera: give azimuth and elevation in degrees, the elevation from -90 to 90, \
                    such as -60,25"
                    .into(),
            ));
        }
    };
    Ok(Look { kind, axes, camera, title: arguments.title.clone() })
}

/// A run that `twofold run` has written.
fn recorded(file: &Path) -> Result<(RunSpec, Answer), CliError> {
    let wrong = |why: String| {
        CliError::Usage(format!(
            "--from {}: {why}; give a file that `twofold run` has written as CSV or JSON",
            file.display()
        ))
    };
    let bytes = record::files::read(file)?;
    let end = String::from_utf8_lossy(&bytes[bytes.len().saturating_sub(1 << 16)..]);
    if end.contains("\"format\":\"twofold-sweep\"") {
        return Err(wrong("it is a sweep, whose rows are runs' ends and no path".into()));
    }
    let (about, answer) = if bytes.first() == Some(&b'{') {
        encode::from_json(&bytes).map_err(|e| wrong(e.to_string()))?
    } else {
        let (about, table) = encode::run_from_csv(&bytes).map_err(|e| wrong(e.to_string()))?;
        let stop = encode::stop_of_csv(&bytes).unwrap_or(Stop::Finished);
        (about, Answer { stop, ..Answer::of_tables(vec![table]) })
    };
    let question = about
        .get("question")
        .cloned()
        .ok_or_else(|| wrong("it does not say of which run it is".into()))?;
    if about["kind"] == "general-run" {
        let name = question["system"]["name"].as_str().unwrap_or("FILE");
        return Err(CliError::Usage(format!(
            "--from {}: the run of a general system is drawn from the system itself: twofold plot \
                --system {name}, and the flags of the run",
            file.display()
        )));
    }
    let spec: RunSpec = serde_json::from_value(question)
        .map_err(|e| wrong(format!("its question is not a run ({e})")))?;
    spec.validate().map_err(|e| wrong(format!("its question is wrong ({e})")))?;
    Ok((spec, answer))
}
