//! A control surface as a `.tosc` file of TouchOSC. In: a surface. Out: XML, compressed by zlib.
//! Thread: any. Pure.
//!
//! The file holds a tree of nodes (`GROUP`, `PAGER`, `BUTTON`, `FADER`, `LABEL`), each with
//! properties, values and OSC messages; the root is `<lexml version='3'>`. Hexler publishes no
//! description: the form is that of files which the editor writes, as the library tosclib describes
//! them. A button has no text, so a label lies on it.

use std::io::{self, Write};

use flate2::Compression;
use flate2::write::ZlibEncoder;

use super::layout::{Area, Colour, Control, SIZE, Surface, TABS, What};
use corybant_core::text::one_line;

/// The numbers of a button that sends while it is held, and of one that stays on.
const MOMENTARY: u8 = 0;
const TOGGLE: u8 = 1;
const TEXT_SIZE: u32 = 20;

/// Returns the bytes of the file.
///
/// # Errors
/// The compressor fails.
pub(super) fn file(surface: &Surface) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(xml(surface).as_bytes())?;
    encoder.finish()
}

/// Returns the text of the file.
fn xml(surface: &Surface) -> String {
    let mut writer = Writer { next_id: 1 };
    let mut children: String = surface
        .controls
        .iter()
        .map(|control| writer.control(control))
        .collect();
    children += &writer.pads(surface);
    let all = Area {
        left: 0,
        top: 0,
        width: SIZE[0],
        height: SIZE[1],
    };
    let root = writer.node(
        "GROUP",
        &properties("corybant", all, [20, 20, 26]),
        "",
        "",
        &children,
    );
    format!("<?xml version='1.0' encoding='UTF-8'?><lexml version='3'>{root}</lexml>")
}

/// Writes nodes, each with an identifier of its own.
struct Writer {
    next_id: u64,
}

impl Writer {
    fn node(
        &mut self,
        kind: &str,
        properties: &str,
        values: &str,
        messages: &str,
        children: &str,
    ) -> String {
        let id = self.next_id;
        self.next_id += 1;
        format!(
            "<node ID='00000000-0000-4000-8000-{id:012x}' type='{kind}'><properties>{properties}</properties><values>{values}</values>\
             <messages>{messages}</messages><children>{children}</children></node>"
        )
    }

    /// Returns the pads, on pages if there are several.
    fn pads(&mut self, surface: &Surface) -> String {
        let mut inner = Area {
            left: 0,
            top: 0,
            ..surface.pads
        };
        let has_tabs = surface.pages.len() > 1;
        if has_tabs {
            inner.height -= TABS;
        }
        let mut pages = String::new();
        for page in &surface.pages {
            let pads: String = page.pads.iter().map(|pad| self.control(pad)).collect();
            let place = if has_tabs { inner } else { surface.pads };
            let about =
                properties(&page.name, place, [20, 20, 26]) + &string("tabLabel", &page.name);
            pages += &self.node("GROUP", &about, "", "", &pads);
        }
        if !has_tabs {
            return pages;
        }
        let about = properties("pages", surface.pads, [20, 20, 26])
            + &flag("tabbar", true)
            + &flag("tabLabels", true)
            + &number("tabbarSize", TABS);
        self.node("PAGER", &about, &value("page", "0"), "", &pages)
    }

    /// Returns the nodes of a control.
    fn control(&mut self, control: &Control) -> String {
        let about = properties(&control.name, control.area, control.colour);
        match control.what {
            What::Text => {
                let about = about + &number("textSize", TEXT_SIZE) + &flag("interactive", false);
                let message = osc(&control.address, ("text", "STRING"), false);
                self.node("LABEL", &about, &value("text", &control.name), &message, "")
            }
            What::Button | What::Toggle => {
                let kind = match control.what {
                    What::Toggle => TOGGLE,
                    _ => MOMENTARY,
                };
                let about = about
                    + &number("buttonType", kind)
                    + &flag("press", true)
                    + &flag("release", true);
                let message = osc(&control.address, ("x", "FLOAT"), true);
                self.node("BUTTON", &about, &value("x", "0"), &message, "") + &self.caption(control)
            }
            What::Fader => {
                let message = osc(&control.address, ("x", "FLOAT"), true);
                self.node("FADER", &about, &value("x", "0"), &message, "") + &self.caption(control)
            }
        }
    }

