//! Tests of the web pages, most of them in a browser.

mod api;
mod browser;
mod drawn;
mod import;
mod messages;
mod play;
mod rig;
mod scenes;
mod score;
mod set_list;
mod stage;
mod takes;
