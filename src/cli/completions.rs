//! `corybant completions`: completes commands and options in a shell.

use clap::CommandFactory;
use clap_complete::Shell;

use super::{Cli, Outcome, print};

/// Arguments of `corybant completions`.
#[derive(clap::Args, Debug)]
pub(super) struct CompletionsArgs {
    /// Shell
    shell: Shell,
}

/// `corybant completions`: prints a script for the shell that completes commands and options.
///
/// # Errors
/// Standard output cannot be written.
pub(super) fn completions(args: &CompletionsArgs) -> Outcome {
    print(&script(args.shell))
}

/// Returns the script that completes the commands and options of the program in `shell`.
fn script(shell: Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "corybant", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;

    #[test]
    fn each_script_has_every_visible_command_and_no_control_character() {
        for shell in Shell::value_variants() {
            let script = script(*shell);
            for command in Cli::command()
                .get_subcommands()
                .filter(|command| !command.is_hide_set())
            {
                assert!(script.contains(command.get_name()), "{shell}: {command}");
            }
            // `print` would change the script if it had one.
            let control = script.find(|c: char| c.is_control() && c != '\n');
            assert_eq!(control, None, "{shell}");
        }
    }
}
