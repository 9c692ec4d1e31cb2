//! Formats of loggers that are known by their first lines, and words for units.

use crate::dialect::Dialect;
use crate::missing;

/// Whether a first line announces a format whose data begin later.
pub(crate) fn needs_more(line: &[u8]) -> bool {
    [
        &b"\"TOA5\""[..],
        b"TOA5",
        b"\"TOACI1\"",
        b"LOCATION,",
        b"#group",
        b"#datatype",
        b"\"Plot Title",
        b" Format ",
        b"Name;Lat;Long",
    ]
    .iter()
    .any(|begin| line.starts_with(begin))
}

/// Sets what is known of a format by the first lines, with their numbers, and not said.
pub(crate) fn recognise(lines: &[(u64, String)], dialect: &mut Dialect) {
    let Some((_, first)) = lines.first() else { return };
    let bare = first.trim_start_matches('"');
    if is_tektronix(lines) && dialect.skip.is_none() && dialect.no_header.is_none() {
        // Tektronix oscilloscopes: settings in the first three columns beside the first rows, no names.
        dialect.format.get_or_insert(TEKTRONIX.to_owned());
        dialect.delimiter.get_or_insert(",".to_owned());
        (dialect.skip, dialect.no_header) = (Some(0), Some(true));
        return;
    }
    let mut set = |format: &str, skip: Option<u64>, units_row: bool, skip_after_names: u64, delimiter: &str| {
        if dialect.skip.is_some() || dialect.no_header.is_some() {
            return;
        }
        dialect.format.get_or_insert(format.to_owned());
        dialect.delimiter.get_or_insert(delimiter.to_owned());
        dialect.skip = skip;
        dialect.units_row.get_or_insert(units_row);
        dialect.skip_after_names.get_or_insert(skip_after_names);
    };
    if bare.starts_with("TOA5") {
        // Campbell Scientific: station, names, units, kinds of processing.
        set("TOA5", Some(1), true, 1, ",");
    } else if bare.starts_with("TOACI1") {
        set("TOACI1", Some(1), false, 0, ",");
    } else if bare.starts_with("Plot Title:") {
        // Onset HOBOware: a title, then names.
        set("HOBO", Some(1), false, 0, ",");
        dialect.time_format.get_or_insert("mdy".to_owned());
        dialect.comment.get_or_insert(String::new());
    } else if first.starts_with("LabVIEW Measurement") {
        // LabVIEW: settings, names with a last one for comments, which rows lack.
        let end = lines
            .iter()
            .rposition(|(_, line)| line.starts_with("***End_of_Header***"));
        set("LabVIEW", end.map(|end| end as u64 + 1), false, 0, "tab");
        let is_comma = |(_, line): &(u64, String)| line.trim() == "Decimal_Separator\t,";
        if lines.iter().any(is_comma) {
            dialect.decimal.get_or_insert(',');
        }
        dialect.short_rows = true;
    } else if ["X,CH", "Time,CH", "X(s),CH"]
        .iter()
        .any(|begin| first.starts_with(begin))
        && first.contains(",Start,Increment")
    {
        // Rigol oscilloscopes: names, a line of units with the first time and the step, and rows without these two.
        set("Rigol", Some(0), true, 0, ",");
        dialect.short_rows = true;
    } else if first.starts_with(" Format ") && first.contains("IAGA-2002") {
        // Magnetic observatories: settings and comments that end in a bar, as the names do.
        let names = lines
            .iter()
            .position(|(_, line)| line.starts_with("DATE ") && line.trim_end().ends_with('|'));
        set(IAGA, names.map(|names| names as u64), false, 0, "spaces");
        if dialect.missing.is_empty() {
            dialect.missing = ["99999.00", "88888.00"].map(str::to_owned).to_vec();
        }
    } else if first.starts_with("LOCATION,") {
        // EnergyPlus weather: eight lines or fewer, then rows without names.
        let data = lines.iter().position(|(_, line)| line.starts_with("DATA PERIODS"));
        if let Some(data) = data.filter(|_| dialect.skip.is_none() && dialect.no_header.is_none()) {
            dialect.format.get_or_insert("EPW".to_owned());
            dialect.delimiter.get_or_insert(",".to_owned());
            dialect.skip = Some(data as u64 + 1);
            dialect.no_header = Some(true);
        }
    } else if first.starts_with("Name;Lat;Long") {
        // Netatmo: the names of a station and its values above those of the table.
        let names = lines.iter().position(|(_, line)| line.starts_with("Timestamp;"));
        set(NETATMO, names.map(|names| names as u64), false, 0, ";");
    } else if first.starts_with("#group") || first.starts_with("#datatype") {
        set("InfluxDB annotated CSV", Some(0), false, 0, ",");
        dialect.comment.get_or_insert("#".to_owned());
    } else if ["#,", "\"#\",", "#;", "#\t"]
        .iter()
        .any(|begin| first.starts_with(begin))
    {
        // Rows are numbered, and the column of the numbers is named so.
        dialect.comment.get_or_insert(String::new());
    } else if first.starts_with('#') {
        // Tab-separated tables of the USGS: comments, names, and a line of widths and kinds, as `5s 15s 20d`.
        let mut rows = lines.iter().filter(|(_, line)| !line.starts_with('#'));
        let (names, widths) = (rows.next(), rows.next());
        let is_width = |cell: &str| {
            let (number, kind) = cell.split_at(cell.len().saturating_sub(1));
            matches!(kind, "s" | "n" | "d") && number.parse::<u32>().is_ok()
        };
        if let (Some((_, names)), Some((_, widths))) = (names, widths)
            && names.contains('\t')
            && widths.split('\t').all(is_width)
        {
            set("RDB", Some(0), false, 1, "tab");
        }
    }
}

