//! Layouts of files that may be read in two ways, or whose names do not stand in one line above each column.

use crate::{numbers, open, open_said, refusal, rows};
use fewbits_table::{Dialect, Scale, Table};

fn lines(header: &str, count: usize, row: impl Fn(usize) -> String) -> String {
    (0..count).fold(format!("{header}\n"), |text, i| text + &row(i) + "\n")
}

/// The times of a table as text, or why there are none.
fn times(text: &str, columns: &[&str], format: Option<&str>) -> Result<Vec<String>, String> {
    times_to(0, text, columns, format)
}

/// Times with so many decimals.
fn times_to(decimals: u8, text: &str, columns: &[&str], format: Option<&str>) -> Result<Vec<String>, String> {
    let said = Dialect {
        time_format: format.map(str::to_owned),
        ..Dialect::default()
    };
    let mut table = Table::open(std::io::Cursor::new(text.to_owned()), &said).map_err(|error| error.to_string())?;
    match columns {
        [] => table.find_time().map(|_| ()),
        columns => table.set_time(columns),
    }
    .map_err(|error| error.to_string())?;
    let batch = rows(&mut table);
    let scale = table.time().ok_or("no time")?.1;
    Ok(batch.times.iter().map(|time| time.shown(scale, decimals)).collect())
}

#[test]
fn a_year_of_two_digits_in_one_day_is_asked_for() {
    for text in [
        "time,x\n24-03-05 09:58:00.5,1\n24-03-05 09:59:00.5,2\n",
        "date,x\n14/11/23,1\n14/11/23,2\n",
    ] {
        let message = times(text, &[], None).unwrap_err();
        assert!(message.contains("year first or last") && message.contains("--time-format ymd"), "{message}");
    }
    // Points stand behind days, and no month is the 15th.
    assert_eq!(times("time,x\n24.03.05,1\n", &[], None).unwrap(), ["2005-03-24T00:00:00"]);
    assert_eq!(times("time,x\n03/15/24,1\n", &[], None).unwrap(), ["2024-03-15T00:00:00"]);
    assert_eq!(times("time,x\n24-03-05,1\n", &[], Some("ymd")).unwrap(), ["2024-03-05T00:00:00"]);
    // Rows behind the first ones decide if the first number is no year.
    for (last, order) in [("15/11/23 10:00", Some("dmy")), ("14/11/23 11:00", None)] {
        let text = lines("time,x", 100, |i| format!("14/11/23 10:00,{i}")) + last + ",1\n";
        let opened = || open_said(&text, &Dialect::default()).unwrap();
        assert!(opened().find_time().unwrap_err().is_day_or_month());
        assert_eq!(opened().survey().unwrap().columns[0].day_order(), order);
    }
}

#[test]
fn digits_beside_a_date_are_hours_or_asked_for() {
    let hours = |count| lines("2024-03-05,0,1", count, |i| format!("2024-03-0{},{},1", 5 + (i + 1) / 24, (i + 1) % 24));
    let said = Dialect {
        no_header: Some(true),
        ..Dialect::default()
    };
    let mut table = open_said(&hours(40), &said).unwrap();
    table.set_time(&["#1", "#2"]).unwrap();
    assert_eq!(rows(&mut table).times[25].shown(Scale::Local, 0), "2024-03-06T01:00:00");
    // The hours of one day may be minutes.
    let text = lines("Date,Time,x", 20, |i| format!("05.03.2024,{i},1"));
    let message = times(&text, &[], None).unwrap_err();
    assert!(message.contains("hours or minutes") && message.contains("%H"), "{message}");
    let columns = ["Date", "Time"];
    assert_eq!(times(&text, &columns, Some("%d.%m.%Y %H")).unwrap()[19], "2024-03-05T19:00:00");
    assert_eq!(times(&text, &columns, Some("%d.%m.%Y %H%M")).unwrap()[19], "2024-03-05T00:19:00");
    let seconds = lines("since,time,x", 50, |i| format!("2024-03-05,{i},1"));
    assert!(times(&seconds, &[], None).unwrap_err().contains("hours or minutes"));
    assert_eq!(
        times("Date,HHMM,x\n2024-03-05,5,1\n2024-03-05,20,1\n", &["Date", "HHMM"], None).unwrap(),
        ["2024-03-05T00:05:00", "2024-03-05T00:20:00"]
    );
}

