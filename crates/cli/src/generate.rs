//! `fewbits generate`: completions for shells, and the manual page.

use crate::Ending;
use crate::arguments::{Cli, GenerateOptions, Generated};
use crate::error::Error;
use clap::CommandFactory;

/// Writes completions or the manual page to standard output, or a page per task into a folder.
pub(crate) fn run(options: &GenerateOptions) -> Result<Ending, Error> {
    use clap_complete::Shell;
    let mut command = Cli::command();
    let shell = match options.what {
        Generated::Bash => Shell::Bash,
        Generated::Elvish => Shell::Elvish,
        Generated::Fish => Shell::Fish,
        Generated::Powershell => Shell::PowerShell,
        Generated::Zsh => Shell::Zsh,
        Generated::Man => {
            if let Some(folder) = &options.folder {
                let name = folder.display().to_string();
                clap_mangen::generate_to(command, folder).map_err(Error::io(&name, "write"))?;
                return Ok(Ending::Good);
            }
            let page = clap_mangen::Man::new(command);
            page.render(&mut std::io::stdout())
                .map_err(Error::io("standard output", "write"))?;
            return Ok(Ending::Good);
        }
    };
    clap_complete::generate(shell, &mut command, "fewbits", &mut std::io::stdout());
    Ok(Ending::Good)
}
