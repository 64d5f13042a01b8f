//! Tests of the web pages, most of them in a browser.

mod browser;
mod drawn;
mod import;
mod messages;
mod play;
mod score;
mod stage;
mod takes;
