//! The page of `corybant doctor`. In: sections with lines. Out: plain text. Pure.

/// Width of the column with the names of facts.
const NAME_WIDTH: usize = 13;

/// One line of a section.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Line {
    /// A name and its value.
    Fact(&'static str, String),
    /// An entry of a list.
    Item(String),
    /// A problem and what to do about it.
    Problem(String),
}

impl Line {
    pub(super) fn fact(name: &'static str, value: impl Into<String>) -> Self {
        Self::Fact(name, value.into())
    }

    pub(super) fn problem(text: impl Into<String>) -> Self {
        Self::Problem(text.into())
    }
}

/// A part of the page with one subject.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Section {
    title: String,
    lines: Vec<Line>,
}

impl Section {
    pub(super) fn new(title: impl Into<String>, lines: Vec<Line>) -> Self {
        Self {
            title: title.into(),
            lines,
        }
    }
}

/// Returns the text of the page with `sections`. The last line has the number of problems.
pub(super) fn text(sections: &[Section]) -> String {
    let mut text = String::new();
    let mut problems = 0;
    for section in sections {
        text += &format!("{}\n", section.title);
        for line in &section.lines {
            match line {
                Line::Fact(name, value) => text += &format!("  {name:NAME_WIDTH$}  {value}\n"),
                Line::Item(item) => text += &format!("  - {item}\n"),
                Line::Problem(problem) => {
                    problems += 1;
                    text += &format!("  ! {problem}\n");
                }
            }
        }
        text.push('\n');
    }
    text + &match problems {
        0 => "No problem found.\n".into(),
        1 => "1 problem, marked with \"!\".\n".into(),
        n => format!("{n} problems, marked with \"!\".\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn problems_are_marked_and_counted() {
        let lines = vec![
            Line::fact("system", "Debian 12"),
            Line::Item("Line in".into()),
            Line::problem("no input: connect one"),
        ];
        let page = text(&[Section::new("A", lines), Section::new("B", vec![])]);
        let expected = "A\n  system         Debian 12\n  - Line in\n  ! no input: connect one\n\nB\n\n1 problem, marked with \"!\".\n";
        assert_eq!(page, expected);
        assert_eq!(text(&[]), "No problem found.\n");
    }
}
