//! Tests of layouts: other readers read them, and every address belongs to the show.

use std::io::Read;

use flate2::read::ZlibDecoder;
use serde_json::Value;

use super::*;
use corybant_core::cue::namespace::Namespace;

/// Names that need escapes in XML, JSON and the scripts of Open Stage Control.
fn hostile() -> Vec<String> {
    let names = [
        "salsa",
        "lead/Hip Hop",
        "<b>]]>&'\"",
        "JS{{run()}}",
        "tab\there\u{1}",
        "ü\u{ffff}",
    ];
    names.map(String::from).into()
}

fn many() -> Vec<String> {
    (0..70).map(|number| format!("label {number}")).collect()
}

fn written(kind: Kind, labels: &[String]) -> Vec<u8> {
    let dancers = ["lead".to_owned()];
    let colours = [("pads".to_owned(), "#58d68d".to_owned())].into();
    let names = ShowNames {
        labels,
        dancers: &dancers,
        colours,
    };
    file(kind, &names).unwrap()
}

fn unpacked(labels: &[String]) -> String {
    let mut xml = String::new();
    let bytes = written(Kind::TouchOsc, labels);
    ZlibDecoder::new(&bytes[..])
        .read_to_string(&mut xml)
        .unwrap();
    xml
}

/// Checks that each address is one of the show, and that each pad and each other control is there.
fn check_addresses(addresses: &[String], labels: &[String]) {
    let namespace = Namespace::new(labels);
    for address in addresses {
        assert!(namespace.find(address).is_some(), "{address}");
    }
    let expected = [
        "/intensity",
        "/hold",
        "/panic",
        "/release",
        "/tempo/tap",
        "/tempo/bpm",
        "/state/clip",
    ];
    for address in expected
        .map(String::from)
        .into_iter()
        .chain(namespace.triggers())
    {
        let count = addresses.iter().filter(|other| **other == address).count();
        assert_eq!(count, 1, "{address}");
    }
}

#[test]
fn an_xml_reader_reads_the_touchosc_layout() {
    for labels in [hostile(), many(), Vec::new()] {
        let xml = unpacked(&labels);
        let document = roxmltree::Document::parse(&xml).unwrap();
        assert_eq!(document.root_element().tag_name().name(), "lexml");
        assert_eq!(document.root_element().attribute("version"), Some("3"));
        let nodes = || {
            document
                .descendants()
                .filter(|node| node.has_tag_name("node"))
        };
        let mut ids: Vec<_> = nodes().map(|node| node.attribute("ID").unwrap()).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(
            ids.len(),
            nodes().count(),
            "each node has its own identifier"
        );
        let paths = document
            .descendants()
            .filter(|node| node.has_tag_name("path"));
        let addresses: Vec<String> = paths
            .map(|path| {
                let value = path.descendants().find(|node| node.has_tag_name("value"));
                value.unwrap().text().unwrap().to_owned()
            })
            .collect();
        check_addresses(&addresses, &labels);
        let pagers = nodes().filter(|node| node.attribute("type") == Some("PAGER"));
        assert_eq!(pagers.count(), usize::from(labels.len() > 32));
    }
    let xml = unpacked(&hostile());
    let document = roxmltree::Document::parse(&xml).unwrap();
    let texts: Vec<String> = document
        .descendants()
        .filter(|node| node.has_tag_name("default"))
        .map(|node| node.children().filter_map(|part| part.text()).collect())
        .collect();
    for name in ["salsa", "<b>]]>&'\"", "tab\\there\\u{1}", "ü"] {
        assert!(texts.iter().any(|text| text == name), "{name}: {texts:?}");
    }
}

/// Adds the addresses of `widget` and of all widgets in it to `found`.
fn collect(widget: &Value, found: &mut Vec<String>, ids: &mut Vec<String>) {
    found.extend(widget["address"].as_str().map(str::to_owned));
    ids.push(widget["id"].as_str().unwrap().to_owned());
    for list in ["widgets", "tabs"] {
        for inner in widget[list].as_array().into_iter().flatten() {
            collect(inner, found, ids);
        }
    }
}

#[test]
fn a_json_reader_reads_the_open_stage_control_session() {
    for labels in [hostile(), many(), Vec::new()] {
        let bytes = written(Kind::OpenStageControl, &labels);
        let session: Value = serde_json::from_slice(&bytes).unwrap();
        assert_eq!(
            (&session["type"], &session["content"]["type"]),
            (&"session".into(), &"root".into())
        );
        let (mut addresses, mut ids) = (Vec::new(), Vec::new());
        collect(&session["content"], &mut addresses, &mut ids);
        check_addresses(&addresses, &labels);
        let count = ids.len();
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), count, "each widget has its own identifier");
    }
    let text = String::from_utf8(written(Kind::OpenStageControl, &hostile())).unwrap();
    assert!(!text.contains("JS{{"), "a label is no script");
}

#[test]
fn pads_have_the_colours_of_their_groups_and_do_not_overlap() {
    let bytes = written(Kind::OpenStageControl, &hostile());
    let session: Value = serde_json::from_slice(&bytes).unwrap();
    let widgets = session["content"]["widgets"].as_array().unwrap();
    let pads = widgets.last().unwrap()["widgets"].as_array().unwrap();
    assert_eq!(
        (&pads[0]["label"], &pads[0]["colorWidget"]),
        (&"salsa".into(), &"#58d68d".into())
    );
    assert_eq!(
        pads[1]["colorWidget"], "#ce6542",
        "the colour of the first dancer"
    );
    let edges = |pad: &Value, start: &str, length: &str| {
        let start = pad[start].as_u64().unwrap();
        start..start + pad[length].as_u64().unwrap()
    };
    for (number, pad) in pads.iter().enumerate() {
        let (x, y) = (edges(pad, "left", "width"), edges(pad, "top", "height"));
        assert!(x.end <= 912 && y.end <= 672 && !x.is_empty() && !y.is_empty());
        for other in &pads[..number] {
            let (other_x, other_y) = (edges(other, "left", "width"), edges(other, "top", "height"));
            let is_apart = x.start >= other_x.end || other_x.start >= x.end;
            assert!(is_apart || y.start >= other_y.end || other_y.start >= y.end);
        }
    }
}
