//! Texts that are no numbers as they stand: whether they are likely numbers of another spelling, and the option that would read them.

/// Marks without ink at the ends of cells, as programs leave them: spaces of several kinds, and the mark of an encoding.
pub(crate) const BLANKS: [char; 7] = [
    '\u{a0}', '\u{202f}', '\u{2009}', '\u{200b}', '\u{feff}', '\u{b}', '\u{c}',
];
/// Spaces between groups of digits that are no plain ones.
pub(crate) const SPACES: [char; 3] = ['\u{a0}', '\u{202f}', '\u{2009}'];

/// Marks that stand for a minus.
pub(crate) const DASHES: [char; 6] = ['\u{2212}', '\u{2013}', '\u{2010}', '\u{2011}', '\u{ff0d}', '\u{fe63}'];

/// The option that the look of a cell suggests.
pub(crate) fn hint(text: &str) -> &'static str {
    let digits = text.bytes().filter(u8::is_ascii_digit).count();
    let commas = text.bytes().filter(|c| *c == b',').count();
    let points = text.bytes().filter(|c| *c == b'.').count();
    let plain = text
        .chars()
        .all(|c| c.is_ascii_digit() || "+-.,'\u{2019}\u{2212} eE".contains(c));
    let is_spaced = text.contains(SPACES) || text.split(' ').skip(1).any(|group| group.len() >= 3);
    let is_grouped = is_spaced
        && text
            .chars()
            .all(|c| c.is_ascii_digit() || SPACES.contains(&c) || "+-., ".contains(c));
    if text.contains('\0') {
        "the cell has NUL bytes, as after a loss of power: leave such lines out with --skip-bad 1 or more"
    } else if text.contains(|c: char| c.is_numeric() && !c.is_ascii()) && digits == 0 {
        "only the digits 0 to 9 are read: convert the column, or leave it out with --without"
    } else if digits > 0 && text.starts_with(['<', '>', '≤', '≥']) {
        "if it is below or above a limit of detection, `fewbits track` takes it; elsewhere make it a gap with --missing"
    } else if digits == 0 {
        "make it a gap with --missing, leave such lines out with --skip-bad, or the column with --without"
    } else if is_grouped {
        if commas == 1 && points == 0 {
            "say --thousands ' ' --decimal ,"
        } else {
            "say --thousands ' '"
        }
    } else if text.contains(CURRENCIES) && !text.ends_with(CURRENCIES) {
        "a sign in front of the number is not read: take it away, or leave the column out with --without"
    } else if text.starts_with('(') && text.ends_with(')') {
        "if brackets mean a negative number, write a minus; or leave the column out with --without"
    } else if plain && digits > 1 && text.ends_with('-') {
        "if a minus behind the number makes it negative, write it in front; or leave the column out with --without"
    } else if plain && commas == 1 && begins_with_zeros(text) {
        "a cell of several parts is no number: leave the column out with --without"
    } else if plain && commas == 1 && points == 0 && text.len() - text.find(',').unwrap_or(0) == 4 {
        "say --thousands , if these are groups of digits, or --decimal , (with --delimiter ';' or tab) if they are decimals"
    } else if plain && commas == 1 && points == 0 {
        "if it has a decimal comma, say --decimal , (and --delimiter ';' or tab)"
    } else if plain && (commas > 1 || (commas == 1 && points == 1)) {
        if points > 0 && text.rfind(',') > text.rfind('.') {
            "say --decimal , --thousands ."
        } else {
            "say --thousands ,"
        }
    } else if plain && text.contains(['\'', '\u{2019}']) && !text.starts_with('\'') {
        "say --thousands \"'\""
    } else if text.bytes().all(|c| c.is_ascii_digit() || b"+-.,_".contains(&c)) && text.contains('_') {
        "say --thousands _"
    } else if is_dotted(text) {
        "if it is a version or an address, say --words; or leave the column out with --without"
    } else if plain && points > 2 {
        "say --thousands and the mark between groups"
    } else if text.len() > 1 && text.bytes().all(|c| c.is_ascii_hexdigit()) {
        "if a unit stands behind the number, say --strip-units; hexadecimal numbers are not read: convert the column, or leave it out with \
         --without"
    } else if text.starts_with('#') {
        "if it is an error of a spreadsheet, make it a gap with --missing"
    } else if text.ends_with(FLAGS) {
        "if a mark stands behind the number, --strip-units cuts it off"
    } else if text.ends_with(SYMBOLS)
        || text.ends_with(CURRENCIES)
        || text.ends_with(|c: char| c.is_alphabetic()) && !text.contains('x')
    {
        "if a unit stands behind the number, say --strip-units"
    } else if text.starts_with("0x") || text.starts_with("0X") {
        "hexadecimal numbers are not read: convert the column, or leave it out with --without"
    } else {
        "mend the cell, name it with --missing, leave such lines out with --skip-bad, or the column with --without"
    }
}

