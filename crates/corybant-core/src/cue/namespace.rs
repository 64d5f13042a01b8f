//! The OSC addresses of one show: the table of all commands, with the labels and the scenes of the
//! show filled in.
//!
//! In: labels, scenes. Out: for each OSC address its command, its reported value and its type. Thread: any.
//!
//! OSC input, the feedback to control surfaces and OSCQuery all use this list. Each address has one
//! value, whose type never changes.

use std::collections::HashMap;

use super::verbs::{Command, LABEL, READOUTS, Readout, ReadoutAddress, SCENE, Shape, VERBS, Verb};
use super::{CueNames, osc_names};

/// The start of each OSC address that belongs to a label, such as `/cue/salsa`.
pub(crate) const CUE_PREFIX: &str = "/cue/";
/// The OSC address that starts a cue with default settings; `LABEL` is a placeholder for the name
/// of the label.
const PLAIN_LAUNCH: &str = "/cue/LABEL";

/// One OSC address of a show, with its command or the value that it reports.
#[derive(Clone, Debug, PartialEq)]
pub struct Address {
    /// The full OSC address, such as `/cue/salsa`.
    pub path: String,
    /// Type and range of the value that the address receives or reports.
    pub shape: Shape,
    /// The command that a message to the address sends; `None` if the address only reports a value.
    pub command: Option<Command>,
    /// The value that the address reports to control surfaces; `None` if it only receives commands.
    pub readout: Option<Readout>,
    /// True if the value is reported only to control surfaces that have sent a message to this
    /// address. False if the value is reported to all control surfaces.
    pub when_used: bool,
    /// Help text for the address, in one phrase.
    pub help: String,
}

/// All OSC addresses of a show.
#[derive(Clone, Debug)]
pub struct Namespace {
    /// All OSC addresses, in the order in which their values are reported.
    addresses: Vec<Address>,
    /// For each full OSC address, its index in `addresses`.
    by_path: HashMap<String, usize>,
    /// For each label, its name in OSC addresses, such as `hip_hop`.
    names: Vec<String>,
}

impl Namespace {
    /// Creates all OSC addresses of a show without scenes; `labels[i]` is the name of label `i`.
    pub fn new(labels: &[String]) -> Self {
        Self::of(labels.into())
    }

    /// Creates all OSC addresses of a show with the labels and scenes in `names`. The addresses of
    /// the labels come last, so further labels at the end only add addresses at the end.
    pub fn of(show: CueNames) -> Self {
        let names = osc_names(show.labels);
        let verbs = VERBS.iter().filter_map(|verb| of_verb(verb, None));
        let readouts = READOUTS
            .iter()
            .filter_map(|readout| of_readout(readout, None));
        let mut addresses: Vec<Address> = verbs.chain(readouts).collect();
        let scene_names = osc_names(show.scenes);
        let scenes = named(SCENE, show.scenes, &scene_names);
        for owner in scenes.chain(named(LABEL, show.labels, &names)) {
            let verbs = VERBS.iter().filter_map(|verb| of_verb(verb, Some(&owner)));
            let readouts = READOUTS
                .iter()
                .filter_map(|readout| of_readout(readout, Some(&owner)));
            addresses.extend(verbs.chain(readouts));
        }
        let by_path = addresses
            .iter()
            .enumerate()
            .map(|(i, address)| (address.path.clone(), i))
            .collect();
        Self {
            addresses,
            by_path,
            names,
        }
    }

    /// Returns all OSC addresses of the show. Other modules refer to an OSC address by its index in
    /// this list.
    pub fn all(&self) -> &[Address] {
        &self.addresses
    }

    /// Returns the index in [`Namespace::all`] of the OSC address `path`; `None` if the show does
    /// not have it.
    pub fn find(&self, path: &str) -> Option<usize> {
        self.by_path.get(path).copied()
    }

    /// Returns, for each label, the OSC address that starts a cue with default settings, such as
    /// `/cue/salsa`.
    pub fn triggers(&self) -> impl Iterator<Item = String> {
        self.names.iter().map(|name| format!("{CUE_PREFIX}{name}"))
    }

