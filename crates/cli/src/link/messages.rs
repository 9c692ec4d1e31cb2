//! `fewbits receive --format`: readings in the messages of other programs, as rows `time,name,value,unit`, which `fewbits track --by name`
//! reads.

use super::format::Format;
use super::split::{MAX_MESSAGE, Messages};
use crate::Ending;
use crate::arguments::ReceiveOptions;
use crate::error::Error;
use crate::notes::Limiter;
use crate::output::{Cell, Shape, Sheet};
use crate::{node, recording};
use fewbits_link::doors::{cayenne, lorawan, senml};
use std::io::{BufReader, Read};
use std::time::{SystemTime, UNIX_EPOCH};

/// Messages, one after the other.
type Source = Box<dyn FnMut() -> std::io::Result<Option<Vec<u8>>>>;

/// Runs `receive --format`.
pub(crate) fn run(options: &ReceiveOptions, format: Format) -> Result<Ending, Error> {
    let (mut messages, name) = source(options, format)?;
    let sensor = options.sensor.as_deref();
    let sensor = sensor
        .map(|bound| node::coding(bound, options.sequence_bits))
        .transpose()?;
    let is_of = |device: &str| {
        options
            .device
            .as_deref()
            .is_none_or(|wanted| wanted.eq_ignore_ascii_case(device))
    };
    let mut notes = Limiter::default();
    if let Some(config) = sensor {
        if format != Format::Lorawan {
            return Err(Error::option("--sensor", &name, "`--format lorawan`: SenML holds no frames"));
        }
        return node::receive(options, config, &name, || {
            loop {
                let Some(message) = messages()? else { return Ok(None) };
                match lorawan::uplink(&String::from_utf8_lossy(&message)) {
                    Ok(Some(up)) if is_of(&up.device) => return Ok(Some(up.payload)),
                    Ok(_) => {}
                    Err(error) => notes.say("message", &format!("warning: a message was not used: {error}")),
                }
            }
        });
    }
    let names = ["time", "name", "value", "unit"].map(str::to_owned).to_vec();
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::Csv, names)?;
    let (mut rows, mut refused) = (0_u64, 0_u64);
    while let Some(message) = messages().map_err(Error::io(&name, "read"))? {
        let read = match format {
            Format::Lorawan => of_uplink(&message, &is_of),
            Format::Senml => senml::from_json(&String::from_utf8_lossy(&message), now()).map(|all| of_senml(&all)),
            Format::SenmlCbor => senml::from_cbor(&message, now()).map(|all| of_senml(&all)),
        };
        match read {
            Ok(read) => {
                rows += read.len() as u64;
                for (time, name, value, unit) in read {
                    sheet.write([Cell::Text(time), Cell::Text(name), value, Cell::Text(unit)])?;
                }
                // A row is out as soon as it is known.
                sheet.flush()?;
            }
            Err(error) => {
                refused += 1;
                notes.say("message", &format!("warning: {name}: a message was not used: {error}"));
            }
        }
    }
    sheet.finish()?;
    if refused > 0 {
        crate::say::say!("warning: {name}: {refused} messages were not used");
    }
    Ok(match (rows, refused) {
        (0, _) => Ending::no_reading(&name, options.device.as_deref()),
        (_, 0) => Ending::Good,
        _ => Ending::Failed,
    })
}

fn source(options: &ReceiveOptions, format: Format) -> Result<(Source, String), Error> {
    #[cfg(feature = "mqtt")]
    if let Some(place) = &options.mqtt {
        return at_broker(place, options.timeout);
    }
    #[cfg(not(feature = "mqtt"))]
    if let Some(place) = &options.mqtt {
        let shown = crate::place::shown(place);
        return Err(Error::content(&shown, crate::place::NO_MQTT));
    }
    let (stream, name) = recording::live(&options.file)?;
    let name = name.to_owned();
    if format == Format::SenmlCbor {
        let mut rest = None::<Vec<u8>>;
        let mut stream = Some(stream);
        let next = move || {
            if let Some(stream) = stream.take() {
                let mut bytes = Vec::new();
                stream.take(MAX_MESSAGE).read_to_end(&mut bytes)?;
                rest = Some(bytes);
            }
            // What is no list has no end that could be known: it is the last message.
            let all = rest.take().filter(|bytes| !bytes.is_empty());
            Ok(all.map(|mut bytes| {
                let end = senml::cbor_length(&bytes).unwrap_or(bytes.len());
                rest = Some(bytes.split_off(end));
                bytes
            }))
        };
        return Ok((Box::new(next), name));
    }
    let mut messages = Messages::new(BufReader::new(stream));
    let next = move || messages.next();
    Ok((Box::new(next), name))
}

/// Messages on a topic: `mqtt://[user:password@]host[:port]/topic`, where the topic may have wildcards.
#[cfg(feature = "mqtt")]
fn at_broker(place: &str, timeout: Option<std::time::Duration>) -> Result<(Source, String), Error> {
    const OPTION: &str = "--mqtt";
    let shown = crate::place::shown(place);
    let parts = place.strip_prefix("mqtt://").and_then(|rest| rest.split_once('/'));
    let Some((broker, topic)) = parts.filter(|(_, topic)| !topic.is_empty()) else {
        return Err(Error::option(OPTION, &shown, "mqtt://[user:password@]host[:port]/topic"));
    };
    let broker = crate::place::mqtt(broker).map_err(|error| Error::content(&shown, error))?;
    let messages = fewbits_link::mqtt::Messages::open(broker, vec![topic.to_owned()])?;
    crate::say::say!("listening at {shown}");
    crate::interrupt::watch();
    let next = move || crate::waiting::next(timeout, |wait| Ok(messages.receive(wait).map(|(_, content)| content)));
    Ok((Box::new(next), shown))
}

type Row = (String, String, Cell, String);

/// The rows of one uplink: names are device, channel and kind, as `0004a30b001c0530/3/temperature`.
fn of_uplink(message: &[u8], is_of: &impl Fn(&str) -> bool) -> Result<Vec<Row>, fewbits_link::Error> {
    let Some(up) = lorawan::uplink(&String::from_utf8_lossy(message))?.filter(|up| is_of(&up.device)) else {
        return Ok(Vec::new());
    };
    let mut rows = Vec::new();
    for reading in cayenne::readings(&up.payload)? {
        let parts: &[&str] = match (reading.kind, reading.values.len()) {
            ("gps", _) => &["/latitude", "/longitude", "/altitude"],
            ("colour", _) => &["/red", "/green", "/blue"],
            (_, 3) => &["/x", "/y", "/z"],
            _ => &[""],
        };
        for (part, value) in parts.iter().zip(&reading.values) {
            let name = format!("{}/{}/{}{part}", up.device, reading.channel, reading.kind);
            rows.push((up.time.clone(), name, Cell::Number(Some(*value)), reading.unit.to_owned()));
        }
    }
    Ok(rows)
}

/// Numbers and truth values as numbers, texts as they are. Records of bytes and of sums alone are left out.
fn of_senml(records: &[senml::Record]) -> Vec<Row> {
    let row = |record: &senml::Record| {
        let value = match &record.value {
            senml::Value::Number(number) => Cell::Number(Some(*number)),
            senml::Value::Truth(truth) => Cell::Whole(i64::from(*truth)),
            senml::Value::Text(text) => Cell::Text(text.clone()),
            _ => return None,
        };
        Some((record.time.to_string(), record.name.clone(), value, record.unit.clone()))
    };
    records.iter().filter_map(row).collect()
}

/// Seconds since 1970, to which relative times refer.
fn now() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs_f64()
}
