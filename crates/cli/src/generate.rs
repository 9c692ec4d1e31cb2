//! `fewbits generate`: completions for shells, and the manual page.

use crate::Ending;
use crate::arguments::{Cli, GenerateOptions, Generated};
use crate::error::Error;
use crate::target::{STANDARD_OUTPUT, Target};
use clap::CommandFactory;
use std::io::Write;

/// Writes completions or the manual page to standard output, or a page per task into a folder.
pub(crate) fn run(options: &GenerateOptions) -> Result<Ending, Error> {
    use clap_complete::Shell;
    let (mut command, mut text) = (Cli::command(), Vec::new());
    let shell = match options.what {
        Generated::Bash => Shell::Bash,
        Generated::Elvish => Shell::Elvish,
        Generated::Fish => Shell::Fish,
        Generated::Powershell => Shell::PowerShell,
        Generated::Zsh => Shell::Zsh,
        Generated::Man => {
            if let Some(folder) = &options.folder {
                let name = folder.display().to_string();
                std::fs::create_dir_all(folder)
                    .and_then(|()| clap_mangen::generate_to(command, folder))
                    .map_err(Error::io(&name, "write"))?;
                return Ok(Ending::Good);
            }
            let page = clap_mangen::Man::new(command);
            page.render(&mut text).map_err(Error::io(STANDARD_OUTPUT, "write"))?;
            return written(&text);
        }
    };
    // The generator panics if its sink fails: memory does not.
    clap_complete::generate(shell, &mut command, "fewbits", &mut text);
    written(&text)
}

fn written(text: &[u8]) -> Result<Ending, Error> {
    let mut target = Target::open(None)?;
    target.write_all(text).map_err(Error::io(STANDARD_OUTPUT, "write"))?;
    target.finish().map(|()| Ending::Good)
}
