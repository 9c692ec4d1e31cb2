//! Prints the sum of the first messages of every scheme, for comparison with other machines. The command line, `golden MESSAGES ADAPTIVE`
//! of the emulator's semihosting, says how many, and how many of the adaptive schemes; a thousand otherwise.

#![no_std]
#![no_main]

use fewbits_cortex_m4::{command_line, exit, print, print_hex};
use fewbits_node::golden::{Scheme, hash};

/// The word of this place as a number.
fn number(line: &[u8], place: usize) -> Option<u32> {
    let word = line.split(|byte| *byte == b' ').nth(place)?;
    word.iter()
        .take_while(|byte| byte.is_ascii_digit())
        .try_fold(0, |value: u32, byte| value.checked_mul(10)?.checked_add(u32::from(byte - b'0')))
        .filter(|value| *value > 0)
}

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    let line = command_line();
    let (messages, of_adaptive) = (number(&line, 1).unwrap_or(1000), number(&line, 2).unwrap_or(1000));
    for (scheme, name) in Scheme::ALL {
        let adaptive = matches!(scheme, Scheme::Adaptive | Scheme::AdaptiveCircle);
        let Ok(sum) = hash(scheme, if adaptive { of_adaptive } else { messages }) else {
            exit(false)
        };
        print(name);
        print(" ");
        print_hex(sum);
        print("\n");
    }
    exit(true)
}
