//! Reuse of pictures: one that this program has drawn of the same questions, and that is unchanged,
//! is not drawn again.
//!
//! Once a picture's files are written, the store keeps the digest of its record, under the
//! picture's questions, together with the digest of the program's own file. Later the picture is
//! reused if the store has a record *by a program of the same digest*, if the record in the folder
//! has that digest, and if every file named in it has the digest that it names. Otherwise (another
//! program, a file that is missing or was changed by one bit) the picture is made again.
//!
//! Without a store nothing is reused: `check`, `bless` and `--fresh` always compute.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::{Value, json};

use super::pipeline::{PictureRecord, compute, parts};
use super::{Picture, View};
use twofold_integrate::Monitor;
use twofold_job::question::{key, question_hash};
use twofold_job::record::{FileError, Hash, files};
use twofold_job::store::Kept;
use twofold_job::{Answer, Ask, JobError, Question, Store};

/// The pictures that can be reused.
#[derive(Debug)]
pub struct ReusablePictures<'a> {
    store: &'a Store,
    program: Hash,
}

/// A picture that can be reused.
#[derive(Clone, Debug, PartialEq)]
pub struct ReusablePicture {
    /// Its record.
    pub record: PictureRecord,
    /// Its files and their lengths.
    pub files: Vec<(PathBuf, u64)>,
}

/// A picture as a question, whose answer is the digest of its record.
#[derive(Debug)]
struct Drawn<'a>(&'a Picture);

impl Question for Drawn<'_> {
    fn kind(&self) -> &'static str {
        "picture"
    }

    /// Everything that one program may put differently into two pictures. Colours, sizes and words
    /// are the program's, whose digest is part of the answer.
    fn json(&self) -> Value {
        let Picture { name, reading, title, caption, view, panels, alterations } = self.0;
        let asked: Vec<_> =
            parts(self.0).into_iter().map(|(part, q)| (part, question_hash(&*q))).collect();
        let said: Vec<_> = panels
            .iter()
            .map(|p| (&p.title, &p.claim, p.repeats.as_ref().map(|r| &r.panel)))
            .collect();
        let view = match view {
            // The function that draws, by its offset from another one, since a program's address
            // varies.
            View::Study(study) => {
                let here = ReusablePictures::of as *const () as usize;
                json!({ "study": (study.draw as *const () as usize).wrapping_sub(here) })
            }
            View::Plots(plots) => json!(plots.looks()),
            other => json!(format!("{other:?}")),
        };
        json!({
            "name": name, "reading": reading, "title": title, "caption": caption,
                "alterations": alterations, "view": view,
            "asked": asked, "said": said,
        })
    }

    fn compute(&self, executor: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let made = compute(self.0, executor).map_err(|error| JobError::Other(error.to_string()))?;
        Ok(answer(&made.record))
    }
}

/// The answer to [`Drawn`].
fn answer(record: &PictureRecord) -> Answer {
    Answer::of_tables(Vec::new()).with_fact(RECORD, &Hash::of(&record.to_json()))
}

/// The digest of a record's file.
const RECORD: &str = "record_sha256";
/// The digest of the program that made it.
const PROGRAM: &str = "program_sha256";

impl<'a> ReusablePictures<'a> {
    /// The reusable pictures that `store` records for this program. None if the program's own file
    /// cannot be read: then nothing is reused.
    pub fn of(store: &'a Store) -> Option<Self> {
        let (program, _) = files::digest(&std::env::current_exe().ok()?).ok()?;
        Some(Self { store, program })
    }

    /// The picture, if it can be reused from `folder`.
    pub fn find(&self, picture: &Picture, folder: &Path) -> Option<ReusablePicture> {
        let question = Drawn(picture);
        let Kept::Answer(known) = self.store.get(&key(&question), &question) else { return None };
        if known.fact::<Hash>(PROGRAM).ok()? != self.program {
            return None;
        }
        let path = folder.join(format!("{}.json", picture.name));
        let bytes = files::read(&path).ok()?;
        if known.fact::<Hash>(RECORD).ok()? != Hash::of(&bytes) {
            return None;
        }
        let record: PictureRecord = serde_json::from_slice(&bytes).ok()?;
        let mut found: Vec<(PathBuf, u64)> = record
            .files()
            .into_par_iter()
            .map(|(file, hash)| {
                let path = folder.join(file);
                let (found, length) = files::digest(&path).ok()?;
                (found == *hash).then_some((path, length))
            })
            .collect::<Option<_>>()?;
        found.push((path, bytes.len() as u64));
        Some(ReusablePicture { record, files: found })
    }

