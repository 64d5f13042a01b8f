//! The Chataigne module (`integrations/chataigne`): its files fit together, and every address that
//! they name belongs to the show.
#![allow(clippy::unwrap_used, missing_docs)]

use corybant_core::cue::namespace::Namespace;
use serde_json::Value;

const MODULE: &str = include_str!("../../integrations/chataigne/module.json");
const SCRIPT: &str = include_str!("../../integrations/chataigne/script.js");
/// The start of the addresses that the script completes with a label.
const CUE: &str = "/cue/";

fn module() -> Value {
    serde_json::from_str(MODULE).unwrap()
}

/// Returns the texts of the script that begin with `/`.
fn paths() -> Vec<&'static str> {
    let texts = SCRIPT.split('"').skip(1).step_by(2);
    texts.filter(|text| text.starts_with('/')).collect()
}

#[test]
fn every_address_belongs_to_the_show() {
    let namespace = Namespace::new(&["salsa".to_owned()]);
    let (mut endings, mut addresses) = (vec!["/cancel"], Vec::new());
    let module = module();
    let launches = module["commands"]["Dance"]["parameters"]["Launch"]["options"].as_object();
    endings.extend(
        launches
            .unwrap()
            .values()
            .map(|ending| ending.as_str().unwrap()),
    );
    assert_eq!(endings.len(), 12);
    for path in paths() {
        match path {
            CUE | "/cancel" => {}
            path => addresses.push(path.to_owned()),
        }
    }
    assert!(addresses.len() > 25, "{addresses:?}");
    addresses.extend(endings.iter().map(|ending| format!("{CUE}salsa{ending}")));
    for address in addresses {
        assert!(namespace.find(&address).is_some(), "{address}");
    }
}

#[test]
fn every_command_has_its_function_and_every_value_its_message() {
    let module = module();
    for (name, command) in module["commands"].as_object().unwrap() {
        let callback = command["callback"].as_str().unwrap();
        let parameters = command["parameters"].as_object().unwrap();
        let start = SCRIPT.find(&format!("function {callback}("));
        let start = start.unwrap_or_else(|| panic!("{name} calls {callback}"));
        let list = SCRIPT[start..].split(['(', ')']).nth(1).unwrap();
        let taken = list
            .split(',')
            .filter(|name| !name.trim().is_empty())
            .count();
        let is_ignored = taken == 0 && parameters.contains_key("Trigger");
        assert!(is_ignored || taken == parameters.len(), "{name}");
    }
    for name in module["values"].as_object().unwrap().keys() {
        let set = format!("local.values.{}.set(", name.to_lowercase());
        assert!(SCRIPT.contains(&set), "{name}");
    }
    let sources = &module["commands"]["Source"]["parameters"]["Source"]["options"];
    for name in sources.as_object().unwrap().keys() {
        let source = corybant_core::tempo::source::TempoSource::named(name);
        assert!(source.is_some(), "{name}");
    }
}