#[test]
fn names_tell_minutes_from_hours() {
    for (name, expected) in [
        ("Time (mm:ss)", "62"),
        ("Elapsed [m:ss]", "62"),
        ("Item:size", "3720"),
        ("Time (hh:mm)", "3720"),
        ("Time [hh:mm:ss]", "3720"),
        ("time", "3720"),
    ] {
        let read = times(&format!("{name},x\n01:01,1\n01:02,2\n"), &[name], None).unwrap();
        assert_eq!(read[1], expected, "{name}");
    }
    assert_eq!(times("time,x\n095800,1\n100001,2\n", &[], None).unwrap(), ["35880", "36001"]);
    assert_eq!(times("time,x\n0958,1\n1001,2\n", &[], None).unwrap(), ["35880", "36060"]);
    assert_eq!(times("time,x\n1958,1\n2001,2\n", &[], None).unwrap(), ["1958", "2001"]);
    assert_eq!(times("time,x\n195800,1\n200001,2\n", &[], None).unwrap(), ["195800", "200001"]);
}

#[test]
fn times_of_further_spellings() {
    for (cells, expected) in [
        (["PT0M0.5S", "PT1H1M"], ["0", "3660"]),
        (["59s", "1m30.5s"], ["59", "90"]),
        (["Jan 2014", "Feb 2014"], ["2014-01-01T00:00:00", "2014-02-01T00:00:00"]),
        (["März 2014", "Mai 2014"], ["2014-03-01T00:00:00", "2014-05-01T00:00:00"]),
    ] {
        let text = format!("time,x\n{},1\n{},2\n", cells[0], cells[1]);
        assert_eq!(times(&text, &[], None).unwrap(), expected, "{text}");
    }
}

/// Dates of digits without marks that begin with a day or with a year of two digits are asked for; numbers that cannot be such dates count.
#[test]
fn dates_of_digits_without_a_century_are_asked_for() {
    for (name, first, second, format) in [
        ("time", "2403050958", "2403051000", "%y%m%d%H%M"),
        ("time", "240305095800", "240305100000", "%y%m%d%H%M%S"),
        ("t", "0503240958", "0503241000", "%d%m%y%H%M"),
        ("time", "050320240958", "050320241000", "%d%m%Y%H%M"),
        ("time", "05032024095800", "05032024100000", "%d%m%Y%H%M%S"),
        ("timestamp", "0305240958", "0305241000", "%m%d%y%H%M"),
    ] {
        let text = format!("{name},x\n{first},1\n{second},2\n");
        let message = times(&text, &[name], None).unwrap_err();
        assert!(message.contains("digits have no marks") && message.contains("--time-format"), "{first}: {message}");
        assert_eq!(times(&text, &[name], Some(format)).unwrap()[1], "2024-03-05T10:00:00", "{first}");
        assert_eq!(times(&text, &[name], Some("s")).unwrap()[0], first.trim_start_matches('0'));
    }
    let message = times("date,x\n240305,1\n240306,2\n", &[], None).unwrap_err();
    assert!(message.contains("digits have no marks"), "{message}");
    let message = times("date,time,x\n240305,0958,1\n240305,1000,2\n", &[], None).unwrap_err();
    assert!(message.contains("--time-format"), "{message}");
    // Seconds since 1970 whose digits are also a date, a count of seconds, and one of milliseconds.
    for (first, second) in [
        ("1701231215", "1701231216"),
        ("240305", "240306"),
        ("2403050998", "2403051008"),
    ] {
        assert_eq!(times(&format!("time,x\n{first},1\n{second},2\n"), &["time"], None).unwrap()[0], first);
    }
    let rows: String = (0..200)
        .map(|i| format!("170123{:02}{:02},1\n", 9 + i / 60, i % 60))
        .collect();
    assert!(times(&format!("time,x\n{rows}"), &["time"], None).is_err(), "200 of 2017");
}

