//! The namespace (all OSC addresses of the show) as the JSON tree of OSCQuery. In: the namespace,
//! the values of all OSC addresses. Out: the tree node at a path as JSON, or one attribute of the
//! node, such as `VALUE`. Pure. Source: the OSCQuery proposal (Vidvox).

use std::collections::BTreeMap;

use serde_json::{Map, Value as Json, json};

use crate::osc::feedback::Value;
use corybant_core::cue::namespace::{Address, Namespace};
use corybant_core::cue::verbs::Shape;

/// The OSCQuery attributes that a node of the address tree may have.
const ATTRIBUTES: [&str; 7] = [
    "FULL_PATH",
    "CONTENTS",
    "TYPE",
    "ACCESS",
    "VALUE",
    "RANGE",
    "DESCRIPTION",
];

/// The reasons why a request for a node of the address tree gets no content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeError {
    /// The address tree has no node at the requested path (HTTP status 404).
    Path,
    /// OSCQuery has no attribute with the requested name (HTTP status 400).
    Attribute,
    /// The node at the requested path does not have the requested attribute (HTTP status 204).
    NoContent,
}

/// A node of the address tree: one part of an OSC address, and the nodes below it.
#[derive(Clone, Debug, Default)]
struct Node {
    /// Index in the namespace of the OSC address that ends at this node; `None` if the node only
    /// contains other nodes.
    address: Option<usize>,
    contents: BTreeMap<String, Node>,
}

/// The tree of all OSC addresses of a show.
#[derive(Clone, Debug)]
pub struct Tree {
    root: Node,
}

impl Tree {
    /// Creates the tree of all OSC addresses in `namespace`.
    pub fn new(namespace: &Namespace) -> Self {
        let mut root = Node::default();
        for (number, address) in namespace.all().iter().enumerate() {
            let mut node = &mut root;
            for part in parts(&address.path) {
                node = node.contents.entry(part.to_owned()).or_default();
            }
            node.address = Some(number);
        }
        Self { root }
    }

    /// Returns the node of the tree at `path`, with all nodes below it, as JSON. If `attribute` is
    /// given, returns only this attribute of the node. `values` has the current value of each OSC
    /// address.
    ///
    /// # Errors
    /// [`TreeError`] if the tree has no such path or the node has no such attribute.
    pub fn describe(
        &self,
        path: &str,
        attribute: Option<&str>,
        namespace: &Namespace,
        values: &[Value],
    ) -> Result<Json, TreeError> {
        let node = parts(path)
            .try_fold(&self.root, |node, part| node.contents.get(part))
            .ok_or(TreeError::Path)?;
        let full_path = format!("/{}", parts(path).collect::<Vec<_>>().join("/"));
        let mut attributes = node.to_json(&full_path, namespace, values);
        match attribute {
            None => Ok(Json::Object(attributes)),
            Some(name) if !ATTRIBUTES.contains(&name) => Err(TreeError::Attribute),
            Some(name) => attributes
                .remove(name)
                .map(|value| json!({ name: value }))
                .ok_or(TreeError::NoContent),
        }
    }

    /// Returns the OSC addresses to which a client subscribes with the path `path`, as indices in
    /// `namespace`. This is the OSC address at `path` if its value can be read. Otherwise these are
    /// all readable OSC addresses below `path`; there may be none.
    pub fn readable_addresses(&self, path: &str, namespace: &Namespace) -> Vec<usize> {
        let Some(node) = parts(path).try_fold(&self.root, |node, part| node.contents.get(part))
        else {
            return Vec::new();
        };
        let is_readable = |address: &usize| namespace.all()[*address].readout.is_some();
        if let Some(address) = node.address.filter(is_readable) {
            return vec![address];
        }
        let mut found = Vec::new();
        node.collect(&mut found);
        found.retain(is_readable);
        found
    }
}

impl Node {
    fn to_json(
        &self,
        full_path: &str,
        namespace: &Namespace,
        values: &[Value],
    ) -> Map<String, Json> {
        let mut json = Map::new();
        json.insert("FULL_PATH".into(), full_path.into());
        match self.address {
            Some(number) => add_method(&namespace.all()[number], values.get(number), &mut json),
            None => _ = json.insert("ACCESS".into(), 0.into()),
        }
        if !self.contents.is_empty() {
            let below = if full_path == "/" { "" } else { full_path };
            let contents = self.contents.iter().map(|(name, node)| {
                let node = node.to_json(&format!("{below}/{name}"), namespace, values);
                (name.clone(), Json::Object(node))
            });
            json.insert("CONTENTS".into(), Json::Object(contents.collect()));
        }
        json
    }

    fn collect(&self, found: &mut Vec<usize>) {
        found.extend(self.address);
        self.contents.values().for_each(|node| node.collect(found));
    }
}

fn parts(path: &str) -> impl Iterator<Item = &str> {
    path.split('/').filter(|part| !part.is_empty())
}

