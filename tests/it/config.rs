//! Tests of show files: the sample files are correct, and all problems are reported at once.
#![allow(clippy::unwrap_used, missing_docs)]

use corybant::config::Config;

const REFERENCE: &str = include_str!("../../config/reference.toml");
const SHOW: &str = include_str!("../../config/show.toml");

fn problems(text: &str) -> Vec<String> {
    Config::parse("show.toml", text).unwrap_err().problems
}

#[test]
fn the_reference_holds_the_defaults_and_nothing_else() {
    assert_eq!(
        Config::parse("reference.toml", REFERENCE).unwrap(),
        Config::default()
    );
}

/// Appends every key below the TOML value `value` to `found`, as `section.key`. `prefix` is the
/// path of `value`, which ends with a dot.
fn keys(prefix: &str, value: &toml::Value, found: &mut Vec<String>) {
    match value {
        toml::Value::Table(table) => {
            for (key, value) in table {
                found.push(format!("{prefix}{key}"));
                keys(&format!("{prefix}{key}."), value, found);
            }
        }
        toml::Value::Array(items) => items.iter().for_each(|item| keys(prefix, item, found)),
        _ => {}
    }
}

#[test]
fn the_reference_names_every_key() {
    let (mut written, mut there) = (Vec::new(), Vec::new());
    keys("", &toml::from_str(REFERENCE).unwrap(), &mut written);
    keys(
        "",
        &toml::Value::try_from(Config::default()).unwrap(),
        &mut there,
    );
    let lists = ["midi", "dmx_in", "clock_out", "motion_in", "scene", "song"];
    there.retain(|key| !lists.contains(&key.as_str()));
    written.sort();
    there.sort();
    assert_eq!(written, there);
}

#[test]
fn the_sample_show_is_allowed() {
    let show = Config::parse("show.toml", SHOW).unwrap();
    assert_eq!(show.output.len(), 2);
    // The settings in its comments are valid too.
    let uncommented: String = SHOW
        .lines()
        .map(|line| {
            line.strip_prefix("# ")
                .filter(|line| !line.starts_with("A show"))
                .unwrap_or(line)
                .to_owned()
                + "\n"
        })
        .collect();
    let show = Config::parse("show.toml", &uncommented).unwrap();
    assert_eq!(
        (show.midi.len(), show.graph.file.to_str()),
        (1, Some("show.graph"))
    );
}

#[test]
fn all_problems_are_reported_at_once() {
    let text = "[audio]\ninput = 3\nchanels = [1]\n\n[plan]\nhorizon_beats = 1\n\n[[output]]\nkind = \"vmc\"\nrate_hz = 1000\ndancer = \"nobody\"\n\n[page]\nlisten = \"everywhere\"\n";
    let found = problems(text);
    assert_eq!(found.len(), 6, "{found:#?}");
    for (part, problem) in [
        "show.toml:2: invalid type",
        "show.toml:3: unknown field `chanels`",
    ]
    .iter()
    .zip(&found)
    {
        assert!(problem.starts_with(part), "{problem}");
    }
    for part in [
        "plan.horizon_beats is 1",
        "output 1.rate_hz is 1000",
        "output 1.dancer is \"nobody\"",
        "page.listen is \"everywhere\"",
    ] {
        assert!(
            found.iter().any(|problem| problem.contains(part)),
            "{part} is missing in {found:#?}"
        );
    }
}

#[test]
fn an_output_that_sends_to_the_osc_input_is_reported() {
    let vrchat = "[[output]]\nkind = \"vrchat\"\n";
    let found = problems(vrchat);
    assert!(
        found.len() == 1
            && found[0].contains("output 1 sends to 127.0.0.1:9000, where osc.listen hears cues"),
        "{found:#?}"
    );
    for (listen, heard) in [
        ("127.0.0.1:9010", false),
        ("0.0.0.0:9000", true),
        ("192.168.7.7:9000", false),
        ("127.0.0.1:0", false),
    ] {
        let text = format!("{vrchat}[osc]\nlisten = \"{listen}\"\n");
        assert_eq!(
            Config::parse("show.toml", &text).is_err(),
            heard,
            "{listen}"
        );
    }
}

#[test]
fn invalid_toml_is_reported_with_its_line() {
    let found = problems("[audio]\ninput = \"default\n");
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].starts_with("show.toml:2: "), "{}", found[0]);
}

#[test]
fn an_unknown_section_is_reported() {
    let found = problems(
        "[lights]\ncolour = \"red\"\n[lights.left]\nx = 1\n[plan]\nhorizon_beats = 1\n[page]\nlisten = 3\n",
    );
    assert_eq!(found.len(), 3, "{found:#?}");
    assert!(
        found[0].starts_with("show.toml:1: unknown field `lights`"),
        "{found:#?}"
    );
    assert!(
        found[1].starts_with("show.toml:8: invalid type"),
        "{found:#?}"
    );
    assert!(found[2].contains("plan.horizon_beats is 1"), "{found:#?}");
}