    /// Returns all OSC addresses that accept commands, as one line for an error message. `LABEL`
    /// stands for the name of any label.
    pub fn commands_in_words(&self) -> String {
        let addresses = || VERBS.iter().filter_map(|verb| verb.address);
        let launches: Vec<&str> = addresses()
            .filter_map(|address| address.strip_prefix(PLAIN_LAUNCH)?.strip_prefix('/'))
            .collect();
        let others: Vec<&str> = addresses()
            .filter(|address| !address.starts_with(CUE_PREFIX))
            .collect();
        format!(
            "{PLAIN_LAUNCH}, {PLAIN_LAUNCH}/{{{}}}, {}",
            launches.join(","),
            others.join(", ")
        )
    }
}

/// A label (kind of motion, such as `salsa`) or a scene of the show, with its name in OSC addresses.
struct Owner<'a> {
    /// [`LABEL`] or [`SCENE`], for which the name stands.
    placeholder: &'static str,
    /// The index in the list of all labels, or of all scenes.
    number: u16,
    /// The name as spelled in the motion graph or in the show file.
    name: &'a str,
    /// The name in OSC addresses, such as `hip_hop`.
    osc_name: &'a str,
}

/// Returns the labels or scenes `names`, whose names in OSC addresses are `osc_names`.
fn named<'a>(
    placeholder: &'static str,
    names: &'a [String],
    osc_names: &'a [String],
) -> impl Iterator<Item = Owner<'a>> {
    let each = (0..).zip(names.iter().zip(osc_names));
    each.map(move |(number, (name, osc_name))| Owner {
        placeholder,
        number,
        name,
        osc_name,
    })
}

/// Returns the placeholder in the OSC address `template`; `None` if it has none.
fn placeholder_in(template: &str) -> Option<&'static str> {
    [LABEL, SCENE].into_iter().find(|it| template.contains(it))
}

/// Returns `template` with `name` in place of the placeholder of `owner`.
fn filled(template: &str, owner: Option<&Owner>, name: impl Fn(&Owner) -> String) -> String {
    match owner {
        Some(owner) => template.replacen(owner.placeholder, &name(owner), 1),
        None => template.into(),
    }
}

/// Creates the OSC address of the command `verb`, for `owner` if it is given. Returns `None` if the
/// command has no OSC address. Also returns `None` if the address needs another owner.
fn of_verb(verb: &Verb, owner: Option<&Owner>) -> Option<Address> {
    let wanted = owner.map(|owner| owner.placeholder);
    let template = verb
        .address
        .filter(|address| placeholder_in(address) == wanted)?;
    let number = owner.map_or(0, |owner| owner.number);
    let is_launch = wanted == Some(LABEL) && verb.readout.is_some();
    Some(Address {
        path: filled(template, owner, |it| it.osc_name.into()),
        shape: verb.command.argument().shape(),
        command: Some(verb.command.with_label(number).with_scene(number)),
        readout: verb
            .readout
            .map(|readout| readout.with_label(number).with_scene(number)),
        when_used: is_launch && template != PLAIN_LAUNCH,
        help: filled(verb.help, owner, |it| it.name.into()),
    })
}

/// Creates the OSC address that reports the value `readout`, for `owner` if it is given. Returns
/// `None` if the address needs another owner.
fn of_readout(readout: &ReadoutAddress, owner: Option<&Owner>) -> Option<Address> {
    let wanted = owner.map(|owner| owner.placeholder);
    let template = Some(readout.address).filter(|it| placeholder_in(it) == wanted)?;
    let number = owner.map_or(0, |owner| owner.number);
    Some(Address {
        path: filled(template, owner, |it| it.osc_name.into()),
        shape: readout.shape,
        command: None,
        readout: Some(readout.readout.with_label(number).with_scene(number)),
        when_used: false,
        help: filled(readout.help, owner, |it| it.name.into()),
    })
}

#[cfg(test)]
mod tests {
    use super::super::launch::{Launch, Quantise};
    use super::super::{Cue, DanceCommand};
    use super::*;

