//! Manifests: the hashes of a figure, layer by layer.
//!
//! A picture has a hash for its spec, its data, its verdict, its pixels and each of its files. The
//! first layer that differs names the part of the program that changed: spec (the question), data
//! (numerics), verdict (judgement), pixels (drawing), file (encoding).

use serde::{Deserialize, Serialize};

use super::Hash;

/// The format's version; a manifest of another version is refused.
pub const VERSION: u32 = 2;

/// All pictures of one figure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Format version.
    pub version: u32,
    /// The figure, "fig7".
    pub figure: String,
    /// The version of the crate that made it.
    pub made_by: String,
    /// Its pictures.
    pub pictures: Vec<PictureEntry>,
}

/// One picture: hashes of its layers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PictureEntry {
    /// The file name without extension, "fig7-printed".
    pub name: String,
    /// Hash of all panels' specs.
    pub spec: Hash,
    /// Hash of all panels' data.
    pub data: Hash,
    /// Hash of all panels' verdicts.
    pub verdict: Hash,
    /// Hash of the decoded pixels (width, height, RGBA).
    pub pixels: Hash,
    /// Hash of the PNG file.
    pub png: Hash,
    /// Hash of the SVG file.
    pub svg: Hash,
    /// Hash of the PDF file.
    pub pdf: Hash,
    /// Its panels.
    pub panels: Vec<PanelEntry>,
}

/// One panel: hashes of its question and its numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PanelEntry {
    /// The panel's label, "i".
    pub label: String,
    /// Hash of the question's canonical JSON.
    pub spec: Hash,
    /// Hash of the answer: tables (little-endian bits), facts, stop reason.
    pub data: Hash,
    /// The verdict, if something is claimed of the panel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<VerdictEntry>,
}

/// A panel's verdict in brief, and the hash of the whole of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VerdictEntry {
    /// The claim.
    pub claim: String,
    /// The finding.
    pub found: String,
    /// Whether they agree.
    pub agrees: bool,
    /// Hash of the verdict's canonical JSON, evidence included.
    pub sha256: Hash,
}

/// A layer of a picture, from question to file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layer {
    /// The question.
    Spec,
    /// The numbers.
    Data,
    /// The interpretation of the numbers.
    Verdict,
    /// The decoded picture.
    Pixels,
    /// The PNG file's bytes.
    Png,
    /// The SVG file's bytes.
    Svg,
    /// The PDF file's bytes.
    Pdf,
}

impl Layer {
    /// The layer's name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Layer::Spec => "spec",
            Layer::Data => "data",
            Layer::Verdict => "verdict",
            Layer::Pixels => "pixels",
            Layer::Png => "PNG file",
            Layer::Svg => "SVG file",
            Layer::Pdf => "PDF file",
        }
    }
}

/// Why a manifest could not be used.
#[derive(Debug, thiserror::Error)]
pub enum ManifestError {
    /// Not JSON, or not of this shape.
    #[error("{name} is not a manifest: {source}")]
    Syntax {
        /// Origin of the manifest, such as its path.
        name: String,
        /// The parser's message.
        source: serde_json::Error,
    },
    /// Another format version.
    #[error("{name} is a manifest of version {found}, this program reads version {VERSION}")]
    Version {
        /// Origin of the manifest, such as its path.
        name: String,
        /// Its version.
        found: u64,
    },
    /// A name that no figure, picture or panel can have.
    #[error(
        "{name} names something {bad:?}: a name has letters, digits, \".\", \"_\" and \"-\", at \
            most {LONGEST_NAME} of them, and does not begin with \".\""
    )]
    Name {
        /// Origin of the manifest, such as its path.
        name: String,
        /// The kind of thing named.
        bad: String,
    },
    /// Two entries for one picture.
    #[error("{name} lists {picture} twice")]
    Twice {
        /// Origin of the manifest, such as its path.
        name: String,
        /// The picture.
        picture: String,
    },
}

/// The longest name of a figure, picture or panel.
const LONGEST_NAME: usize = 100;

/// Whether a name can stand in a path and on a terminal: it cannot leave its folder, hide, or steer
/// anything.
pub fn is_plain_name(name: &str) -> bool {
    let plain = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'_' | b'-');
    !name.is_empty()
        && name.len() <= LONGEST_NAME
        && !name.starts_with('.')
        && name.bytes().all(plain)
}

