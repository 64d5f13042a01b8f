//! The questions of `corybant init` and what their answers may be. In: the devices of the machine, a
//! line. Out: answers, or the reason why a line is none. Thread: main.

use std::path::{Path, PathBuf};

use crate::audio::input::devices::{self, DEFAULT, JACK, OUTPUT_PREFIX};
use crate::cli::run::default_input;
use crate::config::graphs::read_graph;
use crate::daemon::setup::choices::{RENDERERS, Renderer};
use crate::midi::{self, Backend};
use corybant_files::shown;

use super::document::{Answers, Motions};

/// The pads of a new `[[midi]]` send these many labels.
const PADS_MAX: usize = 8;
/// The renderer that is offered: any program that receives VMC.
const RENDERER: &str = "other-vmc";

/// One question, in the order in which they are asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Question {
    Sound,
    Renderer,
    Motions,
    Pads,
    Page,
}

impl Question {
    pub(super) const ALL: [Self; 5] = [
        Self::Sound,
        Self::Renderer,
        Self::Motions,
        Self::Pads,
        Self::Page,
    ];
}

/// The values that the user can choose.
pub(super) struct Choices {
    /// Values of `audio.input` and their names; the first one is the default.
    inputs: Vec<(String, String)>,
    /// Names of the MIDI ports.
    ports: Vec<String>,
    /// Folder of the show file, to which paths are relative.
    folder: PathBuf,
}

/// The pages that the user can choose: the value of `page.listen` and its name.
const PAGES: [(&str, &str); 3] = [
    ("127.0.0.1:8710", "only this computer"),
    (
        "0.0.0.0:8710",
        "also phones and other computers, with a link that has a token",
    ),
    ("off", "no page"),
];

impl Choices {
    /// Finds the devices of this machine. `folder` is the folder of the show file.
    pub(super) fn find(folder: &Path) -> Self {
        let ports = midi::ports(Backend::System).unwrap_or_default();
        Self {
            inputs: inputs(),
            ports: ports.into_iter().map(|port| port.name).collect(),
            folder: folder.into(),
        }
    }

    /// Returns the default answers.
    pub(super) fn defaults(&self) -> Answers {
        Answers {
            input: self.inputs[0].0.clone(),
            renderer: default_renderer(),
            motions: Motions::default(),
            port: String::new(),
            page: PAGES[0].0.into(),
        }
    }

    /// Returns the text of the default answer of `question`.
    pub(super) fn default_of(&self, question: Question) -> String {
        match question {
            Question::Sound => self.inputs[0].0.clone(),
            Question::Renderer => default_renderer().name.into(),
            Question::Motions => "built-in moves".into(),
            Question::Pads => "none".into(),
            Question::Page => PAGES[0].1.into(),
        }
    }

    /// Returns the question `question` with its numbered choices, one line each.
    pub(super) fn text(&self, question: Question) -> String {
        let (words, names): (&str, Vec<&str>) = match question {
            Question::Sound => (
                "Which sound do the dancers hear? A number, or the name of a device.",
                self.inputs.iter().map(|(_, name)| name.as_str()).collect(),
            ),
            Question::Renderer => (
                "Which program shows the dancers? A number, or its name.",
                RENDERERS.iter().map(|renderer| renderer.name).collect(),
            ),
            Question::Motions => (
                "Which motions do they dance? A graph file (from `corybant build` or `corybant import`), or nothing.",
                Vec::new(),
            ),
            Question::Pads => (
                "Which MIDI controller has the pads? A number, a name, or nothing.",
                self.ports.iter().map(String::as_str).collect(),
            ),
            Question::Page => (
                "Who opens the web page? A number.",
                PAGES.iter().map(|(_, name)| *name).collect(),
            ),
        };
        let mut text = format!("{words}\n");
        for (number, name) in (1..).zip(names) {
            text += &format!("  {number}  {name}\n");
        }
        text
    }
}

/// Returns the values of `audio.input` for the sounds of this machine, each with its name.
fn inputs() -> Vec<(String, String)> {
    let first = default_input();
    let mut inputs = vec![(first.to_owned(), named(first).to_owned())];
    if first != DEFAULT {
        inputs.push((DEFAULT.into(), named(DEFAULT).into()));
    }
    for host in devices::devices().hosts {
        if host.host.eq_ignore_ascii_case(JACK) {
            if host.problem.is_none() {
                inputs.push((JACK.into(), "JACK".into()));
            }
            continue;
        }
        for device in host.inputs {
            let prefix = if device.is_loopback {
                OUTPUT_PREFIX
            } else {
                ""
            };
            let value = format!("{prefix}{}", device.id);
            inputs.push((value, format!("{} ({})", device.name, host.host)));
        }
    }
    inputs
}

fn named(input: &str) -> &'static str {
    match input {
        DEFAULT => "the default input of this computer",
        _ => "what this computer plays",
    }
}

fn default_renderer() -> &'static Renderer {
    Renderer::find(RENDERER).unwrap_or(&RENDERERS[0])
}

