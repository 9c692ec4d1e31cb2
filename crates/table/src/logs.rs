//! Lines of receivers and of logs. They have times and numbers, but are no tables: the refusal says how to make one of them.

use crate::error::Error;
use crate::guess;
use crate::head::Head;

/// The refusal of NMEA sentences and of lines of a log; `None` if the first lines are neither.
pub(crate) fn refusal(head: &Head) -> Option<Error> {
    let lines: Vec<&str> = head.filled_lines().collect();
    let sentences: Vec<&str> = lines.iter().filter_map(|line| sentence(line)).collect();
    if 2 * sentences.len() > lines.len() {
        let has = |kind: &str| sentences.iter().any(|found| found.ends_with(kind));
        let mend = if has("RMC") {
            "make a table of one kind of them: (echo utc,status,lat,ns,lon,ew,knots,course,date; grep RMC, FILE | sed 's/.*RMC,//' | cut -d, -f1-9) \
             | fewbits ... - --time-column date,utc --time-format '%d%m%y %H%M%S%.f'"
        } else if has("GGA") {
            "make a table of one kind of them: (echo utc,lat,ns,lon,ew,fix,satellites,hdop,altitude; grep GGA, FILE | sed 's/.*GGA,//' | cut -d, -f1-9) \
             | fewbits ... -"
        } else {
            "make a table of one kind of them, as of the first: (echo NAMES; grep VTG, FILE | sed 's/.*VTG,//; s/[*].*//') | fewbits ... -"
        };
        return Some(Error::Format {
            what: "NMEA 0183, sentences of several kinds",
            mend,
        });
    }
    if are_metrics(&lines) {
        return Some(Error::Format {
            what: "metrics in the text format of Prometheus, which are of one moment",
            mend: "ask its server for a range of time; or of lines with times behind the values: (echo time_ms,value; \
                   sed -nE 's/^NAME([{].*[}])? ([^ ]+) ([0-9]+)$/\\3,\\2/p' FILE) | fewbits ... -",
        });
    }
    if is_sideways(&lines) {
        return Some(Error::Format {
            what: "a table on its side, with a name in front of each line and its values behind",
            mend: "turn it: python3 -c 'import csv, sys; csv.writer(sys.stdout).writerows(zip(*csv.reader(sys.stdin)))' < FILE | \
                   fewbits ... -; or say --no-header if each line is a row",
        });
    }
    let answers = lines.iter().filter(|line| answer(line).is_some()).count();
    if answers > 0
        && lines
            .iter()
            .all(|line| line.starts_with("AT") || line.len() <= 5 || answer(line).is_some())
    {
        return lines.iter().find_map(|line| answer(line)).map(modem);
    }
    lines.first().and_then(|line| logged(line))
}

/// The refusal of lines that are surely those of a log, also where a table of words could be read from them.
pub(crate) fn sure_refusal(head: &Head) -> Option<Error> {
    let mut lines = head.filled_lines().take(5).peekable();
    lines.peek()?;
    if are_metrics(&head.filled_lines().collect::<Vec<_>>()) {
        return refusal(head);
    }
    lines
        .all(|line| answer(line).is_some() || line.starts_with("AT+") || line == "OK" || logged(line).is_some())
        .then(|| refusal(head))?
}

/// Whether lines are as `name{label="text"} value time`, with lines `# TYPE name kind` or labels.
fn are_metrics(lines: &[&str]) -> bool {
    let is_name = |text: &str| {
        text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == ':')
    };
    let is_sample = |line: &&str| {
        let (name, rest) = line.split_once([' ', '{']).unwrap_or((line, ""));
        let values = rest.rsplit_once('}').map_or(rest, |(_, values)| values);
        is_name(name)
            && values.split_whitespace().count() <= 2
            && values.split_whitespace().all(|x| x.parse::<f64>().is_ok())
    };
    let has_type = lines.iter().any(|line| line.starts_with("# TYPE "));
    let mut samples = lines.iter().filter(|line| !line.starts_with('#')).peekable();
    samples.peek().is_some()
        && samples.all(|line| is_sample(line) && (has_type || line.contains("=\"") && line.contains("} ")))
}

/// Whether each line is a name and, behind it, as many numbers or times as the others have, more of them than there are lines.
fn is_sideways(lines: &[&str]) -> bool {
    [',', ';', '\t'].iter().any(|mark| {
        let rows: Vec<Vec<&str>> = lines
            .iter()
            .map(|line| line.split(*mark).map(str::trim).collect())
            .collect();
        let is_value = |cell: &&str| cell.is_empty() || cell.parse::<f64>().is_ok() || guess::looks_like_time(cell);
        let is_row = |row: &Vec<&str>| {
            let is_named = row[0].starts_with(|c: char| c.is_alphabetic()) && !guess::looks_like_time(row[0]);
            row.len() == rows[0].len() && is_named && row[1..].iter().all(is_value)
        };
        rows.len() > 1 && rows[0].len() > rows.len().max(4) && rows.iter().all(is_row)
    })
}