fn add_method(address: &Address, value: Option<&Value>, json: &mut Map<String, Json>) {
    let (read, write) = (address.readout.is_some(), address.command.is_some());
    json.insert("DESCRIPTION".into(), address.help.clone().into());
    json.insert("TYPE".into(), address.shape.tags().into());
    json.insert(
        "ACCESS".into(),
        (u8::from(read) + 2 * u8::from(write)).into(),
    );
    let range = match address.shape {
        Shape::Unit => Some(json!([{ "MIN": 0.0, "MAX": 1.0 }])),
        Shape::Number(min, max) => Some(json!([{ "MIN": min, "MAX": max }])),
        Shape::Count(max) => Some(json!([{ "MIN": 0, "MAX": max }])),
        Shape::Text => None,
        Shape::Section => Some(json!([
            {},
            { "MIN": -1, "MAX": i32::MAX },
            { "MIN": 0.0, "MAX": 1.0 },
        ])),
        Shape::Place => Some(json!([
            { "MIN": 1, "MAX": i32::MAX },
            { "MIN": 1, "MAX": i32::MAX },
        ])),
    };
    json.extend(range.map(|range| ("RANGE".to_owned(), range)));
    if let Some(value) = value.filter(|_| read) {
        json.insert("VALUE".into(), to_json(value));
    }
}

/// Converts a value of an OSC address to a JSON array of its arguments.
fn to_json(value: &Value) -> Json {
    match value {
        Value::Float(x) => json!([float(*x)]),
        Value::Int(n) => json!([n]),
        Value::Text(text) => json!([text]),
        Value::Section(name, beats, confidence) => json!([name, beats, float(*confidence)]),
        Value::Place(place, beats) => json!([place, beats]),
    }
}

/// Converts a float to JSON, with no more digits than are needed to distinguish it from other
/// floats.
fn float(x: f32) -> Json {
    x.to_string()
        .parse::<f64>()
        .map_or(Json::Null, |x| json!(x))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(path: &str, attribute: Option<&str>) -> Result<Json, TreeError> {
        let namespace = Namespace::new(&["salsa", "Hip Hop"].map(String::from));
        let mut values: Vec<Value> = namespace.all().iter().map(|_| Value::Float(0.31)).collect();
        values[namespace.find("/state/clip").unwrap()] = Value::Text("walk".into());
        values[namespace.find("/cue/salsa/lamp").unwrap()] = Value::Int(2);
        Tree::new(&namespace).describe(path, attribute, &namespace, &values)
    }

    #[test]
    fn nodes_have_their_attributes() {
        let bpm = json!({ "FULL_PATH": "/tempo/bpm", "DESCRIPTION": "the tempo, beats per minute", "TYPE": "f", "ACCESS": 3,
            "RANGE": [{ "MIN": 20.0, "MAX": 400.0 }], "VALUE": [0.31] });
        assert_eq!(at("/tempo/bpm", None), Ok(bpm.clone()));
        assert_eq!(at("/tempo/bpm/", None), Ok(bpm));
        let root = at("/", None).unwrap();
        assert_eq!(
            (&root["FULL_PATH"], &root["ACCESS"]),
            (&"/".into(), &0.into())
        );
        let pad = &root["CONTENTS"]["cue"]["CONTENTS"]["hip_hop"];
        assert_eq!(
            (&pad["FULL_PATH"], &pad["ACCESS"], &pad["TYPE"]),
            (&"/cue/hip_hop".into(), &3.into(), &"f".into())
        );
        let gate = &pad["CONTENTS"]["gate"];
        assert_eq!(gate["FULL_PATH"], "/cue/hip_hop/gate");
        let clip = at("/state/clip", None).unwrap();
        assert_eq!(
            (&clip["TYPE"], &clip["ACCESS"], &clip["VALUE"]),
            (&"s".into(), &1.into(), &json!(["walk"]))
        );
        let panic = at("/panic", None).unwrap();
        assert_eq!((&panic["ACCESS"], panic.get("VALUE")), (&2.into(), None));
    }

    #[test]
    fn single_attributes_can_be_requested() {
        assert_eq!(
            at("/cue/salsa/lamp", Some("VALUE")),
            Ok(json!({ "VALUE": [2] }))
        );
        assert_eq!(
            at("/cue/salsa/lamp", Some("RANGE")),
            Ok(json!({ "RANGE": [{ "MIN": 0, "MAX": 2 }] }))
        );
        assert_eq!(at("/panic", Some("VALUE")), Err(TreeError::NoContent));
        assert_eq!(at("/state/clip", Some("RANGE")), Err(TreeError::NoContent));
        assert_eq!(at("/tempo", Some("VALUE")), Err(TreeError::NoContent));
        assert_eq!(at("/tempo", Some("COLOUR")), Err(TreeError::Attribute));
        assert_eq!(at("/tempo/nobody", None), Err(TreeError::Path));
        assert_eq!(at("/cue/salsa/lamp/x", Some("VALUE")), Err(TreeError::Path));
    }

    #[test]
    fn a_subscription_to_a_container_covers_all_readable_addresses_below() {
        let namespace = Namespace::new(&["salsa".to_owned()]);
        let tree = Tree::new(&namespace);
        let readable = |path: &str| tree.readable_addresses(path, &namespace);
        assert_eq!(
            readable("/").len(),
            namespace
                .all()
                .iter()
                .filter(|address| address.readout.is_some())
                .count()
        );
        assert_eq!(
            readable("/beat/bpm"),
            [namespace.find("/beat/bpm").unwrap()]
        );
        assert_eq!(
            readable("/cue/salsa"),
            [namespace.find("/cue/salsa").unwrap()]
        );
        assert_eq!(readable("/beat").len(), 3);
        assert!(readable("/nobody").is_empty() && readable("/panic").is_empty());
    }
}