/// Parts of a second in a column of their own, behind a time of any spelling; and columns that only have the name of such.
#[test]
fn parts_of_a_second_stand_in_a_column_of_their_own() {
    for (text, expected) in [
        (
            "seq,stamp.sec,stamp.nanosec,x\n0,100,0,1\n1,100,500000000,2\n2,101,1,3\n",
            ["100", "100.5", "101.000000001"],
        ),
        ("tv_sec,tv_usec,x\n100,0,1\n100,500000,2\n101,7,3\n", ["100", "100.5", "101.000007"]),
        (
            "Time,ms,x\n05.03.2024 09:58:00,0,1\n05.03.2024 09:58:00,500,2\n05.03.2024 09:58:01,1,3\n",
            [
                "2024-03-05T09:58:00.000000000",
                "2024-03-05T09:58:00.500000000",
                "2024-03-05T09:58:01.001000000",
            ],
        ),
        (
            "Year,Month,Day,Hour,Minute,Second,Millisecond\n2024,3,5,9,58,0,0\n2024,3,5,9,58,0,500\n2024,3,5,9,58,1,1\n",
            [
                "2024-03-05T09:58:00.000000000",
                "2024-03-05T09:58:00.500000000",
                "2024-03-05T09:58:01.001000000",
            ],
        ),
        // Round trips in milliseconds, and a count that goes on.
        ("time,ms\n10,23\n11,24\n12,22\n", ["10", "11", "12"]),
        ("time,ms\n10,23\n10,22\n12,24\n", ["10", "10", "12"]),
        ("time,stamp_ms\n10,10000\n10,10500\n11,11001\n", ["10", "10", "11"]),
    ] {
        assert_eq!(times_to(9, text, &[], None).unwrap(), expected, "{text}");
    }
    // What is said is taken, and a part beyond a second refused.
    let text = "time,ms\n2024-03-05 09:58:00,23\n2024-03-05 09:58:01,24\n";
    assert_eq!(times_to(3, text, &["time", "ms"], None).unwrap()[1], "2024-03-05T09:58:01.024");
    let mut table = open(&lines("time,ms", 3000, |i| format!("{},{}", i / 10, if i == 2500 { 1000 } else { i % 10 })));
    table.set_time(&["time", "ms"]).unwrap();
    let message = refusal(&mut table);
    assert!(message.contains("250 1000") && message.contains("2501"), "{message}");
}

/// An object whose lists are columns is no row; one with vectors is.
#[test]
fn lists_that_are_columns_are_no_row() {
    for text in [
        "{\"time\":[1,2],\"x\":[3.5,null]}",
        "{\"lat\":52.5,\"hourly\":{\"time\":[\"2024-03-05T00:00\",\"2024-03-05T01:00\"],\"t_2m\":[3,4]}}\n",
    ] {
        let message = times(text, &[], None).unwrap_err();
        assert!(message.contains("a list for each column") && message.contains("jq -r"), "{message}");
    }
    let mut table = open("{\"time\":1,\"a\":[1,2],\"b\":[3,4]}\n");
    assert!(table.find_time().unwrap());
    assert_eq!(rows(&mut table).columns.len(), 4);
}