/// Whether digits of a fixed number stand at the beginning, as in `-0020,1`.
fn begins_with_zeros(text: &str) -> bool {
    let digits = text.trim_start_matches(['+', '-']).as_bytes();
    matches!(digits, [b'0', second, ..] if second.is_ascii_digit())
}

/// Beginnings of units that are no letters: per cent, per mille, degrees, micro, inches, minutes.
const SYMBOLS: [char; 7] = ['%', '‰', '°', 'µ', '"', '″', '′'];

/// Whether a text is digits alone with a zero in front, as `007`, or the plus of a number of a telephone.
pub(crate) fn is_padded(text: &str) -> bool {
    let digits = text.strip_prefix('+').filter(|digits| digits.len() > 8).unwrap_or(text);
    text.len() > 1 && (text.starts_with('0') || digits.len() < text.len()) && digits.bytes().all(|c| c.is_ascii_digit())
}

/// Whether a text is a version or an address, as `1.10.2` and `10.0.0.1`: points between digits, which are no groups of three.
pub(crate) fn is_dotted(text: &str) -> bool {
    let mut parts = text.split('.');
    let is_part = |part: &str| !part.is_empty() && part.bytes().all(|c| c.is_ascii_digit());
    let is_group = |(i, part): (usize, &str)| part.len() == 3 || (i == 0 && part.len() < 3);
    text.matches('.').count() >= 2 && parts.clone().all(is_part) && !parts.by_ref().enumerate().all(is_group)
}

/// Signs that may stand before a number.
const CURRENCIES: [char; 4] = ['$', '€', '£', '¥'];

/// Marks that tables put behind numbers that are estimated, revised or doubtful.
const FLAGS: [char; 7] = ['*', '!', '#', '^', '~', '?', '<'];

/// Units that may stand at once behind a number with decimals.
const UNITS: [&str; 36] = [
    "C", "F", "K", "V", "A", "W", "mV", "mA", "mW", "kW", "MW", "Wh", "kWh", "Hz", "kHz", "Pa", "hPa", "kPa", "bar",
    "mbar", "m", "mm", "cm", "km", "s", "ms", "g", "kg", "l", "L", "dB", "dBm", "ppm", "rpm", "k", "M",
];

/// Whether a text is likely a number of another spelling, with groups, a decimal comma or a unit.
pub(crate) fn looks_like_number(text: &str) -> bool {
    let text = text
        .strip_prefix('(')
        .and_then(|text| text.strip_suffix(')'))
        .unwrap_or(text);
    let size = text
        .trim_matches(BLANKS)
        .trim_start_matches(['-', '+', '\''])
        .trim_start_matches(DASHES)
        .trim_start_matches(CURRENCIES)
        .trim_start_matches(['-', ' ']);
    if !size.starts_with(char::is_numeric) {
        return false;
    }
    // A minus behind the number, fractions and digits of other scripts too.
    let hexadecimal = size.strip_prefix("0x").or(size.strip_prefix("0X"));
    if is_dotted(size) {
        return false;
    }
    let is_plain = size
        .strip_suffix('-')
        .unwrap_or(size)
        .chars()
        .all(|c| c.is_numeric() || ".,'_\u{2019} ".contains(c) || SPACES.contains(&c))
        || hexadecimal.is_some_and(|digits| digits.bytes().all(|c| c.is_ascii_hexdigit()));
    let has_unit = without_unit(size).is_some_and(|(number, unit)| {
        let is_spaced = size.as_bytes().get(number.len()) == Some(&b' ');
        let has_decimals = number.contains(['.', ',']);
        number.replace(',', ".").parse::<f64>().is_ok()
            && (unit.starts_with(SYMBOLS)
                || has_decimals && UNITS.contains(&unit)
                || unit.chars().all(|c| FLAGS.contains(&c))
                || (is_spaced && unit.len() <= 6 && !unit.contains(' ')))
    });
    is_plain || has_unit
}

/// The number in front of a unit, as `19.75` of `19.75 °C`.
pub(crate) fn without_unit(text: &str) -> Option<(&str, &str)> {
    let end = text.rfind(|c: char| c.is_ascii_digit())? + 1;
    let (number, unit) = text.split_at(end);
    (!unit.is_empty()).then(|| (number.trim_end(), unit.trim()))
}