impl Manifest {
    /// Reads a manifest; `name` is for messages.
    ///
    /// # Errors
    ///
    /// If the text is not JSON, of an unknown version, names a file outside its folder, or lists a
    /// picture twice.
    pub fn parse(text: &str, name: &str) -> Result<Self, ManifestError> {
        let syntax = |source| ManifestError::Syntax { name: name.to_owned(), source };
        // The version decides how the rest is read, so it is looked at alone first.
        let value: serde_json::Value = serde_json::from_str(text).map_err(syntax)?;
        if let Some(found) = value.get("version").and_then(serde_json::Value::as_u64)
            && found != u64::from(VERSION)
        {
            return Err(ManifestError::Version { name: name.to_owned(), found });
        }
        // Not from `value`, which has kept only the last of two fields of one name.
        let manifest: Self = serde_json::from_str(text).map_err(syntax)?;
        let pictures = manifest.pictures.iter();
        let names = pictures
            .flat_map(|p| std::iter::once(&p.name).chain(p.panels.iter().map(|q| &q.label)));
        let heads = [&manifest.figure, &manifest.made_by];
        if let Some(bad) = heads.into_iter().chain(names).find(|n| !is_plain_name(n)) {
            return Err(ManifestError::Name {
                name: name.to_owned(),
                bad: bad.chars().take(200).collect(),
            });
        }
        let pictures = manifest.pictures.iter().enumerate();
        match pictures
            .skip(1)
            .find(|(i, p)| manifest.pictures[..*i].iter().any(|q| q.name == p.name))
        {
            Some((_, twice)) => {
                Err(ManifestError::Twice { name: name.to_owned(), picture: twice.name.clone() })
            }
            None => Ok(manifest),
        }
    }

    /// The manifest as indented JSON with a final newline.
    pub fn to_json(&self) -> Vec<u8> {
        let mut bytes = serde_json::to_vec_pretty(self).expect("a manifest is plain data");
        bytes.push(b'\n');
        bytes
    }

    /// The entry of a picture.
    pub fn picture(&self, name: &str) -> Option<&PictureEntry> {
        self.pictures.iter().find(|p| p.name == name)
    }
}

/// A difference between an expected and an actual picture.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// The first layer that differs.
    pub layer: Layer,
    /// The panels whose spec, data or verdict differ.
    pub panels: Vec<String>,
}

/// Labels of panels in a sentence: each once, with how many have it. What a panel of ours asks is
/// often one question of a hundred of a kind.
pub fn listed(panels: &[String]) -> String {
    let mut counted: Vec<(&str, usize)> = Vec::new();
    for panel in panels {
        match counted.iter_mut().find(|(label, _)| label == panel) {
            Some((_, count)) => *count += 1,
            None => counted.push((panel, 1)),
        }
    }
    let said = |(label, count): &(&str, usize)| {
        if *count == 1 { (*label).to_owned() } else { format!("{label} ({count} of them)") }
    };
    counted.iter().map(said).collect::<Vec<_>>().join(", ")
}

impl PictureEntry {
    /// The first layer in which `actual` differs from `self`.
    pub fn first_difference(&self, actual: &PictureEntry) -> Option<Difference> {
        // A picture's hashes and its panels' are two statements: each must be what was computed.
        let layers: [(Layer, bool); 7] = [
            (Layer::Spec, self.spec == actual.spec && self.panels.len() == actual.panels.len()),
            (Layer::Data, self.data == actual.data),
            (Layer::Verdict, self.verdict == actual.verdict),
            (Layer::Pixels, self.pixels == actual.pixels),
            (Layer::Png, self.png == actual.png),
            (Layer::Svg, self.svg == actual.svg),
            (Layer::Pdf, self.pdf == actual.pdf),
        ];
        layers.into_iter().find_map(|(layer, same)| {
            let panels = self.panels_differing(actual, layer);
            (!same || !panels.is_empty()).then_some(Difference { layer, panels })
        })
    }

