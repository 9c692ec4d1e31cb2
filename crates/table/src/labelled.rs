//! Lines whose cells have their names in front, as `Temp:20.1,Hum:50` or `time=12:00:01 temp=20.1`: programs that show what a serial port
//! says expect them, and loggers write them. A time may stand in front of the first name: `12:00:01.123 -> Temp:20.1`.

use crate::error::Error;
use crate::guess::looks_like_time;
use crate::head::Head;

/// The key of a time that stands in front without a name.
const TIME: &str = "time";

/// Whether the first lines are such lines: nearly all of them, the first two with a name in common, or the only one with two names.
pub(crate) fn is_labelled(head: &Head) -> bool {
    let lines: Vec<&str> = head.filled_lines().collect();
    let found: Vec<_> = lines.iter().map(|line| found(line)).collect();
    let (Some(Some(first)), Some(second)) = (found.first(), found.get(1).or(found.first())) else {
        return false;
    };
    let Some(second) = second.as_ref().filter(|second| lines.len() > 1 || second.len() > 1) else {
        return false;
    };
    let have_same_name = first
        .iter()
        .any(|(name, _)| second.iter().any(|(other, _)| other == name));
    have_same_name && 10 * found.iter().flatten().count() >= 9 * lines.len()
}

/// The names and the texts of a line.
pub(crate) fn pairs(line: &str, number: u64) -> Result<Vec<(String, String)>, Error> {
    found(line).ok_or_else(|| {
        Error::line(
            number,
            "not every cell has its name in front, as in the first lines",
            "mend the line, or leave such lines out with --skip-bad",
        )
    })
}

fn found(line: &str) -> Option<Vec<(String, String)>> {
    let line = line.trim().trim_end_matches([',', ';']);
    let mut pairs = Vec::new();
    let (mut rest, mut before) = (line, 0);
    // A time without a name ends where the first name begins.
    if !line.starts_with(|c: char| c.is_alphabetic() || c == '_') {
        let is_begin = |(at, c): &(usize, char)| (c.is_alphabetic() || *c == '_') && labels(&line[*at..]);
        let begin = line.char_indices().find(is_begin)?.0;
        let time = line[..begin].trim_end_matches(|c: char| c.is_whitespace() || ",;>-|]".contains(c));
        let time = time.trim_start_matches('[');
        if !looks_like_time(time) && time.parse::<f64>().is_err() {
            return None;
        }
        pairs.push((TIME.to_owned(), time.to_owned()));
        (rest, before) = (&line[begin..], 1);
    }
    // A comma may stand before decimals, where another mark separates cells.
    let marks = ['\t', ';', ','].into_iter().filter(|mark| rest.contains(*mark));
    let cells = marks
        .map(|mark| rest.split(mark).map(cell).collect::<Option<Vec<_>>>())
        .find(Option::is_some);
    let cells = cells.unwrap_or_else(|| rest.split_whitespace().map(cell).collect())?;
    pairs.extend(cells);
    (pairs.len() > before).then_some(pairs)
}

/// The name and the text of a cell.
fn cell(piece: &str) -> Option<(String, String)> {
    let (name, value) = piece.split_at(piece.find([':', '='])?);
    let (name, value) = (name.trim(), value[1..].trim().trim_matches('"'));
    is_name(name).then(|| (name.to_owned(), value.to_owned()))
}

/// Whether a text begins with a name and its mark.
fn labels(text: &str) -> bool {
    text.find([':', '=', ',', ';', '\t'])
        .is_some_and(|at| text[at..].starts_with([':', '=']) && is_name(text[..at].trim()))
}

fn is_name(text: &str) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || " _-./()[]%°#".contains(c);
    text.starts_with(|c: char| c.is_alphabetic() || c == '_') && text.chars().all(is_part)
}

#[cfg(test)]
mod tests {
    use super::found;

    fn texts(line: &str) -> Option<Vec<String>> {
        found(line).map(|pairs| {
            pairs
                .into_iter()
                .map(|(name, value)| format!("{name}|{value}"))
                .collect()
        })
    }

    #[test]
    fn names_stand_in_front() {
        let cases: [(&str, &[&str]); 11] = [
            ("Temp:20.1,Hum:50", &["Temp|20.1", "Hum|50"]),
            ("Temp: 20.1\tHum: 50", &["Temp|20.1", "Hum|50"]),
            ("time=2024-03-01T12:00:00Z temp=-3 x=\"a\"", &["time|2024-03-01T12:00:00Z", "temp|-3", "x|a"]),
            ("12:00:01.123 -> Temp:20.1,Hum:50", &["time|12:00:01.123", "Temp|20.1", "Hum|50"]),
            ("[2024-03-01 12:00:00] T = 3.5; RH (%) = 40;", &["time|2024-03-01 12:00:00", "T|3.5", "RH (%)|40"]),
            ("1700000000,t=20.5 C,state=on", &["time|1700000000", "t|20.5 C", "state|on"]),
            ("Temp:,Hum:50", &["Temp|", "Hum|50"]),
            ("T:2 H:", &["T|2", "H|"]),
            ("a=1;b=2,5", &["a|1", "b|2,5"]),
            ("a=2,5 b=3", &["a|2,5", "b|3"]),
            ("Heat index: 20.9", &[]),
        ];
        for (line, expected) in cases {
            let expected = (!expected.is_empty()).then(|| expected.iter().map(ToString::to_string).collect());
            assert_eq!(texts(line), expected, "{line}");
        }
    }

    #[test]
    fn other_lines_have_none() {
        for line in [
            "time,temp",
            "2024-03-01 12:00:00,20.1",
            "12:30 20",
            "1,2,3",
            "a b c",
            "",
            "x",
            "20.1 C",
            "=3",
            "12:00:01 -> 20.1",
        ] {
            assert_eq!(texts(line), None, "{line}");
        }
    }
}