    /// Returns the text on a control, which a touch passes through.
    fn caption(&mut self, control: &Control) -> String {
        let about = properties(
            &format!("{} text", control.name),
            control.area,
            control.colour,
        ) + &number("textSize", TEXT_SIZE)
            + &flag("background", false)
            + &flag("outline", false)
            + &flag("interactive", false);
        self.node("LABEL", &about, &value("text", &control.name), "", "")
    }
}

/// Returns the properties that all nodes have.
fn properties(name: &str, area: Area, [red, green, blue]: Colour) -> String {
    let Area {
        left,
        top,
        width,
        height,
    } = area;
    let share = |value: u8| f32::from(value) / 255.0;
    let (red, green, blue) = (share(red), share(green), share(blue));
    string("name", name)
        + &property(
            "r",
            "frame",
            &format!("<x>{left}</x><y>{top}</y><w>{width}</w><h>{height}</h>"),
        )
        + &property(
            "c",
            "color",
            &format!("<r>{red}</r><g>{green}</g><b>{blue}</b><a>1</a>"),
        )
        + &flag("visible", true)
}

fn property(kind: &str, key: &str, value: &str) -> String {
    format!(
        "<property type='{kind}'><key>{}</key><value>{value}</value></property>",
        cdata(key)
    )
}

fn string(key: &str, value: &str) -> String {
    property("s", key, &cdata(value))
}

fn flag(key: &str, value: bool) -> String {
    property("b", key, &u8::from(value).to_string())
}

fn number(key: &str, value: impl Into<u32>) -> String {
    property("i", key, &value.into().to_string())
}

/// Returns the value `key` of a control with its default.
fn value(key: &str, default: &str) -> String {
    format!(
        "<value><key>{}</key><locked>0</locked><lockedDefaultCurrent>0</lockedDefaultCurrent><default>{}</default><defaultPull>0</defaultPull></value>",
        cdata(key),
        cdata(default)
    )
}

/// Returns the OSC message of a control: the value `key`, sent as `conversion` if `send` is true, and
/// received from the show.
fn osc(address: &str, (key, conversion): (&str, &str), send: bool) -> String {
    let partial = |kind: &str, conversion: &str, value: &str| {
        format!(
            "<partial><type>{kind}</type><conversion>{conversion}</conversion><value>{}</value><scaleMin>0</scaleMin><scaleMax>1</scaleMax></partial>",
            cdata(value)
        )
    };
    let trigger = format!(
        "<trigger><var>{}</var><condition>ANY</condition></trigger>",
        cdata(key)
    );
    let triggers = if send { trigger.as_str() } else { "" };
    format!(
        "<osc><enabled>1</enabled><send>{}</send><receive>1</receive><feedback>0</feedback><connections>00001</connections>\
         <triggers>{triggers}</triggers><path>{}</path><arguments>{}</arguments></osc>",
        u8::from(send),
        partial("CONSTANT", "STRING", address),
        partial("VALUE", conversion, key)
    )
}

/// Returns `text` as character data of XML. Control characters, which XML does not allow, are
/// escaped.
fn cdata(text: &str) -> String {
    let text = one_line(text).replace("]]>", "]]]]><![CDATA[>");
    let text: String = text
        .chars()
        .filter(|c| !matches!(c, '\u{fffe}' | '\u{ffff}'))
        .collect();
    format!("<![CDATA[{text}]]>")
}