#[test]
fn no_problem_hides_another() {
    let wrong = [
        // A key is missing.
        (
            "[[midi]]\nport = \"pad\"\n[[midi.map]]\nnote = 3\n[[midi.map]]\nlabel = \"salsa\"\n",
            &[
                "missing field `label`",
                "exactly one of note, cc and program",
            ][..],
        ),
        // One table instead of a list of tables, and the keys below it.
        (
            "[midi]\nport = \"pad\"\n[[midi.map]]\nnote = 3\n",
            &["invalid type: map"],
        ),
        // A value on several lines.
        (
            "[audio]\nchanels = [\n  1,\n  2,\n]\n",
            &["unknown field `chanels`"],
        ),
        (
            "[audio]\nchannels = [\n  \"left\",\n  2,\n]\n",
            &["invalid type: string \"left\""],
        ),
        (
            "[audio]\ninput = [\n[1],\n[2]]\n",
            &["invalid type: sequence"],
        ),
        // Lines that only look like sections.
        (
            "[[dancer]]\nhome = [\n  1,\n[2],\n]\n",
            &["invalid type: sequence"],
        ),
    ];
    for (text, expected) in wrong {
        let found = problems(&format!(
            "{text}[tempo]\nbeats_per_bar = 7\n[page]\nlisten = \"everywhere\"\n"
        ));
        for part in expected
            .iter()
            .chain(&["tempo.beats_per_bar is 7", "page.listen is \"everywhere\""])
        {
            assert!(
                found.iter().any(|problem| problem.contains(part)),
                "{part} is missing in {found:#?}"
            );
        }
        assert_eq!(found.len(), expected.len() + 2, "{found:#?}");
    }
}

#[test]
fn feedback_to_the_shows_own_listener_is_refused_with_its_line() {
    let other = corybant::osc::input::own_address::local_addresses()
        .into_iter()
        .find(|ip| ip.is_ipv4() && !ip.is_loopback())
        .map(|ip| format!("{ip}:9000"));
    let own = ["127.0.0.1:9000", "localhost:9000", "0.0.0.0:9000"].map(String::from);
    for to in own.into_iter().chain(other) {
        let text = format!(
            "[osc]\nlisten = \"0.0.0.0:9000\"\nfeedback = [\n  \"127.0.0.1:9001\",\n  \"{to}\",\n]\n"
        );
        let problems = Config::parse("show.toml", &text).unwrap_err().problems;
        assert_eq!(problems.len(), 1, "{problems:?}");
        let start = format!("show.toml:5: osc.feedback holds \"{to}\"");
        assert!(problems[0].starts_with(&start), "{problems:?}");
        assert!(problems[0].contains(
            "so that its feedback would come back to it; set the address and port of the receiver"
        ));
    }
    let text = "[osc]\nlisten = \"127.0.0.1:9000\"\nfeedback = [\"192.0.2.7:9000\"]\n";
    assert!(Config::parse("show.toml", text).is_ok());
}

#[test]
fn a_performer_needs_an_input_of_its_own_and_a_dancer() {
    let show = |text: &str| Config::parse("show.toml", text);
    let good = "[[dancer]]\npass = [\"head\", \"face\"]\n[[motion_in]]\n";
    assert_eq!(show(good).unwrap().motion_in[0].listen, "127.0.0.1:39540");
    // A recording contains the dance alone.
    let alone = show(&show(good).unwrap().danced_by().unwrap()).unwrap();
    assert!(alone.motion_in.is_empty() && alone.dancer[0].pass.is_empty());
    for (text, wanted) in [
        (
            "[[dancer]]\npass = [\"head\"]\n",
            "dancer 1.pass is set, but no [[motion_in]]",
        ),
        (
            "[[dancer]]\npass = [\"tail\"]\n[[motion_in]]\n",
            "unknown variant `tail`",
        ),
        (
            "[[motion_in]]\ndancer = \"nobody\"\n",
            "motion_in 1.dancer is \"nobody\": there is lead",
        ),
        (
            "[[dancer]]\npass = [\"head\"]\n[[motion_in]]\n[[motion_in]]\n",
            "motion_in 2 moves the same dancer",
        ),
        (
            "[[dancer]]\npass = [\"head\"]\n[[motion_in]]\nlisten = \"here\"\n",
            "motion_in 1.listen is \"here\"; it must be HOST:PORT",
        ),
        (
            "[[dancer]]\npass = [\"head\"]\n[[motion_in]]\nlisten = \"0.0.0.0:39539\"\n",
            "an output sends to 127.0.0.1:39539, where motion_in 1.listen receives",
        ),
    ] {
        let found = problems(text).join("\n");
        assert!(found.contains(wanted), "{text}: {found}");
    }
}

