//! Removes what identifies a person or a computer from texts: the home folder, the names of user and
//! host, and network addresses. In: texts from outside, such as names of devices and error
//! messages. Out: the same texts with placeholders. Pure, except for [`Privacy::of_system`].

use std::net::{IpAddr, SocketAddr};

use corybant_core::text::one_line;

/// Longest text from outside that is printed, in characters.
const CHARS_MAX: usize = 400;

/// The names that the page must not contain.
#[derive(Clone, Debug, Default)]
pub(super) struct Privacy {
    /// Path of the home folder; empty if it is unknown.
    home: String,
    /// Names of the user and the host, each with its placeholder.
    names: Vec<(String, &'static str)>,
}

impl Privacy {
    /// Returns the names of the user and the host on which this program runs.
    pub(super) fn of_system() -> Self {
        let home = std::env::home_dir().unwrap_or_default();
        let users = ["USER", "LOGNAME", "USERNAME"].map(std::env::var);
        let folder = home
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let users = users.into_iter().flatten().chain(folder);
        let host = gethostname::gethostname().to_string_lossy().into_owned();
        let short = host.split('.').next().unwrap_or_default().to_owned();
        Self::new(&home.to_string_lossy(), users, [host, short])
    }

    fn new(
        home: &str,
        users: impl IntoIterator<Item = String>,
        hosts: impl IntoIterator<Item = String>,
    ) -> Self {
        let users = users.into_iter().map(|user| (user, "[user]"));
        let hosts = hosts.into_iter().map(|host| (host, "[host]"));
        let is_name = |(name, _): &(String, _)| !name.is_empty();
        Self {
            // A home folder at the root has no name of its own.
            home: if home.len() > 1 {
                home.into()
            } else {
                String::new()
            },
            names: users.chain(hosts).filter(is_name).collect(),
        }
    }

    /// Returns `text`, a text from outside, on one line, without the home folder, the names of user
    /// and host, and network addresses.
    pub(super) fn clean(&self, text: &str) -> String {
        let mut clean = self.without_home(&one_line(text));
        for (name, placeholder) in &self.names {
            clean = replace_words(&clean, name, placeholder);
        }
        let clean = replace_addresses(&clean);
        if clean.chars().count() > CHARS_MAX {
            let start: String = clean.chars().take(CHARS_MAX).collect();
            return format!("{start}…");
        }
        clean
    }

    /// Returns `text` with `~` instead of the home folder.
    pub(super) fn without_home(&self, text: &str) -> String {
        replace_words(text, &self.home, "~")
    }
}

/// Returns `text` with `placeholder` instead of each `name` that is no part of a longer word. Upper
/// and lower case are the same.
fn replace_words(text: &str, name: &str, placeholder: &str) -> String {
    let (mut replaced, mut rest, mut before) = (String::new(), text, None);
    while let Some(c) = rest.chars().next() {
        let found = rest
            .get(..name.len())
            .filter(|start| !name.is_empty() && start.eq_ignore_ascii_case(name));
        let after = rest
            .get(name.len()..)
            .and_then(|after| after.chars().next());
        let is_word =
            !before.is_some_and(char::is_alphanumeric) && !after.is_some_and(char::is_alphanumeric);
        let step = match found.filter(|_| is_word) {
            Some(found) => {
                replaced.push_str(placeholder);
                found.len()
            }
            None => {
                replaced.push(c);
                c.len_utf8()
            }
        };
        before = rest[..step].chars().next_back();
        rest = &rest[step..];
    }
    replaced
}

/// Returns `text` with a placeholder instead of each IP address, except those of this computer
/// alone (127.0.0.1) and of all its networks (0.0.0.0).
fn replace_addresses(text: &str) -> String {
    let is_part = |c: char| c.is_ascii_hexdigit() || matches!(c, '.' | ':' | '[' | ']');
    let mut replaced = String::new();
    let mut rest = text;
    while !rest.is_empty() {
        let end = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
        replaced.push_str(&without_address(&rest[..end]));
        let next = rest[end..].find(is_part).map_or(rest.len(), |at| end + at);
        replaced.push_str(&rest[end..next]);
        rest = &rest[next..];
    }
    replaced
}

/// Returns `word`, or a placeholder with its end if it is an IP address, with or without a port.
fn without_address(word: &str) -> String {
    let trimmed = word.trim_end_matches(['.', ':']);
    let end = &word[trimmed.len()..];
    let socket: Option<SocketAddr> = trimmed.parse().ok();
    let address = trimmed.trim_start_matches('[').trim_end_matches(']');
    let address: Option<IpAddr> = socket.map(|socket| socket.ip()).or(address.parse().ok());
    let Some(address) = address.filter(|ip| !ip.is_loopback() && !ip.is_unspecified()) else {
        return word.into();
    };
    let kind = if address.is_ipv4() { "IPv4" } else { "IPv6" };
    let port = socket.map_or(String::new(), |socket| format!(":{}", socket.port()));
    format!("[{kind} address]{port}{end}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn privacy() -> Privacy {
        Privacy::new(
            "/home/anna",
            ["anna".into()],
            ["stage-pc.example".into(), "stage-pc".into()],
        )
    }

    #[test]
    fn names_and_the_home_folder_are_replaced() {
        for (text, expected) in [
            (
                "/home/anna/show.toml: no such file",
                "~/show.toml: no such file",
            ),
            (
                "/home/annabel/x and /media/anna/usb",
                "/home/annabel/x and /media/[user]/usb",
            ),
            ("Anna's AirPods on STAGE-PC", "[user]'s AirPods on [host]"),
            ("stage-pc.example:9000", "[host]:9000"),
            ("Hannah, banana", "Hannah, banana"),
            ("anna", "[user]"),
            ("מיקרופון 🎤", "מיקרופון 🎤"),
            ("a\u{1b}[2J", "a\\u{1b}[2J"),
        ] {
            assert_eq!(privacy().clean(text), expected);
        }
        assert_eq!(Privacy::new("/", [], []).clean("/a/b"), "/a/b");
    }

    #[test]
    fn addresses_are_replaced_and_those_of_this_computer_are_kept() {
        for (text, expected) in [
            ("to 192.168.1.20:39539.", "to [IPv4 address]:39539."),
            (
                "from 10.0.0.7, 10.0.0.8",
                "from [IPv4 address], [IPv4 address]",
            ),
            ("[fe80::1]:9000", "[IPv6 address]:9000"),
            ("2001:db8::7", "[IPv6 address]"),
            (
                "127.0.0.1:9000 [::1]:8710 0.0.0.0:9000",
                "127.0.0.1:9000 [::1]:8710 0.0.0.0:9000",
            ),
            (
                "hw:CARD=USB,DEV=0: a bad face",
                "hw:CARD=USB,DEV=0: a bad face",
            ),
            ("version 1.2.3", "version 1.2.3"),
        ] {
            assert_eq!(privacy().clean(text), expected);
        }
    }

    #[test]
    fn long_texts_are_cut() {
        let text = privacy().clean(&"🎤".repeat(1_000));
        assert_eq!(text.chars().count(), CHARS_MAX + 1);
    }
}