    /// Remembers a picture whose files have been written.
    ///
    /// # Errors
    /// If the store cannot be written: the picture will be made again next time.
    pub fn remember(&self, picture: &Picture, record: &PictureRecord) -> Result<(), FileError> {
        let question = Drawn(picture);
        self.store.put(
            &key(&question),
            &question,
            &answer(record).with_fact(PROGRAM, &self.program),
        )
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::sync::Arc;

    use super::*;
    use crate::pipeline::compute_with_tables;
    use crate::{FigurePanel, ParameterReading, Study};
    use twofold_job::spec::{Method, MethodSpec, Observation, RunSpec, SwitchSpec};
    use twofold_job::{Column, Entry, Executor, Table};
    use twofold_render::Sheet;
    use twofold_render::sheet::{Axis, ColumnWidth, LineStyle, PlanePanel};
    use twofold_render::style;
    use twofold_system::System;

    /// The two ends of a line.
    #[derive(Debug)]
    struct Ends;

    impl Question for Ends {
        fn kind(&self) -> &'static str {
            "ends"
        }

        fn json(&self) -> Value {
            json!({})
        }

        fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
            let mut table = Table::new("line", ["x", "y"].map(Column::numbers));
            for end in [0.0, 1.0] {
                table.push([end, end].map(Entry::Number));
            }
            Ok(Answer::of_tables(vec![table]))
        }
    }

    /// A picture of a line.
    fn of_a_study() -> Picture {
        let study = Study {
            questions: || vec![Arc::new(Ends)],
            draw: |answers| {
                let table = &answers[0].tables[0];
                let ends = table.numbers("x").iter().zip(table.numbers("y"));
                let panel = PlanePanel::new(Axis::linear("", 0.0, 1.0), Axis::linear("", 0.0, 1.0))
                    .line(ends.map(|(x, y)| [*x, *y]).collect(), LineStyle::new(style::INK, 1.0));
                Sheet::new(ColumnWidth::Single, 1, "").panel("", "", panel)
            },
        };
        Picture {
            name: "line".into(),
            reading: None,
            title: "A line".into(),
            caption: "A line.".into(),
            view: View::Study(study),
            panels: Vec::new(),
            alterations: Vec::new(),
        }
    }

    /// A picture of two runs.
    fn of_runs() -> Picture {
        let run = RunSpec {
            system: System::builtin("two-fold").unwrap(),
            switch: SwitchSpec::tanh(1e-3),
            start: vec![0.2, 0.0, -1.0],
            t_end: 1.0,
            method: MethodSpec::ndsolve_defaults(Method::Dopri5),
            schedule: Default::default(),
            observe: Observation::Section { coordinate: 1, value: 0.0 },
        };
        Picture {
            view: View::Section { horizontal: 0, vertical: 2 },
            panels: ["i", "ii"].map(|label| FigurePanel::new(label, "a run", run.clone())).into(),
            ..of_a_study()
        }
    }

    /// Titles, labels and claims of panels of runs are part of the question.
    #[test]
    fn another_run_title_claim_or_view_is_another_picture() {
        let picture = of_runs();
        let asked = |p: &Picture| key(&Drawn(p));
        let changes: [&dyn Fn(&mut Picture); 6] = [
            &|p| p.panels[0].title.push('.'),
            &|p| p.panels[0].label.push('.'),
            &|p| p.panels[0].claim = Some(crate::Claim::LessOrganisedThanNext),
            &|p| p.panels[0].run.t_end += 1.0,
            &|p| p.view = View::Section { horizontal: 2, vertical: 0 },
            &|p| drop(p.panels.pop()),
        ];
        for change in changes {
            let mut different = picture.clone();
            change(&mut different);
            assert_ne!(asked(&different), asked(&picture));
        }
        assert_eq!(asked(&picture.clone()), asked(&picture));
    }

    /// Makes the picture of a line into `folder` as the command line does, and remembers it.
    fn made(reusable: &ReusablePictures<'_>, folder: &Path) -> (Picture, PictureRecord) {
        let picture = of_a_study();
        let put = |file: &str, bytes: &[u8]| twofold_job::record::write(&folder.join(file), bytes);
        let computed =
            compute_with_tables(&picture, &Executor::quiet(), &mut |file, bytes| put(file, bytes))
                .unwrap();
        let name = &picture.name;
        put(&format!("{name}.png"), &computed.rendered.png).unwrap();
        put(&format!("{name}.svg"), &computed.rendered.svg).unwrap();
        put(&format!("{name}.pdf"), &computed.rendered.pdf).unwrap();
        put(&format!("{name}.json"), &computed.record.to_json()).unwrap();
        reusable.remember(&picture, &computed.record).unwrap();
        (picture, computed.record)
    }

    #[test]
    fn a_picture_is_reused_until_anything_of_it_changes() {
        let place = tempfile::tempdir().unwrap();
        let store = Store::new(place.path().join("store"));
        let reusable = ReusablePictures::of(&store).unwrap();
        let folder = place.path().join("line");
        let (picture, record) = made(&reusable, &folder);
        let found = reusable.find(&picture, &folder).expect("nothing has changed");
        assert_eq!(found.record, record);
        let mut there: Vec<_> = fs::read_dir(&folder)
            .unwrap()
            .map(|e| e.unwrap())
            .map(|e| (e.path(), e.metadata().unwrap().len()))
            .collect();
        let mut found = found.files.clone();
        there.sort();
        found.sort();
        assert_eq!(found, there, "all of its files and no other");
        assert!(record.files().len() > 3, "tables too");

        // One bit of any file, one byte more, or no file.
        for (path, _) in &found {
            let whole = fs::read(path).unwrap();
            let mut changed = whole.clone();
            changed[whole.len() / 2] ^= 1;
            let longer = [&whole[..], b"\n"].concat();
            for bytes in [Some(changed), Some(longer), None] {
                match bytes {
                    Some(bytes) => fs::write(path, bytes).unwrap(),
                    None => fs::remove_file(path).unwrap(),
                }
                assert_eq!(reusable.find(&picture, &folder), None, "{}", path.display());
            }
            fs::write(path, whole).unwrap();
        }
        assert!(reusable.find(&picture, &folder).is_some());
    }

    #[test]
    fn nothing_of_another_program_or_question_is_reused() {
        let place = tempfile::tempdir().unwrap();
        let store = Store::new(place.path().join("store"));
        let folder = place.path().join("line");
        let other = ReusablePictures { store: &store, program: Hash::of(b"another program") };
        let (picture, record) = made(&other, &folder);
        assert!(other.find(&picture, &folder).is_some());
        let ours = ReusablePictures::of(&store).unwrap();
        assert_eq!(ours.find(&picture, &folder), None, "by another program");
        ours.remember(&picture, &record).unwrap();
        assert!(ours.find(&picture, &folder).is_some());
        assert_eq!(other.find(&picture, &folder), None, "ours has taken its place");

        let View::Study(study) = picture.view else { panic!("it is a study") };
        let changes: [&dyn Fn(&mut Picture); 8] = [
            &|p| p.alterations.push("seed 2".into()),
            &|p| p.title = "something else".into(),
            &|p| p.caption.push('.'),
            &|p| p.name.push_str("-other"),
            &|p| p.reading = Some(ParameterReading { name: "a".into(), parameters: Vec::new() }),
            &|p| {
                p.view =
                    View::Study(Study { draw: |_| Sheet::new(ColumnWidth::Single, 1, ""), ..study })
            },
            &|p| p.view = View::Study(Study { questions: Vec::new, ..study }),
            &|p| p.view = View::Section { horizontal: 0, vertical: 2 },
        ];
        for change in changes {
            let mut different = picture.clone();
            change(&mut different);
            assert_eq!(ours.find(&different, &folder), None, "{different:?}");
        }
        assert_eq!(ours.find(&picture, place.path()), None, "elsewhere there is nothing");
    }

    /// A remembered answer equals that of drawing the picture anew.
    #[test]
    fn the_answer_is_that_of_the_question() {
        let picture = of_a_study();
        let executor = Executor::quiet();
        let drawn = Drawn(&picture).compute(&executor, &()).unwrap();
        let record = compute(&picture, &executor).unwrap().record;
        assert_eq!(drawn.fact::<Hash>(RECORD).unwrap(), Hash::of(&record.to_json()));
    }
}