#[test]
fn dates_with_colons() {
    let text = "DateTimeOriginal,x\n2024:03:05 09:58:00,1\n2024:03:15 09:58:01,2\n";
    assert_eq!(times(text, &[], None).unwrap()[1], "2024-03-15T09:58:01");
    let text = "Date(dd:mm:yyyy),Time(hh:mm:ss),x\n15:03:2024,09:58:00,1\n16:03:2024,09:58:01,2\n";
    assert_eq!(times(text, &[], None).unwrap()[1], "2024-03-16T09:58:01");
    let text = text.replace("15:03", "05:03").replace("16:03", "06:03");
    assert!(times(&text, &[], None).unwrap_err().contains("--time-format dmy"));
    // Durations stay.
    assert_eq!(times("time,x\n2024:03:05,1\n", &["time"], None).unwrap(), ["7286585"]);
}

#[test]
fn of_two_times_of_day_behind_a_date_the_first_is_taken() {
    let text = "TYPE,DATE,START TIME,END TIME,USAGE\nuse,2024-03-05,00:00,00:59,.05\nuse,2024-03-05,01:00,01:59,.15\n";
    assert_eq!(times(text, &[], None).unwrap(), ["2024-03-05T00:00:00", "2024-03-05T01:00:00"]);
}

#[test]
fn numbers_of_no_plausible_year_are_asked_for() {
    // Microseconds since 1601.
    let text = "time,x\n13354106280000000,1\n13354106340000000,2\n";
    let message = times(text, &[], None).unwrap_err();
    assert!(message.contains("behind the year 2200") && message.contains("--time-format"), "{message}");
    assert_eq!(times(text, &["time"], Some("us")).unwrap()[0], "2393-03-05T09:58:00Z");
    assert_eq!(times(text, &["time"], Some("s")).unwrap()[0], "13354106280000000");
    // 100 ns since 1601, and since the year 1; nanoseconds since 1970.
    for [first, second] in [
        [133_541_062_800_000_000_u64, 133_541_063_400_000_000],
        [638_452_294_800_000_000, 638_452_295_400_000_000],
    ] {
        let text = format!("time,x\n{first},1\n{second},2\n");
        let message = times(&text, &[], None).unwrap_err();
        assert!(message.contains("may count 100 ns") && message.contains("--time-format ns"), "{message}");
        assert!(times(&text, &["time"], Some("ns")).is_ok());
    }
    let text = "time,x\n1709632680000000000,1\n1709632740000000000,2\n";
    assert_eq!(times(text, &[], None).unwrap()[0], "2024-03-05T09:58:00Z");
}

#[test]
fn names_in_another_order_are_not_left_out() {
    let said = Dialect {
        skip_bad: 9,
        ..Dialect::default()
    };
    let mut table = open_said("time,a,b\n1,10,20\n2,11,21\ntime,b,a\n3,22,12\n", &said).unwrap();
    table.find_time().unwrap();
    let message = refusal(&mut table);
    assert!(message.contains("line 4") && message.contains("another order"), "{message}");
}

#[test]
fn rows_below_single_lines_have_no_names() {
    let settings = "Serial: 1\nStart 09:58:00\nBattery: 4.1     Mode = 12\n";
    let text = lines(&format!("{settings}----"), 9, |i| format!("{i},{},3", i + 1));
    let message = times(&text, &[], None).unwrap_err();
    assert!(
        message.contains("line 5") && message.contains("--no-header") && message.contains("4 lines"),
        "{message}"
    );
}

#[test]
fn names_of_rows_and_of_an_index() {
    let text = "\"time\" \"temp\" \"ok\"\n\"1\" 0 18.5 TRUE\n\"2\" 60 NA FALSE\n";
    let mut table = open(text);
    let names: Vec<&str> = table.columns().iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["column_1", "time", "temp", "ok"]);
    assert_eq!(numbers(&rows(&mut table).columns[1]), [Some(18.5), None]);
    // Of a table of pandas whose columns have two names each.
    let table = open(",room,room\nsensor,a,b\ntime,,\n2024-03-05 09:58:00,1.5,2\n2024-03-05 09:59:00,1.6,3\n");
    let names: Vec<&str> = table.columns().iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["time", "a", "b"]);
    // An empty cell behind the last name is no column, whatever the title has there.
    assert_eq!(
        open("Report,Plant A,North\ntime,temp,\n1,2.5,\n2,2.6,\n")
            .columns()
            .len(),
        2
    );
    // Where all cells have quotes, the one too many may be the last.
    assert!(refusal(&mut open("\"time\",\"temp\"\n\"0\",\"1\",\"2\"\n")).contains("3 cells instead of 2"));
}