/// Magnetic observatories.
pub(crate) const IAGA: &str = "IAGA-2002";
/// Weather stations for homes.
pub(crate) const NETATMO: &str = "Netatmo";
/// Oscilloscopes whose settings stand beside the first rows.
pub(crate) const TEKTRONIX: &str = "Tektronix";
/// Number of columns of these settings.
pub(crate) const SETTINGS: usize = 3;

fn is_tektronix(lines: &[(u64, String)]) -> bool {
    let is_row = |(_, line): &(u64, String)| {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        cells.len() > SETTINGS + 1
            && cells[SETTINGS..SETTINGS + 2]
                .iter()
                .all(|cell| cell.parse::<f64>().is_ok())
    };
    let first = lines.first().map_or("", |(_, line)| line.trim_start_matches('"'));
    first.starts_with("Record Length") && lines.iter().all(is_row)
}

/// Names of columns of formats without a line of names.
pub(crate) fn names(format: &str, lines: &[(u64, String)], count: usize) -> Vec<String> {
    let setting = |name: &str| {
        let found = lines
            .iter()
            .find_map(|(_, line)| line.strip_prefix(name)?.strip_prefix(','));
        found
            .and_then(|rest| rest.split(',').next())
            .unwrap_or("")
            .trim()
            .to_owned()
    };
    let name = |i: usize| match (format, i) {
        ("EPW", i) => EPW.split('|').nth(i).unwrap_or("").to_owned(),
        (TEKTRONIX, i) => match i {
            0..SETTINGS => ["setting", "setting_value", "setting_unit"][i].to_owned(),
            3 => "time".to_owned(),
            4 => setting("Source"),
            _ => String::new(),
        },
        _ => String::new(),
    };
    (0..count).map(name).collect()
}

/// Names of the columns of an EPW file, as far as they are usual.
const EPW: &str = "year|month|day|hour|minute|uncertainty|dry_bulb|dew_point|humidity|pressure|extraterrestrial_horizontal|\
    extraterrestrial_normal|infrared|global_horizontal|direct_normal|diffuse_horizontal|global_illuminance|\
    direct_illuminance|diffuse_illuminance|zenith_luminance|wind_direction|wind_speed|total_sky_cover|\
    opaque_sky_cover|visibility|ceiling|weather_observed|weather_codes|precipitable_water|aerosol_depth|\
    snow_depth|days_since_snow|albedo|rain_depth|rain_quantity";

/// Words that stand for units in a row of their own.
const UNITS: &str = "ts rn smp volt volts v vdc vac mv uv kv amp amps a ma ua w mw kw wh kwh mwh hz khz mhz s sec secs second seconds ms us ns msecs usecs nsecs \
    min mins minute minutes h hr hour hours day days m mm cm km um nm ft in inch inches m/s km/h mph kn knots m3 l ml l/s l/min m3/h \
    kg g mg ug t lb pa hpa kpa mpa bar mbar mb psi atm mmhg inhg c k f degc degf deg degrees °c °f °k ℃ ℉ celsius kelvin fahrenheit % \
    percent rh %rh ppm ppb ppt lux lx w/m2 w/m^2 j kj mj n nm db dba dbm ohm ohms kohm mohm s/m us/cm ms/cm ph ntu mg/l ug/m3 µg/m³ \
    sequence mol mmol umol µmol nmol degt nmi yr mo dy mn µg/m3 rad rpm g0 count counts # unitless none unit utc local va var m^3 m² m³ w/m² µs µm µa mm/h umol/m2/s deg_c deg_f inhg";

/// As [`are_units`] of the cells behind the first, if that is no name of a column: a word for the kind of the row, as `DATAU`.
pub(crate) fn are_units_behind(cells: &[String]) -> bool {
    let is_kind = |word: &str| {
        let word = word.to_lowercase();
        ["unit", "einheit", "datau"].iter().any(|begin| word.starts_with(begin))
    };
    match cells {
        [first, rest @ ..] => is_kind(first) && are_units(rest),
        [] => false,
    }
}

/// Whether the cells of a row are units: every one that is not empty is a unit's word or stands in brackets, and there is one.
pub(crate) fn are_units(cells: &[String]) -> bool {
    let is_unit = |cell: &str| {
        let lower = cell.trim().to_lowercase();
        let lower = lower.replace("deg ", "deg");
        let in_brackets =
            (lower.starts_with('(') && lower.ends_with(')')) || (lower.starts_with('[') && lower.ends_with(']'));
        let is_date_pattern = lower.contains("yyyy") || lower.contains("hh:mm");
        let is_known = |text: &str| UNITS.split_ascii_whitespace().any(|unit| unit == text);
        // A product or quotient of units, as `µmol/m²/s`.
        let mut factors = lower
            .split(|c: char| "/·.*^-²³⁻¹ ".contains(c) || c.is_ascii_digit())
            .filter(|factor| !factor.is_empty())
            .peekable();
        let is_compound = factors.peek().is_some() && lower.contains(['/', '·', '²', '³', '^', '.', '⁻']);
        lower.is_empty()
            || in_brackets
            || is_date_pattern
            || is_known(&lower)
            || (is_compound && factors.all(is_known))
            || matches!(lower.as_str(), "1" | "-" | "--")
    };
    // A gap, as `M` or `N.A.`, tells of no units.
    let is_word = |cell: &String| cell != "1" && !missing::is_usual(cell.trim(), true);
    let is_row = cells.first().is_some_and(|cell| cell.trim() == "1");
    !is_row && cells.iter().any(is_word) && cells.iter().all(|cell| is_unit(cell))
}