    /// The labels of the panels that are not the same in a layer.
    fn panels_differing(&self, actual: &PictureEntry, layer: Layer) -> Vec<String> {
        let same = |a: &PanelEntry, b: &PanelEntry| match layer {
            Layer::Spec => a.spec == b.spec,
            Layer::Data => a.data == b.data,
            Layer::Verdict => a.verdict == b.verdict,
            Layer::Pixels | Layer::Png | Layer::Svg | Layer::Pdf => true,
        };
        let mut labels = Vec::new();
        for (i, panel) in self.panels.iter().enumerate() {
            // Questions of one kind have one label: the first is held against the first, the second
            // against the second.
            let before = self.panels[..i].iter().filter(|p| p.label == panel.label).count();
            let other = actual.panels.iter().filter(|p| p.label == panel.label).nth(before);
            if other.is_none_or(|other| !same(panel, other)) {
                labels.push(panel.label.clone());
            }
        }
        labels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry() -> PictureEntry {
        let h = |s: &str| Hash::of(s.as_bytes());
        let panel =
            |l: &str| PanelEntry { label: l.into(), spec: h("s"), data: h("d"), verdict: None };
        PictureEntry {
            name: "fig7-printed".into(),
            spec: h("1"),
            data: h("2"),
            verdict: h("7"),
            pixels: h("3"),
            png: h("4"),
            svg: h("5"),
            pdf: h("6"),
            panels: vec![panel("i"), panel("ii")],
        }
    }

    #[test]
    fn panels_of_one_label_are_told_apart_by_their_order() {
        let h = |s: &str| Hash::of(s.as_bytes());
        let with = |data: [&str; 3]| {
            let panels = data.map(|d| PanelEntry {
                label: "leaving".into(),
                spec: h("s"),
                data: h(d),
                verdict: None,
            });
            PictureEntry { data: h(&data.join(" ")), panels: panels.to_vec(), ..entry() }
        };
        let difference = with(["a", "b", "c"]).first_difference(&with(["a", "x", "c"])).unwrap();
        assert_eq!(
            (difference.layer, difference.panels),
            (Layer::Data, vec!["leaving".to_owned()])
        );
        let swapped = with(["a", "b", "c"]).first_difference(&with(["b", "a", "c"])).unwrap();
        assert_eq!(swapped.panels.len(), 2);
    }

    #[test]
    fn labels_are_said_once() {
        let panels = ["i", "leaving", "ii", "leaving", "leaving"].map(str::to_owned);
        assert_eq!(listed(&panels), "i, leaving (3 of them), ii");
        assert_eq!(listed(&[]), "");
    }

    #[test]
    fn names_the_first_layer_and_the_panel() {
        let expected = entry();
        assert_eq!(expected.first_difference(&entry()), None);
        let mut actual = entry();
        actual.data = Hash::of(b"other");
        actual.panels[1].data = Hash::of(b"other");
        actual.png = Hash::of(b"other");
        let difference = expected.first_difference(&actual).unwrap();
        assert_eq!(difference, Difference { layer: Layer::Data, panels: vec!["ii".into()] });
    }

    #[test]
    fn other_versions_and_other_files_are_refused() {
        let error = Manifest::parse(r#"{"version": 7}"#, "m.json").unwrap_err().to_string();
        assert!(error.contains("version 7") && error.contains("m.json"), "{error}");
        let error = Manifest::parse("not json", "m.json").unwrap_err().to_string();
        assert!(error.contains("m.json is not a manifest"), "{error}");
        assert!(Manifest::parse("[1]", "m.json").is_err());
    }

    #[test]
    fn names_cannot_leave_their_folder_or_steer_a_terminal() {
        let manifest = |figure: &str, name: &str, label: &str| {
            let mut m = Manifest {
                version: VERSION,
                figure: figure.into(),
                made_by: "0".into(),
                pictures: vec![entry()],
            };
            m.pictures[0].name = name.into();
            m.pictures[0].panels[0].label = label.into();
            Manifest::parse(&String::from_utf8(m.to_json()).unwrap(), "m.json")
        };
        manifest("fig7", "fig7-printed", "a-i").unwrap();
        for bad in [
            "",
            ".",
            "..",
            "../x",
            "/etc/x",
            "a/b",
            "a\\b",
            "C:x",
            ".hidden",
            "a\u{1b}[2Jb",
            "a\nb",
            "é",
            &"a".repeat(101),
        ] {
            for wrong in
                [manifest(bad, "p", "i"), manifest("fig7", bad, "i"), manifest("fig7", "p", bad)]
            {
                let error = wrong.unwrap_err();
                assert!(matches!(error, ManifestError::Name { .. }), "{bad}: {error}");
                assert!(!error.to_string().contains('\u{1b}'));
            }
        }
    }

    #[test]
    fn round_trip() {
        let m = Manifest {
            version: VERSION,
            figure: "fig7".into(),
            made_by: "0.1.0".into(),
            pictures: vec![entry()],
        };
        assert_eq!(Manifest::parse(std::str::from_utf8(&m.to_json()).unwrap(), "m").unwrap(), m);
    }

    /// Each layer alone, with the panels that it differs in.
    #[test]
    fn every_layer_is_looked_at() {
        let other = Hash::of(b"other");
        let verdict = |h: &str| VerdictEntry {
            claim: "c".into(),
            found: "f".into(),
            agrees: true,
            sha256: Hash::of(h.as_bytes()),
        };
        let mut expected = entry();
        expected.panels.iter_mut().for_each(|p| p.verdict = Some(verdict("v")));
        type Change = fn(&mut PictureEntry, Hash);
        let changes: [(Layer, Change, &[&str]); 7] = [
            (Layer::Spec, |p, h| (p.spec, p.panels[0].spec) = (h.clone(), h), &["i"]),
            (Layer::Data, |p, h| (p.data, p.panels[1].data) = (h.clone(), h), &["ii"]),
            (Layer::Verdict, |p, h| (p.verdict, p.panels[1].verdict) = (h, None), &["ii"]),
            (Layer::Pixels, |p, h| p.pixels = h, &[]),
            (Layer::Png, |p, h| p.png = h, &[]),
            (Layer::Svg, |p, h| p.svg = h, &[]),
            (Layer::Pdf, |p, h| p.pdf = h, &[]),
        ];
        let mut all = expected.clone();
        for (layer, change, panels) in changes.into_iter().rev() {
            let mut one = expected.clone();
            change(&mut one, other.clone());
            // Alone, and with everything behind it.
            change(&mut all, other.clone());
            for actual in [&one, &all] {
                let difference = expected.first_difference(actual).unwrap();
                assert_eq!(difference.layer, layer);
                assert_eq!(difference.panels, panels);
            }
        }
        // A panel that is not there differs, and one that is there for nothing.
        let mut fewer = expected.clone();
        fewer.panels.remove(0);
        assert_eq!(
            expected.first_difference(&fewer).unwrap(),
            Difference { layer: Layer::Spec, panels: vec!["i".into()] }
        );
        assert_eq!(
            fewer.first_difference(&expected).unwrap(),
            Difference { layer: Layer::Spec, panels: Vec::new() }
        );
    }

    /// A panel's statements are looked at though the picture's hash of them all is as it was.
    #[test]
    fn every_statement_of_a_panel_is_looked_at() {
        let mut expected = entry();
        let verdict = VerdictEntry {
            claim: "c".into(),
            found: "f".into(),
            agrees: true,
            sha256: Hash::of(b"v"),
        };
        expected.panels[1].verdict = Some(verdict);
        let verdict = |p: &mut PictureEntry, change: fn(&mut VerdictEntry)| {
            p.panels[1].verdict.iter_mut().for_each(change)
        };
        type Change<'a> = &'a dyn Fn(&mut PictureEntry);
        let changes: [(Layer, Change<'_>); 7] = [
            (Layer::Spec, &|p| p.panels[1].spec = Hash::of(b"other")),
            (Layer::Data, &|p| p.panels[1].data = Hash::of(b"other")),
            (Layer::Verdict, &|p| verdict(p, |v| v.claim.push('!'))),
            (Layer::Verdict, &|p| verdict(p, |v| v.found.push('!'))),
            (Layer::Verdict, &|p| verdict(p, |v| v.agrees = false)),
            (Layer::Verdict, &|p| verdict(p, |v| v.sha256 = Hash::of(b"other"))),
            (Layer::Verdict, &|p| p.panels[1].verdict = None),
        ];
        for (layer, change) in changes {
            let mut forged = expected.clone();
            change(&mut forged);
            let found = forged.first_difference(&expected).unwrap();
            assert_eq!(found, Difference { layer, panels: vec!["ii".into()] });
        }
    }

    #[test]
    fn nothing_is_said_twice() {
        let m = Manifest {
            version: VERSION,
            figure: "fig7".into(),
            made_by: "0".into(),
            pictures: vec![entry(), entry()],
        };
        let error = Manifest::parse(&String::from_utf8(m.to_json()).unwrap(), "m.json")
            .unwrap_err()
            .to_string();
        assert!(error.contains("m.json lists fig7-printed twice"), "{error}");
        let once = Manifest { pictures: vec![entry()], ..m };
        let text = String::from_utf8(once.to_json()).unwrap();
        let twice = text.replacen("\"figure\"", "\"figure\": \"fig8\", \"figure\"", 1);
        assert!(
            Manifest::parse(&twice, "m.json").unwrap_err().to_string().contains("duplicate field")
        );
    }

    #[test]
    fn a_picture_is_found_by_its_name() {
        let mut second = entry();
        second.name = "fig7-reconstructed".into();
        let pictures = vec![entry(), second.clone()];
        let m = Manifest { version: VERSION, figure: "fig7".into(), made_by: "0".into(), pictures };
        assert_eq!(m.picture("fig7-reconstructed"), Some(&second));
        assert_eq!(m.picture("fig7"), None);
        let longest = "a".repeat(LONGEST_NAME);
        assert!(is_plain_name(&longest) && !is_plain_name(&format!("{longest}a")));
    }

    #[test]
    fn layers_are_called_as_in_messages() {
        let layers = [
            Layer::Spec,
            Layer::Data,
            Layer::Verdict,
            Layer::Pixels,
            Layer::Png,
            Layer::Svg,
            Layer::Pdf,
        ];
        let names = ["spec", "data", "verdict", "pixels", "PNG file", "SVG file", "PDF file"];
        assert_eq!(layers.map(Layer::name), names);
        assert!(layers.is_sorted());
    }
}
