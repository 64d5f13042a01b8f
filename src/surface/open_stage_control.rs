//! A control surface as a session of Open Stage Control. In: a surface. Out: JSON. Thread: any. Pure.
//!
//! A session is an object with `type`, `version` and `content`, the root widget. Properties that are
//! left out have the default values of the program. Widgets without a target send to the address
//! with which Open Stage Control is started (`--send`).

use serde_json::{Value, json};

use super::layout::{Area, Colour, Control, Surface, What};

/// The version of Open Stage Control whose widgets the session uses.
const VERSION: &str = "1.30.1";

/// Returns the text of the file.
pub(super) fn file(surface: &Surface) -> String {
    let mut widgets: Vec<Value> = surface.controls.iter().map(widget).collect();
    widgets.push(pads(surface));
    let session = json!({
        "createdWith": "Open Stage Control",
        "version": VERSION,
        "type": "session",
        "content": {
            "type": "root",
            "id": "root",
            "traversing": false,
            "widgets": widgets,
            "tabs": [],
        },
    });
    format!("{session:#}\n")
}

/// Returns the panel with the pads, on tabs if there are several pages.
fn pads(surface: &Surface) -> Value {
    let mut panel = placed("panel", "pads", surface.pads);
    let widgets = |pads: &[Control]| pads.iter().map(widget).collect::<Vec<_>>();
    panel["bypass"] = true.into();
    match surface.pages.as_slice() {
        [] => panel["widgets"] = json!([]),
        [page] => panel["widgets"] = widgets(&page.pads).into(),
        pages => {
            let tab = |page: &super::layout::Page| {
                json!({
                    "type": "tab",
                    "id": format!("page {}", page.name),
                    "label": page.name,
                    "bypass": true,
                    "widgets": widgets(&page.pads),
                    "tabs": [],
                })
            };
            panel["tabs"] = pages.iter().map(tab).collect::<Vec<_>>().into();
        }
    }
    panel
}

fn widget(control: &Control) -> Value {
    let kind = match control.what {
        What::Button | What::Toggle => "button",
        What::Fader => "fader",
        What::Text => "text",
    };
    // Widgets with the same identifier would be one; addresses are all different.
    let mut widget = placed(kind, &control.address, control.area);
    widget["address"] = control.address.as_str().into();
    widget["colorWidget"] = hex(control.colour).into();
    match control.what {
        What::Button | What::Toggle => {
            let mode = match control.what {
                What::Toggle => "toggle",
                _ => "push",
            };
            widget["mode"] = mode.into();
            widget["label"] = plain(&control.name).into();
            (widget["on"], widget["off"]) = (1.into(), 0.into());
            widget["typeTags"] = "f".into();
        }
        What::Fader => {
            widget["range"] = json!({ "min": 0, "max": 1 });
            widget["typeTags"] = "f".into();
            widget["comments"] = control.name.as_str().into();
        }
        What::Text => {
            widget["default"] = control.name.as_str().into();
            widget["interaction"] = false.into();
        }
    }
    widget
}

fn placed(kind: &str, id: &str, area: Area) -> Value {
    json!({
        "type": kind,
        "id": id,
        "left": area.left,
        "top": area.top,
        "width": area.width,
        "height": area.height,
    })
}

fn hex([red, green, blue]: Colour) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Returns `label` with a space between the two characters that begin a script or the value of
/// another widget in Open Stage Control: a name is never a script.
fn plain(label: &str) -> String {
    let mut plain = String::with_capacity(label.len());
    for c in label.chars() {
        if c == '{' {
            plain.push(' ');
        }
        plain.push(c);
    }
    plain
}
