//! The show file that `corybant init` writes. In: answers. Out: text with comments. Pure.

use toml_edit::Value;

use crate::daemon::setup::choices::Renderer;

/// The note of the first pad of a controller; usual for drum pads.
const FIRST_NOTE: usize = 36;
/// The labels of the built-in repertoire that the first pads launch.
const LABELS: [&str; 8] = [
    "salsa",
    "charleston",
    "disco",
    "twist",
    "vogue",
    "robot",
    "wave",
    "jump",
];
/// The port at which a show receives OSC by default, which VRChat uses too.
const OSC_PORT: &str = ":9000";

/// The motions of a show.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Motions {
    /// Path of the graph file; empty for the built-in repertoire.
    pub(super) graph: String,
    /// Labels of the graph for the first pads; empty for the built-in repertoire.
    pub(super) labels: Vec<String>,
}

/// The answers to all questions.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Answers {
    /// Value of `audio.input`.
    pub(super) input: String,
    pub(super) renderer: &'static Renderer,
    pub(super) motions: Motions,
    /// Name of the MIDI port of the controller; empty without a controller.
    pub(super) port: String,
    /// Value of `page.listen`.
    pub(super) page: String,
}

/// Returns `text` as a value in TOML, with quotation marks.
fn quoted(text: &str) -> String {
    Value::from(text).to_string()
}

/// Returns the text of the show file `name`.
pub(super) fn text(answers: &Answers, name: &str) -> String {
    let mut text = format!(
        "# A show of Corybant: `corybant run {name}`. A running show takes over many edits of this file.\n\
         # config/reference.toml lists every key with its range and default; `corybant check {name}` finds errors.\n\n"
    );
    text += &format!(
        "# The sound that the dancers hear. `corybant devices` lists the inputs.\n[audio]\ninput = {}\n\n",
        quoted(&answers.input)
    );
    text += &motions(&answers.motions);
    text += &output(answers.renderer);
    text += &pads(&answers.port, &answers.motions);
    text += &format!(
        "# The web page with pads, tempo and setup. \"127.0.0.1:8710\": this computer; \"0.0.0.0:8710\": phones too; \"off\".\n[page]\nlisten = {}\n\n",
        quoted(&answers.page)
    );
    text + SCENES
}

/// An example of scenes, in comments.
const SCENES: &str = "# Scenes are named states of the show: OSC /scene/calm, the page, or a pad with label = \"!scene calm\" recalls one.\n\
     # [[scene]]\n# name = \"calm\"\n# intensity = 0.3        # amount of movement\n# quantise = \"bar\"       # begins at a bar\n# fade_beats = 8         # and fades over 8 beats\n";

fn motions(motions: &Motions) -> String {
    if motions.graph.is_empty() {
        return "# The motions: the built-in moves. Your own: `corybant import`, or `corybant build FOLDER -o show.graph`.\n\
                [graph]\n# file = \"show.graph\"\n\n"
            .into();
    }
    format!(
        "# The motions: a graph made by `corybant build`.\n[graph]\nfile = {}\n\n",
        quoted(&motions.graph)
    )
}

/// Returns the output for `renderer`, and OSC cues at another port if both would have the same one.
fn output(renderer: &Renderer) -> String {
    let port = renderer.to.rsplit(':').next().unwrap_or_default();
    let mut text = format!(
        "# {}. {}\n# offset_ms is the time by which poses are sent before the sound.\n[[output]]\nkind = {}\nto = {}\noffset_ms = 0\n\n",
        renderer.name,
        renderer.hint.replace("{port}", port),
        quoted(renderer.kind.name()),
        quoted(renderer.to)
    );
    if renderer.to.ends_with(OSC_PORT) {
        text += "# Cues by OSC, beside the port of the renderer.\n[osc]\nlisten = \"127.0.0.1:9010\"\n\n";
    }
    text
}

/// Returns the controller at `port` with a pad for each of the first labels, or an example in
/// comments.
fn pads(port: &str, motions: &Motions) -> String {
    let built_in = || LABELS.map(String::from).to_vec();
    let labels = match motions.graph.is_empty() {
        true => built_in(),
        false => motions.labels.clone(),
    };
    let mut text = String::from("# Pads of a MIDI controller; *learn* on the page adds more.\n");
    if port.is_empty() {
        text += "# [[midi]]\n# port = \"Launchpad\"      # `corybant devices` lists the ports\n# [[midi.map]]\n# note = 36\n# label = \"salsa\"\n\n";
        return text;
    }
    text += &format!("[[midi]]\nport = {}\n", quoted(port));
    for (note, label) in (FIRST_NOTE..).zip(&labels) {
        text += &format!("[[midi.map]]\nnote = {note}\nlabel = {}\n", quoted(label));
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::daemon::setup::choices::RENDERERS;

    fn answers(renderer: &'static Renderer) -> Answers {
        Answers {
            input: "my \"desk\" \\ 2".into(),
            renderer,
            motions: Motions::default(),
            port: "Pad's \"X\"".into(),
            page: "0.0.0.0:8710".into(),
        }
    }

    #[test]
    fn every_answer_gives_a_show_file_without_problems() {
        let labels = corybant_repertoire::graph().unwrap().labels;
        for renderer in RENDERERS {
            let text = text(&answers(renderer), "show.toml");
            let config =
                Config::parse("show.toml", &text).unwrap_or_else(|error| panic!("{error}\n{text}"));
            assert_eq!(config.audio.input, "my \"desk\" \\ 2");
            assert_eq!(config.output[0].kind, renderer.kind);
            assert_eq!(
                (config.midi[0].port.as_str(), config.midi[0].map.len()),
                ("Pad's \"X\"", 8)
            );
            assert_eq!(config.page.listen, "0.0.0.0:8710");
            let mut problems = Vec::new();
            config.check_labels(&labels, &mut problems);
            assert_eq!(problems, [""; 0]);
        }
    }

    #[test]
    fn the_examples_in_comments_are_valid() {
        let plain = Answers {
            port: String::new(),
            ..answers(&RENDERERS[0])
        };
        let text = text(&plain, "show.toml");
        let uncommented: String = text
            .lines()
            .map(|line| {
                let example = line
                    .strip_prefix("# ")
                    .filter(|rest| rest.starts_with('[') || rest.split(' ').nth(1) == Some("="));
                example.unwrap_or(line).to_owned() + "\n"
            })
            .collect();
        let config = Config::parse("show.toml", &uncommented)
            .unwrap_or_else(|error| panic!("{error}\n{uncommented}"));
        assert_eq!((config.scene.len(), config.midi.len()), (1, 1));
        assert_eq!(config.graph.file.to_str(), Some("show.graph"));
    }

    #[test]
    fn a_graph_brings_its_own_labels() {
        let own = Answers {
            motions: Motions {
                graph: "my.graph".into(),
                labels: vec!["waltz".into()],
            },
            ..answers(&RENDERERS[0])
        };
        let config = Config::parse("show.toml", &text(&own, "show.toml")).unwrap();
        assert_eq!(config.midi[0].map.len(), 1);
        assert_eq!(config.midi[0].map[0].label, "waltz");
    }
}
