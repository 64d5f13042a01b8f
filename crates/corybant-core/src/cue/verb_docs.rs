//! Generates `docs/osc.md` from the table of all commands ([`VERBS`]). In: the table. Out:
//! Markdown. Thread: any.

use super::verbs::{READOUTS, Shape, VERBS, Verb};

const HEAD: &str = "\
# Commands and values

Generated from `crates/corybant-core/src/cue/verbs/table.rs` by

```
CORYBANT_WRITE_DOCS=1 cargo test -p corybant-core verb_docs
```

`LABEL` stands for a label of the motion graph. In an OSC address its name is in lower case, and every
character outside `a-z 0-9 _ -` is `_`; a second label of the same name gets the suffix `_2`. `SCENE` stands for a
`[[scene]]` of the show file, with the same rules for its name.

## Commands

A button is pressed by a number above 0 or by a message without an argument, and released by 0. An
address may be an OSC pattern, such as `/cue/*/cancel`, as long as it matches one kind of command.
The texts that begin with `!` stand in the `label` of a `[[midi.map]]`; those of the dance also in
a cue list. In a `[[midi.map]]` the options of a label are keys: `mode = \"gate\"`.

| OSC address | argument | MIDI map or cue list | page message | effect |
|---|---|---|---|---|
";

const TAKES: &str = r#"
## Takes

In a show with a show file and a `[[motion_in]]`, these messages record its first live performer; see
`docs/show-file.md`. The page shows the state in its message `take`.

| OSC address | arguments | MIDI map | page message | effect |
|---|---|---|---|---|
| `/record/start` | label, beats (1 to 256, may be left out) | `label = "mine"`, `record = true`, `beats = 16`; a second press stops | `{"record":{"label":"mine","beats":16}}` | record a take from a start of a bar on, after a count-in |
| `/record/stop` | nothing, or a number above 0 | `!record_stop` | `{"record_stop":true}` | stop the take; during the count-in, drop it |
| `/record/undo` | nothing, or a number above 0 | `!record_undo` | `{"record_undo":true}` | remove the last take from the show, then the one before it; motion files stay |
| `/record/rename` | label | – | `{"record_rename":"yours"}` | give the last take another label |
"#;

const READOUT_HEAD: &str = "
## Values

A control surface that has sent a message receives the value of each of these addresses, at once and
after every change. The launch addresses below `/cue/LABEL/` report to surfaces that have used them.
OSCQuery serves the same values.

| OSC address | type | value |
|---|---|---|
";

/// Returns the text of `docs/osc.md`, the list of all commands and reported values, as Markdown.
pub fn markdown() -> String {
    let commands: String = VERBS.iter().map(command_row).collect();
    let own = VERBS.iter().filter_map(|verb| {
        verb.readout?;
        Some((verb.address?, verb.command.argument().shape(), verb.help))
    });
    let others = READOUTS
        .iter()
        .map(|readout| (readout.address, readout.shape, readout.help));
    let values: String = own
        .map(|(address, shape, _)| (address, shape, "the state of this command"))
        .chain(others)
        .map(|(address, shape, help)| format!("| `{address}` | {} | {help} |\n", words(shape)))
        .collect();
    format!("{HEAD}{commands}{TAKES}{READOUT_HEAD}{values}")
}

fn command_row(verb: &Verb) -> String {
    let code = |text: &str| match text {
        "" => "–".into(),
        // A `|` would end the cell of the Markdown table.
        text => format!("`{}`", text.replace('|', "\\|")),
    };
    format!(
        "| {} | {} | {} | {} | {} |\n",
        code(verb.address.unwrap_or_default()),
        verb.command.argument(),
        code(verb.text),
        code(verb.message),
        verb.help
    )
}

fn words(shape: Shape) -> String {
    match shape {
        Shape::Unit => "float, 0 to 1".into(),
        Shape::Number(min, max) => format!("float, {min} to {max}"),
        Shape::Count(i32::MAX) => "integer, from 0".into(),
        Shape::Count(max) => format!("integer, 0 to {max}"),
        Shape::Text => "text".into(),
        Shape::Section => {
            "text; integer, beats until the next section, -1 if unknown; float, confidence, 0 to 1"
                .into()
        }
        Shape::Place => "integer, from 1; integer, beats in the phrase".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_in_the_repository_is_the_generated_one() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/osc.md");
        let generated = markdown();
        if std::env::var_os("CORYBANT_WRITE_DOCS").is_some() {
            std::fs::write(path, &generated).unwrap();
        }
        let stored = std::fs::read_to_string(path).unwrap_or_default();
        assert!(
            stored == generated,
            "docs/osc.md is out of date: run `CORYBANT_WRITE_DOCS=1 cargo test -p corybant-core verb_docs`"
        );
    }

    #[test]
    fn every_row_of_the_commands_has_five_cells() {
        for row in VERBS.iter().map(command_row) {
            assert_eq!(row.replace("\\|", "").matches('|').count(), 6, "{row}");
        }
    }
}