    #[test]
    fn every_address_exists_once_and_has_help_and_a_purpose() {
        let namespace = Namespace::new(&["Salsa", "Hip Hop", "hip/hop"].map(String::from));
        for (i, address) in namespace.all().iter().enumerate() {
            let path = &address.path;
            assert_eq!(namespace.find(path), Some(i), "{path} exists twice");
            assert!(path.starts_with('/') && !address.help.is_empty(), "{path}");
            assert!(
                address.command.is_some() || address.readout.is_some(),
                "{path} has no purpose"
            );
            assert!(
                path.bytes()
                    .all(|c| matches!(c, b'a'..=b'z' | b'0'..=b'9' | b'_' | b'-' | b'/')),
                "{path}"
            );
        }
        let at = |path: &str| &namespace.all()[namespace.find(path).unwrap()];
        let launch =
            |launch: Launch| Some(Command::Button(Cue::Dance(DanceCommand::Launch(launch))));
        assert_eq!(at("/cue/hip_hop_2").command, launch(Launch::plain(2)));
        assert_eq!(at("/cue/hip_hop_2").help, "dance hip/hop for 8 beats");
        assert_eq!(
            (
                at("/cue/salsa/lamp").shape.tags(),
                at("/cue/salsa").shape.tags(),
                at("/state/clip").shape.tags()
            ),
            ("i", "f", "s")
        );
        assert_eq!(
            at("/cue/salsa/4bars").command,
            launch(Launch {
                quantise: Quantise::Bars4,
                ..Launch::plain(0)
            })
        );
        assert_eq!(
            at("/cue/salsa/avoid").command,
            launch(Launch {
                avoid: true,
                ..Launch::plain(0)
            })
        );
        assert_eq!(
            at("/cue/salsa/queue").command,
            launch(Launch {
                queued: true,
                ..Launch::plain(0)
            })
        );
    }

    #[test]
    fn the_order_of_the_addresses_of_a_label_stays_the_same() {
        let namespace = Namespace::new(&["salsa".to_owned()]);
        let paths: Vec<&str> = namespace.all().iter().map(|a| a.path.as_str()).collect();
        let label = paths
            .iter()
            .position(|path| path.starts_with("/cue/"))
            .unwrap();
        let paths = &paths[label..];
        assert_eq!(
            (paths[0], paths[1], paths[14], paths[15]),
            (
                "/cue/salsa",
                "/cue/salsa/trigger",
                "/cue/salsa/cancel",
                "/cue/salsa/lamp"
            )
        );
        assert_eq!(paths.len(), 16, "the addresses of labels come last");
        let two = Namespace::new(&["salsa".to_owned(), "pop".to_owned()]);
        assert_eq!(two.all()[..namespace.all().len()], *namespace.all());
    }

    #[test]
    fn scenes_have_addresses_before_the_labels() {
        let (labels, scenes) = (["calm".to_owned()], ["Big Beat", "calm"].map(String::from));
        let names = |labels| CueNames {
            labels,
            scenes: &scenes,
        };
        let namespace = Namespace::of(names(&labels));
        let at = |path: &str| &namespace.all()[namespace.find(path).unwrap()];
        let calm = at("/scene/calm");
        assert_eq!(calm.command, Some(Command::Button(Cue::Scene(Some(1)))));
        assert_eq!(calm.readout, Some(Readout::Scene(1)));
        assert_eq!(at("/scene/big_beat").help, "recall the scene Big Beat");
        assert!(!calm.when_used);
        let without = Namespace::of(names(&[]));
        assert_eq!(namespace.all()[..without.all().len()], *without.all());
    }

    #[test]
    fn the_list_of_commands_fits_on_one_line() {
        let words = Namespace::new(&["salsa".to_owned()]).commands_in_words();
        assert!(
            words.starts_with("/cue/LABEL, /cue/LABEL/{trigger,gate,"),
            "{words}"
        );
        for address in [
            "/panic",
            "/hold",
            "/tempo/tap",
            "/offset",
            "/sync",
            ",cancel}",
        ] {
            assert!(words.contains(address), "{address} is not in {words}");
        }
        assert!(!words.contains("/beat/phase"), "{words}");
    }
}