/// What stands in front of a modem's answer of signal strength, as of `+CSQ: 17,99`.
fn answer(line: &str) -> Option<&str> {
    let (front, cells) = line.split_once("+CSQ:")?;
    let is_cells = cells.trim().bytes().all(|c| c.is_ascii_digit() || c == b',');
    (is_cells && !cells.trim().is_empty()).then_some(front)
}

fn modem(front: &str) -> Error {
    let mend = if front.bytes().any(|c| c.is_ascii_digit()) {
        "take the numbers out: (echo time,rssi,ber; sed -nE 's/^(.*[0-9Z])[^0-9Z]*[+]CSQ: *([0-9]+),([0-9]+).*/\\1,\\2,\\3/p' FILE) | \
         fewbits ... --missing 99 -"
    } else {
        "take the numbers out: (echo rssi,ber; sed -nE 's/.*[+]CSQ: *([0-9]+),([0-9]+).*/\\1,\\2/p' FILE) | fewbits ... --missing 99 -"
    };
    Error::Format {
        what: "answers of a modem",
        mend,
    }
}

/// The refusal of a line of a web server, or of a kernel, whose times stand in brackets.
fn bracketed(line: &str) -> Option<Error> {
    let (front, rest) = line.split_once('[')?;
    let (time, text) = rest.split_once(']')?;
    let is_kernel = front.is_empty()
        && (time.trim().parse::<f64>().is_ok() || guess::looks_like_time(time))
        && text.contains(|c: char| c.is_alphabetic());
    let is_server = front.split_whitespace().count() == 3 && text.starts_with(" \"") && guess::looks_like_time(time);
    let (what, mend) = if is_kernel {
        (
            "a log of a kernel, in which times and values stand among words",
            "take these out, as of temp=20.5: (echo time,temp; sed -nE 's/^\\[ *([0-9.]+)\\].*temp=([-+0-9.]+).*/\\1,\\2/p' FILE) | \
             fewbits ... -",
        )
    } else if is_server {
        (
            "a log of a web server",
            "take out what you need, as: (echo time,status,bytes; sed -nE 's/^[^[]*\\[([^]]+)\\] \"[^\"]*\" ([0-9]+) ([0-9]+).*/\\1,\\2,\\3/p' \
             FILE) | fewbits ... -",
        )
    } else {
        return None;
    };
    Some(Error::Format { what, mend })
}

/// Talker and kind of a sentence, as `GPGGA` of `$GPGGA,123519,...`; other cells may stand in front.
fn sentence(line: &str) -> Option<&str> {
    let begin = line.rfind(['$', '!'])? + 1;
    let (name, _) = line.get(begin..)?.split_once(',')?;
    let is_name = name.len() >= 5 && name.bytes().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit());
    is_name.then_some(name)
}

/// The refusal of a line `time host program[number]: text`, with a priority in front or not, or of one with its time in brackets.
fn logged(line: &str) -> Option<Error> {
    if let Some(found) = bracketed(line) {
        return Some(found);
    }
    const WHAT: &str = "a log, in which times and values stand among words";
    let (priority, rest) = match line.strip_prefix('<').and_then(|rest| rest.split_once('>')) {
        Some((digits, rest)) if !digits.is_empty() && digits.bytes().all(|c| c.is_ascii_digit()) => (true, rest),
        _ => (false, line),
    };
    let mut words = rest.split_whitespace();
    let mut first = words.next()?;
    if priority && first.bytes().all(|c| c.is_ascii_digit()) {
        first = words.next()?;
    }
    let has_year = guess::looks_like_time(first);
    if !has_year {
        let is_month = first.len() == 3 && first.bytes().all(|c| c.is_ascii_alphabetic());
        let is_day = words.next()?.parse::<u8>().is_ok();
        let is_clock = words.next()?.split(':').count() == 3;
        if !(is_month && is_day && is_clock) {
            return None;
        }
    }
    // A date and a time of day apart.
    let is_apart = has_year
        && words
            .clone()
            .next()
            .is_some_and(|clock| clock.contains(':') && guess::looks_like_time(&format!("{first} {clock}")));
    let is_tagged = words
        .nth(1 + usize::from(is_apart))
        .is_some_and(|tag| tag.ends_with(':'));
    if !is_tagged && !priority {
        return None;
    }
    let mend = if is_apart {
        "take these out, as of temp=20.5: (echo time,temp; sed -nE 's/^(<[0-9]+>[0-9]* *)?([^ ]+ +[^ ]+) .*temp=([-+0-9.]+).*/\\2,\\3/p' FILE) | \
         fewbits ... -"
    } else if has_year {
        "take these out, as of temp=20.5: (echo time,temp; sed -nE 's/^(<[0-9]+>[0-9]* *)?([^ ]+) .*temp=([-+0-9.]+).*/\\2,\\3/p' FILE) | \
         fewbits ... -"
    } else {
        "take these out, with the year, as of temp=20.5: (echo time,temp; sed -nE 's/^(<[0-9]+>)?([A-Z][a-z]+) +([0-9]+) ([0-9:.]+) \
         .*temp=([-+0-9.]+).*/\\3 \\2 2026 \\4,\\5/p' FILE) | fewbits ... -"
    };
    Some(Error::Format { what: WHAT, mend })
}
