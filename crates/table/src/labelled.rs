//! Lines whose cells have their names in front, as `Temp:20.1,Hum:50` or `time=12:00:01 temp=20.1`: programs that show what a serial port
//! says expect them, and loggers write them. A time may stand in front of the first name: `12:00:01.123 -> Temp:20.1`.

use crate::error::{Error, Place};
use crate::guess::looks_like_time;
use crate::head::Head;

/// The key of a time that stands in front without a name.
const TIME: &str = "time";

/// Whether the first lines are such lines: as many names as in the first line, or nearly all of them, in each of at least two.
pub(crate) fn is_labelled(head: &Head) -> bool {
    let lines: Vec<&str> = head
        .lines
        .iter()
        .map(|(_, line)| line.trim())
        .filter(|line| !line.is_empty())
        .collect();
    let found: Vec<_> = lines.iter().map(|line| found(line)).collect();
    let (Some(Some(first)), Some(Some(second))) = (found.first(), found.get(1)) else {
        return false;
    };
    let have_same_name = first
        .iter()
        .any(|(name, _)| second.iter().any(|(other, _)| other == name));
    have_same_name && 10 * found.iter().flatten().count() >= 9 * lines.len()
}

/// The names and the texts of a line.
pub(crate) fn pairs(line: &str, number: u64) -> Result<Vec<(String, String)>, Error> {
    found(line).ok_or_else(|| Error::Line {
        place: Place { line: number, row: 0 },
        problem: "not every cell has its name in front, as in the first lines".to_owned(),
        mend: "mend the line, or leave such lines out with --skip-bad",
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
    let mark = [',', ';', '\t'].into_iter().find(|mark| rest.contains(*mark));
    let pieces: Vec<&str> = match mark {
        Some(mark) => rest.split(mark).collect(),
        None => rest.split_whitespace().collect(),
    };
    for piece in pieces {
        let at = piece.find([':', '='])?;
        let (name, value) = (piece[..at].trim(), piece[at + 1..].trim());
        if !is_name(name) || value.is_empty() && mark.is_none() {
            return None;
        }
        pairs.push((name.to_owned(), value.trim_matches('"').to_owned()));
    }
    (pairs.len() > before).then_some(pairs)
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
        let cases: [(&str, &[&str]); 8] = [
            ("Temp:20.1,Hum:50", &["Temp|20.1", "Hum|50"]),
            ("Temp: 20.1\tHum: 50", &["Temp|20.1", "Hum|50"]),
            ("time=2024-03-01T12:00:00Z temp=-3 x=\"a\"", &["time|2024-03-01T12:00:00Z", "temp|-3", "x|a"]),
            ("12:00:01.123 -> Temp:20.1,Hum:50", &["time|12:00:01.123", "Temp|20.1", "Hum|50"]),
            ("[2024-03-01 12:00:00] T = 3.5; RH (%) = 40;", &["time|2024-03-01 12:00:00", "T|3.5", "RH (%)|40"]),
            ("1700000000,t=20.5 C,state=on", &["time|1700000000", "t|20.5 C", "state|on"]),
            ("Temp:,Hum:50", &["Temp|", "Hum|50"]),
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
