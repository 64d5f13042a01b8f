//! The controls of a control surface and their places. In: the names of a show. Out: a surface.
//! Thread: any. Pure.
//!
//! ```text
//!  tempo │ clip         │ tap │ hold │ release │ panic
//!  ──────┼──────────────────────────────────────────────
//!  inten-│ pads, at most 32 on a page
//!  sity  │
//! ```

use super::ShowNames;
use crate::web::colours::group_of;
use corybant_core::cue::namespace::Namespace;

/// Width and height of a surface, in pixels.
pub(super) const SIZE: [u32; 2] = [1024, 768];
/// Free pixels around a control.
const GAP: u32 = 8;
/// Height of the row above the pads.
const BAR: u32 = 72;
/// Width of the fader.
const FADER: u32 = 88;
/// Greatest number of pads on one page.
const PADS_MAX: usize = 32;
/// Greatest number of pads in one row.
const COLUMNS_MAX: usize = 8;
/// Height of the names of the pages, if there are several.
pub(super) const TABS: u32 = 40;
/// Colours of dancers and groups, as on the page.
const COLOURS: [Colour; 8] = [
    [206, 101, 66],
    [48, 149, 162],
    [209, 162, 63],
    [162, 124, 212],
    [134, 191, 111],
    [221, 105, 162],
    [97, 139, 215],
    [203, 203, 200],
];
/// Colours of the other controls.
const PLAIN: Colour = [58, 58, 73];
const WARNING: Colour = [214, 69, 65];

/// Red, green and blue, 0 to 255.
pub(super) type Colour = [u8; 3];

/// What a control is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum What {
    /// Sends 1 when it is pressed and 0 when it is released.
    Button,
    /// Sends 1 and 0 in turn.
    Toggle,
    /// Sends 0 to 1.
    Fader,
    /// Shows a number or a text; sends nothing.
    Text,
}

/// The place of a control, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Area {
    pub(super) left: u32,
    pub(super) top: u32,
    pub(super) width: u32,
    pub(super) height: u32,
}

/// One control.
#[derive(Clone, Debug)]
pub(super) struct Control {
    pub(super) what: What,
    /// The text on the control.
    pub(super) name: String,
    pub(super) address: String,
    pub(super) colour: Colour,
    pub(super) area: Area,
}

/// A page of pads.
#[derive(Clone, Debug)]
pub(super) struct Page {
    pub(super) name: String,
    /// The pads, with places relative to [`Surface::pads`].
    pub(super) pads: Vec<Control>,
}

/// A control surface.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    /// The controls beside the pads.
    pub(super) controls: Vec<Control>,
    /// The place of the pads.
    pub(super) pads: Area,
    pub(super) pages: Vec<Page>,
}

impl Surface {
    /// Creates the surface of a show.
    pub(super) fn new(names: &ShowNames) -> Self {
        let addresses = Namespace::new(names.labels).triggers().collect::<Vec<_>>();
        let pads: Vec<(&String, String)> = names.labels.iter().zip(addresses).collect();
        let place = Area {
            left: FADER + 2 * GAP,
            top: BAR + 2 * GAP,
            width: SIZE[0] - FADER - 3 * GAP,
            height: SIZE[1] - BAR - 3 * GAP,
        };
        let has_tabs = pads.len() > PADS_MAX;
        let inner = Area {
            height: place.height - if has_tabs { TABS } else { 0 },
            ..place
        };
        let page = |(number, pads): (usize, &[(&String, String)])| Page {
            name: format!("{}", number + 1),
            pads: page_of(pads, inner, names),
        };
        Self {
            controls: controls(),
            pads: place,
            pages: pads.chunks(PADS_MAX).enumerate().map(page).collect(),
        }
    }
}

/// Returns the controls beside the pads.
fn controls() -> Vec<Control> {
    let control = |what, name: &str, address: &str, colour, area| Control {
        what,
        name: name.into(),
        address: address.into(),
        colour,
        area,
    };
    let bar = |left, width| Area {
        left,
        top: GAP,
        width,
        height: BAR,
    };
    let fader = Area {
        left: GAP,
        top: BAR + 2 * GAP,
        width: FADER,
        height: SIZE[1] - BAR - 3 * GAP,
    };
    vec![
        control(What::Text, "tempo", "/tempo/bpm", PLAIN, bar(8, 200)),
        control(What::Text, "clip", "/state/clip", PLAIN, bar(216, 300)),
        control(What::Button, "tap", "/tempo/tap", PLAIN, bar(524, 116)),
        control(What::Toggle, "hold", "/hold", PLAIN, bar(648, 116)),
        control(What::Button, "release", "/release", PLAIN, bar(772, 116)),
        control(What::Button, "panic", "/panic", WARNING, bar(896, 120)),
        control(What::Fader, "intensity", "/intensity", PLAIN, fader),
    ]
}

/// Returns the pads of one page in rows; `place` is their common place.
fn page_of(pads: &[(&String, String)], place: Area, names: &ShowNames) -> Vec<Control> {
    let columns = (1..COLUMNS_MAX)
        .find(|columns| columns * columns * 2 >= pads.len() * 3)
        .unwrap_or(COLUMNS_MAX) as u32;
    let rows = (pads.len() as u32).div_ceil(columns).max(1);
    let (width, height) = (place.width / columns, place.height / rows);
    let pad = |(number, (label, address)): (u32, &(&String, String))| Control {
        what: What::Button,
        name: (*label).clone(),
        address: address.clone(),
        colour: colour_of(label, names),
        area: Area {
            left: number % columns * width,
            top: number / columns * height,
            width: width - GAP,
            height: height - GAP,
        },
    };
    (0..).zip(pads).map(pad).collect()
}

/// Returns the colour of a pad: that of its group in the show file, or else the one that the page
/// gives to the group.
fn colour_of(label: &str, names: &ShowNames) -> Colour {
    let group = group_of(label);
    if let Some(colour) = names.colours.get(group).and_then(|text| parse(text)) {
        return colour;
    }
    let mut groups: Vec<&str> = Vec::new();
    for label in names.labels {
        let other = group_of(label);
        if !groups.contains(&other) {
            groups.push(other);
        }
    }
    let dancer = names.dancers.iter().position(|name| name == group);
    let number = groups.iter().position(|other| *other == group);
    let number = dancer.or(number.map(|number| names.dancers.len() + number));
    match number {
        Some(number) if groups.len() > 1 => COLOURS[number % COLOURS.len()],
        _ => PLAIN,
    }
}

/// Parses a colour of the form `#rrggbb`.
fn parse(text: &str) -> Option<Colour> {
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6)?;
    let [_, red, green, blue] = u32::from_str_radix(digits, 16).ok()?.to_be_bytes();
    Some([red, green, blue])
}