#[test]
fn marks_of_the_end_of_a_file_are_no_rows() {
    for end in ["\u{1a}", "\u{1a}\u{1a}", "\u{c}\n"] {
        let mut table = open(&format!("time,x\r\n1,10\r\n2,20\r\n{end}"));
        assert_eq!(rows(&mut table).rows, 2);
    }
}

/// As microcontrollers write for a plotter of the serial port, and services in their logs: the first line was taken for the names.
#[test]
fn cells_with_their_names_in_front() {
    let found = |text: &str| {
        let mut table = open_said(text, &Dialect::default()).unwrap();
        table.find_certain_time().unwrap();
        let names: Vec<String> = table
            .selected()
            .iter()
            .map(|i| table.columns()[*i].name.clone())
            .collect();
        let batch = rows(&mut table);
        (names, batch.columns.iter().map(numbers).collect::<Vec<_>>())
    };
    let expected = (
        vec!["Temp".to_owned(), "Hum".to_owned()],
        vec![
            [20.1, 20.2, 20.3].map(Some).to_vec(),
            [50.0, 51.0, 52.0].map(Some).to_vec(),
        ],
    );
    for text in [
        "Temp:20.1,Hum:50\nTemp:20.2,Hum:51\nTemp:20.3,Hum:52\n",
        "Temp: 20.1\tHum: 50\nHum: 51\tTemp: 20.2\nTemp: 20.3\tHum: 52\n",
        "Temp=20.1 Hum=50\r\nTemp=20.2 Hum=51\r\nTemp=20.3 Hum=52\r\n",
        "12:00:01.5 -> Temp:20.1,Hum:50\n12:00:02.5 -> Temp:20.2,Hum:51\n12:00:03.5 -> Temp:20.3,Hum:52\n",
        "time=2026-03-01T12:00:00Z Temp=20.1 Hum=50\ntime=2026-03-01T12:00:01Z Temp=20.2 Hum=51\n\ntime=2026-03-01T12:00:02Z Temp=20.3 Hum=52\n",
    ] {
        assert_eq!(found(text), expected, "{text}");
    }
    // A cell that is not there is a gap. A name that stands twice is refused, and so is a line without names.
    let (_, columns) = found("a:1,b:2\na:3\na:4,b:5\n");
    assert_eq!(columns[1], [Some(2.0), None, Some(5.0)]);
    for line in ["a:1,a:2", "5"] {
        let text = lines("a:1,b:2", 40, |_| "a:1,b:2".to_owned()) + line + "\n";
        let error = refusal(&mut open_said(&text, &Dialect::default()).unwrap());
        assert!(error.contains("line 42"), "{error}");
    }
    // One line is a row too, and a comma may stand before decimals.
    assert_eq!(found("A:1,B:2\n").1, [[Some(1.0)], [Some(2.0)]]);
    assert_eq!(found("A=1 B=2\nA=3 B=\n").1[1], [Some(2.0), None]);
    assert!(refusal(&mut open_said("a=1;b=2,5\na=2;b=3,5\n", &Dialect::default()).unwrap()).contains("`2,5`"));
    // A table with a line of names is one.
    assert_eq!(found("name,value\na=1,2\na=2,3\n").0.len(), 2);
}

#[test]
fn lists_of_lists_are_named() {
    let lists = "[[1700000000,\"1.5\"],\n[1700000010,\"2.5\"]]\n";
    let message = open_said(lists, &Dialect::default()).err().unwrap().to_string();
    assert!(message.contains("a list of lists") && message.contains("jq"), "{message}");
}
