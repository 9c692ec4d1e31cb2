//! What a program on the board needs below `main`: start, semihosting, the serial port, the counter of instructions and the depth of the
//! stack. Nothing here allocates, and a panic does not link.

#![no_std]

pub mod measure;

use core::arch::{asm, global_asm};
use core::panic::PanicInfo;

unsafe extern "C" {
    /// Defined nowhere: a program in which a panic can be reached does not link.
    fn fewbits_a_panic_can_be_reached() -> !;
    static _bss_end: u8;
    static _stack_start: u8;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never called; the linker refuses the program where it could be.
    unsafe { fewbits_a_panic_can_be_reached() }
}

// The table of vectors; then data are copied, zeros are laid and the program's `main` runs.
global_asm!(
    ".section .vectors, \"a\"",
    ".word _stack_start",
    ".word reset",
    ".rept 14",
    ".word fault",
    ".endr",
    ".section .text.reset, \"ax\"",
    ".thumb_func",
    ".global reset",
    "reset:",
    "ldr r0, =_data_start",
    "ldr r1, =_data_end",
    "ldr r2, =_data_load",
    "0: cmp r0, r1",
    "bhs 1f",
    "ldr r3, [r2], #4",
    "str r3, [r0], #4",
    "b 0b",
    "1: ldr r0, =_bss_start",
    "ldr r1, =_bss_end",
    "movs r2, #0",
    "2: cmp r0, r1",
    "bhs 3f",
    "str r2, [r0], #4",
    "b 2b",
    // The floating-point unit: coprocessors 10 and 11.
    "3: ldr r0, =0xE000ED88",
    "ldr r1, [r0]",
    "orr r1, r1, #0xF00000",
    "str r1, [r0]",
    "dsb",
    "isb",
    "bl main",
    ".thumb_func",
    "fault:",
    "b fault",
);

/// One call of the debugger's services.
fn semihosting(operation: u32, argument: u32) -> u32 {
    let result;
    // SAFETY: the emulator reads and writes only what the operation's arguments name.
    unsafe {
        asm!("bkpt 0xAB", inlateout("r0") operation => result, in("r1") argument, options(nostack));
    }
    result
}

/// Writes text to the emulator's terminal.
pub fn print(text: &str) {
    for byte in text.bytes() {
        // SYS_WRITEC takes the address of the character.
        semihosting(0x03, &raw const byte as u32);
    }
}

/// Writes a number in decimals.
pub fn print_number(value: u32) {
    let mut divisor = 1_000_000_000;
    let (mut rest, mut begun) = (value, false);
    while divisor > 0 {
        let mut digit = b'0';
        while rest >= divisor {
            rest -= divisor;
            digit += 1;
        }
        begun |= digit != b'0' || divisor == 1;
        if begun {
            semihosting(0x03, &raw const digit as u32);
        }
        divisor /= 10;
    }
}

/// Writes sixteen hexadecimal digits.
pub fn print_hex(value: u64) {
    for shift in (0..16).rev() {
        let digit = (value >> (4 * shift)) as u8 & 15;
        let letter = if digit < 10 { b'0' + digit } else { b'a' + digit - 10 };
        semihosting(0x03, &raw const letter as u32);
    }
}

/// Ends the emulation.
pub fn exit(success: bool) -> ! {
    // SYS_EXIT: ADP_Stopped_ApplicationExit, or an error.
    semihosting(0x18, if success { 0x2_0026 } else { 0x2_0023 });
    loop {}
}

/// Opens a file of the host for reading; `name` ends in a zero.
pub fn open(name: &[u8]) -> Option<u32> {
    let block = [name.as_ptr() as u32, 1, name.len().saturating_sub(1) as u32];
    let handle = semihosting(0x01, block.as_ptr() as u32);
    (handle != u32::MAX).then_some(handle)
}

/// Reads eight bytes of a file; `None` at its end.
pub fn read_eight(handle: u32) -> Option<[u8; 8]> {
    let mut bytes = [0; 8];
    let block = [handle, bytes.as_mut_ptr() as u32, 8];
    (semihosting(0x06, block.as_ptr() as u32) == 0).then_some(bytes)
}

/// The emulator's command line, zeros behind it.
pub fn command_line() -> [u8; 64] {
    let mut line = [0; 64];
    let block = [line.as_mut_ptr() as u32, 63];
    semihosting(0x15, block.as_ptr() as u32);
    line
}

const UART: *mut u32 = 0x4000_4000 as *mut u32;

/// Prepares the first serial port.
pub fn serial_begin() {
    // SAFETY: the registers of the board's UART: baud divider, then transmitter on.
    unsafe {
        UART.add(4).write_volatile(16);
        UART.add(2).write_volatile(1);
    }
}

/// Sends one byte through the serial port.
pub fn serial_write(byte: u8) {
    // SAFETY: as above: state (bit 0: full) and data.
    unsafe {
        while UART.add(1).read_volatile() & 1 != 0 {}
        UART.write_volatile(byte.into());
    }
}

/// Sends a frame of less than 254 bytes in consistent-overhead byte stuffing, ended by a zero byte.
pub fn serial_frame(frame: &[u8]) {
    for run in frame.split(|byte| *byte == 0) {
        serial_write(run.len() as u8 + 1);
        run.iter().copied().for_each(serial_write);
    }
    serial_write(0);
}

const SYSTICK: *mut u32 = 0xE000_E010 as *mut u32;
const TICKS: u32 = 0xff_ffff;

/// Starts the system timer.
pub fn timer_begin() {
    // SAFETY: the timer's registers: reload, value, control (on, processor's clock).
    unsafe {
        SYSTICK.add(1).write_volatile(TICKS);
        SYSTICK.add(2).write_volatile(0);
        SYSTICK.write_volatile(5);
    }
}

/// Ticks of the timer, modulo 2^24. Under `-icount shift=0` an instruction takes a nanosecond and a tick (25 MHz) forty of them.
pub fn ticks() -> u32 {
    // SAFETY: reads the timer's value, which counts down.
    TICKS - unsafe { SYSTICK.add(2).read_volatile() }
}

const PATTERN: u32 = 0xA5C3_5A3C;

/// Fills the free stack with a pattern.
#[inline(never)]
pub fn stack_paint() {
    let here: u32;
    // SAFETY: only memory below the stack pointer and above the static data is written: nobody's.
    unsafe {
        asm!("mov {}, sp", out(reg) here);
        let mut place = (&raw const _bss_end) as *mut u32;
        while (place as u32) < here - 32 {
            place.write_volatile(PATTERN);
            place = place.add(1);
        }
    }
}

/// Bytes of the stack that were used since [`stack_paint`], from `top`, a value of [`stack_pointer`].
#[inline(never)]
pub fn stack_used(top: u32) -> u32 {
    // SAFETY: reads between the static data and the stack's beginning.
    unsafe {
        let mut place = (&raw const _bss_end) as *const u32;
        while (place as u32) < top && place.read_volatile() == PATTERN {
            place = place.add(1);
        }
        top - place as u32
    }
}

/// The stack pointer.
#[inline(always)]
pub fn stack_pointer() -> u32 {
    let here;
    // SAFETY: reads a register.
    unsafe { asm!("mov {}, sp", out(reg) here) };
    here
}