#[test]
fn dmx_inputs_are_read_and_their_problems_have_lines() {
    let text = "[[dmx_in]]\nuniverse = 20\ninterface = \"10.0.0.1\"\n[[dmx_in.patch]]\nchannel = 1\nlabels = [\"salsa\", \"pop\"]\n\
                [[dmx_in.patch]]\nchannel = 2\nlabel = \"!intensity\"\n[[dmx_in]]\nprotocol = \"art-net\"\nuniverse = 0\nlisten = \"0.0.0.0\"\n";
    let show = Config::parse("show.toml", text).unwrap();
    assert_eq!(
        (show.dmx_in.len(), show.dmx_in[0].patch.len()),
        (2, 2),
        "{:?}",
        show.dmx_in
    );
    let listen = show.dmx_in[1].listen_addr().unwrap();
    assert_eq!(listen.to_string(), "0.0.0.0:6454");
    let mut missing = Vec::new();
    show.check_labels(&["salsa".to_owned()], &mut missing);
    assert!(
        missing[0].starts_with("dmx_in 1.patch 1 asks for the label \"pop\""),
        "{missing:?}"
    );
    for (wrong, part) in [
        (
            "universe = 0",
            "show.toml:2: dmx_in 1.universe is 0; for \"sacn\" it must be from 1 to 63999",
        ),
        (
            "protocol = \"art-net\"\nuniverse = 32768",
            "show.toml:3: dmx_in 1.universe is 32768; for \"art-net\" it must be from 0 to 32767",
        ),
        (
            "listen = \"here\"",
            "show.toml:2: dmx_in 1.listen is \"here\"; it must be an IP address",
        ),
        (
            "interface = \"eth0\"",
            "show.toml:2: dmx_in 1.interface is \"eth0\"; it must be an IPv4 address",
        ),
        (
            "protocol = \"art-net\"\ninterface = \"10.0.0.1\"",
            "show.toml:3: dmx_in 1.interface is \"10.0.0.1\", but Art-Net has no multicast",
        ),
        (
            "[[dmx_in.patch]]\nchannel = 1\nlabels = [\"a\"]\n[[dmx_in.patch]]\nchannel = 1\nfrom = 19\nlabel = \"b\"",
            "show.toml:5: dmx_in 1.patch 2 has the levels 19 to 255 of channel 1, which overlap 10 to 19 of dmx_in 1.patch 1",
        ),
        (
            "[[dmx_in.patch]]\nchannel = 600\nlabel = \"a\"",
            "show.toml:3: dmx_in 1.patch 1.channel is 600; it must be from 1 to 512",
        ),
        (
            "[[dmx_in]]",
            "show.toml:2: dmx_in 2.universe is 1 of sacn again: move its patch to dmx_in 1",
        ),
    ] {
        let found = problems(&format!("[[dmx_in]]\n{wrong}\n"));
        assert!(
            found.len() == 1 && found[0].contains(part),
            "{wrong}: {found:#?}"
        );
    }
}

#[test]
fn timecode_needs_a_source_that_exists() {
    for right in [
        "source = \"ltc:2\"\nrate = \"29.97df\"\noffset = \"01:00:00:00\"",
        "source = \"mtc:jack:\"",
        "source = \"art-net:127.0.0.1\"\nengage = false",
        "source = \"osc\"\noffset = \"12.5\"",
    ] {
        let show = format!("[timecode]\n{right}\n");
        let show = Config::parse("show.toml", &show).unwrap();
        assert!(show.timecode.is_on(), "{right}");
    }
    for (wrong, part) in [
        ("source = \"ltc:0\"", "show.toml:2: the source is \"ltc:0\""),
        (
            "source = \"mtc\"",
            "timecode.source is \"mtc\", the port of tempo.midi_clock",
        ),
        ("source = \"mtc:Desk\"", "timecode.source is \"Desk\""),
        (
            "rate = \"60\"",
            "the frame rate is \"60\"; allowed are auto",
        ),
        ("offset = \"1 hour\"", "the offset is \"1 hour\""),
        ("freewheel_frames = 901", "timecode.freewheel_frames is 901"),
        (
            "source = \"ltc:2\"\n[audio]\nchannels = [2]",
            "audio.channels has 2",
        ),
        (
            "[tempo]\nsource = \"timecode\"",
            "tempo.source is \"timecode\", but timecode.source",
        ),
    ] {
        let found = problems(&format!("[timecode]\n{wrong}\n"));
        assert!(
            found.len() == 1 && found[0].contains(part),
            "{wrong}: {found:#?}"
        );
    }
}
