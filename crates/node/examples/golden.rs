//! `golden N` prints the sums of `N` messages of every scheme (a million by default), `golden write FOLDER` writes the golden vectors,
//! `golden samples N FILE` the first samples of the adaptive encoder.

use fewbits_node::golden::{RECORDS, Scheme, Signal, VERSION, Vectors, hash};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [word, folder] = &arguments[..]
        && word == "write"
    {
        for (scheme, name) in Scheme::ALL {
            std::fs::write(format!("{folder}/{name}.bin"), file(scheme)?)?;
        }
        return Ok(());
    }
    if let [word, count, file] = &arguments[..]
        && word == "samples"
    {
        let mut signal = Signal::new(1);
        let bytes: Vec<u8> = (0..count.parse()?)
            .flat_map(|_: u32| signal.sample().to_le_bytes())
            .collect();
        return Ok(std::fs::write(file, bytes)?);
    }
    let count = arguments.first().map_or(Ok(1_000_000), |text| text.parse())?;
    for (scheme, name) in Scheme::ALL {
        println!("{name} {:016x}", hash(scheme, count)?);
    }
    Ok(())
}

fn file(scheme: Scheme) -> Result<Vec<u8>, fewbits_node::Error> {
    let mut vectors = Vectors::new(scheme)?;
    let mut records = Vec::new();
    let mut input_bytes = 0;
    for _ in 0..RECORDS {
        let (input, message) = vectors.next_record()?;
        let packet = message.unwrap_or_default();
        input_bytes = input.bytes().len() as u16;
        records.extend_from_slice(input.bytes());
        records.push(packet.bits() as u8);
        records.extend_from_slice(&packet.to_bytes()[..packet.byte_count()]);
    }
    let mut bytes = b"fbgv".to_vec();
    bytes.extend_from_slice(&[VERSION, scheme as u8]);
    bytes.extend_from_slice(&input_bytes.to_le_bytes());
    bytes.extend_from_slice(&RECORDS.to_le_bytes());
    bytes.extend(records);
    Ok(bytes)
}
