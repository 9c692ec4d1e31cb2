//! First rows that look like something else, and lines that are no tables.

use super::{numbers, open, open_said, rows, seconds};
use fewbits_table::Dialect;

fn not_opened(text: &str) -> String {
    open_said(text, &Dialect::default()).err().expect("refused").to_string()
}

#[test]
fn first_row_with_a_gap_is_no_row_of_units() {
    for (names, gap, column) in [
        ("t,v", "1,N.A.", 1),
        ("t,v", "1,M", 1),
        ("v,t", "M,1", 0),
        ("v,t", "n.a.,1", 0),
    ] {
        let rest = if column == 1 { "2,5\n3,6\n" } else { "5,2\n6,3\n" };
        let mut table = open(&format!("{names}\n{gap}\n{rest}"));
        let batch = rows(&mut table);
        assert_eq!(batch.rows, 3, "{names} {gap}");
        let column = if batch.columns.len() == 1 { 0 } else { column };
        assert_eq!(numbers(&batch.columns[column]), [None, Some(5.0), Some(6.0)], "{names} {gap}");
    }
    // Ratios have the unit 1.
    let mut table = open("time,ratio,level\ns,1,m\n0,0.5,3\n1,0.25,4\n");
    assert_eq!(rows(&mut table).rows, 2);
    assert_eq!(table.columns()[2].unit, "m");
}

#[test]
fn short_table_above_another_is_refused() {
    for above in ["time,a\n1,2\n2,3\n\n", "time,a\n2024-03-05T10:00:00,2\n"] {
        let text = format!("{above}time,a,b\n3,3,4\n4,4,4\n5,5,5\n");
        assert!(not_opened(&text).contains("rows of numbers stand above the line of names"), "{text}");
    }
    // Settings with a name of the table among them.
    let mut table = open("gain,time\n2,5\ntime,a,b\n3,3,4\n4,4,4\n5,5,5\n");
    assert_eq!(seconds(&rows(&mut table)), [3.0, 4.0, 5.0]);
}

#[test]
fn rows_in_single_quotes_below_plain_names_are_read() {
    let mut table = open("t,p\n'1','2.5'\n'2','3.5'\n");
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(2.5), Some(3.5)]);
}

#[test]
fn sentences_and_logs_are_named() {
    let repeated = |line: &str| {
        (0..9)
            .map(|i| line.replace('@', &i.to_string()) + "\r\n")
            .collect::<String>()
    };
    for (line, mend) in [
        ("$GPGGA,12351@.00,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47", "grep GGA"),
        ("$GNRMC,12351@,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A", "%d%m%y %H%M%S%.f"),
        ("2026-03-05 10:00:0@,!AIVDM,1,1,,B,177KQJ5000G?tO`K>RA1wUbN0TKH,0*5C", "NMEA"),
    ] {
        let refusal = not_opened(&repeated(line));
        assert!(refusal.contains("NMEA 0183") && refusal.contains(mend), "{refusal}");
    }
    for (line, mend) in [
        ("Mar  5 10:00:0@ host sensord[123]: temp=20.@ hum=40", "with the year"),
        ("<13>Mar  5 10:00:0@ host logger: temp=2@", "with the year"),
        ("<34>1 2026-03-05T10:00:0@.003Z host app 123 ID47 - temp=2@", "take these out, as of"),
        ("2026-03-05T10:00:0@+0100 host sensord[123]: temperature 2@.5 C", "take these out, as of"),
    ] {
        let refusal = not_opened(&repeated(line));
        assert!(refusal.contains("this is a log") && refusal.contains(mend), "{refusal}");
    }
    // A table of words could be made of these.
    for (line, what, mend) in [
        ("Mar  5 10:00:0@ pi kernel: [    1.234567] thermal zone0: temp=4512@", "a log", "with the year"),
        ("[    @.234567] thermal zone0: temp=45123", "a log of a kernel", "time,temp"),
        ("[Tue Mar  5 10:00:0@ 2024] thermal zone0: temp=45123", "a log of a kernel", "time,temp"),
        (
            "10.0.0.1 - - [05/Mar/2024:10:00:0@ +0100] \"GET /a?t=2 HTTP/1.1\" 200 23@",
            "web server",
            "time,status,bytes",
        ),
        ("+CSQ: 1@,99\r\n\r\nOK", "a modem", "(echo rssi,ber"),
        ("2024-03-05 10:00:0@ +CSQ: 1@,99", "a modem", "(echo time,rssi,ber"),
        ("2024-03-05 10:00:0@ host app[1]: temp=2@", "a log", "+[^ ]+"),
    ] {
        let refusal = not_opened(&repeated(line));
        assert!(refusal.contains(what) && refusal.contains(mend), "{refusal}");
    }
    assert!(not_opened("<html>\n<td>1</td>\n").contains("HTML"));
    let rows_of_numbers = not_opened("2026-03-05T10:00:00 1 2\n2026-03-05T10:00:01 1 2\n");
    assert!(rows_of_numbers.contains("no line of names"), "{rows_of_numbers}");
}