/// Takes `line`, the answer to `question`, into `answers`. An empty line takes the default, which
/// `answers` has already.
///
/// # Errors
/// A sentence that says what is allowed.
pub(super) fn ask(
    choices: &Choices,
    question: Question,
    line: &str,
    answers: &mut Answers,
) -> Result<(), String> {
    if line.is_empty() {
        return Ok(());
    }
    match question {
        Question::Sound => {
            let (values, names) = choices
                .inputs
                .iter()
                .cloned()
                .unzip::<_, _, Vec<_>, Vec<_>>();
            answers.input = match chosen(line, &names) {
                Some(number) => values[number].clone(),
                None if is_number(line) => return Err(not_listed(line, values.len())),
                None => line.into(),
            };
        }
        Question::Renderer => {
            let names: Vec<String> = RENDERERS.iter().map(|it| it.name.into()).collect();
            let number = chosen(line, &names).ok_or_else(|| not_listed(line, names.len()))?;
            answers.renderer = &RENDERERS[number];
        }
        Question::Motions => answers.motions = motions(&choices.folder, line)?,
        Question::Pads => {
            answers.port = match chosen(line, &choices.ports) {
                Some(number) => choices.ports[number].clone(),
                None if is_number(line) => return Err(not_listed(line, choices.ports.len())),
                None if line.eq_ignore_ascii_case("none") => String::new(),
                None => line.into(),
            };
        }
        Question::Page => {
            let names = PAGES.map(|(_, name)| name.to_owned());
            let number = chosen(line, &names).ok_or_else(|| not_listed(line, names.len()))?;
            answers.page = PAGES[number].0.into();
        }
    }
    Ok(())
}

/// Returns the index of the name in `names` that `line` chooses by its number or by its spelling.
fn chosen(line: &str, names: &[String]) -> Option<usize> {
    let number = line.parse::<usize>().ok();
    let by_number = number.and_then(|number| number.checked_sub(1));
    let by_name = || {
        names
            .iter()
            .position(|name| name.eq_ignore_ascii_case(line))
    };
    by_number
        .filter(|&index| index < names.len())
        .or_else(by_name)
}

fn is_number(line: &str) -> bool {
    line.bytes().all(|byte| byte.is_ascii_digit())
}

fn not_listed(line: &str, count: usize) -> String {
    match count {
        0 => format!("{line:?} is not in the list, which is empty; press Enter for the default"),
        _ => format!("{line:?} is not in the list; a number from 1 to {count} is allowed"),
    }
}

/// Reads the graph file `line`, a path relative to `folder`.
fn motions(folder: &Path, line: &str) -> Result<Motions, String> {
    let path = folder.join(line);
    if path.is_dir() {
        let folder = shown(&path);
        return Err(format!(
            "{folder} is a folder; build a graph from it with `corybant build {folder} -o {folder}.graph`, and give that file"
        ));
    }
    let graph = read_graph(Some(&path))?;
    Ok(Motions {
        graph: line.into(),
        labels: graph.labels.into_iter().take(PADS_MAX).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choices() -> Choices {
        let input = |value: &str, name: &str| (value.to_owned(), name.to_owned());
        Choices {
            inputs: vec![
                input("default", "the default input"),
                input("hw:1", "Desk (ALSA)"),
            ],
            ports: vec!["Launchpad".into()],
            folder: PathBuf::new(),
        }
    }

    fn answered(lines: [&str; 5]) -> Result<Answers, String> {
        let choices = choices();
        let mut answers = choices.defaults();
        for (question, line) in Question::ALL.into_iter().zip(lines) {
            ask(&choices, question, line, &mut answers)?;
        }
        Ok(answers)
    }

    #[test]
    fn a_choice_is_made_by_number_or_name() {
        let answers = answered(["2", "vrchat", "", "launchpad", "3"]).unwrap();
        assert_eq!(
            (
                answers.input.as_str(),
                answers.renderer.id,
                answers.port.as_str(),
                answers.page.as_str()
            ),
            ("hw:1", "vrchat", "Launchpad", "off")
        );
        let answers = answered(["USB Audio", "1", "", "none", "2"]).unwrap();
        assert_eq!(
            (answers.input.as_str(), answers.port.as_str()),
            ("USB Audio", "")
        );
        assert_eq!(answered([""; 5]).unwrap(), choices().defaults());
    }

    #[test]
    fn a_wrong_answer_says_what_is_allowed() {
        for (lines, why) in [
            (
                ["3", "", "", "", ""],
                "\"3\" is not in the list; a number from 1 to 2 is allowed",
            ),
            (
                ["", "blendr", "", "", ""],
                "\"blendr\" is not in the list; a number from 1 to",
            ),
            (["", "", "no.graph", "", ""], "no.graph"),
            (["", "", "src", "", ""], "src is a folder; build a graph"),
            (["", "", "", "0", ""], "\"0\" is not in the list"),
            (["", "", "", "", "4"], "a number from 1 to 3 is allowed"),
        ] {
            let error = answered(lines).unwrap_err();
            assert!(error.contains(why), "{error}");
        }
    }

    #[test]
    fn every_question_shows_its_choices() {
        for question in Question::ALL {
            let text = choices().text(question);
            assert!(text.ends_with('\n') && !choices().default_of(question).is_empty());
        }
        assert!(choices().text(Question::Pads).contains("  1  Launchpad\n"));
    }
}
